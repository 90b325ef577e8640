"""The whole simulator on one screen: scene in, recording with truth out."""

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from frontend.arrays import Float32Array, FloatArray
from frontend.georeference import Georeference
from frontend.recording import Recording, Truth
from frontend.trajectory import Trajectory
from sssslam.simulation.absorption import absorption
from sssslam.simulation.dead_reckoning import dead_reckon
from sssslam.simulation.drift import draw_drift
from sssslam.simulation.planes import Mounting, Rates, at_rest, beam_planes
from sssslam.simulation.receiver import background, leak, time_varying_gain
from sssslam.simulation.renderer import make_beam, render
from sssslam.simulation.scene import Scene
from sssslam.simulation.sensors import Platform, Series, sense
from sssslam.simulation.speckle import SpeckleSource
from sssslam.simulation.terrain import Terrain, make_terrain
from sssslam.simulation.vehicle import Motion, make_motion

EPOCH = 1_704_067_200.0  # 2024-01-01T00:00:00Z, the start of every simulated dive
CHUNK = 512


@dataclass(frozen=True)
class Dive:
    """What is settled before the first ping is sent.

    Parameters
    ----------
    scene : Scene
        The scene.
    terrain : Terrain
        The seafloor.
    motion : Motion
        The true motion, in seconds since the start.
    sensors : dict of str to dict of str to ndarray
        What the sensors say, in seconds since the start.
    time : ndarray, shape (N,)
        When the pings are sent [s since the start].
    trajectory_dr : Trajectory
        The track as reckoned on board.
    speckle : tuple of SpeckleSource
        Port's and starboard's.
    """

    scene: Scene
    terrain: Terrain
    motion: Motion
    sensors: dict[str, Series]
    time: FloatArray
    trajectory_dr: Trajectory
    speckle: tuple[SpeckleSource, SpeckleSource]


def simulate(scene: Scene, folder: str | Path | None = None) -> Recording:
    """Simulate a dive.

    Parameters
    ----------
    scene : Scene
        What is simulated; same scene, same bytes.
    folder : str, Path or None
        Where the echoes of a long dive are kept, in files ``port.npy`` and ``starboard.npy``; None: in memory.

    Returns
    -------
    recording : Recording
        The recording with its truth.
    """
    dive = prepare(scene)
    shape = (dive.time.size, scene.sonar.n_samples)
    port, starboard = (_echo_array(shape, folder, side) for side in ("port", "starboard"))
    for start in range(0, dive.time.size, CHUNK):
        pings = slice(start, start + CHUNK)
        port[pings], starboard[pings] = _sound(dive, pings)
    return _recording(dive, slice(None), (port, starboard))


def simulate_chunks(scene: Scene, n_pings: int = CHUNK) -> Iterator[Recording]:
    """Simulate a dive piece by piece, the echoes of one piece in memory at a time.

    Parameters
    ----------
    scene : Scene
        What is simulated.
    n_pings : int
        Pings a piece; how a dive is cut changes nothing in it.

    Yields
    ------
    recording : Recording
        The next pings, and the sensors' answers until the ones after them.
    """
    dive = prepare(scene)
    for start in range(0, dive.time.size, n_pings):
        pings = slice(start, start + n_pings)
        yield _recording(dive, pings, _sound(dive, pings))


def prepare(scene: Scene) -> Dive:
    """Make the seafloor, the true motion and the navigation of a dive.

    Parameters
    ----------
    scene : Scene
        What is simulated.

    Returns
    -------
    dive : Dive
        All but the echoes.
    """
    floor_rng, motion_rng, drift_rng, sensor_rng, port_rng, starboard_rng = np.random.default_rng(scene.seed).spawn(6)
    terrain = make_terrain(scene.terrain, floor_rng)
    path = scene.survey.path(scene.vehicle.turn_radius)
    motion = make_motion(scene.vehicle, path, terrain.heightfield, motion_rng)
    time = ping_times(scene, motion.duration)
    drift = draw_drift(scene.drift, motion.duration, drift_rng)
    platform = Platform(motion, terrain.heightfield, drift, scene.drift, _georeference(scene))
    sensors = sense(platform, scene.sensors, sensor_rng)
    start = motion.trajectory(np.zeros(1))
    trajectory_dr = dead_reckon(sensors, time, (float(start.x[0]), float(start.y[0])))
    spacing = (scene.vehicle.speed / scene.sonar.ping_rate, scene.sonar.sample_spacing)
    speckle = SpeckleSource(scene.speckle, spacing, port_rng), SpeckleSource(scene.speckle, spacing, starboard_rng)
    return Dive(scene, terrain, motion, sensors, time, trajectory_dr, speckle)


