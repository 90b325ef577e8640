"""Better navigation: raw packets of an XTF file take the place of ping headers that lack or hold what they record."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from frontend.arrays import FloatArray
from frontend.frames import wrap_angle
from sssslam.navigation.series import Series, interpolate_angle, interpolate_position
from sssslam.readers.xtf_navigation import METRES_PER_DEGREE, RawNavigation

_KINDS = (("east", "north"), ("roll",), ("pitch",), ("heading",))
# Packets serve where they cover this share of the pings, and are finer with this many times the header's changes.
_LEAST_COVERED, _FINER = 0.9, 1.2
# Headers and packets further apart than this, in the middle of all pings, come from different sensors [rad, m].
_SAME_ANGLE, _SAME_PLACE = float(np.radians(5.0)), 20.0


def better_navigation(
    navigation: RawNavigation, is_geographic: bool, time: FloatArray, raw: Mapping[str, tuple[Series, int]]
) -> tuple[RawNavigation, list[str]]:
    """Take from raw packets what ping headers lack or hold over several pings.

    Parameters
    ----------
    navigation : RawNavigation
        Navigation of the ping headers, one row a ping.
    is_geographic : bool
        Whether positions are degrees.
    time : ndarray, shape (N,)
        Ping times [s].
    raw : mapping of str to (Series, int)
        Raw series of east, north, roll, pitch, heading, and the packet type each comes from.

    Returns
    -------
    navigation : RawNavigation
        With the better series interpolated to the pings.
    notes : list of str
        What was replaced, and what was kept although packets differ.
    """
    better: dict[str, FloatArray] = {}
    notes = []
    for names in _KINDS:
        if all(name in raw for name in names):
            at_pings = [_at_pings(name, raw[name][0], time, is_geographic) for name in names]
            in_headers = [getattr(navigation, name) for name in names]
            if not _is_finer([raw[name][0] for name in names], at_pings[0], in_headers, time):
                continue
            agrees, how = _agreement(in_headers, at_pings, is_geographic)
            better |= dict(zip(names, at_pings, strict=True)) if agrees else {}
            notes.append(_note("position" if len(names) == 2 else names[0], raw[names[0]][1], agrees, how))
    return replace(navigation, **better), notes


def _at_pings(name: str, series: Series, time: FloatArray, is_geographic: bool) -> FloatArray:
    if name not in ("east", "north"):
        return interpolate_angle(series, time)
    is_longitude = name == "east" and is_geographic
    return interpolate_position(
        Series(series.time, np.unwrap(series.values, period=360)) if is_longitude else series, time
    )


def _is_finer(
    series: Sequence[Series], at_pings: FloatArray, in_headers: Sequence[FloatArray], time: FloatArray
) -> bool:
    """Whether packets cover the pings and say more often something new than the headers do."""
    if np.isfinite(at_pings).mean() < _LEAST_COVERED:
        return False
    n_new = max(_n_changes(one.values[(one.time >= time[0]) & (one.time <= time[-1])]) for one in series)
    n_held = max(_n_changes(values[np.isfinite(values)]) for values in in_headers)
    is_recorded = all(np.isfinite(values).any() for values in in_headers)
    return not is_recorded or n_new > _FINER * n_held


def _n_changes(values: FloatArray) -> int:
    return 1 + int(np.count_nonzero(np.diff(values)))


def _agreement(
    in_headers: Sequence[FloatArray], at_pings: Sequence[FloatArray], is_geographic: bool
) -> tuple[bool, str]:
    """Whether both mean the same, and how far apart they are in the middle of all pings; empty if headers lack it."""
    off = [one - other for one, other in zip(in_headers, at_pings, strict=True)]
    if not np.isfinite(off[0]).any():
        return True, ""
    if len(off) == 1:
        middle = float(np.nanmedian(np.abs(wrap_angle(off[0]))))
        return middle < _SAME_ANGLE, f"{np.degrees(middle):.2g} deg"
    if is_geographic:
        east = (off[0] + 180) % 360 - 180
        off = [east * METRES_PER_DEGREE * np.cos(np.radians(at_pings[1])), off[1] * METRES_PER_DEGREE]
    middle = float(np.nanmedian(np.hypot(*off)))
    return middle < _SAME_PLACE, f"{middle:.2g} m"


def _note(what: str, kind: int, agrees: bool, how: str) -> str:
    if not agrees:
        return f"{what} of packets of type {kind} is {how} from that of the ping headers, which is kept"
    why = f"finer than the ping headers and {how} from them" if how else "the ping headers have none"
    return f"{what} is taken from packets of type {kind}: {why}"
