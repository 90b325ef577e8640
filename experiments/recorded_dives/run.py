"""Recorded dives, as recorded and dead-reckoned: one row a run, the recorded positions as reference."""

import argparse
import os
import platform
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from river import fetch

import sssslam
from frontend.acceptance import Rejection
from frontend.frames import wrap_angle
from sssslam.config import load_config
from sssslam.evaluation.loop_closures import judge_loop_closures
from sssslam.evaluation.trajectory import evaluate_tracks
from sssslam.navigation.dead_reckoned import rebuild_dead_reckoned
from sssslam.readers.held_navigation import fill_unknown

HERE = Path(__file__).resolve().parent
# Drift that is injected: the speed reads too little by this share, the heading turns away by this much a second. The
# larger stands out from a GNSS that jumps by 4 m; the smaller is nearer to what a vehicle without Doppler log has.
LARGE_DRIFT, SMALL_DRIFT = (-0.1, np.radians(-0.1)), (-0.05, np.radians(-0.03))
COLUMNS = (
    *("dive", "navigation", "settings", "submaps", "candidates", "right", "likely", "likely and right", "accepted"),
    *("kept", "ATE dead-reckoned [m]", "ATE corrected [m]", "s"),
)
HEADER = f"| {' | '.join(COLUMNS)} |\n|{'---|' * len(COLUMNS)}"


@dataclass(frozen=True)
class Case:
    """A dive, the navigation it is given, and the settings that its size asks for."""

    dive: str
    navigation: str
    settings: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """What the settings are called."""
        known = {"9 m": WINDOWS_9, "15 m": WINDOWS_15, "45 m": WINDOWS_45, "Doppler": DOPPLER}
        return " and ".join(name for name, keys in known.items() if set(keys) <= set(self.settings)) or "default"


# Windows shorter than the default for a track that turns back, and those of the range alone.
# The shortest leave the crossing at 31 and 51 m more than two lengths apart.
WINDOWS_9 = ("windows.length=9", "windows.overlap=0.5")
WINDOWS_15 = ("windows.length=15", "windows.overlap=0.8")
WINDOWS_45 = ("windows.length=45", "windows.overlap=0.5")
# The default drift of a vehicle that has a Doppler log, which no vehicle here has.
DOPPLER = (
    "dead_reckoning.velocity_scale_sd=0.01",
    "dead_reckoning.velocity_misalignment_sd=0.01",
    "dead_reckoning.heading_deviation_sd=0.02",
    "dead_reckoning.velocity_noise=0.02",
)
CASES = (
    Case("starfish", "recorded"),
    Case("starfish", "dead-reckoned"),
    Case("starfish", "drifting"),
    Case("starfish", "drifting less"),
    Case("starfish", "dead-reckoned", WINDOWS_15),
    Case("starfish", "drifting", WINDOWS_15),
    Case("starfish", "drifting less", WINDOWS_15),
    Case("starfish", "dead-reckoned", WINDOWS_9),
    Case("starfish", "dead-reckoned", WINDOWS_45),
    Case("starfish", "dead-reckoned", DOPPLER),
    Case("scotsman", "recorded"),
    Case("scotsman", "dead-reckoned"),
    Case("river", "recorded"),
    Case("river", "dead-reckoned"),
)


def drift(recording: sssslam.Recording, scale: float, rate: float) -> sssslam.Recording:
    """Dead reckoning with a stated drift; the recorded track stays the reference."""
    track = recording.trajectory_dr
    yaw = wrap_angle(track.yaw + rate * (track.time - track.time[0]))
    speed = (1 + scale) * fill_unknown(track.time, recording.speed)
    wrong = replace(recording, trajectory_dr=replace(track, yaw=yaw), speed=speed)
    return replace(rebuild_dead_reckoned(wrong), truth=sssslam.Truth(track))


def as_recorded(recording: sssslam.Recording) -> sssslam.Recording:
    """The recorded track, judged against itself."""
    return replace(recording, truth=sssslam.Truth(recording.trajectory_dr))


NAVIGATION: dict[str, Callable[[sssslam.Recording], sssslam.Recording]] = {
    "recorded": as_recorded,
    "dead-reckoned": rebuild_dead_reckoned,
    "drifting": lambda recording: drift(recording, *LARGE_DRIFT),
    "drifting less": lambda recording: drift(recording, *SMALL_DRIFT),
}


