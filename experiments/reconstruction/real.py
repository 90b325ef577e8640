"""Real recordings: does any method diverge, what does pitch change, and how tall does a shadow say the wreck is?"""

import argparse
import statistics
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "recorded_dives"))
from river import fetch
from rows import library_methods
from scenes import data_folder
from scipy.ndimage import label

from frontend.arrays import FloatArray
from frontend.bottom import Bottom, BottomConfig, find_bottom
from frontend.radiometry import Radiometry, RadiometryConfig
from frontend.reconstruction import JointConfig, ReconstructionConfig, calibrate, method_of
from frontend.reconstruction.ground_image import shadows_of_lines
from frontend.reconstruction.window_data import window_data
from frontend.recording import Recording
from frontend.shadows import ShadowConfig
from frontend.submaps import Submap
from frontend.windows import Window, sliding_windows
from sssslam.evaluation.reconstruction import high_pass
from sssslam.readers import read

RECORDINGS = {"scotsman": "scotsman-iver2.xtf", "starfish": "starfish-iver2-barbados.logdoc"}
RIVER = "river"  # Humminbird on a boat
FETCHED = Path(__file__).parents[1] / "recorded_dives" / "out" / RIVER  # by either experiment
TALLER_THAN_ALTITUDE = 1.0  # relief over altitude beyond which a reconstruction has diverged


@dataclass(frozen=True)
class Shown:
    """What a method made of a recording."""

    name: str
    method: str
    submaps: list[Submap]
    altitude: float

    @property
    def line(self) -> str:
        """A row of the table."""
        relief = [float(np.nanmax(s.surface.z) - np.nanmin(s.surface.z)) for s in self.submaps]
        fine = [float(np.nanstd(high_pass(s.surface.z, 20.0 / s.surface.spacing))) for s in self.submaps]
        diverged = sum(not r < TALLER_THAN_ALTITUDE * self.altitude for r in relief)
        values = f"{statistics.median(relief):.2f} | {max(relief):.2f} | {statistics.median(fine):.3f}"
        return f"| {self.name} | {self.method} | {len(relief)} | {values} | {self.altitude:.1f} | {diverged} |"


class Shadow(NamedTuple):
    """The longest shadow of a side: its ping, the place of its crest in the submap [m], the height it speaks of [m]."""

    ping: int
    side: str
    crest: FloatArray
    height: float


def reconstructed(name: str, recording: Recording, methods: Sequence[str]) -> Iterator[Shown]:
    """Every window of a recording by every method; says what the shadows of the middle one speak of."""
    windows = sliding_windows(recording.trajectory_dr, float(recording.slant_range_max.max()))
    bottom = find_bottom(recording, BottomConfig())
    radiometry = calibrate(recording, windows, bottom, RadiometryConfig(), JointConfig())
    middle = len(windows) // 2
    shadows = longest_shadows(recording, windows[middle], (bottom, radiometry))
    for method in methods:
        make = method_of(ReconstructionConfig.model_validate({"method": method}))
        submaps = [make(recording, window, bottom, radiometry) for window in windows]
        for shadow in shadows:
            what = f"{name}, ping {shadow.ping}, {shadow.side}: {shadow.height:.2f} m by its shadow"
            print(f"{what}, {standing(submaps[middle], shadow.crest):.2f} m by {method}", flush=True)
        yield Shown(name, method, submaps, float(np.median(bottom.altitude)))


def longest_shadows(recording: Recording, window: Window, known: tuple[Bottom, Radiometry]) -> list[Shadow]:
    """The longest shadow of each side, and how tall what casts it stands on a flat floor.

    By similar triangles, ``height / altitude = (end - crest) / end`` with the ground ranges of the shadow's two ends.
    """
    data = window_data(recording, window, *known)
    dark = shadows_of_lines(data, known[1], ShadowConfig())
    found = []
    for side, name in enumerate(("port", "starboard")):
        runs = [_longest_run(line) for line in dark[:, side]]
        ping = int(np.argmax([end - first for first, end in runs]))
        slant, altitude = (np.array(runs[ping]) + 0.5) * data.sample_spacing[ping], data.altitude[ping]
        if slant[1] > slant[0] > altitude:
            crest, end = np.sqrt(slant**2 - altitude**2)
            outward = (1 - 2 * side) * data.T_submap_pings[ping, :2, 1]
            place = data.sensors[ping, side, :2] + crest * outward / np.hypot(*outward)
            found.append(Shadow(window.first_ping + ping, name, place, float(altitude * (end - crest) / end)))
    return found


