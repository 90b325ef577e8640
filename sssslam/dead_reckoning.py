"""Which track is corrected: the recorded one, or one reckoned anew from the raw sensors; and how far it may drift."""

from dataclasses import replace

import numpy as np

from backend.dead_reckoning import DeadReckoning
from backend.drift_model import DeadReckoningConfig
from backend.sensor_reckoning import reckon
from backend.sensor_series import can_reckon
from frontend.arrays import FloatArray
from frontend.georeference import Georeference
from frontend.recording import Recording
from frontend.trajectory import Trajectory

_EARTH_RATE = 7.292115e-5  # rad/s, WGS 84
_LEAST = 1e-3  # rad, m


def dead_reckon(recording: Recording, config: DeadReckoningConfig) -> tuple[Recording, DeadReckoning]:
    """Choose the track to correct.

    Parameters
    ----------
    recording : Recording
        The dive.
    config : DeadReckoningConfig
        Says which track is wanted, and the errors of the sensors.

    Returns
    -------
    recording : Recording
        The dive with that track: the recorded one, or, where the configuration asks for it or no position was recorded,
        the one that the raw sensors give.
    dead_reckoning : DeadReckoning
        The uncertainty of that very track.

    Raises
    ------
    ValueError
        If the sensors are asked for and do not say enough.
    """
    wants_sensors = config.source == "sensors" or (
        not _has_moved(recording.trajectory_dr) and can_reckon(recording.sensors)
    )
    if not wants_sensors:
        return recording, DeadReckoning(recording.ping_time, recording.trajectory_dr.poses, config)
    track, place = recording.trajectory_dr, recording.georeference
    start = float(track.x[0]), float(track.y[0])
    reckoning = reckon(on_the_map(recording), track.time, start, config, earth_rate(place))
    trajectory = Trajectory.from_poses(track.time, reckoning.T_world_body)
    return replace(
        recording, trajectory_dr=trajectory, notes=(*recording.notes, _said(recording, trajectory))
    ), reckoning


def on_the_map(recording: Recording) -> dict[str, dict[str, FloatArray]]:
    """Raw sensors with fixes in the world frame.

    Parameters
    ----------
    recording : Recording
        The dive.

    Returns
    -------
    sensors : dict of str to dict of str to ndarray
        Its sensors; fixes in degrees got a ``position_x`` and ``position_y`` [m], or are left out where the world frame
        has no place on the Earth.
    """
    sensors = dict(recording.sensors)
    fixes = sensors.get("gnss", {"position_x": np.zeros(0)})
    if "position_x" in fixes and "position_y" in fixes:
        return sensors
    sensors.pop("gnss", None)
    if recording.georeference is not None and "latitude" in fixes and "longitude" in fixes:
        x, y = recording.georeference.to_local(fixes["latitude"], fixes["longitude"])
        sensors["gnss"] = {"time": fixes["time"], "position_x": x, "position_y": y}
    return sensors


def earth_rate(place: Georeference | None) -> FloatArray:
    """Turn rate of the Earth in the world frame.

    Parameters
    ----------
    place : Georeference or None
        Where the world frame lies.

    Returns
    -------
    rate : ndarray, shape (3,)
        East, north and up [rad/s]; zero where the place is unknown, which the gyro's bias then takes up in part.
    """
    if place is None:
        return np.zeros(3)
    latitude = np.radians(place.latitude)
    return _EARTH_RATE * np.array([0.0, np.cos(latitude), np.sin(latitude)])


def first_pose_sigmas(dead_reckoning: DeadReckoning, ping: int) -> FloatArray:
    """How uncertain the first anchor of a graph is.

    No loop closure sees where the whole track lies and how it is turned: so the first pose says how well that is known,
    and the graph carries it to every anchor. It moves nothing, as the first anchor is where dead reckoning has it.

    Parameters
    ----------
    dead_reckoning : DeadReckoning
        The uncertainty of the track.
    ping : int
        The anchor's ping.

    Returns
    -------
    sigmas : ndarray, shape (6,)
        Along the world's axes [rad, rad, rad, m, m, m]; at least a milliradian and a millimetre.
    """
    x, y, z, yaw = dead_reckoning.sigmas[ping]
    tilt = dead_reckoning.config.tilt_sd
    return np.maximum([tilt, tilt, yaw, x, y, z], _LEAST)


def _has_moved(track: Trajectory) -> bool:
    """Whether positions were recorded at all; a reader without any leaves the vehicle at the origin."""
    return bool(np.ptp(track.x) > 0 or np.ptp(track.y) > 0)


def _said(recording: Recording, trajectory: Trajectory) -> str:
    apart = np.hypot(trajectory.x - recording.trajectory_dr.x, trajectory.y - recording.trajectory_dr.y).max()
    used = ", ".join(sorted(name for name in recording.sensors if name != "altimeter"))
    return f"Track reckoned anew from the raw sensors ({used}); at most {apart:.1f} m from the recorded one."
