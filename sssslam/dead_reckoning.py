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
_LEAST = np.array([1e-4, 1e-4, 1e-4, 1e-3, 1e-3, 1e-3])  # rad, m
# Without a Doppler log speed is that through the water. A current of a tenth of it, 0.1 m/s for a small vehicle, makes
# the way longer by as much from behind and is a crab angle from abeam; as that changes with the heading, part of it is
# noise: 2 m in 100 s. The compass of a small vehicle deviates by 3 deg.
_WITHOUT_DOPPLER = {
    "velocity_scale_sd": 0.1,
    "velocity_misalignment_sd": 0.1,
    "heading_deviation_sd": 0.05,
    "velocity_noise": 0.2,
}


def suit_sensors(config: DeadReckoningConfig, recording: Recording) -> DeadReckoningConfig:
    """Fill in the errors of heading and speed that suit the sensors of a dive.

    Parameters
    ----------
    config : DeadReckoningConfig
        Errors of the sensors; a key that was set is kept.
    recording : Recording
        The dive.

    Returns
    -------
    config : DeadReckoningConfig
        As given; where the speed comes from no Doppler log, with the larger errors of a speed through the water.
    """
    if not _is_without_doppler(recording):
        return config
    left_open = _WITHOUT_DOPPLER.keys() - config.model_fields_set
    return config.model_copy(update={name: _WITHOUT_DOPPLER[name] for name in sorted(left_open)})


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
    if _is_without_doppler(recording):
        recording = replace(recording, notes=(*recording.notes, _said_of_drift(config)))
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
        Along the world's axes [rad, rad, rad, m, m, m]; at least a tenth of a milliradian and a millimetre.
    """
    x, y, z, yaw = dead_reckoning.sigmas[ping]
    tilt = dead_reckoning.config.tilt_sd
    return np.maximum([tilt, tilt, yaw, x, y, z], _LEAST)


def _has_moved(track: Trajectory) -> bool:
    """Whether positions were recorded at all; a reader without any leaves the vehicle at the origin."""
    return bool(np.ptp(track.x) > 0 or np.ptp(track.y) > 0)


def _is_without_doppler(recording: Recording) -> bool:
    """Whether the track was reckoned with a speed through the water."""
    return "speed_log" in recording.sensors and "dvl" not in recording.sensors


def _said_of_drift(config: DeadReckoningConfig) -> str:
    return (
        f"No Doppler log: the drift is that of a compass and a speed through the water, {config.velocity_scale_sd:.0%} "
        f"of the speed, {config.velocity_misalignment_sd:.2g} rad of crab, {config.heading_deviation_sd:.2g} rad of "
        "compass deviation; [dead_reckoning] in a configuration says otherwise."
    )


def _said(recording: Recording, trajectory: Trajectory) -> str:
    apart = np.hypot(trajectory.x - recording.trajectory_dr.x, trajectory.y - recording.trajectory_dr.y).max()
    used = ", ".join(sorted(name for name in recording.sensors if name != "altimeter"))
    return f"Track reckoned anew from the raw sensors ({used}); at most {apart:.1f} m from the recorded one."
