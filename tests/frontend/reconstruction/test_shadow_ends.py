"""Crest and end of a shadow lie on one ray from the sonar: found in echoes, and as rows over the cells of a raster."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from pydantic import ValidationError

from frontend.arrays import FloatArray
from frontend.reconstruction.forward import Raster
from frontend.reconstruction.measured_heights import MeasuredHeights, bilinear, rows_of, share_of_length
from frontend.reconstruction.posterior import Posterior
from frontend.reconstruction.shadow_ends import ShadowEnds, ShadowEndsConfig, find_shadow_ends, hear
from tests.frontend.reconstruction.small_window import make_posterior, make_scene

RASTER = Raster(81, 21, 1.0, (-10.0, -40.0))
LINE, PORT = 2, 0
SHARE, TAIL = 0.1, 20.0
FIRST, AFTER = 44, 53  # bins of half a metre: 22.0 to 26.5 m


def ends_of(crest: float, end: float, pitch: float = 0.0, advance: float = 0.0) -> ShadowEnds:
    """One shadow to port of a vehicle at the origin, 12 m above zero, heading along x."""
    one = np.ones(1)
    forward, outward = np.array([[1.0, 0.0]]), np.array([[0.0, 1.0]])
    motion = (np.tan(pitch) * one, advance * one, 0.0 * one)
    ranges = crest * one, end * one
    return ShadowEnds(np.array([[0.0, 0.0, 12.0]]), outward, forward, *motion, *ranges, one, SHARE, TAIL)


def lit(is_dark: slice | None = None, share: float = 0.0) -> Posterior:
    """Six lines over a floor as flat as they expect it, as bright as they expect it but for a dark stretch of one."""
    posterior, _ = make_posterior(relief=0.0)
    flat = posterior.origin()
    mu = posterior.predict(flat)
    echoes = mu.copy()
    if is_dark is not None:
        floor = posterior.bins.floor[PORT, is_dark]
        echoes[LINE, PORT, is_dark] = floor + share * (mu[LINE, PORT, is_dark] - floor)
    return replace(posterior, bins=replace(posterior.bins, intensity=echoes, looks=np.full(mu.shape, 4.0)))


def test_a_dark_stretch_between_lit_floor_is_found_from_its_first_bin_to_its_last() -> None:
    posterior = lit(slice(FIRST, AFTER))
    ends = find_shadow_ends(posterior, ShadowEndsConfig())
    assert len(ends) == 1
    # labels average half a metre, one bin
    np.testing.assert_allclose([ends.crest[0], ends.end[0]], [0.5 * FIRST, 0.5 * AFTER], atol=0.5)
    np.testing.assert_allclose(ends.sensor[0], posterior.beams.sensor[LINE, PORT])
    assert ends.outward[0] @ posterior.beams.side[LINE, PORT, :2] > 0.9


@pytest.mark.parametrize(
    ("is_dark", "share"),
    [
        (None, 0.0),  # nothing is dark
        (slice(FIRST, FIRST + 3), 0.0),  # too short
        (slice(FIRST, AFTER), 0.1),  # a slope that faces away: dark, not black
        (slice(FIRST, 60), 0.0),  # no end is seen
    ],
)
def test_what_is_no_whole_shadow_says_nothing(is_dark: slice | None, share: float) -> None:
    assert len(find_shadow_ends(lit(is_dark, share), ShadowEndsConfig())) == 0


def test_a_line_kept_aside_says_nothing() -> None:
    posterior = lit(slice(FIRST, AFTER))
    looks = posterior.bins.looks.copy()
    looks[LINE] = 0.0
    aside = replace(posterior, bins=replace(posterior.bins, looks=looks))
    assert len(find_shadow_ends(aside, ShadowEndsConfig())) == 0


def test_nothing_is_believed_where_the_configuration_says_so() -> None:
    assert len(find_shadow_ends(lit(slice(FIRST, AFTER)), ShadowEndsConfig(darkest=0.0))) == 0


@given(
    st.integers(10, 20),
    st.floats(0.5, 5.0),
    st.floats(-2.0, 2.0),
)
def test_a_ridge_and_the_floor_where_its_shadow_ends_fit_exactly(y: int, height: float, floor: float) -> None:
    z = np.full(RASTER.shape, floor)
    z[y + 40] = floor + height  # the row of cells at y
    down = 12.0 - floor
    y_end = y * down / (down - height)  # by similar triangles, in the plane athwart the track
    crest, end = np.hypot(y, down - height), np.hypot(y_end, down)
    assume(y + 1 < y_end < 39)  # on the raster, and off the flank of the ridge
    measured = ends_of(crest, end).crests(z, RASTER)
    np.testing.assert_allclose(measured.miss(z), 0.0, atol=1e-9)


def test_a_ridge_too_low_by_a_metre_misses_by_a_metre() -> None:
    z = np.zeros(RASTER.shape)
    z[40 + 15] = 2.0
    crest, end = np.hypot(15, 10), np.hypot(18, 12)
    measured = ends_of(crest, end).crests(z, RASTER)
    z[40 + 15] = 1.0
    np.testing.assert_allclose(measured.miss(z), -1.0, atol=1e-9)


def test_a_pitched_vehicle_sees_the_crest_ahead_or_astern_of_itself() -> None:
    z = np.zeros(RASTER.shape)
    level, nose_down = (ends_of(18.0, 22.0, pitch).crests(z, RASTER) for pitch in (0.0, 0.2))
    x = RASTER.origin[0] + RASTER.spacing * (np.arange(RASTER.n_cells) % RASTER.n_x)
    # nose down, the beam plane leans astern: 12 m down, less at the crest, times the tangent
    share = 18.0 / 22.0
    crest, end = -12.0 * share * np.tan(0.2), -12.0 * np.tan(0.2)
    np.testing.assert_allclose(level.weights @ x, 0.0, atol=1e-9)
    np.testing.assert_allclose(nose_down.weights @ x, crest - share * end, atol=1e-9)


def test_a_turning_vehicle_hears_the_crest_where_it_has_gone_to() -> None:
    still, moving = (
        ends_of(18.0, 22.0, 0.0, advance).crests(np.zeros(RASTER.shape), RASTER) for advance in (0.0, 0.01)
    )
    x = RASTER.origin[0] + RASTER.spacing * (np.arange(RASTER.n_cells) % RASTER.n_x)
    share = 18.0 / 22.0
    across = [np.sqrt(18.0**2 - (12.0 * share) ** 2), np.sqrt(22.0**2 - 12.0**2)]
    np.testing.assert_allclose(
        moving.weights @ x - still.weights @ x, 0.01 * (across[0] - share * across[1]), atol=1e-9
    )


def test_a_longer_line_of_neighbours_counts_no_more_than_its_length() -> None:
    posterior = lit(slice(FIRST, AFTER))
    near, far = (find_shadow_ends(posterior, ShadowEndsConfig(length=length)) for length in (1.0, 1000.0))
    assert far.precision[0] < 0.02 * near.precision[0]


@given(st.lists(st.tuples(st.floats(-60.0, 60.0), st.floats(-60.0, 60.0)), min_size=1, max_size=5))
def test_weights_add_up_to_one_and_give_back_a_plane_inside(places: list[tuple[float, float]]) -> None:
    cells, weights = bilinear(RASTER, np.array(places))
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)
    x, y = RASTER.origin[0] + np.arange(RASTER.n_x), RASTER.origin[1] + np.arange(RASTER.n_y)
    plane = (0.3 * x[None, :] - 0.2 * y[:, None]).ravel()
    held = np.clip(places, [x[0], y[0]], [x[-1] - 0.001, y[-1] - 0.001])
    np.testing.assert_allclose((weights * plane[cells]).sum(axis=1), held @ [0.3, -0.2], atol=1e-9)


def test_measurements_of_both_are_kept_in_order() -> None:
    def one(cell: int, height: float) -> MeasuredHeights:
        rows = rows_of(RASTER, np.array([[cell]]), np.ones((1, 1)))
        return MeasuredHeights(rows, np.array([height]), np.array([2.0]))

    z: FloatArray = np.arange(float(RASTER.n_cells)).reshape(RASTER.shape)
    np.testing.assert_allclose(one(3, 1.0).and_also(one(5, 9.0)).miss(z), [2.0, -4.0])


def test_a_share_of_one_is_refused() -> None:
    with pytest.raises(ValidationError, match="less than 1"):
        ShadowEndsConfig(darkest=1.0)


def test_a_posterior_that_hears_a_shadow_looks_for_an_object_where_its_crest_is() -> None:
    posterior = lit()
    ends = ends_of(18.0, 22.0)
    heard = hear(ends, posterior, np.zeros(posterior.raster.shape))
    crest = ends.crests(np.zeros(posterior.raster.shape), posterior.raster)
    assert len(heard.measured.height) == len(posterior.measured.height) + 1
    row, column = np.unravel_index(np.argmax(heard.standing), posterior.raster.shape)
    across = np.sqrt(18.0**2 - (12.0 * 18.0 / 22.0) ** 2)
    assert abs(posterior.raster.origin[1] + row * posterior.raster.spacing - across) <= 1.0
    assert abs(posterior.raster.origin[0] + column * posterior.raster.spacing) <= 1.0
    assert heard.standing.max() == pytest.approx(-SHARE * crest.miss(np.zeros(posterior.raster.shape))[0])


def test_a_shadow_that_the_surface_contradicts_counts_less() -> None:
    flat = np.zeros(RASTER.shape)
    ends = ends_of(18.0, 22.0)
    crests = ends.crests(flat, RASTER)
    squares = crests.precision * crests.miss(flat) ** 2
    np.testing.assert_allclose(ends.robust(crests, flat).precision, crests.precision / (1 + squares / TAIL))
    np.testing.assert_allclose(
        replace(ends, tail=float(squares[0])).robust(crests, flat).precision, 0.5 * crests.precision
    )


def test_a_crest_that_is_high_enough_asks_for_no_object() -> None:
    posterior = lit()
    heard = hear(ends_of(18.0, 22.0), posterior, np.full(posterior.raster.shape, 20.0))
    assert not heard.standing.any()


def test_lines_of_any_pitch_have_level_directions() -> None:
    _, _, _, beams, _ = make_scene(pitch=0.2)
    posterior = replace(lit(slice(FIRST, AFTER)), beams=beams)
    ends = find_shadow_ends(posterior, ShadowEndsConfig())
    np.testing.assert_allclose(np.hypot(*ends.forward.T), 1.0)
    np.testing.assert_allclose(np.hypot(*ends.outward.T), 1.0)
    np.testing.assert_allclose(ends.slope, np.tan(0.2), rtol=1e-6)


def test_a_single_line_counts_in_full() -> None:
    np.testing.assert_array_equal(share_of_length(np.zeros((1, 2)), 4.0), [1.0])


def test_lines_close_together_share_one_measurement() -> None:
    place = np.stack([0.4 * np.arange(5.0), np.zeros(5)], axis=1)
    np.testing.assert_allclose(share_of_length(place, 4.0), 0.1)
    np.testing.assert_allclose(share_of_length(place, 0.1), 1.0)
