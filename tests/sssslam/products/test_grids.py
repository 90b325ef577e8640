"""Tests of grids as files."""

from pathlib import Path

import numpy as np
import pytest
import rasterio
from rasterio.crs import CRS
from rasterio.transform import Affine

from frontend.georeference import Georeference
from sssslam.products.grids import format_geotiff, read_geotiff, read_terrain

Z = np.array([[1.0, 2.0, np.nan], [4.0, 5.0, 6.0]])  # south row first
GRID = (0.5, (100.0, 200.0))


def write(path: Path, georeference: Georeference | None = None) -> Path:
    path.write_bytes(format_geotiff({"height [m]": Z, "sigma [m]": Z / 10}, *GRID, georeference))
    return path


def test_gdal_finds_each_height_at_its_place(tmp_path: Path) -> None:
    with rasterio.open(write(tmp_path / "z.tif", Georeference(58.0, 11.0))) as file:
        assert file.descriptions == ("height [m]", "sigma [m]")
        assert file.crs is not None
        values = [v[0] for v in file.sample([(100.0, 200.0), (101.0, 200.5), (100.5, 200.0)])]
        assert values == [1.0, 6.0, 2.0]
        assert file.bounds == (99.75, 199.75, 101.25, 200.75)
        assert np.isnan(file.nodata)


def test_the_crs_leads_to_the_right_place_on_the_earth(tmp_path: Path) -> None:
    from pyproj import Transformer

    georeference = Georeference(58.0, 11.0)
    with rasterio.open(write(tmp_path / "z.tif", georeference)) as file:
        to_earth = Transformer.from_crs(file.crs.to_wkt(), 4326, always_xy=True)
    longitude, latitude = to_earth.transform(100.0, 200.0)
    expected = georeference.to_geographic([100.0], [200.0])
    assert latitude == pytest.approx(float(expected[0][0]), abs=1e-9)
    assert longitude == pytest.approx(float(expected[1][0]), abs=1e-9)


def test_reading_gives_the_grid_back(tmp_path: Path) -> None:
    (height, sigma), crs = read_geotiff(write(tmp_path / "z.tif"))
    np.testing.assert_array_equal(height.z, Z)
    np.testing.assert_allclose(sigma.z, Z / 10, rtol=1e-7)
    assert (height.spacing, height.origin) == (0.5, (100.0, 200.0))
    assert crs is None


def test_the_same_grid_gives_the_same_bytes() -> None:
    grids = [format_geotiff({"z": Z}, *GRID, Georeference(58.0, 11.0)) for _ in range(2)]
    assert grids[0] == grids[1]


def test_nodata_of_a_foreign_file_is_unknown(tmp_path: Path) -> None:
    profile = {"driver": "GTiff", "width": 2, "height": 1, "count": 1, "dtype": "float32", "nodata": -9999.0}
    with rasterio.open(tmp_path / "z.tif", "w", transform=Affine(2, 0, 0, 0, -2, 0), **profile) as file:
        file.write(np.array([[[-9999.0, 3.0]]], dtype=np.float32))
    np.testing.assert_array_equal(read_terrain(tmp_path / "z.tif").z, [[np.nan, 3.0]])


def test_a_turned_grid_is_refused(tmp_path: Path) -> None:
    profile = {"driver": "GTiff", "width": 2, "height": 2, "count": 1, "dtype": "float32"}
    with rasterio.open(tmp_path / "z.tif", "w", transform=Affine.rotation(30), **profile) as f:
        f.write(np.zeros((1, 2, 2), dtype=np.float32))
    with pytest.raises(ValueError, match="north up with square cells is wanted, got the transform"):
        read_geotiff(tmp_path / "z.tif")


def test_a_file_that_is_no_geotiff_is_refused(tmp_path: Path) -> None:
    (tmp_path / "z.tif").write_text("no")
    for name in ("z.tif", "none.tif"):
        with pytest.raises(ValueError, match="a GeoTIFF is wanted, cannot read it"):
            read_geotiff(tmp_path / name)


def test_an_archive_is_read_with_its_origin(tmp_path: Path) -> None:
    np.savez(tmp_path / "z.npz", z=Z, spacing=0.5, origin=[100.0, 200.0])
    terrain = read_terrain(tmp_path / "z.npz")
    np.testing.assert_array_equal(terrain.z, Z)
    assert (terrain.spacing, terrain.origin) == (0.5, (100.0, 200.0))


def test_the_frame_of_the_terrain_must_be_that_of_the_run(tmp_path: Path) -> None:
    path = write(tmp_path / "z.tif", Georeference(58.0, 11.0))
    crs = read_geotiff(path)[1]
    assert read_terrain(path, crs).spacing == 0.5
    with pytest.raises(ValueError, match=r"must be in the frame of the run \(EPSG:32633\), got \+proj=tmerc"):
        read_terrain(path, CRS.from_epsg(32633))


@pytest.mark.parametrize("missing", ["z", "spacing", "origin"])
def test_an_archive_that_lacks_something_is_refused(tmp_path: Path, missing: str) -> None:
    values = {"z": Z, "spacing": 0.5, "origin": [0.0, 0.0]}
    np.savez(tmp_path / "z.npz", **{name: value for name, value in values.items() if name != missing})
    with pytest.raises(ValueError, match=r"an \.npz with z\[north, east\], spacing and origin is wanted"):
        read_terrain(tmp_path / "z.npz")


def test_a_file_that_is_no_archive_is_refused(tmp_path: Path) -> None:
    (tmp_path / "z.npz").write_text("no")
    with pytest.raises(ValueError, match="spacing and origin is wanted"):
        read_terrain(tmp_path / "z.npz")


def test_an_archive_that_is_no_grid_is_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "z.npz", z=Z[0], spacing=0.5, origin=[0.0, 0.0])
    with pytest.raises(ValueError, match=r"z must be a grid and spacing positive, got shape \(3,\) and 0.5 m"):
        read_terrain(tmp_path / "z.npz")
