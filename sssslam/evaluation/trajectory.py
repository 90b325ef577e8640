"""How far a track is from the reference: absolute, relative, and at its end."""

import numpy as np

from frontend.arrays import FloatArray
from frontend.frames import wrap_angle
from frontend.trajectory import Trajectory
from sssslam.evaluation.alignment import aligned
from sssslam.evaluation.association import associate
from sssslam.evaluation.metric import Metric, root_mean_square

RPE_DISTANCES = (50.0, 100.0)  # m
_PAIR_TOLERANCE = 0.1  # of the distance, as evo takes it
_CHI_SQUARE_95 = -2.0 * np.log(0.05)  # of two degrees of freedom


def ate(trajectory: Trajectory, trajectory_ref: Trajectory) -> Metric:
    """Absolute trajectory error: horizontal, after SE(2) alignment without scale.

    Parameters
    ----------
    trajectory, trajectory_ref : Trajectory
        The track and the reference, on the same clock.

    Returns
    -------
    ate : Metric
        Root mean square [m].
    """
    matched, matched_ref, _ = associate(trajectory, trajectory_ref)
    xy, xy_ref = matched.positions[:, :2], matched_ref.positions[:, :2]
    return _rms("ate", aligned(xy, xy_ref) - xy_ref, "horizontal, SE(2) aligned without scale")


def ate_unaligned(trajectory: Trajectory, trajectory_ref: Trajectory) -> Metric:
    """Absolute trajectory error: horizontal, as the tracks lie.

    Parameters
    ----------
    trajectory, trajectory_ref : Trajectory
        The track and the reference, on the same clock and in the same frame.

    Returns
    -------
    ate : Metric
        Root mean square [m].
    """
    matched, matched_ref, _ = associate(trajectory, trajectory_ref)
    return _rms("ate_unaligned", (matched.positions - matched_ref.positions)[:, :2], "horizontal, not aligned")


def ate_se3(trajectory: Trajectory, trajectory_ref: Trajectory) -> Metric:
    """Absolute trajectory error: in space, after SE(3) alignment without scale.

    Parameters
    ----------
    trajectory, trajectory_ref : Trajectory
        The track and the reference, on the same clock.

    Returns
    -------
    ate : Metric
        Root mean square [m].
    """
    matched, matched_ref, _ = associate(trajectory, trajectory_ref)
    error = aligned(matched.positions, matched_ref.positions) - matched_ref.positions
    return _rms("ate_se3", error, "in three dimensions, SE(3) aligned without scale")


def _rms(name: str, error: FloatArray, how: str) -> Metric:
    return Metric(name, root_mean_square(np.linalg.norm(error, axis=1)), "m", f"{how}, {len(error)} poses")


def rpe(trajectory: Trajectory, trajectory_ref: Trajectory, distance: float) -> tuple[Metric, Metric]:
    """Relative pose error over a fixed distance: the drift, whatever came before.

    Parameters
    ----------
    trajectory, trajectory_ref : Trajectory
        The track and the reference, on the same clock.
    distance : float
        Distance along the reference between the two poses of a pair [m].

    Returns
    -------
    translation, yaw : Metric
        Root mean squares of the horizontal shift [m] and of the turn [rad] between level frames, over all pairs; NaN
        where the track is too short for a pair.
    """
    matched, matched_ref, _ = associate(trajectory, trajectory_ref)
    i, j = _pairs(matched_ref.distance, distance)
    shift = _relative_shift(matched, i, j) - _relative_shift(matched_ref, i, j)
    turn = wrap_angle((matched.yaw[j] - matched.yaw[i]) - (matched_ref.yaw[j] - matched_ref.yaw[i]))
    how = f"between level frames {distance:.0f} m apart along the reference, {i.size} pairs"
    name = f"{distance:.0f}m"
    return (
        Metric(f"rpe_{name}", root_mean_square(np.linalg.norm(shift, axis=1)), "m", f"horizontal, {how}"),
        Metric(f"rpe_yaw_{name}", root_mean_square(turn), "rad", how),
    )


def _pairs(along: FloatArray, distance: float) -> tuple[np.ndarray, np.ndarray]:
    """Each pose and the later one nearest to the distance, if it is within the tolerance."""
    first = np.arange(along.size - 1)
    after = np.clip(np.searchsorted(along, along[first] + distance), first + 1, along.size - 1)
    before = np.maximum(after - 1, first + 1)
    miss_after, miss_before = (np.abs(along[k] - along[first] - distance) for k in (after, before))
    second = np.where(miss_before <= miss_after, before, after)
    kept = np.minimum(miss_before, miss_after) <= _PAIR_TOLERANCE * distance
    return first[kept], second[kept]


