"""Trajectories in the TUM format: ``t x y z qx qy qz qw``, which evo and every SLAM tool read."""

import os
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from frontend.arrays import FloatArray
from frontend.frames import attitude_from_rotation, rotation_world_body
from frontend.trajectory import Trajectory

_MIN_QUATERNION_NORM = 0.5  # a rounded unit quaternion stays within 1e-6 of 1; half is no quaternion at all
_MAX_NUMBER = 1e12  # no time, coordinate or quaternion is larger, and sums of squares stay finite


def format_tum(trajectory: Trajectory) -> str:
    """A trajectory as the text of a TUM file.

    Parameters
    ----------
    trajectory : Trajectory
        N poses.

    Returns
    -------
    text : str
        N rows, fixed notation, 6 decimals; time in seconds, position in ENU metres, quaternions with ``qw >= 0``.
    """
    rotations = Rotation.from_matrix(rotation_world_body(trajectory.roll, trajectory.pitch, trajectory.yaw))
    rows = np.column_stack([trajectory.time, trajectory.positions, rotations.as_quat(canonical=True)])
    return "".join(" ".join(f"{value:.6f}" for value in row) + "\n" for row in np.round(rows, 6) + 0.0)


def read_tum(path: str | os.PathLike[str]) -> Trajectory:
    """Read a trajectory from a TUM file.

    Parameters
    ----------
    path : path-like
        The file; empty lines and lines that begin with ``#`` are skipped.

    Returns
    -------
    trajectory : Trajectory
        Its poses.

    Raises
    ------
    ValueError
        If the file cannot be read, or a row breaks a rule of the format.
    """
    rows = _read_rows(Path(path))
    _check_rows(rows, path)
    time, x, y, z = rows[:, :4].T.copy()
    return Trajectory(time, x, y, z, *attitude_from_rotation(Rotation.from_quat(rows[:, 4:]).as_matrix()))


def _read_rows(path: Path) -> FloatArray:
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: a TUM trajectory (text) is wanted, cannot read it ({_reason(error)})") from None
    rows = [_parse_row(line, f"{path}, line {i}") for i, line in enumerate(lines, 1) if line.split("#")[0].strip()]
    if not rows:
        raise ValueError(f"{path}: a TUM trajectory needs at least one row, the file has none")
    return np.array(rows, dtype=np.float64)


def _reason(error: OSError | UnicodeDecodeError) -> str:
    return "it is not text" if isinstance(error, UnicodeDecodeError) else str(error.strerror)


def _parse_row(line: str, where: str) -> list[float]:
    words = line.split("#")[0].split()
    if len(words) != 8:
        raise ValueError(f"{where}: a TUM row has 8 numbers (t x y z qx qy qz qw), got {len(words)} words")
    try:
        values = [float(word) for word in words]
    except ValueError:
        raise ValueError(f"{where}: a TUM row has 8 numbers (t x y z qx qy qz qw), got {line.strip()[:60]!r}") from None
    if not np.all(np.abs(values) < _MAX_NUMBER):
        raise ValueError(
            f"{where}: the numbers of a TUM row must be finite and below {_MAX_NUMBER:g}, got {line.strip()[:60]!r}"
        )
    return values


def _check_rows(rows: FloatArray, path: str | os.PathLike[str]) -> None:
    late = np.flatnonzero(np.diff(rows[:, 0]) <= 0)
    if late.size:
        raise ValueError(f"{path}: times must increase strictly, row {late[0] + 2} is not later than the one before")
    weak = np.flatnonzero(np.linalg.norm(rows[:, 4:], axis=1) < _MIN_QUATERNION_NORM)
    if weak.size:
        raise ValueError(f"{path}: quaternions must have length 1, row {weak[0] + 1} has {rows[weak[0], 4:].tolist()}")
