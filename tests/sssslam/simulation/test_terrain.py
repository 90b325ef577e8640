from pathlib import Path

import numpy as np
import pytest

from sssslam.simulation.fields import random_field, turned
from sssslam.simulation.landforms import Box, Groove, Ridge, Scarp, Waves
from sssslam.simulation.layers import Fractal, Objects, Sediment
from sssslam.simulation.terrain import TerrainConfig, make_grid, make_terrain
from sssslam.simulation.terrain_files import GridFile

GRID = make_grid((200.0, 160.0), 0.5)


def _rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def test_the_grid_is_centred_and_holds_its_edges() -> None:
    assert GRID.shape == (321, 401)
    assert (GRID.x[0], GRID.x[-1], GRID.y[0], GRID.y[-1]) == (-100.0, 100.0, -80.0, 80.0)


@pytest.mark.parametrize(("size", "spacing"), [((1.0, 1.0), 1.0), ((1e5, 1e5), 0.1)])
def test_a_grid_too_small_or_too_large_is_refused(size: tuple[float, float], spacing: float) -> None:
    with pytest.raises(ValueError, match=r"terrain of \d+ x \d+ cells given, 4 x 4 to 400000000 cells in all wanted"):
        make_grid(size, spacing)


@pytest.mark.parametrize("exponent", [3.0, 4.2])
def test_a_fractal_falls_with_wavenumber_by_its_exponent(exponent: float) -> None:
    grid = make_grid((255.5, 255.5), 0.5)
    field = random_field(grid, (exponent, 1e9, 0.0), _rng())
    power = np.abs(np.fft.fft2(field)) ** 2
    k = np.hypot(np.fft.fftfreq(512, 0.5)[:, None], np.fft.fftfreq(512, 0.5)[None, :])
    # Isotropic, so the mean over rings of an octave has the slope of the spectrum; 8 octaves, thousands of modes.
    edges = 0.5 / 2.0 ** np.arange(6)
    rings = [power[(k <= high) & (k > 0.5 * high)].mean() for high in edges]
    slope = np.polyfit(np.log2(edges), np.log2(rings), 1)[0]
    assert slope == pytest.approx(-exponent, abs=0.25)


def test_a_fractal_has_the_rms_asked_for_and_no_mean() -> None:
    z, log_reflectivity = Fractal(rms=0.8).add(GRID, _rng())
    assert z.std() == pytest.approx(0.8)
    assert z.mean() == pytest.approx(0.0, abs=1e-9)
    assert not log_reflectivity.any()


def test_nothing_is_shorter_than_the_shortest_wavelength() -> None:
    z, _ = Fractal(shortest=20.0).add(GRID, _rng())
    k = np.hypot(np.fft.fftfreq(321, 0.5)[:, None], np.fft.fftfreq(401, 0.5)[None, :])
    power = np.abs(np.fft.fft2(z)) ** 2
    assert power[k > 1 / 19.0].max() < 1e-12 * power.max()


def test_a_spectrum_that_does_not_fit_the_grid_is_refused() -> None:
    with pytest.raises(ValueError, match=r"no wavelength from 1000\.0 to 2000\.0 m fits 401 x 321 cells of 0\.5 m"):
        random_field(GRID, (4.0, 2000.0, 1000.0), _rng())


def test_sediment_is_bright_and_dark_but_flat() -> None:
    z, log_reflectivity = Sediment(rms=0.3).add(GRID, _rng())
    assert not z.any()
    assert log_reflectivity.std() == pytest.approx(0.3)


def test_boulders_stand_and_pits_lie_within_their_limits() -> None:
    boulders, bright = Objects(count=50, pits=0.0, radius=(2.0, 4.0), steepness=(0.5, 0.5)).add(GRID, _rng())
    assert boulders.min() == 0.0
    assert bright[boulders > 0.01].min() >= 0.3
    pits, plain = Objects(count=50, pits=1.0, radius=(2.0, 4.0), steepness=(0.5, 0.5)).add(GRID, _rng())
    np.testing.assert_allclose(pits, -boulders)
    assert not plain.any()


