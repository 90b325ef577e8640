"""Tests of how shape is judged."""

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from frontend.frames import invert, level, planar_pose, transform
from frontend.heightfield import Heightfield
from frontend.submaps import Submap
from frontend.trajectory import Trajectory
from sssslam.evaluation.reconstruction import (
    HeightErrors,
    averaged,
    compare_heights,
    evaluate_map,
    evaluate_submaps,
    high_pass,
    true_heights,
)

X, Y = np.meshgrid(np.arange(100.0), np.arange(80.0))
WAVES = np.sin(2 * np.pi * X / 8.0) + np.cos(2 * np.pi * Y / 6.0)
ONES = np.ones_like(X)


def grid(z: np.ndarray, spacing: float = 1.0) -> Heightfield:
    return Heightfield(z, spacing, (0.0, 0.0))


def test_the_truth_has_no_error_and_correlates_fully() -> None:
    errors = compare_heights(grid(WAVES), ONES, WAVES)
    assert errors.rmse == errors.rmse_without_mean == errors.z_score == 0.0
    for name in ("correlation_20m", "correlation_10m", "slope_correlation_along", "slope_correlation_across"):
        assert getattr(errors, name) == pytest.approx(1.0)


def test_an_offset_and_a_tilt_are_told_apart() -> None:
    tilted = WAVES + 3.0 + 0.1 * X - 0.05 * Y
    errors = compare_heights(grid(tilted), ONES, WAVES)
    tilt = 0.1 * X - 0.05 * Y
    assert errors.rmse == pytest.approx(np.sqrt(np.mean((tilt + 3.0) ** 2)))
    assert errors.rmse_without_mean == pytest.approx(np.std(tilt))
    assert errors.rmse_without_plane == pytest.approx(0.0, abs=1e-9)


def test_slopes_are_judged_along_and_across_separately() -> None:
    along, across = np.sin(X / 3.0), np.sin(Y / 3.0)
    errors = compare_heights(grid(along + across), ONES, along - across)
    assert errors.slope_correlation_along == pytest.approx(1.0)
    assert errors.slope_correlation_across == pytest.approx(-1.0)


def test_half_the_amplitude_of_the_wavelength_is_kept_and_long_waves_go() -> None:
    kept = {length: high_pass(np.sin(2 * np.pi * X / length), 20.0) for length in (4.0, 20.0, 200.0)}
    middle = (slice(30, 50), slice(30, 70))
    waves = {length: np.sin(2 * np.pi * X / length)[middle] for length in kept}
    shares = [np.sum(kept[n][middle] * waves[n]) / np.sum(waves[n] ** 2) for n in (4.0, 20.0)]
    assert shares[0] > 0.99
    assert shares[1] == pytest.approx(0.5, abs=0.01)  # the Gaussian is cut at four standard deviations
    assert np.abs(kept[200.0][middle]).max() < 0.02  # exp(-2 pi^2 s^2 / L^2) keeps 0.7 % at L = 200


@given(st.integers(0, 200), st.floats(-50, 50))
def test_unknown_cells_and_a_constant_leave_no_trace_in_the_high_pass(seed: int, height: float) -> None:
    holes = np.random.default_rng(seed).random(X.shape) < 0.3
    residual = high_pass(np.where(holes, np.nan, height), 20.0)
    np.testing.assert_array_equal(np.isnan(residual), holes)
    np.testing.assert_allclose(residual[~holes], 0.0, atol=1e-9)


def test_noise_of_the_claimed_size_scores_one_and_is_covered() -> None:
    sigma = 0.1 + 0.01 * X
    noise = np.random.default_rng(0).normal(0.0, sigma)
    errors = compare_heights(grid(WAVES + noise), sigma, WAVES)
    # 8000 cells: a standard deviation of 0.008 and 0.24 %
    assert errors.z_score == pytest.approx(1.0, abs=0.03)
    assert errors.coverage_95 == pytest.approx(95.0, abs=0.8)
    assert compare_heights(grid(WAVES + noise), 0.5 * sigma, WAVES).z_score == pytest.approx(2.0, abs=0.06)


def test_a_cell_without_sigma_has_no_score() -> None:
    errors = compare_heights(grid(WAVES + 1.0), np.where(X < 50, 0.0, 2.0), WAVES)
    assert errors.z_score == pytest.approx(0.5)


def test_cells_that_one_side_does_not_know_do_not_count() -> None:
    half = np.where(X < 50, WAVES + 1.0, np.nan)
    errors = compare_heights(grid(half), ONES, np.where(Y < 40, WAVES, np.nan))
    assert errors.rmse == pytest.approx(1.0)
    assert errors.correlation_20m == pytest.approx(1.0)


def test_a_flat_floor_has_no_correlation() -> None:
    errors = compare_heights(grid(0.0 * X), ONES, WAVES)
    assert np.isnan(errors.slope_correlation_along)
    assert errors.rmse == pytest.approx(np.sqrt(np.mean(WAVES**2)))


def test_a_handful_of_cells_is_not_judged() -> None:
    errors = compare_heights(grid(WAVES[:1, :1]), ONES[:1, :1], WAVES[:1, :1])
    assert all(np.isnan(getattr(errors, f.name)) for f in fields(HeightErrors))


