"""Plane, ramp, mound and wall as the simulator sees them, which shares no renderer with the inversion."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from frontend.arrays import FloatArray
from frontend.bottom import BottomConfig, find_bottom
from frontend.frames import transform
from frontend.radiometry import Radiometry, RadiometryConfig, Seafloor
from frontend.reconstruction import JointConfig, calibrate
from frontend.reconstruction.forward import Raster
from frontend.reconstruction.joint import cell_spacing, first_surface, reconstruct, reconstruct_together
from frontend.reconstruction.priors import PriorConfig
from frontend.reconstruction.roughness import RoughnessConfig
from frontend.reconstruction.shadow_ends import ShadowEndsConfig
from frontend.reconstruction.solver import SolverConfig
from frontend.reconstruction.uncertainty import resample
from frontend.recording import Recording
from frontend.submaps import Submap
from frontend.windows import Window
from sssslam.simulation import Scene, simulate
from tests.frontend.reconstruction.test_window_data import make_data, make_recording

Floor = Callable[[FloatArray, FloatArray], FloatArray]
JOINT = JointConfig()
# the sonar is calibrated over a flat floor; what its echoes say of floors does not hold for ramps and walls
ROUGH = Seafloor(roughness=0.1, reflectivity=0.1, length=8.0)


class Seen(NamedTuple):
    """A submap beside the floor that was simulated: points in the world (K, 3), and how far each is too high [m]."""

    submap: Submap
    points: FloatArray
    error: FloatArray

    def inside(self, across: float, along: float = 30.0) -> Any:
        """Points so far from the track at most, the ends of the line left out."""
        return (np.abs(self.submap.points[:, 1]) < across) & (np.abs(self.submap.points[:, 0]) < along)


LINE = ((-35.0, 0.0, 35.0, 0.0),)


def sound(folder: Path, floor: Floor, legs: Sequence[Sequence[float]] = LINE, **waves: float) -> Recording:
    """Straight lines, or one of 70 m eastwards, at z = -38, 12 m above a floor; 400 kHz, 50 m, single looks."""
    axis = np.arange(-80.0, 80.5, 0.5)
    z = np.broadcast_to(floor(axis[None, :], axis[:, None]), (axis.size, axis.size))
    np.savez(folder / "floor.npz", z=z, spacing=0.5, origin=[-80.0, -80.0])
    scene = {
        "seed": 4,
        "terrain": {
            "size": [150.0, 130.0],
            "depth": 50.0,
            "layers": [{"kind": "grid", "file": str(folder / "floor.npz")}],
        },
        "survey": {"pattern": "legs", "legs": legs},
        "drift": {"grade": "none"},
        "sonar": {"range_max": 50.0, "ping_rate": 4.0, "n_sub_beams": 1, "motion": "stop-and-hop"},
        "vehicle": {
            "keeping": "depth",
            "depth": 38.0,
            "turn_rate_deg": 15.0,
            "waves": {"roll_deg": 0.0, "pitch_deg": 0.0, "yaw_deg": 0.0, "heave": 0.0, **waves},
        },
    }
    return simulate(Scene.model_validate(scene))


def calibrated(recording: Recording) -> Radiometry:
    bottom = find_bottom(recording, BottomConfig())
    return calibrate(recording, [whole(recording)], bottom, RadiometryConfig(), JOINT)


def whole(recording: Recording) -> Window:
    return Window(0, 0, recording.n_pings, recording.n_pings // 2)


def see(recording: Recording, radiometry: Radiometry, config: JointConfig = JOINT) -> Seen:
    submap = reconstruct(recording, whole(recording), find_bottom(recording, BottomConfig()), radiometry, config)
    points = transform(submap.T_world_submap_dr, submap.points)
    assert recording.truth is not None
    assert recording.truth.terrain is not None
    return Seen(submap, points, points[:, 2] - recording.truth.terrain.sample(points[:, 0], points[:, 1]))


@pytest.fixture(scope="module")
def flat(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """A flat floor."""
    return sound(tmp_path_factory.mktemp("flat"), lambda x, y: 0.0 * (x + y))


@pytest.fixture(scope="module")
def radiometry(flat: Recording) -> Radiometry:
    """The sonar's, as found over the flat floor: a slope the only window has all along would pass for a pattern."""
    return calibrated(flat)


