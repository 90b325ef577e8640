"""The run in a few sentences, for the top of the report."""

from collections.abc import Mapping
from typing import Any

import numpy as np

_SAME_TRACK = 0.01  # m; below it the corrected track is the given one for any reader
_SAME_ERROR = 0.01  # relative change of an error that is not worth a word


def format_metric(value: float | None, unit: str) -> str:
    """A value as a reader wants it: three figures or so, radians as degrees.

    Parameters
    ----------
    value : float or None
        The value; None is unknown.
    unit : str
        Its unit.

    Returns
    -------
    text : str
        Value and unit.
    """
    if value is None:
        return "unknown"
    if unit == "rad":
        value, unit = float(np.rad2deg(value)), "°"
    exact = float(value).is_integer() and unit in ("", "loop closures", "candidates", "poses")
    digits = 0 if exact or value == 0 else int(np.clip(2 - np.floor(np.log10(max(abs(value), 1e-9))), 0, 3))
    number = f"{value:,.{digits}f}".replace(",", "\u202f")
    return f"{number}{unit}" if unit == "°" else f"{number}\u00a0{unit}".rstrip("\u00a0")


def format_duration(seconds: float) -> str:
    """A time span in words.

    Parameters
    ----------
    seconds : float
        The span [s].

    Returns
    -------
    text : str
        Seconds, minutes or hours.
    """
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"


def verdict(manifest: Mapping[str, Any]) -> list[str]:
    """Judge a run in words.

    Parameters
    ----------
    manifest : mapping
        ``run.json``.

    Returns
    -------
    sentences : list of str
        What was run, what was found, how far the track was moved, and how well, where a reference tells.
    """
    metrics = {metric["name"]: metric["value"] for metric in manifest["metrics"]}
    found = [_ran(manifest), _closures(manifest["counts"], metrics), _moved(manifest)]
    return [*found, _judged(metrics)]


def _ran(manifest: Mapping[str, Any]) -> str:
    track, counts = manifest["track"], manifest["counts"]
    duration = format_duration(manifest["input"]["duration"])
    dropped = f" ({_count(counts['pings_dropped'], 'more')} dropped)" if counts["pings_dropped"] else ""
    pings = f"{_count(counts['pings'], 'ping')}{dropped}"
    submaps = _count(counts["submaps"], "submap")
    return f"The vehicle ran {format_metric(track['distance'], 'm')} in {duration}; {pings} made {submaps}."


def _count(n: int, noun: str) -> str:
    ending = "" if n == 1 or noun == "more" else "es" if noun.endswith("x") else "s"
    return f"{n:,} {noun}".replace(",", "\u202f") + ending


def _closures(counts: Mapping[str, int], metrics: Mapping[str, float | None]) -> str:
    accepted, candidates = counts["loop_closures"], counts["candidates"]
    if not candidates:
        return "No two submaps were compared: the track passes no place again, or was not known to."
    if not accepted:
        return f"None of {_count(candidates, 'candidate')} was accepted as a loop closure."
    verb = "was" if accepted == 1 else "were"
    text = f"{accepted} of {_count(candidates, 'candidate')} {verb} accepted as loop closures"
    wrong = metrics.get("closures_false")
    if wrong is None:
        return f"{text}."
    return f"{text}; {'none' if wrong == 0 else f'{wrong:.0f}'} of them {'are' if wrong > 1 else 'is'} false."


def _moved(manifest: Mapping[str, Any]) -> str:
    rms, most = (format_metric(manifest["track"][name], "m") for name in ("shift_rms", "shift_max"))
    n_closures, n_fixes = manifest["counts"]["loop_closures"], manifest["counts"].get("fixes", 0)
    movers = [*(["They"] if n_closures else []), *([_count(n_fixes, "fix") + " at the surface"] if n_fixes else [])]
    if movers:
        return f"{' and '.join(movers)} moved the track by {rms} (root mean square), at most {most}."
    if manifest["track"]["shift_max"] < _SAME_TRACK:
        return "Without a loop closure there is nothing to correct: the track is the one that was given."
    return f"The track was moved by at most {most} all the same."


def _judged(metrics: Mapping[str, float | None]) -> str:
    after, before = metrics.get("ate"), metrics.get("ate_dr")
    if after is None or before is None:
        return "There is no reference to judge the corrected track by."
    values = f"from {format_metric(before, 'm')} to {format_metric(after, 'm')}"
    change = after / before - 1.0 if before > 0 else 0.0
    if abs(change) < _SAME_ERROR:
        return f"Against the reference its error (ATE) stayed the same, {format_metric(after, 'm')}."
    if change < 0:
        return f"Against the reference the error of the track (ATE) fell {values}, {-change:.0%} less."
    return f"Against the reference the error of the track (ATE) ROSE {values}, {change:.0%} more: do not use it."
