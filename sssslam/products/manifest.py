"""``run.json``: versions, seed, timings, counts, notes and metrics of a run."""

import json
import os
import platform
import subprocess
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from frontend.trajectory import Trajectory
from sssslam.health import examine

if TYPE_CHECKING:
    from sssslam.products.result import Result

_SECTIONS = ("versions", "seed", "input", "counts", "track", "timings", "notes", "metrics")


class Measured(Protocol):
    """A metric: a value with its unit and how it was got."""

    @property
    def name(self) -> str:
        """What was measured."""

    @property
    def value(self) -> float:
        """The number; NaN where it is unknown."""

    @property
    def unit(self) -> str:
        """Its unit."""

    @property
    def how(self) -> str:
        """What changes the number: alignment, number of poses."""


def describe_run(result: "Result", metrics: Sequence[Measured]) -> dict[str, Any]:
    """What ``run.json`` holds.

    Parameters
    ----------
    result : Result
        The run.
    metrics : sequence of Measured
        Its metrics against a reference, where there is one.

    Returns
    -------
    manifest : dict
        Plain values; unknown numbers are None. Only ``timings`` differs between two runs of the same input.
    """
    recording = result.recording
    return {
        "versions": _versions(),
        "seed": result.config.get("seed"),
        "input": {
            "source": recording.source,
            "sha256": recording.source_sha256,
            "start_time": round(float(recording.ping_time[0]), 6),
            "duration": round(float(recording.ping_time[-1] - recording.ping_time[0]), 6),
        },
        "counts": _counts(result),
        "track": describe_track(result.trajectory, recording.trajectory_dr),
        "timings": [{"stage": stage, "seconds": round(t, 3)} for stage, t in result.timings.items()],
        "notes": list(dict.fromkeys([*recording.notes, *result.notes])),
        "findings": [{"what": found.what, "advice": found.advice} for found in examine(recording).findings],
        "metrics": describe_metrics(metrics),
    }


def describe_track(trajectory: Trajectory, trajectory_dr: Trajectory) -> dict[str, float]:
    """How far the vehicle ran and how far its track was moved.

    Parameters
    ----------
    trajectory, trajectory_dr : Trajectory
        The corrected and the dead-reckoned track, at the same times.

    Returns
    -------
    description : dict of str to float
        Horizontal distance of the corrected track, and root mean square and maximum of the horizontal shift [m].
    """
    shift = np.hypot(trajectory.x - trajectory_dr.x, trajectory.y - trajectory_dr.y)
    numbers = {"distance": trajectory.distance[-1], "shift_rms": np.sqrt(np.mean(shift**2)), "shift_max": shift.max()}
    return {name: round(float(value), 6) for name, value in numbers.items()}


def describe_metrics(metrics: Sequence[Measured]) -> list[dict[str, Any]]:
    """Metrics as plain values.

    Parameters
    ----------
    metrics : sequence of Measured
        The metrics.

    Returns
    -------
    rows : list of dict
        ``name``, ``value`` (None where unknown), ``unit`` and ``how`` of each.
    """
    return [
        {"name": m.name, "value": float(m.value) if np.isfinite(m.value) else None, "unit": m.unit, "how": m.how}
        for m in metrics
    ]


def format_manifest(manifest: Mapping[str, Any]) -> str:
    """The text of ``run.json``.

    Parameters
    ----------
    manifest : mapping
        What `describe_run` gives.

    Returns
    -------
    text : str
        JSON with sorted keys.
    """
    return json.dumps(manifest, indent=1, sort_keys=True, allow_nan=False, ensure_ascii=False) + "\n"


def read_manifest(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read ``run.json``.

    Parameters
    ----------
    path : path-like
        The file.

    Returns
    -------
    manifest : dict
        What `describe_run` gave.

    Raises
    ------
    ValueError
        If the file cannot be read or is not the description of a run.
    """
    try:
        manifest = json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ValueError(f"{path}: the run.json of a run is wanted, cannot read it ({error})") from None
    missing = [key for key in _SECTIONS if not isinstance(manifest, dict) or key not in manifest]
    if missing:
        raise ValueError(f"{path}: the run.json of a run is wanted, it lacks {', '.join(missing)}")
    return dict(manifest)


def _counts(result: "Result") -> dict[str, int]:
    return {
        "pings": result.recording.n_pings,
        "pings_dropped": int(result.recording.n_dropped),
        "samples": result.recording.n_samples,
        "submaps": len(result.submaps),
        "candidates": len(result.loop_closures),
        "loop_closures": sum(bool(closure.accepted) for closure in result.loop_closures),
        **result.counts,
    }


def _versions() -> dict[str, Any]:
    return {
        "sssslam": _version("sssslam"),
        "commit": _commit(),
        "python": platform.python_version(),
        "packages": {name: _version(name) for name in _dependencies()},
    }


def _dependencies() -> list[str]:
    try:
        needed = requires("sssslam") or []
    except PackageNotFoundError:
        return []
    names = {
        need.split(";")[0].split(">")[0].split("<")[0].split("=")[0].strip() for need in needed if "extra" not in need
    }
    return sorted(name for name in names if _version(name))


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


@cache
def _commit() -> str | None:
    """The commit of a source checkout; None where the package is installed from a wheel or git is missing."""
    root = Path(__file__).parents[2]
    if not (root / ".git").exists():
        return None
    try:
        command = ["git", "-C", str(root), "rev-parse", "HEAD"]
        return subprocess.run(command, capture_output=True, text=True, check=True, timeout=10).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return None
