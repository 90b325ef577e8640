"""Tests of what a metric says."""

import numpy as np

from sssslam.evaluation.metric import Metric, root_mean_square


def test_a_metric_says_value_unit_and_how() -> None:
    assert str(Metric("ate", 1.8412, "m", "SE(2) aligned, 1243 poses")) == "ate 1.841 m (SE(2) aligned, 1243 poses)"
    assert str(Metric("z_score", 1.0, "", "9 rows")) == "z_score 1 (9 rows)"
    assert str(Metric("rpe_50m", np.nan, "m", "0 pairs")) == "rpe_50m unknown (0 pairs)"


def test_the_root_mean_square_of_a_345_triangle_and_of_nothing() -> None:
    assert root_mean_square(np.array([3.0, 4.0])) == np.sqrt(12.5)
    assert np.isnan(root_mean_square(np.array([])))