def test_a_finer_terrain_is_averaged_over_the_cells() -> None:
    terrain = Heightfield(np.where((X + Y) % 2 == 0, 1.0, -1.0), 0.25, (0.0, 0.0))
    np.testing.assert_allclose(averaged(terrain, 1.0).z[4:-4, 4:-4], 0.0, atol=1e-12)
    assert averaged(terrain, 0.3) is terrain


def test_an_unknown_cell_spoils_the_means_that_hold_it() -> None:
    z = np.zeros((9, 9))
    z[4, 4] = np.nan
    smoothed = averaged(Heightfield(z, 0.5, (0.0, 0.0)), 1.5).z
    assert np.isnan(smoothed).sum() == 9
    assert np.nanmax(np.abs(smoothed)) < 1e-12


def track_east() -> Trajectory:
    t = np.arange(0.0, 60.0)
    zeros = np.zeros(t.size)
    return Trajectory(t, 10.0 + t, zeros + 40.0, zeros - 30.0, zeros + 0.1, zeros - 0.05, zeros + 0.7)


def terrain() -> Heightfield:
    axis = np.arange(-40.0, 120.0, 0.5)
    x, y = np.meshgrid(axis, axis)
    return Heightfield(-45.0 + np.sin(x / 3.0) + np.cos(y / 4.0), 0.5, (-40.0, -40.0))


def submap(anchor_time: float, error: float) -> Submap:
    """The terrain as it lies below the true pose, too high by an error, with a spike in shadow."""
    T_world_submap_ref = level(track_east().poses[int(anchor_time)])
    x, y = np.meshgrid(np.arange(-10.0, 11.0), np.arange(-12.0, 13.0))
    world = transform(T_world_submap_ref, np.stack([x, y, 0 * x], axis=-1))
    z = terrain().sample(world[..., 0], world[..., 1]) - T_world_submap_ref[2, 3] + error
    shadow = np.zeros(z.shape, dtype=np.bool_)
    shadow[3, 3], z[3, 3] = True, 99.0
    surface = Heightfield(z, 1.0, (-10.0, -12.0))
    elsewhere = planar_pose(500.0, 0.0, 0.0)
    body = invert(T_world_submap_ref) @ track_east().poses[int(anchor_time)]
    return Submap(0, 0, 60, 30, anchor_time, elsewhere, body, surface, np.full(z.shape, 0.1), 0 * z, shadow)


def test_a_submap_is_judged_at_its_true_pose_wherever_the_run_put_it() -> None:
    z_true = true_heights(submap(30.0, 0.0), track_east(), terrain())
    shown = np.delete(submap(30.0, 0.0).surface.z.ravel(), 3 * 21 + 3)
    np.testing.assert_allclose(np.delete(z_true.ravel(), 3 * 21 + 3), shown, atol=1e-9)


def test_submaps_count_by_their_median_and_without_shadow() -> None:
    submaps = [submap(t, error) for t, error in ((20.0, 0.2), (30.0, -0.3), (40.0, 5.0))]
    late = replace(submap(30.0, 77.0), anchor_time=1e6)
    # The terrain is twice as fine as the submap and its waves are long: averaging it costs below 5 cm.
    found = {m.name: m for m in evaluate_submaps([*submaps, late], track_east(), terrain())}
    assert found["submap_rmse"].value == pytest.approx(0.3, abs=0.05)
    assert found["submap_slope_correlation_along"].value > 0.99
    assert "3 submaps" in found["submap_rmse"].how
    assert found["submap_rmse"].unit == "m"
    assert found["submap_z_score"].unit == ""


def test_no_submaps_give_unknown_metrics() -> None:
    assert all(np.isnan(m.value) for m in evaluate_submaps([], track_east(), terrain()))


def test_a_map_is_judged_where_it_lies() -> None:
    x, y = np.meshgrid(np.arange(0.0, 40.0), np.arange(0.0, 30.0))
    seafloor = Heightfield(terrain().sample(x, y) + 0.5, 1.0, (0.0, 0.0))
    found = {m.name: m for m in evaluate_map(seafloor, np.full(x.shape, 0.5), terrain())}
    assert found["map_rmse"].value == pytest.approx(0.5, abs=0.05)
    assert found["map_correlation_20m"].value > 0.99
    assert "1200 cells of 1 m" in found["map_rmse"].how


def test_a_terrain_elsewhere_is_refused() -> None:
    seafloor = Heightfield(np.zeros((20, 20)), 1.0, (5000.0, 0.0))
    with pytest.raises(
        ValueError, match=r"must lie under the map in x 5000 to 5019, y 0 to 19 m, it covers x -40 to 120"
    ):
        evaluate_map(seafloor, np.ones((20, 20)), terrain())


def test_a_map_without_a_known_cell_gives_unknown_metrics() -> None:
    empty = Heightfield(np.full((1, 1), np.nan), 1.0, (0.0, 0.0))
    assert all(np.isnan(m.value) for m in evaluate_map(empty, np.full((1, 1), np.nan), terrain()))
