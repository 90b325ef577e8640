"""The forward model and its adjoint."""

from dataclasses import replace

import numpy as np
import pytest

from frontend.frames import rotation_world_body
from frontend.reconstruction import kernels
from frontend.reconstruction.forward import (
    ROW_LENGTH,
    Beams,
    Bins,
    Raster,
    coverage,
    linearise,
    pull_back,
    render,
)
from tests.frontend.reconstruction.small_window import make_scene, make_tables

STILL = (np.zeros(1), np.zeros(1))  # neither advance nor turn


def test_adjoint_equals_finite_differences() -> None:
    z, rho, raster, beams, bins = make_scene()
    tables = make_tables()
    rng = np.random.default_rng(1)
    weight = rng.standard_normal(bins.intensity.shape) / render(z, rho, raster, beams, tables, bins)
    by_height, by_rho, _ = pull_back(z, rho, raster, beams, tables, bins, weight)

    def cost(dz: np.ndarray, drho: np.ndarray) -> float:
        return float((weight * render(z + dz, rho + drho, raster, beams, tables, bins)).sum())

    # away from cells where the step changes what is seen, central differences are exact to their own rounding
    step, relative = 1e-6, []
    for gradient, which in ((by_height, 0), (by_rho, 1)):
        order = np.argsort(-np.abs(gradient).ravel())[:200:5]
        for cell in order:
            d = np.zeros(raster.n_cells)
            d[cell] = step
            d = d.reshape(raster.shape)
            zero = np.zeros_like(d)
            up, down = (cost(s * d, zero) if which == 0 else cost(zero, s * d) for s in (1, -1))
            exact = (up - down) / (2 * step)
            relative.append(abs(gradient.ravel()[cell] - exact) / abs(exact))
    assert np.quantile(relative, 0.8) < 1e-6


def test_adjoint_by_the_beam_pattern_equals_finite_differences() -> None:
    z, rho, raster, beams, bins = make_scene(pitch=0.05)
    tables, rng = make_tables(), np.random.default_rng(2)
    weight = rng.standard_normal(bins.intensity.shape) / render(z, rho, raster, beams, tables, bins)
    _, _, by_beam = pull_back(z, rho, raster, beams, tables, bins, weight)
    for _ in range(5):
        step = 1e-5 * rng.standard_normal(tables.log_beam.shape)
        up, down = (
            (weight * render(z, rho, raster, beams, replace(tables, log_beam=tables.log_beam + s * step), bins)).sum()
            for s in (1, -1)
        )
        assert (by_beam * step).sum() == pytest.approx((up - down) / 2, rel=1e-6)


def test_jacobian_rows_are_the_adjoint_bin_by_bin() -> None:
    z, rho, raster, beams, bins = make_scene(pitch=0.1)
    tables = make_tables()
    mu = render(z, rho, raster, beams, tables, bins)
    rows = linearise(z, rho, raster, beams, tables, bins, mu)
    for index in ((2, 0, 40), (3, 1, 35), (0, 1, 50)):
        weight = np.zeros(mu.shape)
        weight[index] = 1.0 / mu[index]
        by_height, by_rho, _ = pull_back(z, rho, raster, beams, tables, bins, weight)
        dense = np.zeros((2, raster.n_cells))
        n = rows.n_cells[index]
        np.add.at(dense[0], rows.cell[index][:n], rows.by_height[index][:n])
        np.add.at(dense[1], rows.cell[index][:n], rows.by_reflectivity[index][:n])
        np.testing.assert_allclose(dense[0], by_height.ravel(), rtol=1e-4, atol=1e-5)  # float32 rows
        np.testing.assert_allclose(dense[1], by_rho.ravel(), rtol=1e-4, atol=1e-5)


def test_water_column_holds_only_the_noise_floor() -> None:
    z, rho, raster, beams, bins = make_scene(relief=0.0)
    mu = render(np.full_like(z, -12.0), rho, raster, beams, make_tables(), bins)
    # the first echo comes from 12 m below and is shared with the bin before
    np.testing.assert_array_equal(mu[:, 0, : int(12 / 0.5) - 1], 1e-7)
    assert (mu[:, 0, int(12 / 0.5) + 1] > 1e-6).all()


def test_energy_of_a_flat_floor_matches_the_integral() -> None:
    raster = Raster(140, 30, 1.0, (-5.0, -70.0))
    z, rho = np.full(raster.shape, -12.0), np.zeros(raster.shape)
    eye = np.eye(3)[None]
    sides = np.stack([eye[:, :, 1], -eye[:, :, 1]], 1)
    beams = Beams(np.array([[[10.3, 0.2, 0.0]] * 2]), eye[:, :, 0], sides, eye[:, :, 2], *STILL)
    bins = Bins(np.ones((1, 2, 100)), np.ones((1, 2, 100)), np.full((2, 100), 1e-7), 0.5)
    tables = make_tables()
    mu = render(z, rho, raster, beams, tables, bins)
    r = np.array([30.25])
    theta = np.arccos(12 / r)
    beam = np.exp(np.interp(theta, -0.5 + 0.035 * np.arange(61), tables.log_beam[0]))
    exact = beam * r**-3 * (12 / r) ** 2 / np.sqrt(1 - (12 / r) ** 2)
    # two samples a bin at a step of a quarter cell: the sharing ripples by a few percent
    assert mu[0, 0, 58:63].mean() == pytest.approx(exact[0] + 1e-7, rel=0.03)