# Bounds: bins are half a metre wide, so heights are good to half a bin on the whole; single-look speckle of six looks a
# cell leaves 0.07 m after smoothing.
HALF_A_BIN, SPECKLE = 0.25, 0.12


def test_a_flat_floor_is_flat_at_its_depth(flat: Recording, radiometry: Radiometry) -> None:
    seen = see(flat, radiometry)
    inside = seen.inside(45.0)
    assert inside.sum() > 5000
    assert abs(seen.error[inside].mean()) < HALF_A_BIN
    assert seen.error[inside].std() < SPECKLE
    assert np.abs(seen.submap.log_reflectivity[seen.submap.is_known]).max() < 0.3


def test_a_flat_floor_stays_flat_under_roll_and_pitch(tmp_path: Path) -> None:
    recording = sound(tmp_path, lambda x, y: 0.0 * (x + y), roll_deg=4.0, pitch_deg=3.0)
    assert np.ptp(recording.trajectory_dr.roll) > 0.15
    seen = see(recording, calibrated(recording))
    inside = seen.inside(45.0)
    assert abs(seen.error[inside].mean()) < HALF_A_BIN
    assert seen.error[inside].std() < SPECKLE


@pytest.mark.parametrize("y", [22.0, -22.0], ids=["port", "starboard"])
def test_a_mound_stands_where_it_is_and_as_high(tmp_path: Path, radiometry: Radiometry, y: float) -> None:
    recording = sound(tmp_path, lambda x, north: 2.0 * np.exp(-((x - 5) ** 2 + (north - y) ** 2) / 50))
    seen = see(recording, radiometry)
    peak = seen.points[np.argmax(seen.points[:, 2])]
    np.testing.assert_allclose(peak[:2], [5.0, y], atol=1.5)  # a cell and its diagonal neighbour
    around = np.hypot(seen.points[:, 0] - 5, seen.points[:, 1] - y) < 12
    truth = seen.points[around, 2] - seen.error[around]
    assert np.corrcoef(truth, seen.points[around, 2])[0, 1] > 0.97
    # the belief in small relief, and a crest seen from one side only, take a tenth
    assert peak[2] - np.median(seen.points[:, 2]) == pytest.approx(np.ptp(truth), rel=0.2)
    assert seen.error[seen.inside(45.0)].std() < SPECKLE


def test_a_ramp_along_the_track_has_its_slope(tmp_path: Path, radiometry: Radiometry) -> None:
    seen = see(sound(tmp_path, lambda x, y: 0.03 * x + 0.0 * y), replace(radiometry, seafloor=ROUGH))
    inside = seen.inside(40.0)
    slope = np.polyfit(seen.points[inside, 0], seen.points[inside, 2], 1)[0]
    assert slope == pytest.approx(0.03, rel=0.25)  # beside the track, echoes hardly know of it


def test_a_ramp_across_the_track_has_its_slope_where_long_waves_are_believed_in(
    tmp_path: Path, radiometry: Radiometry
) -> None:
    # a slope as wide as the swath is longer than any wave of the default belief, which takes it for reflectivity
    # and one ramp is smooth: a belief that follows the window would take some of its slope back
    believing = JointConfig(
        prior=PriorConfig(longest=200.0),
        roughness=RoughnessConfig(n_rounds=0),
        solver=SolverConfig(n_steps=10, n_products=20, improvement=1e-6),
    )
    seen = see(sound(tmp_path, lambda x, y: 0.06 * y + 0.0 * x), replace(radiometry, seafloor=ROUGH), believing)
    inside = seen.inside(40.0)
    slope = np.polyfit(seen.points[inside, 1], seen.points[inside, 2], 1)[0]
    assert slope == pytest.approx(0.06, rel=0.1)  # bounded steps have not quite arrived


def test_a_groove_along_the_track_is_found_on_a_dive_that_was_smooth_so_far(
    tmp_path: Path, radiometry: Radiometry
) -> None:
    def groove(x: FloatArray, y: FloatArray) -> FloatArray:
        return np.clip((np.abs(y) - 10.0) * 0.16, 0.0, 3.2) * (np.abs(y) < 30.0) + 0.0 * x

    recording = sound(tmp_path, groove)
    following, fixed = (
        see(recording, radiometry, JointConfig(roughness=RoughnessConfig(n_rounds=n)))
        for n in (RoughnessConfig().n_rounds, 0)
    )
    rms = [float(np.sqrt(np.mean(seen.error[seen.inside(28.0)] ** 2))) for seen in (following, fixed)]
    assert rms[0] < 0.1 * 3.2  # of its height
    assert rms[0] < 0.5 * rms[1]