def _relative_shift(trajectory: Trajectory, i: np.ndarray, j: np.ndarray) -> FloatArray:
    """Position of pose j in the level frame of pose i, shape (P, 2)."""
    dx, dy = trajectory.x[j] - trajectory.x[i], trajectory.y[j] - trajectory.y[i]
    c, s = np.cos(trajectory.yaw[i]), np.sin(trajectory.yaw[i])
    return np.stack([c * dx + s * dy, c * dy - s * dx], axis=-1)


def end_point_error(trajectory: Trajectory, trajectory_ref: Trajectory) -> tuple[Metric, Metric]:
    """Horizontal error at the last pose that the reference covers, as the tracks lie.

    Parameters
    ----------
    trajectory, trajectory_ref : Trajectory
        The track and the reference, on the same clock and in the same frame.

    Returns
    -------
    error, share : Metric
        The error [m], and as a share of the distance run [%]; NaN where the reference does not move.
    """
    matched, matched_ref, _ = associate(trajectory, trajectory_ref)
    error = float(np.hypot(matched.x[-1] - matched_ref.x[-1], matched.y[-1] - matched_ref.y[-1]))
    run = float(matched_ref.distance[-1])
    share = 100.0 * error / run if run > 0 else float("nan")
    how = f"horizontal, not aligned, after {run:.0f} m"
    return Metric("end_point_error", error, "m", how), Metric("end_point_error_share", share, "%", how)


def track_coverage(trajectory: Trajectory, sigmas: FloatArray, trajectory_ref: Trajectory) -> Metric:
    """How often the reference lies in the horizontal ellipse that ought to hold it in 95 of 100 cases.

    Parameters
    ----------
    trajectory, trajectory_ref : Trajectory
        The track and the reference, on the same clock and in the same frame.
    sigmas : ndarray, shape (N, 4)
        Standard deviations of the track's x, y, z [m] and yaw [rad].

    Returns
    -------
    coverage : Metric
        Share of the poses [%]; NaN where no sigma is known.
    """
    matched, matched_ref, is_matched = associate(trajectory, trajectory_ref)
    error, sigma = (matched.positions - matched_ref.positions)[:, :2], sigmas[is_matched, :2]
    known = np.all(sigma > 0, axis=1)
    inside = np.sum((error[known] / sigma[known]) ** 2, axis=1) <= _CHI_SQUARE_95
    share = 100.0 * float(np.mean(inside)) if inside.size else float("nan")
    return Metric("track_coverage_95", share, "%", f"horizontal, not aligned, 95 % is right, {inside.size} poses")


def track_nees(trajectory: Trajectory, sigmas: FloatArray, trajectory_ref: Trajectory) -> Metric:
    """How large the track's errors are against its own sigmas.

    Parameters
    ----------
    trajectory, trajectory_ref : Trajectory
        The track and the reference, on the same clock and in the same frame.
    sigmas : ndarray, shape (N, 4)
        Standard deviations of the track's x, y, z [m] and yaw [rad].

    Returns
    -------
    nees : Metric
        Mean of the squared errors of x, y and yaw over their variances; 1 is right on the average of many runs, as the
        errors of one run hang together. NaN where no sigma is known.
    """
    matched, matched_ref, is_matched = associate(trajectory, trajectory_ref)
    error = matched.positions[:, :2] - matched_ref.positions[:, :2]
    error = np.column_stack([error, wrap_angle(matched.yaw - matched_ref.yaw)])
    sigma = sigmas[is_matched][:, [0, 1, 3]]
    known = np.all(sigma > 0, axis=1)
    nees = root_mean_square(error[known] / sigma[known]) ** 2
    return Metric(
        "track_nees", nees, "", f"x y yaw over sigma, not aligned, 1 is right, {np.count_nonzero(known)} poses"
    )


def evaluate_tracks(trajectory: Trajectory, trajectory_dr: Trajectory, trajectory_ref: Trajectory) -> list[Metric]:
    """All metrics of the corrected track, each followed by that of the dead-reckoned one.

    Parameters
    ----------
    trajectory, trajectory_dr, trajectory_ref : Trajectory
        The corrected and the dead-reckoned track and the reference, on the same clock and in the same frame.

    Returns
    -------
    metrics : list of Metric
        Names of the dead-reckoned track end in ``_dr``.
    """
    pairs = [(f(trajectory, trajectory_ref), f(trajectory_dr, trajectory_ref)) for f in (ate, ate_unaligned, ate_se3)]
    pairs += zip(
        end_point_error(trajectory, trajectory_ref), end_point_error(trajectory_dr, trajectory_ref), strict=True
    )
    for distance in RPE_DISTANCES:
        pairs += zip(
            rpe(trajectory, trajectory_ref, distance), rpe(trajectory_dr, trajectory_ref, distance), strict=True
        )
    return [metric for pair in pairs for metric in (pair[0], _of_dead_reckoning(pair[1]))]


def _of_dead_reckoning(metric: Metric) -> Metric:
    return Metric(f"{metric.name}_dr", metric.value, metric.unit, f"{metric.how}, dead-reckoned")