def test_a_wall_casts_a_shadow_as_long_as_the_ray_over_its_crest_says() -> None:
    raster = Raster(140, 30, 0.5, (-5.0, -35.0))
    z = np.full(raster.shape, -12.0)
    y = raster.origin[1] + raster.spacing * np.arange(raster.n_y)
    z[(y >= 14.9) & (y <= 15.6)] = -10.0
    eye = np.eye(3)[None]
    sides = np.stack([eye[:, :, 1], -eye[:, :, 1]], 1)
    beams = Beams(np.array([[[3.2, 0.0, 0.0]] * 2]), eye[:, :, 0], sides, eye[:, :, 2], *STILL)
    passed, seen = coverage(z, raster, beams, 30.0)
    column = passed.any(axis=0).argmax()
    shadow = y[(passed & ~seen)[:, column] & (y > 0)]
    # the ray over the rear edge (15.5, -10) reaches -12 at 15.5 * 12 / 10 = 18.6 m; a cell seen in part counts as seen
    assert 18.6 - 0.75 <= shadow.max() <= 18.6
    assert shadow.min() == pytest.approx(16.0, abs=0.5)


def one_line(z: float = 0.0, roll: float = 0.0, turn: float = 0.0) -> Beams:
    """One line at (3.2, 0, z) that heads along x."""
    rotation = rotation_world_body([roll], [0.0], [0.0])
    side = np.stack([rotation[:, :, 1], -rotation[:, :, 1]], axis=1)
    under_way = (np.zeros(1), np.full(1, turn))
    return Beams(np.array([[[3.2, 0.0, z]] * 2]), rotation[:, :, 0], side, rotation[:, :, 2], *under_way)


def flat(n_bins: int = 80) -> tuple[np.ndarray, np.ndarray, Raster, Bins]:
    """A floor 12 m below, and empty bins."""
    raster = Raster(140, 30, 0.5, (-5.0, -35.0))
    bins = Bins(np.ones((1, 2, n_bins)), np.ones((1, 2, n_bins)), np.full((2, n_bins), 1e-7), 0.4)
    return np.full(raster.shape, -12.0), np.zeros(raster.shape), raster, bins


def test_what_lies_to_port_is_heard_on_port() -> None:
    z, rho, raster, bins = flat()
    rho[raster.origin[1] + raster.spacing * np.arange(raster.n_y) > 0] += 1.0  # y > 0 is port of a line along x
    plain = render(z, np.zeros_like(rho), raster, one_line(), make_tables(), bins)
    bright = render(z, rho, raster, one_line(), make_tables(), bins)
    far = slice(40, 70)
    np.testing.assert_allclose((bright[:, 0] - 1e-7)[:, far], np.e * (plain[:, 0] - 1e-7)[:, far])
    np.testing.assert_array_equal(bright[:, 1, far], plain[:, 1, far])


def angle_seen(raster: Raster, beams: Beams, bins: Bins, z: np.ndarray) -> np.ndarray:
    """Mean angle from the body's nadir of each bin; NaN where nothing is seen."""
    tables, rho = make_tables(), np.zeros_like(z)
    rows = linearise(z, rho, raster, beams, tables, bins, render(z, rho, raster, beams, tables, bins))
    return np.where(rows.share > 0, tables.angle_first + tables.angle_step * rows.knot, np.nan)


def test_roll_moves_the_beam_and_not_the_echo() -> None:
    z, _, raster, bins = flat()
    level, rolled = (angle_seen(raster, one_line(roll=roll), bins, z) for roll in (0.0, 0.1))
    # starboard down turns the body's nadir towards port; a bin weighs its samples by a beam that turned, too
    np.testing.assert_allclose(rolled[:, 0, 40:], level[:, 0, 40:] - 0.1, atol=1e-3)
    np.testing.assert_allclose(rolled[:, 1, 40:], level[:, 1, 40:] + 0.1, atol=1e-3)


def test_angles_over_a_flat_floor_are_those_of_the_triangle() -> None:
    z, _, raster, bins = flat()
    angle = angle_seen(raster, one_line(), bins, z)
    middle = (np.arange(80) + 0.5) * 0.4
    # a bin of 0.4 m holds three samples; far out they differ by a hundredth of a radian
    np.testing.assert_allclose(angle[0, :, 40:75], np.broadcast_to(np.arccos(12 / middle[40:75]), (2, 35)), atol=0.01)
    assert np.isnan(angle[0, :, :28]).all()


def test_share_is_what_stands_above_the_floor() -> None:
    z, rho, raster, beams, bins = make_scene()
    mu = render(z, rho, raster, beams, make_tables(), bins)
    rows = linearise(z, rho, raster, beams, make_tables(), bins, mu)
    np.testing.assert_allclose(rows.share, (mu - bins.floor) / mu, atol=1e-12)