def test_an_object_is_as_high_as_its_radius_and_steepness_say() -> None:
    z, _ = Objects(count=1, pits=0.0, radius=(5.0, 5.0), steepness=(0.4, 0.4)).add(GRID, _rng(1))
    # The crest may fall between cells half a metre apart: (1 - 0.35^2 / 25)^2 of it is left.
    assert 1.97 < z.max() <= 2.0


@pytest.mark.parametrize("values", [{"radius": (3.0, 1.0)}, {"steepness": (0.0, 1.0)}])
def test_limits_out_of_order_are_refused(values: dict[str, tuple[float, float]]) -> None:
    with pytest.raises(ValueError, match="a smallest and a largest positive number wanted"):
        Objects.model_validate(values)


def test_waves_repeat_after_their_wavelength_and_move_in_their_direction() -> None:
    z, log_reflectivity = Waves(wavelength=10.0, height=1.0, direction_deg=90.0, wander=0.0).add(GRID, _rng())
    assert np.ptp(z) == pytest.approx(1.0, abs=0.01)
    np.testing.assert_allclose(z[:, 20:], z[:, :-20], atol=1e-9)
    assert np.ptp(z, axis=0).max() < 1e-9
    # Troughs are the bright ones.
    assert log_reflectivity[z == z.min()].min() > 0 > log_reflectivity[z == z.max()].max()


def test_skewed_waves_are_steeper_on_the_lee_side() -> None:
    z, _ = Waves(wavelength=20.0, height=1.0, direction_deg=90.0, skewness=0.5, wander=0.0).add(GRID, _rng())
    slope = np.diff(z[0])
    assert -slope.min() > 1.3 * slope.max()


def test_wandering_crests_are_not_straight() -> None:
    z, _ = Waves(wavelength=10.0, height=1.0, direction_deg=90.0, wander=0.2).add(GRID, _rng())
    assert np.ptp(z, axis=0).max() > 0.3


def test_a_ridge_is_half_as_high_at_half_its_width() -> None:
    z, _ = Ridge(height=4.0, width=20.0, through=(10.0, 0.0), strike_deg=0.0).add(GRID, _rng())
    row = dict(zip(GRID.x.tolist(), z[0].tolist(), strict=True))
    assert (row[10.0], row[0.0], row[20.0]) == pytest.approx((4.0, 2.0, 2.0))


def test_a_scarp_lifts_the_floor_to_the_right_of_its_strike() -> None:
    z, _ = Scarp(height=4.0, width=2.0, strike_deg=90.0).add(GRID, _rng())
    # Striking east, the right-hand side is the south.
    assert (z[0, 0], z[-1, 0]) == (2.0, -2.0)
    assert z[160, 0] == pytest.approx(0.0, abs=1e-12)


def test_the_groove_rises_to_its_brink_and_drops() -> None:
    z, _ = Groove(height=4.0, foot=8.0, brink=30.0, drop=1.0, strike_deg=90.0).add(GRID, _rng())
    column = dict(zip(GRID.y.tolist(), z[:, 0].tolist(), strict=True))
    assert [column[y] for y in (0.0, 8.0, 19.0, 30.0, 31.0, -19.0)] == pytest.approx([0.0, 0.0, 2.0, 4.0, 0.0, 2.0])


def test_a_groove_whose_brink_lies_before_its_foot_is_refused() -> None:
    with pytest.raises(ValueError, match=r"the brink must lie beyond the foot, got foot 9\.0 m and brink 8\.0 m"):
        Groove(foot=9.0, brink=8.0)


def test_a_box_covers_its_outline() -> None:
    z, log_reflectivity = Box(centre=(10.0, 20.0), size=(8.0, 4.0, 3.0), heading_deg=90.0, log_reflectivity=0.5).add(
        GRID, _rng()
    )
    y, x = np.nonzero(z == 3.0)
    assert (GRID.x[x].min(), GRID.x[x].max()) == (6.0, 14.0)
    assert (GRID.y[y].min(), GRID.y[y].max()) == (18.0, 22.0)
    np.testing.assert_array_equal(log_reflectivity, np.where(z > 0, 0.5, 0.0))