def ping_times(scene: Scene, duration: float) -> FloatArray:
    """Times of the pings since the start of the dive.

    Parameters
    ----------
    scene : Scene
        Ping rate, range and sound speed.
    duration : float
        How long the vehicle moves [s].

    Returns
    -------
    time : ndarray, shape (N,)
        Seconds; the last ping's echo is back before the end.
    """
    sonar, most = scene.sonar, scene.water.sound_speed / (2 * scene.sonar.range_max)
    if sonar.ping_rate > most:
        raise ValueError(
            f"a ping rate of {sonar.ping_rate} 1/s given, but an echo from {sonar.range_max} m takes "
            f"{1 / most:.3f} s: at most {most:.2f} 1/s wanted"
        )
    return np.arange(max(1, int(duration * sonar.ping_rate + 1e-9))) / sonar.ping_rate


def _sound(dive: Dive, pings: slice) -> tuple[Float32Array, Float32Array]:
    """Send some pings and record the echoes of both sides."""
    scene = dive.scene
    loss = float(absorption(scene.sonar.frequency, scene.water))
    quiet = background(scene.sonar, scene.receiver, scene.water.sound_speed, loss)
    port, starboard = (_hear(dive, pings, side, quiet) for side in (0, 1))
    gain = time_varying_gain(scene.sonar, scene.receiver, loss)
    port, starboard = leak(port, starboard, scene.receiver.crosstalk)
    return scene.recorder.record(gain * port), scene.recorder.record(gain * starboard)


def _hear(dive: Dive, pings: slice, side: int, quiet: FloatArray) -> FloatArray:
    """Intensity at one array (0 port, 1 starboard): the floor's echo and the background, speckled."""
    scene, time, source = dive.scene, dive.time[pings], dive.speckle[side]
    arm = (scene.sonar.lever_arm_port, scene.sonar.lever_arm_starboard)[side]
    mounting = Mounting(arm, 1.0 - 2.0 * side, float(np.radians(scene.sonar.squint_deg)))
    travelling = scene.sonar.motion == "travel-time"
    rates = Rates(dive.motion.velocity(time), dive.motion.angular_rate(time)) if travelling else at_rest(time.size)
    loss = float(absorption(scene.sonar.frequency, scene.water))
    beam = make_beam(scene.sonar, scene.receiver, scene.seabed, scene.water.sound_speed, loss)
    planes = beam_planes(dive.motion.trajectory(time), rates, mounting)
    echo = render(dive.terrain, beam, planes, scene.sonar.n_samples)
    return (echo * source.texture(*echo.shape) + quiet) * source.speckle(*echo.shape)


def _recording(dive: Dive, pings: slice, echoes: tuple[Float32Array, Float32Array]) -> Recording:
    scene, time, track = dive.scene, dive.time[pings], dive.trajectory_dr[pings]
    next_time = np.append(dive.time, np.inf)[1:][pings][-1] if time.size else np.inf
    altimeter = dive.sensors["altimeter"]
    true = dive.motion.trajectory(time)
    return Recording(
        *echoes,
        sample_spacing=np.full(time.size, scene.sonar.sample_spacing),
        sound_speed=np.full(time.size, scene.water.sound_speed),
        trajectory_dr=replace(track, time=EPOCH + time),
        altitude=np.interp(time, altimeter["time"], altimeter["altitude"]),
        depth=-track.z,
        speed=_speed(dive.trajectory_dr)[pings],
        sonar=scene.sonar.geometry(scene.water.sound_speed, scene.recorder.quantity),
        georeference=_georeference(scene),
        source=f"simulated scene {scene.name}, seed {scene.seed}",
        source_sha256=hashlib.sha256(scene.model_dump_json().encode()).hexdigest(),
        truth=Truth(replace(true, time=EPOCH + time), dive.terrain.heightfield),
        sensors={name: _between(series, time[0], next_time) for name, series in dive.sensors.items()},
    )


def _between(series: Series, start: float, end: float) -> Series:
    """A sensor's answers in a span of time; the last piece of a dive has no end."""
    inside = (series["time"] >= start) & (series["time"] < end)
    return {name: values[inside] + (EPOCH if name == "time" else 0.0) for name, values in series.items()}


def _speed(trajectory: Trajectory) -> FloatArray:
    if len(trajectory) < 2:
        return np.full(len(trajectory), np.nan)
    return np.asarray(np.hypot(np.gradient(trajectory.x, trajectory.time), np.gradient(trajectory.y, trajectory.time)))


def _georeference(scene: Scene) -> Georeference | None:
    return None if scene.position is None else Georeference(*scene.position)


def _echo_array(shape: tuple[int, int], folder: str | Path | None, side: str) -> Float32Array:
    if folder is None:
        return np.empty(shape, dtype=np.float32)
    return np.lib.format.open_memmap(Path(folder) / f"{side}.npy", mode="w+", dtype=np.float32, shape=shape)