@pytest.mark.parametrize("turn", [1e-3, -1e-3])
def test_a_turn_under_way_hears_port_from_astern_and_starboard_from_ahead(turn: float) -> None:
    raster = Raster(280, 120, 0.25, (-10.0, -35.0))
    z, x = np.full(raster.shape, -12.0), raster.origin[0] + 0.25 * np.arange(120)
    ramp = np.broadcast_to(0.05 * x, z.shape)  # brightness tells the place along the track
    bins = Bins(np.ones((1, 2, 80)), np.ones((1, 2, 80)), np.full((2, 80), 1e-9), 0.4)
    loud = np.log(render(z, ramp, raster, one_line(turn=turn), make_tables(), bins))
    plain = np.log(render(z, np.zeros_like(z), raster, one_line(turn=turn), make_tables(), bins))
    place = (loud - plain)[0] / 0.05 - 3.2
    across = np.sqrt(((np.arange(80) + 0.5) * 0.4) ** 2 - 12.0**2, where=np.arange(80) > 40, out=np.zeros(80))
    # turning to port, the port beam swings astern by turn times range; sharing among bins blurs by a few millimetres
    np.testing.assert_allclose(place[0, 45:75], -turn * across[45:75] ** 2, atol=0.03)
    np.testing.assert_allclose(place[1, 45:75], turn * across[45:75] ** 2, atol=0.03)


def test_a_higher_floor_echoes_earlier() -> None:
    z, rho, raster, bins = flat()
    first = [
        (render(z + up, rho, raster, one_line(), make_tables(), bins)[0, 0] > 2e-7).argmax() * bins.width
        for up in (0.0, 2.0)
    ]
    assert first[0] - first[1] == pytest.approx(2.0, abs=bins.width)


def test_doubled_reflectivity_is_doubled_energy() -> None:
    z, rho, raster, beams, bins = make_scene()
    once = render(z, rho, raster, beams, make_tables(), bins) - 1e-7
    twice = render(z, rho + np.log(2), raster, beams, make_tables(), bins) - 1e-7
    np.testing.assert_allclose(twice, 2 * once, rtol=1e-9, atol=1e-20)


def test_rows_are_never_longer_than_their_room() -> None:
    z, rho, raster, beams, _bins = make_scene(relief=2.0)
    wide = Bins(np.ones((6, 2, 4)), np.ones((6, 2, 4)), np.full((2, 4), 1e-7), 8.0)
    mu = render(z, rho, raster, beams, make_tables(), wide)
    rows = linearise(z, rho, raster, beams, make_tables(), wide, mu)
    assert rows.n_cells.max() == ROW_LENGTH
    filled = np.arange(ROW_LENGTH) < rows.n_cells[..., None]
    assert np.isfinite(rows.by_height[filled]).all()
    assert ((rows.cell[filled] >= 0) & (rows.cell[filled] < raster.n_cells)).all()


def test_a_line_that_starts_off_the_raster_sees_nothing() -> None:
    z, rho, raster, bins = flat()
    away = one_line()
    away.sensor[..., 0] += 100.0
    np.testing.assert_array_equal(render(z, rho, raster, away, make_tables(), bins), 1e-7)
    passed, seen = coverage(z, raster, away, 30.0)
    assert not passed.any()
    assert not seen.any()


def test_compiled_kernels_do_what_their_python_says() -> None:
    z, rho, raster, _ = flat()
    z += 0.3 * np.sin(0.4 * np.arange(raster.n_y))[:, None]
    grid = (raster.n_y, raster.n_x, raster.spacing, *raster.origin)
    row = np.zeros((1, 2, 16))  # a line along x at the origin: side axis, up axis, heading, walk
    row[..., 8], row[..., 9], row[:, 0, 4], row[:, 0, 12], row[:, 1, 4], row[:, 1, 12] = 1, 1, 1, 1, -1, -1
    tables = make_tables()
    packed = (tables.log_beam, tables.log_range[None], np.array([-0.5, 0.035, 0.25, 2.0]))
    weight = np.random.default_rng(1).standard_normal((1, 2, 60))
    results = []
    for compiled in (True, False):
        render_lines, pull = (
            kernel if compiled else getattr(kernel, "py_func", kernel)
            for kernel in (kernels._render, kernels._pull_back)
        )
        mu, gradients, beam = np.zeros((1, 2, 60)), np.zeros((2, *raster.shape)), np.zeros((2, 61))
        render_lines(z, rho, grid, row, packed, 0.4, mu)
        pull(z, rho, grid, row, packed, 0.4, weight, gradients, beam)
        results.append((mu, gradients, beam))
    # the compiler may fuse a multiplication with an addition
    np.testing.assert_allclose(results[0][0], results[1][0], rtol=1e-12, atol=1e-20)
    np.testing.assert_allclose(results[0][1], results[1][1], rtol=1e-9, atol=1e-12 * np.abs(results[1][1]).max())
    np.testing.assert_allclose(results[0][2], results[1][2], rtol=1e-9, atol=1e-12 * np.abs(results[1][2]).max())
