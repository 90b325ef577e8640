"""The paper's method on simulated seafloors, which shares no renderer with them, and on a real dive."""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from frontend.arrays import FloatArray
from frontend.bottom import Bottom, BottomConfig, find_bottom
from frontend.frames import transform
from frontend.radiometry import Radiometry, RadiometryConfig, estimate_radiometry
from frontend.reconstruction import ReconstructionConfig, WoockConfig, method_of
from frontend.reconstruction.line_solver import LineSolverConfig
from frontend.reconstruction.lines import with_heave
from frontend.reconstruction.window_data import window_data
from frontend.reconstruction.woock import invert_lines, line_cloud, reconstruct
from frontend.recording import Recording
from frontend.submaps import Submap
from frontend.windows import Window
from sssslam.readers import read
from sssslam.simulation import Scene, simulate

Floor = Callable[[FloatArray, FloatArray], FloatArray]
WOOCK = WoockConfig()
STILL = {"roll_deg": 0.0, "pitch_deg": 0.0, "yaw_deg": 0.0, "heave": 0.0}


class Seen(NamedTuple):
    """A submap beside the floor that was simulated, cell by cell: place in the submap, heights [m], true heights."""

    submap: Submap
    x: FloatArray
    y: FloatArray
    z: FloatArray
    truth: FloatArray

    def inside(self, across: float, along: float = 25.0) -> Any:
        """Known cells so far from the track at most, the ends of the line left out."""
        near = (np.abs(self.y) < across) & (np.abs(self.x) < along)
        return near & np.isfinite(self.z) & np.isfinite(self.truth)


def sound(folder: Path, floor: Floor, legs: list[list[float]] | None = None, **vehicle: Any) -> Recording:
    """A line of 60 m eastwards at z = -38, 12 m above the mean of a floor; 400 kHz, 45 m, single looks."""
    axis = np.arange(-80.0, 80.25, 0.25)
    z = np.broadcast_to(floor(axis[None, :], axis[:, None]), (axis.size, axis.size))
    np.savez(folder / "floor.npz", z=z, spacing=0.25, origin=[-80.0, -80.0])
    waves = {**STILL, **vehicle.pop("waves", {})}
    scene = {
        "seed": 4,
        "terrain": {
            "size": [150.0, 130.0],
            "depth": 50.0,
            "layers": [{"kind": "grid", "file": str(folder / "floor.npz")}],
        },
        "survey": {"pattern": "legs", "legs": legs or [[-30.0, 0.0, 30.0, 0.0]]},
        "drift": {"grade": "none"},
        "sonar": {"range_max": 45.0, "ping_rate": 4.0, "n_sub_beams": 1, "motion": "stop-and-hop"},
        "vehicle": {"keeping": "depth", "depth": 38.0, "waves": waves, **vehicle},
    }
    return simulate(Scene.model_validate(scene))


def flat_floor(x: FloatArray, y: FloatArray) -> FloatArray:
    return np.asarray(0.0 * (x + y))


def mounds(x: FloatArray, y: FloatArray) -> FloatArray:
    """Two mounds and a hollow off the track."""
    places = ((-8.0, 20.0, 1.5), (10.0, -18.0, 1.5), (5.0, 28.0, -1.0))
    return np.asarray(sum(h * np.exp(-((x - a) ** 2 + (y - b) ** 2) / 40) for a, b, h in places))


