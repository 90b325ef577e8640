"""Dives: what the pings of a file say, brought into one local frame and made a Recording."""

import hashlib
import mmap
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from frontend.arrays import AnyArray, BoolArray, Float32Array, FloatArray
from frontend.georeference import Georeference
from frontend.recording import Recording, SonarGeometry
from sssslam.readers.ping_times import repair_times
from sssslam.readers.xtf_navigation import METRES_PER_DEGREE, RawNavigation, good_pings
from sssslam.readers.xtf_packets import map_file
from sssslam.readers.xtf_trajectory import make_trajectory

_MIN_SLANT_RANGE, _MAX_SLANT_RANGE = 1e-3, 50e3
# Positions this far from the middle of a dive [m] are damage, and so are parallels of this share of the equator.
_MAX_REACH, _MIN_PARALLEL = 500e3, 1e-3


@dataclass(frozen=True)
class Pings:
    """The pings of one file as recorded, before those without a position are left out.

    Parameters
    ----------
    port, starboard : ndarray of float32, shape (P, M)
        Samples, near end first; NaN where there is none.
    sample_spacing : ndarray, shape (P,)
        Slant range between samples [m].
    sound_speed : ndarray, shape (P,)
        Sound speed [m/s].
    stamp : ndarray, shape (P,)
        Time as recorded [s]; NaN where unknown.
    navigation : RawNavigation
        Navigation as recorded, but its speed in m/s.
    sonar : SonarGeometry
        The sonar.
    notes : tuple of str
        What was decided, assumed or skipped.
    n_dropped : int
        Pings that were left out already.
    is_geographic : bool
        Whether positions are degrees; else metres of a grid.
    is_local : bool
        Whether those metres are x and y of a local frame already, whose origin is to be kept.
    georeference : Georeference or None
        Where that local frame lies.
    sha256 : str
        Of all files that the pings came from; empty for that of the one file read.
    """

    port: Float32Array
    starboard: Float32Array
    sample_spacing: FloatArray
    sound_speed: FloatArray
    stamp: FloatArray
    navigation: RawNavigation
    sonar: SonarGeometry = SonarGeometry()
    notes: tuple[str, ...] = ()
    n_dropped: int = 0
    is_geographic: bool = True
    is_local: bool = False
    georeference: Georeference | None = None
    sha256: str = ""

    def __getitem__(self, rows: AnyArray) -> "Pings":
        names = ("port", "starboard", "sample_spacing", "sound_speed", "stamp", "navigation")
        return replace(self, **{name: getattr(self, name)[rows] for name in names})


@dataclass(frozen=True)
class _Dive:
    """The pings of one file that have a position, and their times."""

    path: Path
    sha256: str
    pings: Pings
    time: FloatArray


def read_dives(paths: Sequence[Path], extract: Callable[[Path, mmap.mmap], Pings]) -> list[Recording]:
    """Read several files of one format into one local frame.

    Parameters
    ----------
    paths : sequence of Path
        The files.
    extract : callable
        Takes a path and the bytes of the file, gives its pings or raises a ValueError without the path.

    Returns
    -------
    recordings : list of Recording
        One a file, in the order of time; the origin of their frame is the first good ping of the first.

    Raises
    ------
    ValueError
        If a file gives no recording, or some positions are degrees and some are metres.
    """
    dives = sorted((_dive(path, extract) for path in paths), key=lambda dive: dive.time[0])
    first = dives[0].pings
    for dive in dives[1:]:
        if (dive.pings.is_geographic, dive.pings.is_local) != (first.is_geographic, first.is_local):
            raise ValueError(
                f"{dives[0].path} and {dive.path}: one has positions in {_kind(first)} and one in"
                f" {_kind(dive.pings)}; one kind is wanted"
            )
    origin = float(first.navigation.east[0]), float(first.navigation.north[0])
    georeference = Georeference(latitude=origin[1], longitude=origin[0]) if first.is_geographic else None
    return [_named(dive, georeference, origin) for dive in dives]


def _kind(pings: Pings) -> str:
    return "degrees" if pings.is_geographic else "metres of a local frame" if pings.is_local else "metres"