def path_of(dive: str, river: Path) -> Path:
    """The file of a dive; the river's is fetched."""
    if dive == "river":
        return fetch(river)
    folder = os.environ.get("SSSSLAM_DATA")
    if not folder:
        raise SystemExit("SSSSLAM_DATA is not set; the folder of the recordings is wanted")
    names = {"starfish": "starfish-iver2-barbados.logdoc", "scotsman": "scotsman-iver2.xtf"}
    return Path(folder) / "recordings" / names[dive]


def run(case: Case, settings: list[str], out: Path, river: Path) -> str:
    """One run: its products to a folder, its candidates to a table beside them, and a row."""
    recording = NAVIGATION[case.navigation](sssslam.read(path_of(case.dive, river)))
    config = load_config(settings=[*case.settings, *settings])
    start = time.perf_counter()
    result = sssslam.slam(recording, config)
    seconds = time.perf_counter() - start
    folder = out / f"{case.dive} {case.navigation} {case.label}".replace(" ", "-")
    result.write(folder)
    truth = recording.truth.trajectory
    anchors = {submap.number: submap.anchor_time for submap in result.submaps}
    judged = judge_loop_closures(result.loop_closures, anchors, truth)
    at_front = np.array([c.accepted or c.reason not in set(Rejection) for c in result.loop_closures], dtype=bool)
    (folder / "candidates.md").write_text(candidates(result, judged, at_front))
    errors = {m.name: m.value for m in evaluate_tracks(result.trajectory, recording.trajectory_dr, truth)}
    kept = sum(closure.accepted for closure in result.loop_closures)
    right, likely = judged.is_right, np.array([is_likely(c) for c in result.loop_closures], dtype=bool)
    counts = (len(result.submaps), len(right), right.sum(), likely.sum(), (likely & right).sum(), at_front.sum(), kept)
    numbers = [*map(str, counts), f"{errors['ate_dr']:.2f}", f"{errors['ate']:.2f}", f"{seconds:.0f}"]
    return f"| {' | '.join([case.dive, case.navigation, case.label, *numbers])} |"


def is_likely(closure: sssslam.LoopClosure) -> bool:
    """Whether heights correlate well over a good part, whatever the tests of the front end said."""
    return closure.correlation > 0.5 and closure.overlap > 0.25


def candidates(result: sssslam.Result, judged: object, at_front: np.ndarray) -> str:
    """Every candidate: where along the track, how far from the reference, and what became of it."""
    truth = result.recording.truth.trajectory
    along = {s.number: float(np.interp(s.anchor_time, truth.time, truth.distance)) for s in result.submaps}
    lines = [
        "| at [m] | and at [m] | shift error [m] | turn error [deg] | correlation | overlap | front end | reason |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for k, c in enumerate(result.loop_closures):
        off = f"{judged.shift_error[k]:.2f} | {np.degrees(judged.turn_error[k]):.1f}"
        verdict = "yes" if at_front[k] else "no"
        place = f"{along[c.target]:.0f} | {along[c.source]:.0f}"
        lines.append(
            f"| {place} | {off} | {c.correlation:.2f} | {c.overlap:.2f} | {verdict} | {c.reason or 'accepted'} |"
        )
    return "\n".join(lines) + "\n"


def main() -> None:
    """Print the table, a row after each run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--dives", nargs="+", default=["starfish", "scotsman", "river"])
    parser.add_argument("--navigation", nargs="+", default=list(NAVIGATION))
    parser.add_argument("--settings", nargs="+", help="only the rows with these settings")
    parser.add_argument("--out", type=Path, default=HERE / "out")
    parser.add_argument("--river", type=Path, default=HERE / "out" / "river", help="where the river dive is kept")
    parser.add_argument("-s", "--set", action="append", default=[], help="section.key=value, for every run")
    arguments = parser.parse_args()
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False)
    print(
        f"commit {commit.stdout.strip()}, {platform.machine()}, Python {platform.python_version()}\n\n{HEADER}",
        flush=True,
    )
    for case in CASES:
        is_wanted = case.dive in arguments.dives and case.navigation in arguments.navigation
        if is_wanted and (not arguments.settings or case.label in arguments.settings):
            print(run(case, arguments.set, arguments.out, arguments.river), flush=True)


if __name__ == "__main__":
    main()