def standing(submap: Submap, place: FloatArray) -> float:
    """How far the highest point within 2 m of a place stands over the median of what lies within 10 m [m]."""
    distance = np.hypot(*(submap.points[:, :2] - place).T)
    z = submap.points[:, 2]
    near, around = z[distance < 2], z[(distance > 4) & (distance < 10)]
    return float(near.max() - np.median(around)) if near.size and around.size else float("nan")


def _longest_run(dark: FloatArray) -> tuple[int, int]:
    """First sample of the longest dark run that ends within the line, and the one after it."""
    runs, n = label(dark)
    if runs[-1]:
        runs[runs == runs[-1]] = 0  # goes on beyond the range
    lengths = np.bincount(runs, minlength=n + 1)[1:]
    if lengths.size == 0 or lengths.max() == 0:
        return 0, 0
    inside = np.flatnonzero(runs == 1 + int(np.argmax(lengths)))
    return int(inside[0]), int(inside[-1]) + 1


def path_of(name: str, river: Path) -> Path:
    """The file of a recording; the river's is fetched into a folder."""
    return fetch(river) if name == RIVER else data_folder() / "recordings" / RECORDINGS[name]


def draw(shown: Sequence[Shown], path: Path) -> None:
    """The middle submap of every method."""
    figure, axes = plt.subplots(1, len(shown), figsize=(3.6 * len(shown), 4), squeeze=False)
    for panel, one in zip(axes[0], shown, strict=True):
        surface = one.submaps[len(one.submaps) // 2].surface
        z = surface.z - np.nanmedian(surface.z)
        limit = float(np.nanpercentile(np.abs(z), 98))
        extent = (surface.x[0], surface.x[-1], surface.y[0], surface.y[-1])
        image = panel.imshow(z, origin="lower", extent=extent, cmap="RdBu_r", vmin=-limit, vmax=limit)
        figure.colorbar(image, ax=panel, shrink=0.6, label="height [m]")
        panel.set(title=f"{one.name}, {one.method}", xlabel="along [m]", ylabel="to port [m]")
    figure.tight_layout()
    figure.savefig(path, dpi=90, pil_kwargs={"quality": 85})
    plt.close(figure)


def main() -> None:
    """Print the table and draw a figure a recording; also Scotsman with its pitch taken for zero."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--methods", nargs="+", choices=library_methods(), default=library_methods())
    parser.add_argument("--recordings", nargs="+", choices=[*RECORDINGS, RIVER], default=[*RECORDINGS, RIVER])
    parser.add_argument("--river", type=Path, default=FETCHED, help="Where it is kept.")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "out")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    print(
        "| recording | method | windows | median relief [m] | largest | rms below 20 m [m] | altitude [m] | diverged |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for name in arguments.recordings:
        try:
            recording = read(path_of(name, arguments.river))
        except (ValueError, OSError) as error:
            print(f"{name} skipped: {error}")
            continue
        variants = {name: recording}
        if name == "scotsman":
            level = replace(recording.trajectory_dr, pitch=0.0 * recording.trajectory_dr.pitch)
            variants[f"{name} without pitch"] = replace(recording, trajectory_dr=level)
        for variant, one in variants.items():
            shown = list(reconstructed(variant, one, arguments.methods))
            print("\n".join(part.line for part in shown), flush=True)
            draw(shown, arguments.out / f"{variant.replace(' ', '-')}.jpg")


if __name__ == "__main__":
    main()
