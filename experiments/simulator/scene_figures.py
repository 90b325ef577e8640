"""One figure a shipped scene: seafloor and tracks, waterfall, mean echo. Usage: scene_figures.py FOLDER [SCENE ...]."""

import sys
import time
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from frontend.recording import Quantity, Recording
from sssslam.simulation import load_scene, scene_names, simulate


def draw_floor(axes: Axes, recording: Recording) -> None:
    """Heights with both tracks."""
    terrain, true, reckoned = recording.truth.terrain, recording.truth.trajectory, recording.trajectory_dr
    extent = (terrain.x[0], terrain.x[-1], terrain.y[0], terrain.y[-1])
    image = axes.imshow(terrain.z, origin="lower", extent=extent, cmap="viridis")
    plt.colorbar(image, ax=axes, label="height [m]", shrink=0.7)
    axes.plot(true.x, true.y, "w", lw=1, label="true")
    axes.plot(reckoned.x, reckoned.y, "r", lw=1, label="dead-reckoned")
    axes.set(xlabel="east [m]", ylabel="north [m]", aspect="equal")
    axes.legend(loc="lower right", fontsize="small")


def decibels(echoes: np.ndarray, quantity: Quantity) -> np.ndarray:
    """Echoes as levels; the recorder's own numbers where they are logarithms already."""
    if quantity is Quantity.LOG:
        return echoes
    return (20 if quantity is Quantity.AMPLITUDE else 10) * np.log10(np.maximum(echoes, 1e-3))


def draw_waterfall(axes: Axes, recording: Recording) -> None:
    """Both sides over slant range."""
    image = decibels(np.hstack([recording.port[:, ::-1], recording.starboard]), recording.sonar.quantity)
    low, high = np.percentile(image, [2, 99.5])
    reach = recording.slant_range_max[0]
    extent = (-reach, reach, recording.n_pings, 0)
    axes.imshow(image, aspect="auto", cmap="copper", vmin=low, vmax=high, extent=extent, interpolation="none")
    axes.set(xlabel="slant range, port < 0 < starboard [m]", ylabel="ping")


def draw_mean(axes: Axes, recording: Recording) -> None:
    """Mean echo of each side."""
    slant_range = (np.arange(recording.n_samples) + 0.5) * recording.sample_spacing[0]
    for side in ("port", "starboard"):
        mean = getattr(recording, side).mean(axis=0, dtype=np.float64)
        axes.plot(slant_range, decibels(mean, recording.sonar.quantity), label=side)
    axes.set(xlabel="slant range [m]", ylabel=f"mean {recording.sonar.quantity} [dB or steps]")
    axes.legend()


def main(folder: Path, names: list[str]) -> None:
    """Simulate and draw."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        scene = load_scene(name)
        started = time.perf_counter()
        recording = simulate(scene)
        seconds, dive = time.perf_counter() - started, np.ptp(recording.ping_time)
        figure, axes = plt.subplots(1, 3, figsize=(20, 8), width_ratios=[1.1, 1.4, 0.8], layout="constrained")
        for axis, draw in zip(axes, (draw_floor, draw_waterfall, draw_mean), strict=True):
            draw(axis, recording)
        figure.suptitle(f"{name}: {scene.description}")
        figure.savefig(folder / f"{name}.jpg", dpi=60, pil_kwargs={"quality": 80})
        plt.close(figure)
        print(f"{name}: {recording.n_pings} pings, {dive:.0f} s of dive in {seconds:.1f} s")


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:] or scene_names())
