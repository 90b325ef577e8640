"""The data model: a side-scan recording is arrays, one row a ping."""

from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Self

import numpy as np

from frontend.arrays import AnyArray, Float32Array, FloatArray
from frontend.georeference import Georeference
from frontend.heightfield import Heightfield
from frontend.trajectory import Trajectory


class Quantity(StrEnum):
    """What the numbers of a recording are."""

    INTENSITY = "intensity"
    AMPLITUDE = "amplitude"
    LOG = "log"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class SonarGeometry:
    """The sonar and where it sits on the vehicle; unknown numbers are NaN.

    Parameters
    ----------
    frequency : float
        Centre frequency [Hz].
    horizontal_beamwidth, vertical_beamwidth : float
        One-way -3 dB widths [rad].
    mounting_depression : float
        Angle of the beam axis below the horizontal [rad].
    lever_arm_port, lever_arm_starboard : tuple of float
        Transducers in the body frame (forward, port, up) [m].
    quantity : Quantity
        What the recorded numbers are.
    """

    frequency: float = np.nan
    horizontal_beamwidth: float = np.nan
    vertical_beamwidth: float = np.nan
    mounting_depression: float = np.nan
    lever_arm_port: tuple[float, float, float] = (0.0, 0.0, 0.0)
    lever_arm_starboard: tuple[float, float, float] = (0.0, 0.0, 0.0)
    quantity: Quantity = Quantity.UNKNOWN


@dataclass(frozen=True)
class Truth:
    """What a simulated recording knows and a real one does not.

    Parameters
    ----------
    trajectory : Trajectory
        True body poses, one a ping.
    terrain : Heightfield or None
        True heights in the world frame.
    """

    trajectory: Trajectory
    terrain: Heightfield | None = None


@dataclass(frozen=True)
class Recording:
    """A side-scan recording: N pings of M samples a side, with the navigation as recorded.

    Sample i is centred at ``(i + 0.5) * sample_spacing`` from its transducer. Unknown is NaN, never 0.

    Parameters
    ----------
    port, starboard : ndarray of float32, shape (N, M)
        Echoes of each side; NaN where a ping has no sample.
    sample_spacing : ndarray, shape (N,)
        Slant range between samples [m].
    sound_speed : ndarray, shape (N,)
        Sound speed at the sonar [m/s].
    trajectory_dr : Trajectory
        Navigation as recorded; its ``time`` is the ping time.
    altitude, depth, speed : ndarray, shape (N,)
        Height above the seafloor, depth below the surface [m], speed [m/s], as recorded.
    sonar : SonarGeometry
        The sonar.
    georeference : Georeference or None
        Where the world frame lies on the Earth.
    source, source_sha256 : str
        File name (several joined with a comma) and digest.
    notes : tuple of str
        What a reader changed or found suspicious, one sentence each.
    n_dropped : int
        Pings of the file that could not be used.
    truth : Truth or None
        Truth of a simulated recording.
    sensors : dict of str to dict of str to ndarray
        Raw sensor series (imu, dvl, depth, compass, gnss), each with its own ``time``.
    """

    port: Float32Array
    starboard: Float32Array
    sample_spacing: FloatArray
    sound_speed: FloatArray
    trajectory_dr: Trajectory
    altitude: FloatArray
    depth: FloatArray
    speed: FloatArray
    sonar: SonarGeometry = SonarGeometry()
    georeference: Georeference | None = None
    source: str = ""
    source_sha256: str = ""
    notes: tuple[str, ...] = ()
    n_dropped: int = 0
    truth: Truth | None = None
    sensors: dict[str, dict[str, FloatArray]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _check_shapes(self)
        _check_values(self)

    @property
    def n_pings(self) -> int:
        """Number of pings N."""
        return self.port.shape[0]

    @property
    def n_samples(self) -> int:
        """Number of samples M a side."""
        return self.port.shape[1]

    @property
    def ping_time(self) -> FloatArray:
        """Shape (N,): seconds since 1970 UTC."""
        return self.trajectory_dr.time

    @property
    def slant_range_max(self) -> FloatArray:
        """Shape (N,): slant range at the far edge of the last sample [m]."""
        return self.sample_spacing * self.n_samples

    @property
    def ping_spacing(self) -> float:
        """Median distance run between pings [m]."""
        return self.trajectory_dr.ping_spacing

    def __getitem__(self, pings: slice | AnyArray) -> Self:
        """The recording of some of the pings."""
        rows = {name: getattr(self, name)[pings] for name in _ROWS}
        truth = replace(self.truth, trajectory=self.truth.trajectory[pings]) if self.truth else None
        return replace(self, **rows, truth=truth)


_ROWS = ("port", "starboard", "sample_spacing", "sound_speed", "trajectory_dr", "altitude", "depth", "speed")


def _check_shapes(recording: Recording) -> None:
    shape = recording.port.shape
    if len(shape) != 2 or recording.starboard.shape != shape:
        raise ValueError(
            f"port and starboard must both be (pings, samples), got {shape} and {recording.starboard.shape}"
        )
    n, n_samples = shape
    if n == 0 or n_samples == 0:
        raise ValueError(f"a recording needs at least one ping and one sample, got {n} pings of {n_samples} samples")
    for name in _ROWS[2:]:
        if len(getattr(recording, name)) != n:
            raise ValueError(f"{name} must have one row a ping: {n} wanted, got {len(getattr(recording, name))}")


def _check_values(recording: Recording) -> None:
    trajectory = recording.trajectory_dr
    for name in ("time", "x", "y", "z", "roll", "pitch", "yaw"):
        bad = np.flatnonzero(~np.isfinite(getattr(trajectory, name)))
        if bad.size:
            raise ValueError(f"navigation must be finite: {name} of ping {bad[0]} is not ({bad.size} such pings)")
    if np.any(np.diff(trajectory.time) <= 0):
        first = int(np.flatnonzero(np.diff(trajectory.time) <= 0)[0]) + 1
        raise ValueError(f"ping times must increase strictly: ping {first} is not later than the one before")
    if not np.all(recording.sample_spacing > 0):
        raise ValueError(f"sample spacing must be positive, got {np.nanmin(recording.sample_spacing)} m")
    if not np.all(recording.sound_speed > 0):
        raise ValueError(f"sound speed must be positive, got {np.nanmin(recording.sound_speed)} m/s")
