import numpy as np
import pytest
from scipy.stats import chi2, norm

from frontend.frames import planar_pose
from frontend.priors import Prior


def prior(n_sigmas=3.0):
    return Prior(
        planar_pose(10.0, -5.0, 3.0), np.diag([0.01, 0.01, 0.04 - 0.002**2, 25.0 - 0.01, 4.0 - 0.01, 1.0]), n_sigmas
    )


def test_the_prediction_itself_is_admitted():
    assert prior().admits(planar_pose(10.0, -5.0, 3.0))
    assert prior().squared_distance(10.0, -5.0, 3.0) == 0


def test_distance_counts_standard_deviations_of_x_y_and_yaw():
    assert prior().squared_distance(15.0, -3.0, 3.2) == pytest.approx(3.0)


def test_yaw_is_compared_across_the_turn():
    assert prior().squared_distance(10.0, -5.0, 3.2 - 2 * np.pi) == pytest.approx(1.0)


def test_the_gate_leaves_out_as_much_as_its_standard_deviations_do_in_one_dimension():
    assert chi2.sf(prior(3.0).limit, 3) == pytest.approx(2 * norm.sf(3.0))
    edge = np.sqrt(prior().limit)
    assert prior().admits(planar_pose(10.0 + 4.999 * edge, -5.0, 3.0))
    assert not prior().admits(planar_pose(10.0 + 5.001 * edge, -5.0, 3.0))


def test_height_and_tilt_do_not_matter():
    assert prior().admits(planar_pose(10.0, -5.0, 3.0, z=100.0))


def test_distances_of_many_poses_come_in_their_shape():
    assert prior().squared_distance(np.zeros((4, 1)), np.zeros(3), 3.0).shape == (4, 3)


def test_a_covariance_of_wrong_shape_is_refused():
    with pytest.raises(ValueError, match=r"must be \(6, 6\), got \(3, 3\)"):
        Prior(np.eye(4), np.eye(3))


@pytest.mark.parametrize("value", [np.nan, np.inf, -1.0])
def test_a_covariance_that_is_none_is_refused(value):
    covariance = np.eye(6)
    covariance[3, 3] = value
    with pytest.raises(ValueError, match="must be finite and have no negative variance"):
        Prior(np.eye(4), covariance)


def test_a_perfect_prediction_still_leaves_room_for_the_windows_own_shape():
    perfect = Prior(np.eye(4), np.zeros((6, 6)))
    assert perfect.admits(planar_pose(0.2, -0.1, 0.004))
    assert not perfect.admits(planar_pose(1.0, 0.0, 0.0))
