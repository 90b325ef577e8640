"""``report.html``: one self-contained page, made from the other products of a run."""

import base64
import math
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined, Template

from frontend.frames import planar_parameters
from frontend.loop_closures import LoopClosure
from sssslam.products.figure_tracks import count_reasons
from sssslam.products.figures import FIGURES
from sssslam.products.loop_closures import read_loop_closures
from sssslam.products.manifest import read_manifest
from sssslam.products.verdict import format_duration, format_metric, verdict

# Rows of the table of candidates; all of them are in loop_closures.csv.
_MAX_ACCEPTED, _MAX_REJECTED = 60, 15


def render_report(out: Path) -> str:
    """The report of a run, from its other products.

    Parameters
    ----------
    out : Path
        The folder with ``run.json``, ``loop_closures.csv``, ``config.toml`` and ``figures/``.

    Returns
    -------
    html : str
        A page that needs no other file. Wall times stand between ``<!-- timings -->`` and ``<!-- /timings -->`` only.
    """
    manifest = {"findings": []} | read_manifest(out / "run.json")
    suspicious = {finding["what"] for finding in manifest["findings"]}
    loop_closures, _ = read_loop_closures(out / "loop_closures.csv")
    return _template().render(
        title=manifest["input"]["source"] or "a recording",
        verdict=verdict(manifest),
        tiles=_tiles(manifest),
        figures={name: uri for name in FIGURES if (uri := _embed(out / "figures" / f"{name}.png"))},
        metrics=_metric_rows(manifest["metrics"]),
        timings=_timings(manifest),
        closures=_closure_rows(loop_closures),
        n_closures=len(loop_closures),
        reasons=count_reasons(loop_closures),
        manifest=manifest,
        notes=[note for note in manifest["notes"] if note not in suspicious],
        config=(out / "config.toml").read_text(encoding="utf-8"),
    )


@cache
def _template() -> Template:
    loader = PackageLoader("sssslam.products", "templates")
    environment = Environment(
        loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return environment.get_template("report.html")


def _embed(path: Path) -> str:
    return f"data:image/png;base64,{base64.b64encode(path.read_bytes()).decode('ascii')}" if path.is_file() else ""


def _tiles(manifest: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """The numbers that a reader looks for first: label, value, and what stands beside it."""
    track, counts = manifest["track"], manifest["counts"]
    metrics = {metric["name"]: metric for metric in manifest["metrics"]}
    tiles = [
        ("distance run", format_metric(track["distance"], "m"), format_duration(manifest["input"]["duration"])),
        ("loop closures", str(counts["loop_closures"]), f"of {counts['candidates']} candidates"),
        ("track moved", format_metric(track["shift_max"], "m"), "at most"),
    ]
    if "ate" in metrics and "ate_dr" in metrics:
        before, after = (format_metric(metrics[name]["value"], "m") for name in ("ate_dr", "ate"))
        tiles.append(("error of the track (ATE)", after, f"dead-reckoned {before}"))
    return tiles


def _metric_rows(metrics: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """A row a metric; that of the dead-reckoned track, named ``_dr``, stands beside its twin."""
    texts = {metric["name"]: format_metric(metric["value"], metric["unit"]) for metric in metrics}
    own = [metric for metric in metrics if metric["name"].removesuffix("_dr") not in texts.keys() - {metric["name"]}]
    return [{**m, "text": texts[m["name"]], "text_dr": texts.get(f"{m['name']}_dr", "")} for m in own]


def _timings(manifest: Mapping[str, Any]) -> list[dict[str, Any]]:
    total = sum(row["seconds"] for row in manifest["timings"]) or 1.0
    return [
        {
            "stage": row["stage"],
            "seconds": f"{row['seconds']:.2f}",
            "per_ping": f"{1000.0 * row['seconds'] / max(manifest['counts']['pings'], 1):.2f}",
            "share": round(100.0 * row["seconds"] / total, 1),
        }
        for row in manifest["timings"]
    ]


def _closure_rows(loop_closures: Sequence[LoopClosure]) -> list[dict[str, Any]]:
    """Accepted candidates, then rejected ones, each by what they have going for them."""
    ordered = sorted(loop_closures, key=lambda c: (-c.n_inliers, -np.nan_to_num(c.correlation), c.target))
    accepted, rejected = ([c for c in ordered if bool(c.accepted) == wanted] for wanted in (True, False))
    return [_closure_row(closure) for closure in (*accepted[:_MAX_ACCEPTED], *rejected[:_MAX_REJECTED])]


def _closure_row(closure: LoopClosure) -> dict[str, Any]:
    x, y, yaw = planar_parameters(closure.T_target_source)
    numbers = {
        "x": _fixed(x, 2),
        "y": _fixed(y, 2),
        "yaw": _fixed(float(np.rad2deg(yaw)), 1),
        "sigma": _fixed(float(np.hypot(closure.sigmas[3], closure.sigmas[4])), 2),
        "correlation": _fixed(closure.correlation, 2),
        "overlap": _fixed(100.0 * closure.overlap, 0),
    }
    return {"closure": closure, **numbers}


def _fixed(value: float, digits: int) -> str:
    return f"{value:.{digits}f}".replace("-", "\u2212") if math.isfinite(value) else ""
