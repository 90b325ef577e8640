"""The local frame on the Earth: true north, metres, there and back."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj import Geod

from frontend.georeference import Georeference

latitudes, longitudes = st.floats(-80.0, 80.0), st.floats(-179.9, 179.9)
offsets = st.floats(-20e3, 20e3)


def test_the_origin_is_where_x_and_y_are_zero() -> None:
    x, y = Georeference(54.5, -1.25).to_local([54.5], [-1.25])
    np.testing.assert_allclose([x, y], 0.0, atol=1e-6)


def test_a_minute_of_latitude_is_a_nautical_mile_to_the_north() -> None:
    x, y = Georeference(45.0, 10.0).to_local([45.0 + 1 / 60], [10.0])
    assert abs(x[0]) < 1e-6
    # a minute of meridian at 45 degrees is 1852.2 m on WGS 84
    assert y[0] == pytest.approx(1852.2, abs=0.5)


def test_a_minute_of_longitude_shrinks_with_the_cosine_of_latitude() -> None:
    x, _ = Georeference(60.0, 10.0).to_local([60.0], [10.0 + 1 / 60])
    # radius of curvature 6394 km in the prime vertical at 60 degrees
    assert x[0] == pytest.approx(6394209 * np.cos(np.radians(60)) * np.radians(1 / 60), rel=1e-5)


@settings(deadline=None, max_examples=30)
@given(latitudes, longitudes, offsets, offsets)
def test_positions_come_back(latitude: float, longitude: float, x: float, y: float) -> None:
    place = Georeference(latitude, longitude)
    again = place.to_local(*place.to_geographic([x], [y]))
    # a nanodegree is a tenth of a millimetre
    np.testing.assert_allclose(np.ravel(again), [x, y], atol=1e-4)


@settings(deadline=None, max_examples=30)
@given(latitudes, longitudes, st.floats(0.0, 360.0), st.floats(1.0, 10e3))
def test_distance_and_true_bearing_are_those_of_the_ellipsoid(
    latitude: float, longitude: float, bearing: float, distance: float
) -> None:
    end_longitude, end_latitude, _ = Geod(ellps="WGS84").fwd(longitude, latitude, bearing, distance)
    x, y = Georeference(latitude, longitude).to_local([end_latitude], [end_longitude])
    # a transverse Mercator's scale error at 10 km from its meridian is (10 / 6371)^2 / 2 = 1.2e-6
    expected = distance * np.sin(np.radians(bearing)), distance * np.cos(np.radians(bearing))
    np.testing.assert_allclose([x[0], y[0]], expected, atol=distance * 3e-6 + 1e-5)


def test_the_reference_system_is_a_transverse_mercator_of_scale_one() -> None:
    crs = Georeference(54.5, -1.25).crs
    assert crs.is_projected
    assert crs.coordinate_operation is not None
    assert crs.coordinate_operation.method_name == "Transverse Mercator"
    parameters = {parameter.name: parameter.value for parameter in crs.coordinate_operation.params}
    assert parameters["Scale factor at natural origin"] == 1
    assert parameters["Latitude of natural origin"] == 54.5


def test_the_antimeridian_is_no_wall() -> None:
    x, _ = Georeference(10.0, 179.999).to_local([10.0], [-179.999])
    assert x[0] == pytest.approx(219.3, abs=0.5)  # 0.002 degrees of 109.6 km