def whole(recording: Recording) -> Window:
    return Window(0, 0, recording.n_pings, recording.n_pings // 2)


def bottom_of(recording: Recording) -> Bottom:
    return find_bottom(recording, BottomConfig())


def see(recording: Recording, radiometry: Radiometry, config: WoockConfig = WOOCK) -> Seen:
    submap = reconstruct(recording, whole(recording), bottom_of(recording), radiometry, config)
    x, y = np.meshgrid(submap.surface.x, submap.surface.y)
    world = transform(submap.T_world_submap_dr, np.stack([x, y, submap.surface.z], axis=-1))
    assert recording.truth is not None
    assert recording.truth.terrain is not None
    return Seen(submap, x, y, world[..., 2], recording.truth.terrain.sample(world[..., 0], world[..., 1]))


@pytest.fixture(scope="module")
def flat(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    return sound(tmp_path_factory.mktemp("flat"), flat_floor)


@pytest.fixture(scope="module")
def radiometry(flat: Recording) -> Radiometry:
    """The sonar's, as found over the flat floor."""
    return estimate_radiometry(flat, bottom_of(flat), RadiometryConfig())


# Speckle: 18 looks a cell of 1 m or so, a twelfth of the amplitude; at 45 degrees of grazing half of that is slope, and
# the walk of such slopes over 30 cells is 0.2 m.
SPECKLE = 0.2


def test_a_flat_floor_is_flat_at_its_depth(flat: Recording, radiometry: Radiometry) -> None:
    seen = see(flat, radiometry)
    inside = seen.inside(40.0)
    assert inside.sum() > 3500
    error = (seen.z - seen.truth)[inside]
    assert abs(error.mean()) < SPECKLE
    assert error.std() < SPECKLE
    assert not seen.submap.is_shadow.any()


@pytest.mark.parametrize(
    "waves", [{"roll_deg": 8.0}, {"pitch_deg": 5.0}, {"heave": 0.4}], ids=["roll", "pitch", "heave"]
)
def test_a_flat_floor_stays_flat_under_motion(tmp_path: Path, waves: dict[str, float]) -> None:
    recording = sound(tmp_path, flat_floor, waves=waves)
    # a rolling sonar shows angles of its beam pattern that a level one hides
    seen = see(recording, estimate_radiometry(recording, bottom_of(recording), RadiometryConfig()))
    error = (seen.z - seen.truth)[seen.inside(40.0)]
    assert abs(error.mean()) < SPECKLE
    assert error.std() < SPECKLE


def test_relief_is_found_and_beats_a_flat_floor(tmp_path: Path, radiometry: Radiometry) -> None:
    seen = see(sound(tmp_path, mounds), radiometry)
    inside = seen.inside(40.0)
    error = (seen.z - seen.truth)[inside]
    assert error.std() < 0.7 * seen.truth[inside].std()
    assert np.corrcoef(seen.z[inside], seen.truth[inside])[0, 1] > 0.75


def groove(x: FloatArray, y: FloatArray) -> FloatArray:
    """The paper's figure 1: on both sides a rise of 3 m from 8 to 28 m out, then a drop within a metre."""
    return np.asarray(np.interp(np.abs(y), [8.0, 28.0, 29.0], [0.0, 3.0, 0.0]) + 0 * x)


def test_behind_the_groove_the_surface_is_tangent_to_the_beam(tmp_path: Path, radiometry: Radiometry) -> None:
    seen = see(sound(tmp_path, groove), radiometry)
    near = np.abs(seen.x) < 20
    for side in (-1, 1):
        out = side * seen.y
        crest = float(np.mean(seen.z[near & (np.abs(out - 27.5) < 1)]))
        dark = near & (out > 30) & (out < 34)
        assert seen.submap.is_shadow[dark].mean() > 0.95
        slope = np.polyfit(out[dark], seen.z[dark], 1)[0]
        # the ray over the crest comes down from z = -38
        assert slope == pytest.approx((crest + 38.0) / 27.5, rel=0.15)
        # no shadow before the brink, nor beyond the place where the true ray meets the foot: 28 * 12.5 / 9.5 = 36.8
        assert seen.submap.is_shadow[near & (out > 0) & (out < 26)].mean() < 0.02
        assert seen.submap.is_shadow[near & (out > 38) & (out < 42)].mean() < 0.1
    ramp = near & (np.abs(seen.y) > 10) & (np.abs(seen.y) < 27)
    assert np.polyfit(np.abs(seen.y[ramp]), seen.z[ramp], 1)[0] > 0.03  # uphill, if not all of 0.15


def test_a_groove_casts_one_shadow_a_side(tmp_path: Path, radiometry: Radiometry) -> None:
    recording = sound(tmp_path, groove)
    data = with_heave(window_data(recording, whole(recording), bottom_of(recording), radiometry))
    config = WoockConfig(n_levels=1, n_registrations=1, n_draws=2)
    state = invert_lines(data, radiometry, recording.sonar, config)
    cloud = line_cloud(state, config, np.random.default_rng(0))
    sizes = np.bincount(cloud.shadow_region)[1:]
    large = np.flatnonzero(sizes > 100) + 1
    assert len(large) == 2
    assert {np.sign(np.median(cloud.points[cloud.shadow_region == k, 1])) for k in large} == {-1.0, 1.0}
    # the first and the last line are left out
    assert set(cloud.line) == set(range(1, state.frames.shape[0] - 1))


def test_a_ridge_stays_sharp_in_a_turn(tmp_path: Path) -> None:
    recording = sound(
        tmp_path,
        lambda x, y: 1.5 * np.exp(-((y - 16) ** 2) / 8) + 0 * x,
        [[-30.0, -10.0, 0.0, -10.0], [8.0, -8.0, 25.0, 8.0]],
        turn_rate_deg=5.0,
    )
    yaw = np.unwrap(recording.trajectory_dr.yaw)
    assert np.ptp(yaw) > 0.6
    seen = see(recording, estimate_radiometry(recording, bottom_of(recording), RadiometryConfig()))
    world = transform(seen.submap.T_world_submap_dr, np.stack([seen.x, seen.y, seen.z], axis=-1))
    known = np.isfinite(seen.z)
    crest, beside = (known & (np.abs(world[..., 1] - y) < 1.0) for y in (16.0, 22.0))
    flank = known & (np.abs(world[..., 1] - 10.0) < 1.0)
    # a ridge on a straight line in the world: in every stretch of it the crest stands over both sides
    for west in (-20.0, -8.0, 4.0):
        stretch = (world[..., 0] > west) & (world[..., 0] < west + 12)
        top, behind, before = (float(np.mean(seen.z[part & stretch])) for part in (crest, beside, flank))
        assert top > behind + 0.3
        assert top > before + 0.2


def test_stopped_at_once_it_still_gives_the_flat_floor(flat: Recording, radiometry: Radiometry) -> None:
    hurried = WoockConfig(solver=LineSolverConfig(time_limit=1e-9))
    seen = see(flat, radiometry, hurried)
    inside = seen.inside(40.0)
    assert inside.sum() > 3500
    assert np.abs(seen.z - seen.truth)[inside].max() < 0.1


def test_costs_fall_in_every_registration(tmp_path: Path, radiometry: Radiometry) -> None:
    recording = sound(tmp_path, mounds, waves={"roll_deg": 5.0, "pitch_deg": 3.0})
    data = with_heave(window_data(recording, whole(recording), bottom_of(recording), radiometry))
    state = invert_lines(data, radiometry, recording.sonar, WOOCK)
    assert len(state.costs) == WOOCK.n_levels * WOOCK.n_registrations
    for costs in state.costs:
        assert (np.diff(costs) < 0).all()


def test_sigma_reflectivity_and_shadow_are_known_where_heights_are(flat: Recording, radiometry: Radiometry) -> None:
    submap = see(flat, radiometry).submap
    for values in (submap.sigma, submap.log_reflectivity):
        np.testing.assert_array_equal(np.isfinite(values), submap.is_known)
    assert (submap.sigmas > 0).all()
    assert not submap.is_shadow[~submap.is_known].any()


def test_the_same_window_gives_the_same_bytes(flat: Recording, radiometry: Radiometry) -> None:
    config = WoockConfig(n_levels=1, n_registrations=1)
    first, second = (see(flat, radiometry, config).submap for _ in range(2))
    assert first.surface.z.tobytes() == second.surface.z.tobytes()
    assert first.sigma.tobytes() == second.sigma.tobytes()


@pytest.mark.parametrize("n_pings", [1, 2, 5])
def test_a_window_of_a_few_pings_is_no_trouble(flat: Recording, radiometry: Radiometry, n_pings: int) -> None:
    window = Window(3, 40, 40 + n_pings, 40)
    submap = reconstruct(flat, window, bottom_of(flat), radiometry, WoockConfig(n_levels=2))
    assert np.isfinite(submap.points).all()
    assert submap.is_known.any()
    assert (submap.number, submap.first_ping, submap.end_ping) == (3, 40, 40 + n_pings)


def test_silence_and_saturation_do_not_diverge(flat: Recording, radiometry: Radiometry) -> None:
    rng = np.random.default_rng(0)
    port, starboard = np.zeros_like(flat.port), flat.starboard * rng.choice([0.0, 1.0, 1e6], flat.starboard.shape)
    broken = replace(flat, port=port, starboard=starboard.astype(np.float32))
    submap = reconstruct(broken, whole(flat), bottom_of(flat), radiometry, WOOCK)
    assert np.isfinite(submap.points).all()
    # altitude is known: no cell may end up above the vehicle or as far below the floor
    assert np.abs(submap.points[:, 2] + 12.5).max() < 12.0


def test_the_method_is_chosen_by_name(flat: Recording, radiometry: Radiometry) -> None:
    quick = WoockConfig(n_levels=1, n_registrations=1)
    chosen = method_of(ReconstructionConfig(method="woock", woock=quick))
    by_name = chosen(flat, whole(flat), bottom_of(flat), radiometry)
    assert by_name.surface.z.tobytes() == see(flat, radiometry, quick).submap.surface.z.tobytes()


@pytest.mark.skipif("SSSSLAM_DATA" not in os.environ, reason="SSSSLAM_DATA is not set: the Scotsman is not at hand")
def test_the_scotsman_does_not_diverge() -> None:
    recording = read(Path(os.environ["SSSSLAM_DATA"]) / "recordings" / "scotsman-iver2.xtf")[:300]
    radiometry = estimate_radiometry(recording, bottom_of(recording), RadiometryConfig())
    submap = reconstruct(recording, whole(recording), bottom_of(recording), radiometry, WOOCK)
    z = submap.points[:, 2] + submap.T_world_submap_dr[2, 3]
    # depth and altitude put the floor near 26 m; the hull is metres high, and nothing else is
    assert -29 < np.median(z) < -23
    assert np.percentile(z, 0.5) > np.median(z) - 4
    assert np.percentile(z, 99.5) < np.median(z) + 5
    assert 0.001 < submap.shadow.mean() < 0.3
