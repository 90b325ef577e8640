"""A small dive with truth, made without the pipeline: submaps cut from a known terrain at known poses."""

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from frontend.frames import invert, level, planar_pose, pose, rotation_world_body, transform
from frontend.georeference import Georeference
from frontend.heightfield import Heightfield
from frontend.loop_closures import LoopClosure
from frontend.recording import Quantity, Recording, SonarGeometry, Truth
from frontend.submaps import Submap
from frontend.trajectory import Trajectory
from sssslam.products.result import Result

START = 1_700_000_000.0  # s since 1970


def make_terrain(rng: np.random.Generator, size: float, spacing: float) -> Heightfield:
    """Fractal relief of 0.8 m rms about -60 m on a square that starts 60 m south-west of the origin."""
    n = int(size / spacing)
    k = np.hypot(*np.meshgrid(np.fft.fftfreq(n), np.fft.rfftfreq(n), indexing="ij"))
    amplitude = np.where(k > 0, np.maximum(k, 1e-9) ** -2.1, 0.0)
    z = np.fft.irfft2(amplitude * np.exp(2j * np.pi * rng.random(k.shape)), s=(n, n))
    return Heightfield(-60.0 + 0.8 * z / z.std(), spacing, (-60.0, -60.0))


def make_track(length: float, n_legs: int, step: float) -> Trajectory:
    """Legs east and west, 30 m apart, and a tie line back across them; 12 m above the mean seafloor."""
    corners = [(length * ((i + 1) // 2 % 2), 30.0 * (i // 2)) for i in range(2 * n_legs)]
    corners += [(corners[-1][0] / 2 + length / 4, corners[-1][1] + 25.0), (length / 2, -25.0)]
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
    s = np.arange(0.0, along[-1], step)
    x, y = (np.interp(s, along, c) for c in np.transpose(corners))
    yaw = np.arctan2(np.gradient(y), np.gradient(x))
    wave = np.sin(s / 9.0)
    return Trajectory(START + s / 1.5, x, y, -48.0 + 0.2 * wave, 0.02 * wave, 0.01 * np.cos(s / 9.0), yaw)


def drift(trajectory: Trajectory, turn: float, stretch: float) -> Trajectory:
    """The track that a heading error and a speed error make of it, from the same start."""
    dx, dy = np.diff(trajectory.x), np.diff(trajectory.y)
    angle = turn * np.linspace(0.2, 1.0, dx.size)
    x = trajectory.x[0] + np.concatenate([[0.0], np.cumsum(stretch * (np.cos(angle) * dx - np.sin(angle) * dy))])
    y = trajectory.y[0] + np.concatenate([[0.0], np.cumsum(stretch * (np.sin(angle) * dx + np.cos(angle) * dy))])
    return replace(trajectory, x=x, y=y, yaw=trajectory.yaw + np.concatenate([angle, angle[-1:]]))


def make_submap(
    number: int, pings: tuple[int, int], tracks: tuple[Trajectory, Trajectory], terrain: Heightfield, spacing: float
) -> Submap:
    """What a perfect inversion would give but for noise that grows with range; cells behind steep slopes are shadow."""
    rng, (track_ref, track_dr) = np.random.default_rng(number), tracks
    anchor = sum(pings) // 2
    x, y = np.meshgrid(np.arange(-20.0, 20.1, spacing), np.arange(-25.0, 25.1, spacing))
    T_world_submap_ref = level(track_ref.poses[anchor])
    X, Y, _ = np.moveaxis(transform(T_world_submap_ref, np.stack([x, y, 0 * x], axis=-1)), -1, 0)
    sigma = 0.04 + 0.2 * (np.abs(y) / 25.0) ** 2
    z = terrain.sample(X, Y) - T_world_submap_ref[2, 3] + sigma * rng.standard_normal(x.shape)
    z[np.hypot(x / 20.0, y / 25.0) > 1.0] = np.nan
    slope = np.gradient(np.nan_to_num(z), spacing, axis=0) * np.sign(y)
    body = rotation_world_body(track_ref.roll[anchor], track_ref.pitch[anchor], 0.0)
    return Submap(
        number=number,
        first_ping=pings[0],
        end_ping=pings[1],
        anchor_ping=anchor,
        anchor_time=float(track_ref.time[anchor]),
        T_world_submap_dr=level(track_dr.poses[anchor]),
        T_submap_body=pose(np.zeros(3), body),
        surface=Heightfield(z, spacing, (-20.0, -25.0)),
        sigma=np.where(np.isfinite(z), sigma, np.nan),
        log_reflectivity=np.where(np.isfinite(z), 0.4 * np.sin(X / 15.0) * np.cos(Y / 11.0), np.nan),
        is_shadow=np.isfinite(z) & (slope < -0.45),
    )


def make_loop_closures(submaps: list[Submap], track_ref: Trajectory) -> tuple[LoopClosure, ...]:
    """A candidate for every far pair of submaps within 45 m: near ones are right, others wrong or without an answer."""
    T = [level(track_ref.poses[submap.anchor_ping]) for submap in submaps]
    candidates = []
    for target, source in ((a, b) for a in range(len(submaps)) for b in range(a + 5, len(submaps))):
        between = invert(T[target]) @ T[source]
        separation, rng = np.hypot(*between[:2, 3]), np.random.default_rng([target, source])
        if separation < 45.0:
            candidates.append(_candidate((target, source), between, separation, rng))
    return tuple(candidates)


def _candidate(pair: tuple[int, int], between: Any, separation: float, rng: np.random.Generator) -> LoopClosure:
    right, found = separation < 24.0, separation < 36.0
    error = planar_pose(*(rng.normal(0, 0.3, 2) if right else rng.normal(0, 15.0, 2)), rng.normal(0, 0.01))
    n_inliers = int(rng.integers(14, 40) if right else rng.integers(2, 8))
    reason = "" if right else ("inliers 5 below 8" if found else "no consensus, not even of two")
    return LoopClosure(
        target=pair[0],
        source=pair[1],
        T_target_source=between @ error if found else np.full((4, 4), np.nan),
        sigmas=np.array([0.01, 0.01, 0.01, 0.3, 0.3, 0.1]) if found else np.full(6, np.nan),
        n_matches=int(rng.integers(40, 90)),
        n_inliers=n_inliers,
        correlation=float(rng.uniform(0.7, 0.93) if right else rng.uniform(0.1, 0.55)) if found else np.nan,
        overlap=max(0.0, 1.0 - separation / 45.0),
        accepted=right,
        reason=reason,
    )


def make_recording(track_dr: Trajectory, truth: Truth, n_samples: int) -> Recording:
    """Echoes that look the part: a silent water column, then speckle that falls with range."""
    rng, n = np.random.default_rng(5), len(track_dr)
    slant_range = (np.arange(n_samples) + 0.5) * 30.0 / n_samples
    mean = np.where(slant_range > 12.0, (12.0 / slant_range) ** 3, 1e-4)
    port, starboard = (rng.exponential(mean, (n, n_samples)).astype(np.float32) for _ in range(2))
    ones = np.ones(n)
    return Recording(
        port=port,
        starboard=starboard,
        sample_spacing=30.0 / n_samples * ones,
        sound_speed=1500.0 * ones,
        trajectory_dr=track_dr,
        altitude=12.0 * ones,
        depth=48.0 * ones,
        speed=1.5 * ones,
        sonar=SonarGeometry(frequency=600e3, quantity=Quantity.INTENSITY),
        georeference=Georeference(58.25, 11.45),
        source="dive <7> & more.xtf",
        source_sha256="ab" * 32,
        notes=("Ping 0 had no position.",),
        n_dropped=1,
        truth=truth,
    )


def build_result(length: float = 80.0, n_legs: int = 3, spacing: float = 1.0, step: float = 0.8) -> Result:
    """The whole: truth, drift, submaps every 15 m, candidates and a corrected track that has an eighth of the drift."""
    terrain = make_terrain(np.random.default_rng(3), length + 120.0, spacing / 2)
    track_ref = make_track(length, n_legs, step)
    track_dr, track = drift(track_ref, 0.08, 1.02), drift(track_ref, 0.01, 1.002)
    n, window, stride = len(track_ref), int(30.0 / step), int(15.0 / step)
    tracks = (track_ref, track_dr)
    starts = range(0, n - window, stride)
    submaps = [make_submap(i, (a, a + window), tracks, terrain, spacing) for i, a in enumerate(starts)]
    claimed = np.linspace(0.2, 0.8, n)
    return Result(
        recording=make_recording(track_dr, Truth(track_ref, terrain), 200),
        config={"seed": 7, "windows": {"length": 30.0, "overlap": 0.5}, "matching": {"radius": 8.0, "limit": None}},
        trajectory=track,
        sigmas=np.column_stack([claimed, claimed, np.full(n, 0.05), np.full(n, 0.01)]),
        submaps=tuple(submaps),
        T_world_submap=np.stack([level(track.poses[submap.anchor_ping]) for submap in submaps]),
        loop_closures=make_loop_closures(submaps, track_ref),
        solution=SimpleNamespace(g2o="VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n"),  # type: ignore[arg-type]
        timings={"reconstruction": 12.3456, "matching": 3.2},
        notes=("Port is the finer channel.",),
    )


@pytest.fixture(scope="session")
def result() -> Result:
    """The dive; nobody changes it."""
    return build_result()


@pytest.fixture
def make_result() -> Callable[..., Result]:
    """The builder of dives, for other sizes."""
    return build_result


@pytest.fixture(scope="session")
def written(result: Result, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The folder that the dive left; nobody changes it."""
    out = tmp_path_factory.mktemp("run") / "out"
    result.write(out)
    return out