def test_waves_too_short_for_the_coarsest_cells_are_found_on_a_dive_that_was_smooth_so_far(
    tmp_path: Path, radiometry: Radiometry
) -> None:
    def waves(x: FloatArray, y: FloatArray) -> FloatArray:
        return np.asarray(0.2 * np.sin(2 * np.pi * (0.5 * x + np.sqrt(0.75) * y) / 7.0))

    recording = sound(tmp_path, waves)
    following, fixed = (
        see(recording, radiometry, JointConfig(roughness=RoughnessConfig(n_rounds=n)))
        for n in (RoughnessConfig().n_rounds, 0)
    )
    rms = [float(np.std(seen.error[seen.inside(40.0)])) for seen in (following, fixed)]
    assert rms[0] < 0.6 * rms[1]


def test_a_ridge_has_the_height_that_its_shadow_tells(tmp_path: Path, radiometry: Radiometry) -> None:
    def ridges(x: FloatArray, y: FloatArray) -> FloatArray:
        return np.clip((np.abs(y) - 10.0) * 0.16, 0.0, 3.2) * (np.abs(y) < 30.0) + 0.0 * x

    recording = sound(tmp_path, ridges)
    deaf = JointConfig(shadow_ends=ShadowEndsConfig(darkest=0.0))
    heard, not_heard = (see(recording, radiometry, config) for config in (JOINT, deaf))
    crests = [float(np.abs(seen.error[seen.inside(30.0) & ~seen.inside(24.0)].mean())) for seen in (heard, not_heard)]
    assert crests[0] < 0.75 * crests[1]