def test_directions_are_headings() -> None:
    along, across = turned(GRID, np.radians(90.0))
    assert along[0, -1] == pytest.approx(100.0)
    assert across[0, 0] == pytest.approx(80.0)


def test_layers_add_up_over_the_depth() -> None:
    config = TerrainConfig(size=(200.0, 160.0), spacing=0.5, depth=30.0, layers=(Scarp(height=4.0), Ridge(height=1.0)))
    terrain = make_terrain(config, _rng())
    expected = -30.0 + Scarp(height=4.0).add(GRID, _rng())[0] + Ridge(height=1.0).add(GRID, _rng())[0]
    np.testing.assert_allclose(terrain.z, expected, atol=1e-5)
    assert terrain.heightfield.sample([-50.0], [3.2])[0] == pytest.approx(-32.0, abs=0.02)
    np.testing.assert_array_equal(terrain.reflectivity, 1.0)


def test_a_flat_floor_is_a_terrain_without_layers() -> None:
    terrain = make_terrain(TerrainConfig(size=(20.0, 20.0), layers=()), _rng())
    np.testing.assert_array_equal(terrain.z, -50.0)


def test_a_layer_more_leaves_the_others_as_they_were() -> None:
    size = (60.0, 60.0)
    one = make_terrain(TerrainConfig(size=size, layers=(Fractal(),)), _rng())
    two = make_terrain(TerrainConfig(size=size, layers=(Fractal(), Sediment())), _rng())
    np.testing.assert_array_equal(one.z, two.z)


def _npz(folder: Path, **arrays: object) -> Path:
    path = folder / "grid.npz"
    np.savez(path, **arrays)  # type: ignore[arg-type]
    return path


def test_a_grid_file_is_laid_with_its_middle_on_the_origin(tmp_path: Path) -> None:
    x, y = np.meshgrid(np.arange(101.0), np.arange(81.0))
    path = _npz(tmp_path, z=0.1 * x + 0.02 * y, spacing=2.5)
    z, _ = GridFile(file=path).add(make_grid((100.0, 60.0), 0.5), _rng())
    # A plane stays one under cubic interpolation: 0.1 m in 2.5 m eastward, 0.02 northward.
    expected = 0.04 * make_grid((100.0, 60.0), 0.5).x[None, :] + 0.008 * make_grid((100.0, 60.0), 0.5).y[:, None]
    np.testing.assert_allclose(z, expected, atol=1e-6)


def test_a_grid_file_is_stretched_and_shifted(tmp_path: Path) -> None:
    x, _ = np.meshgrid(np.arange(101.0), np.arange(81.0))
    path = _npz(tmp_path, z=(x - 50.0) ** 2, spacing=1.0)
    grid = make_grid((100.0, 60.0), 1.0)
    z, _ = GridFile(file=path, scale=2.0, height_scale=3.0, centre=(10.0, 0.0)).add(grid, _rng())
    lowest = grid.x[np.argmin(z[0])]
    assert lowest == -10.0
    assert z[0, 52] - z[0, 40] == pytest.approx(3.0 * (6.0**2 - 0.0), rel=1e-3)


