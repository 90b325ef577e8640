"""Figures of the loop closure experiment."""

from collections.abc import Mapping
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt

Curve = tuple[np.ndarray, np.ndarray]
_ROWS = ("chain", "correlation", "ransac", "fgr", "kiss-matcher", "map-closures", "chance")
_COLOURS = {row: f"C{k}" for k, row in enumerate(_ROWS)}


def draw_curves(curves: Mapping[tuple[str, str, str], Curve], path: Path) -> None:
    """Precision over recall, one panel for each knowledge of the heading; broken lines have the true terrain."""
    panes = sorted({heading for heading, _, _ in curves})
    figure, axes = plt.subplots(1, max(len(panes), 1), figsize=(5.5 * max(len(panes), 1), 4.5), squeeze=False)
    for axis, pane in zip(axes[0], panes, strict=False):
        for (heading, surface, row), (recall, precision) in curves.items():
            if heading == pane and len(recall):
                style = "-" if surface == "reconstructed" else "--"
                axis.plot(recall, precision, style, color=_COLOURS[row], label=f"{row}, {surface}", lw=1.5)
        axis.set(xlim=(0, 1.02), ylim=(0, 1.03), xlabel="recall, overlap of 30 % and more", ylabel="precision")
        axis.set_title(f"heading {pane}")
        axis.grid(alpha=0.3)
        axis.legend(fontsize=7, loc="lower left")
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def draw_reliability(claims: Mapping[str, list[tuple[float, float, int]]], path: Path) -> None:
    """Share that is right over the probability that was said; bars are two standard deviations of counting."""
    figure, axis = plt.subplots(figsize=(4.8, 4.5))
    for name, rows in claims.items():
        said, right, n = np.array(rows).T
        spread = 2 * np.sqrt((right * (1 - right) + 1 / (n + 4)) / n)
        axis.errorbar(said, right, yerr=np.minimum(spread, 0.5), fmt="o-", capsize=3, label=name)
    axis.plot([0, 1], [0, 1], "k:", lw=1)
    axis.set(xlim=(-0.02, 1.02), ylim=(-0.05, 1.05), xlabel="probability said", ylabel="share that is right")
    axis.grid(alpha=0.3)
    axis.legend()
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)