def _named(dive: _Dive, georeference: Georeference | None, origin: tuple[float, float]) -> Recording:
    """The recording of one file; its name goes before any complaint."""
    try:
        if dive.pings.is_local:
            return replace(_recording(dive, None, (0.0, 0.0)), georeference=dive.pings.georeference)
        return _recording(dive, georeference, origin)
    except ValueError as error:
        raise ValueError(f"{dive.path}: {error}") from None


def _dive(path: Path, extract: Callable[[Path, mmap.mmap], Pings]) -> _Dive:
    """The good pings of one file; its name goes before any complaint."""
    try:
        data = map_file(path)
        pings = extract(path, data)
        is_good = _good_pings(pings)
        n_lost = int((~is_good).sum())
        kept = pings[np.flatnonzero(is_good)]
        time, repairs = repair_times(kept.stamp, _nominal_interval(kept))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    except OSError as error:
        raise ValueError(f"{path}: cannot be read ({error.strerror}); a readable recording is wanted") from None
    lost = [f"pings dropped, for lack of a position or range that can be used: {n_lost}"] if n_lost else []
    notes, n_dropped = (*pings.notes, *lost, *repairs), pings.n_dropped + n_lost
    sha256 = pings.sha256 or hashlib.sha256(data).hexdigest()
    return _Dive(path, sha256, replace(kept, notes=notes, n_dropped=n_dropped), time)


def _good_pings(pings: Pings) -> BoolArray:
    """Pings with a position; refused if there is none."""
    if not len(pings.stamp):
        raise ValueError("the file holds no whole ping with samples on both sides; at least one is wanted")
    extent = pings.sample_spacing * pings.port.shape[1]
    has_extent = (extent > _MIN_SLANT_RANGE) & (extent < _MAX_SLANT_RANGE)
    if not has_extent.any():
        raise ValueError(
            f"no ping has a slant range that can be, the first has {extent[0]:g} m; 1 mm to 50 km is wanted"
        )
    is_good = good_pings(pings.navigation, pings.is_geographic) & has_extent & _are_together(pings)
    if not is_good.any():
        raise ValueError(
            f"none of {len(is_good)} pings has a position (all are missing, zero or impossible); navigation is wanted"
        )
    return is_good


def _are_together(pings: Pings) -> BoolArray:
    """Pings in one region, and not at a pole, where no local frame can be."""
    east, north = pings.navigation.east, pings.navigation.north
    if not (np.isfinite(east) & np.isfinite(north)).any():
        return np.zeros(len(north), dtype=np.bool_)
    unit, width = 1.0, np.ones(len(north))
    if pings.is_geographic:
        # Counted from one of them, longitudes have no step within the dive, wherever it is.
        east = (east - east[np.isfinite(east)][0] + 180) % 360
        unit, width = METRES_PER_DEGREE, np.cos(np.radians(north))
    off = unit * np.hypot(width * (east - np.nanmedian(east)), north - np.nanmedian(north))
    return np.asarray((off < _MAX_REACH) & (width > _MIN_PARALLEL))


def _nominal_interval(pings: Pings) -> float:
    """The time that sound needs there and back [s]: what a ping takes at least, where no stamp tells."""
    return max(float(np.median(2 * pings.sample_spacing / pings.sound_speed)) * pings.port.shape[1], 1e-3)


def _recording(dive: _Dive, georeference: Georeference | None, origin: tuple[float, float]) -> Recording:
    pings = dive.pings
    trajectory, notes = make_trajectory(pings.navigation, dive.time, georeference, origin)
    if georeference is None and not pings.is_local:
        notes.append(
            f"positions are metres of an unnamed grid; the origin is easting {origin[0]:.3f}, northing {origin[1]:.3f}"
        )
    return Recording(
        port=pings.port,
        starboard=pings.starboard,
        sample_spacing=pings.sample_spacing,
        sound_speed=pings.sound_speed,
        trajectory_dr=trajectory,
        altitude=pings.navigation.altitude,
        depth=pings.navigation.depth,
        speed=pings.navigation.speed,
        sonar=pings.sonar,
        georeference=georeference,
        source=dive.path.name.encode("utf-8", "replace").decode(),
        source_sha256=dive.sha256,
        notes=(*pings.notes, *notes),
        n_dropped=pings.n_dropped,
    )
