import numpy as np

from backend.poses import RelativePose
from backend.stacks import stacked


def test_a_stack_holds_what_was_stacked_and_parts_of_it(make_survey):
    odometry = make_survey(0).odometry()
    part = stacked(odometry)[2:5]
    assert len(stacked(odometry)) == len(odometry)
    assert part.target.tolist() == [2, 3, 4]
    assert part.source.tolist() == [3, 4, 5]
    assert np.array_equal(part.T_target_source[1], odometry[3].T_target_source)
    assert np.array_equal(part.covariance[2], odometry[4].covariance)


def test_a_stack_of_none_has_the_shapes_of_one():
    none: list[RelativePose] = []
    assert len(stacked(none)) == 0
    assert stacked(none).T_target_source.shape == (0, 4, 4)
    assert stacked(none).covariance.shape == (0, 6, 6)
