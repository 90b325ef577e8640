"""Joining: several recordings, one dive."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from frontend.arrays import AnyArray, Float32Array, FloatArray
from frontend.frames import wrap_angle
from frontend.georeference import Georeference
from frontend.recording import Recording, Truth
from frontend.trajectory import Trajectory

_TRAJECTORY = ("time", "x", "y", "z", "roll", "pitch", "yaw")
_ROWS = ("sample_spacing", "sound_speed", "altitude", "depth", "speed")


def join(recordings: Sequence[Recording]) -> Recording:
    """Join the recordings of one dive.

    Parameters
    ----------
    recordings : sequence of Recording
        At least one; any order.

    Returns
    -------
    recording : Recording
        All pings in the order of time, in the local frame of the first; NaN beyond the samples of a shorter ping.

    Raises
    ------
    ValueError
        If they overlap in time, come from different sonars, or only some of them are georeferenced.
    """
    first, *others = sorted(recordings, key=lambda recording: recording.ping_time[0])
    if not others:
        return first
    moved = [_in_frame(recording, first) for recording in others]
    for before, after in zip([first, *moved], moved, strict=False):
        _check_follows(before, after)
    return _concatenate([first, *moved])


def _check_follows(before: Recording, after: Recording) -> None:
    names = f"{before.source or 'the first'} and {after.source or 'the second'}"
    overlap = before.ping_time[-1] - after.ping_time[0]
    if overlap >= 0:
        raise ValueError(
            f"{names} overlap in time by {overlap:.1f} s; files of one dive that follow one another are wanted"
        )
    for name in ("frequency", "quantity"):
        values = [getattr(recording.sonar, name) for recording in (before, after)]
        if len(set(map(str, values))) > 1:
            raise ValueError(f"{names} differ in {name}: {values[0]} and {values[1]}; one sonar is wanted")


def _in_frame(recording: Recording, first: Recording) -> Recording:
    """The recording in the local frame of the first one; its truth stays only where the frames are the same."""
    here, there = recording.georeference, first.georeference
    if (here is None) != (there is None):
        without = recording if here is None else first
        raise ValueError(
            f"{without.source or 'one file'} has no position on the Earth and the others have; one kind is wanted"
        )
    if here is None or there is None or here == there:
        return recording
    return replace(recording, trajectory_dr=_move(recording.trajectory_dr, here, there), georeference=there, truth=None)


def _move(trajectory: Trajectory, here: Georeference, there: Georeference) -> Trajectory:
    """A trajectory in another local frame: positions over latitude and longitude, yaw by the convergence."""
    latitude, longitude = here.to_geographic(trajectory.x, trajectory.y)
    x, y = there.to_local(latitude, longitude)
    convergence = np.radians(here.longitude - there.longitude) * np.sin(np.radians(latitude))
    return replace(trajectory, x=x, y=y, yaw=wrap_angle(trajectory.yaw + convergence))


def _concatenate(recordings: Sequence[Recording]) -> Recording:
    n_samples = max(recording.n_samples for recording in recordings)
    rows: dict[str, Any] = {name: np.concatenate([getattr(r, name) for r in recordings]) for name in _ROWS}
    for side in ("port", "starboard"):
        rows[side] = np.concatenate([_padded(getattr(r, side), n_samples) for r in recordings])
    notes = [f"{recording.source}: {note}" for recording in recordings for note in recording.notes]
    if len({recording.n_samples for recording in recordings}) > 1:
        notes.append(f"the files differ in samples a side: shorter pings are filled with NaN up to {n_samples}")
    return replace(
        recordings[0],
        **rows,
        trajectory_dr=_chain([recording.trajectory_dr for recording in recordings]),
        source=", ".join(recording.source for recording in recordings),
        source_sha256=", ".join(recording.source_sha256 for recording in recordings),
        notes=tuple(notes),
        n_dropped=sum(recording.n_dropped for recording in recordings),
        truth=_join_truth([recording.truth for recording in recordings]),
        sensors=_join_sensors([recording.sensors for recording in recordings]),
    )


def _padded(samples: Float32Array, n_samples: int) -> Float32Array:
    return np.pad(samples, ((0, 0), (0, n_samples - samples.shape[1])), constant_values=np.nan)


def _chain(trajectories: Sequence[Trajectory]) -> Trajectory:
    return Trajectory(*(np.concatenate([getattr(t, name) for t in trajectories]) for name in _TRAJECTORY))


def _join_truth(truths: Sequence[Truth | None]) -> Truth | None:
    """True poses of all, over the terrain of the first; None if one has no truth or another terrain."""
    known = [truth for truth in truths if truth is not None]
    terrain = known[0].terrain if known else None
    for truth in known:
        other = truth.terrain
        if (terrain is None) != (other is None):
            return None
        if terrain is not None and other is not None:
            same_grid = (terrain.spacing, terrain.origin) == (other.spacing, other.origin)
            if not same_grid or not np.array_equal(terrain.z, other.z, equal_nan=True):
                return None
    return Truth(_chain([truth.trajectory for truth in known]), terrain) if len(known) == len(truths) else None


def _join_sensors(sensors: Sequence[dict[str, dict[str, FloatArray]]]) -> dict[str, dict[str, FloatArray]]:
    """Raw series one after another; a sensor that some files lack or describe otherwise is left out."""
    first = sensors[0]
    shared = [name for name in first if all(_same_layout(first[name], other.get(name, {})) for other in sensors)]
    return {
        name: {key: np.concatenate([other[name][key] for other in sensors]) for key in first[name]} for name in shared
    }


def _same_layout(one: dict[str, AnyArray], other: dict[str, AnyArray]) -> bool:
    return one.keys() == other.keys() and all(one[key].shape[1:] == other[key].shape[1:] for key in one)