def test_gaps_are_filled_from_their_neighbours_and_that_is_said(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    z = np.full((50, 50), 2.0)
    z[20:23, 20:23] = np.nan
    z[:, 40:] = 5.0
    filled, _ = GridFile(file=_npz(tmp_path, z=z, spacing=1.0)).add(make_grid((20.0, 20.0), 1.0), _rng())
    # Cubic splines ring by a thousandth at the step far off.
    np.testing.assert_allclose(filled, 0.0, atol=5e-3)
    assert "9 of 2500 heights are unknown" in caplog.text


def test_a_terrain_larger_than_its_file_is_refused(tmp_path: Path) -> None:
    path = _npz(tmp_path, z=np.zeros((50, 80)), spacing=1.0)
    with pytest.raises(ValueError, match=r"grid\.npz covers 79 x 49 m: a terrain that fits in it is wanted"):
        GridFile(file=path).add(make_grid((79.0, 60.0), 1.0), _rng())


@pytest.mark.parametrize(
    ("arrays", "complaint"),
    [
        ({"z": np.zeros((5, 5))}, "spacing wanted, the file has not got it"),
        ({"heights": np.zeros((5, 5))}, "spacing and z wanted, the file has not got it"),
        ({"z": np.zeros((5, 5)), "spacing": [1.0, 2.0]}, "one spacing and an origin of two numbers wanted"),
        ({"z": np.zeros((5, 5)), "spacing": 0.0}, r"spacing must be positive, got 0\.0 m"),
        ({"z": np.zeros(5), "spacing": 1.0}, r"a grid of at least 2 x 2 heights wanted, got shape \(5,\)"),
        ({"z": np.full((5, 5), np.nan), "spacing": 1.0}, "a grid of at least 2 x 2 heights wanted"),
        ({"z": np.array([["a", "b"]]), "spacing": 1.0}, r"not a readable \.npz of numbers"),
    ],
)
def test_a_grid_file_without_what_it_takes_is_refused(
    tmp_path: Path, arrays: dict[str, object], complaint: str
) -> None:
    with pytest.raises(ValueError, match=complaint):
        GridFile(file=_npz(tmp_path, **arrays)).add(make_grid((2.0, 2.0), 0.5), _rng())


@pytest.mark.parametrize(("name", "kind"), [("broken.npz", r"\.npz of numbers"), ("broken.tif", "raster")])
def test_a_file_that_is_something_else_is_refused(tmp_path: Path, name: str, kind: str) -> None:
    (tmp_path / name).write_bytes(b"not a grid at all")
    with pytest.raises(ValueError, match=f"not a readable {kind}"):
        GridFile(file=tmp_path / name).add(GRID, _rng())


def test_a_file_that_is_not_there_is_refused() -> None:
    with pytest.raises(ValueError, match=r"terrain file nowhere\.npz given, there is no such file"):
        GridFile(file=Path("nowhere.npz")).add(GRID, _rng())


def _geotiff(path: Path, crs: str, transform: tuple[float, ...], z: np.ndarray) -> Path:
    import rasterio

    profile = {"driver": "GTiff", "height": z.shape[0], "width": z.shape[1], "count": 1, "dtype": "float64"}
    with rasterio.open(path, "w", crs=crs, transform=rasterio.Affine(*transform), nodata=-9999.0, **profile) as file:
        file.write(z, 1)
    return path


def test_a_geotiff_has_its_north_up(tmp_path: Path) -> None:
    north = np.linspace(10.0, 0.0, 41)[:, None] + np.zeros((1, 61))
    path = _geotiff(tmp_path / "a.tif", "EPSG:32630", (2.0, 0.0, 5e5, 0.0, -2.0, 5e6), north)
    grid = make_grid((40.0, 40.0), 1.0)
    z, _ = GridFile(file=path).add(grid, _rng())
    np.testing.assert_allclose(z, 0.125 * grid.y[:, None] + 0 * z, atol=1e-6)


def test_a_geotiff_in_degrees_is_refused(tmp_path: Path) -> None:
    path = _geotiff(tmp_path / "a.tif", "EPSG:4326", (1e-5, 0.0, 7.0, 0.0, -1e-5, 50.0), np.zeros((9, 9)))
    with pytest.raises(ValueError, match="a grid in degrees given, one in metres wanted: project it first"):
        GridFile(file=path).add(GRID, _rng())


def test_a_geotiff_of_oblong_cells_is_refused(tmp_path: Path) -> None:
    path = _geotiff(tmp_path / "a.tif", "EPSG:32630", (1.0, 0.0, 5e5, 0.0, -2.0, 5e6), np.zeros((9, 9)))
    with pytest.raises(ValueError, match=r"square cells with north up wanted, got 1\.0 x 2\.0 m"):
        GridFile(file=path).add(GRID, _rng())