def test_two_passes_together_know_a_hill_between_them_better_than_each_alone(
    tmp_path: Path, radiometry: Radiometry
) -> None:
    """A hill between two opposing passes, each of which sees one flank well."""

    def hill(x: FloatArray, y: FloatArray) -> FloatArray:
        return np.asarray(-50.0 + 0.8 * np.exp(-((x / 9.0) ** 2 + (y / 6.0) ** 2)))

    recording = sound(tmp_path, hill, legs=[[-35.0, -16.0, 35.0, -16.0], [35.0, 16.0, -35.0, 16.0]])
    assert recording.truth is not None
    track = recording.truth.trajectory
    passes = [np.flatnonzero((np.abs(track.x) < 35.0) & (np.abs(track.y - y) < 0.5)) for y in (-16.0, 16.0)]
    windows = [Window(k, int(p[0]), int(p[-1]) + 1, int(p[len(p) // 2])) for k, p in enumerate(passes)]
    bottom = find_bottom(recording, BottomConfig())

    def error(*seen: Window) -> float:
        submap = reconstruct_together(recording, seen, bottom, replace(radiometry, seafloor=ROUGH), JOINT)
        x, y, z = transform(submap.T_world_submap_dr, submap.points).T
        on_hill = (np.abs(x) < 15.0) & (np.abs(y) < 10.0)
        off = (z - hill(x, y))[on_hill]
        return float(np.std(off))

    alone = [error(window) for window in windows]
    assert error(*windows) < 0.8 * min(alone)


def test_a_wall_casts_a_shadow_and_what_lies_in_it_is_marked(tmp_path: Path, radiometry: Radiometry) -> None:
    recording = sound(tmp_path, lambda x, y: 4.0 * ((y > 19.5) & (y < 20.5)) + 0.0 * x)
    patient = JointConfig(solver=SolverConfig(n_steps=14))  # bounded steps climb a wall slowly
    submap = see(recording, replace(radiometry, seafloor=ROUGH), patient).submap
    x, y = np.meshgrid(submap.surface.x, submap.surface.y)
    # the ray over the crest (20.5, 4 m up of 12) comes down at 20.5 * 12 / 8 = 30.7 m
    behind = (y > 23) & (y < 27) & (np.abs(x) < 25)
    before = (np.abs(y) < 17) & (np.abs(x) < 25)
    assert submap.is_shadow[behind].mean() > 0.8
    assert submap.is_shadow[before].mean() < 0.02
    assert np.isfinite(submap.surface.z[behind]).all()


def test_sigma_says_how_far_heights_are_off(flat: Recording, radiometry: Radiometry) -> None:
    seen = see(flat, radiometry)
    assert (seen.submap.sigmas > 0).all()
    inside = seen.inside(45.0)
    error = seen.error[inside] - seen.error[inside].mean()
    assert np.mean(np.abs(error) < 2 * seen.submap.sigmas[inside]) > 0.95


def test_what_no_line_passes_is_unknown(flat: Recording, radiometry: Radiometry) -> None:
    submap = see(flat, radiometry).submap
    for values in (submap.sigma, submap.log_reflectivity):
        np.testing.assert_array_equal(np.isfinite(values), submap.is_known)
    assert not submap.is_shadow[~submap.is_known].any()
    reach = np.hypot(50.0, 1.0)
    assert np.abs(submap.points[:, 1]).max() < reach
    assert np.abs(submap.points[:, 1]).max() > np.sqrt(50.0**2 - 12.0**2) - 2.0


def test_a_submap_knows_its_pings_and_its_frame(flat: Recording, radiometry: Radiometry) -> None:
    window = Window(7, 20, 120, 60)
    bottom = find_bottom(flat, BottomConfig())
    submap = reconstruct(flat, window, bottom, radiometry, JointConfig(n_levels=1))
    assert (submap.number, submap.first_ping, submap.end_ping, submap.anchor_ping) == (7, 20, 120, 60)
    assert submap.anchor_time == flat.ping_time[60]
    np.testing.assert_array_equal(submap.T_world_submap_dr[:3, 3], flat.trajectory_dr.positions[60])
    np.testing.assert_allclose(
        submap.T_world_submap_dr @ submap.T_submap_body, flat.trajectory_dr.poses[60], atol=1e-12
    )


@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="one thread only: set NUMBA_NUM_THREADS to 2 or more")
def test_one_thread_and_two_give_the_same_bytes(flat: Recording, radiometry: Radiometry) -> None:
    before, found = numba.get_num_threads(), []
    for n_threads in (1, 2):
        numba.set_num_threads(n_threads)
        submap = see(flat, radiometry).submap
        found.append([a.tobytes() for a in (submap.surface.z, submap.sigma, submap.log_reflectivity)])
    numba.set_num_threads(before)
    assert found[0] == found[1]


@pytest.mark.parametrize(
    ("slant_range", "spacing"), [(55, 1.0), (50, 1.0), (30, 0.5), (110, 2.0), (5.5, 0.1), (300, 5)]
)
def test_cells_follow_the_range(slant_range: float, spacing: float) -> None:
    assert cell_spacing(slant_range) == pytest.approx(spacing)


@given(st.floats(1.0, 2000.0))
def test_cells_are_a_fiftyfifth_of_the_range_to_a_factor(slant_range: float) -> None:
    # between neighbours of 1, 2, 5, 10 the worst is the root of 2.5
    assert abs(np.log(cell_spacing(slant_range) * 55 / slant_range)) < 0.5 * np.log(2.5) + 1e-9


def test_a_plane_is_resampled_exactly_inside() -> None:
    old, new = Raster(12, 10, 2.0, (-4.0, 6.0)), Raster(9, 11, 1.0, (0.0, 10.0))

    def plane(raster: Raster) -> FloatArray:
        x = raster.origin[0] + raster.spacing * np.arange(raster.n_x)
        y = raster.origin[1] + raster.spacing * np.arange(raster.n_y)
        return np.asarray(0.3 * x[None, :] - 0.2 * y[:, None])

    # the spline's mirrored edge dies out by a factor of 3.7 a cell
    np.testing.assert_allclose(resample(plane(old), old, new), plane(new), atol=0.05)
    np.testing.assert_allclose(resample(plane(old), old, old), plane(old), atol=1e-12)


def test_the_first_surface_lies_below_the_track() -> None:
    data = make_data(make_recording())
    z = first_surface(data, Raster(81, 20, 1.0, (-10.0, -40.0)))
    # the transducers hang 0.2 m out of a rolling body: centimetres
    np.testing.assert_allclose(z, -12.0, atol=0.03)


def test_the_first_surface_follows_the_altimeter_along_the_track() -> None:
    data = make_data(make_recording())
    data.altitude[:] = np.linspace(11.0, 13.0, 8)
    z = first_surface(data, Raster(81, 20, 1.0, (-10.0, -40.0)))
    assert (np.diff(z[40]) <= 1e-12).all()
    assert -13.1 < z.min() < z.max() < -10.9
