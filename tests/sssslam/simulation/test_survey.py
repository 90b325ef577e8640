from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from frontend.arrays import FloatArray
from sssslam.simulation.dubins import dubins_path
from sssslam.simulation.survey import Lawnmower, Legs, Polyline, Star, join_legs
from sssslam.simulation.survey_curves import FigureOfEight, Spiral, TrackFile, read_track

RADIUS = 20.0
coordinate = st.floats(-100.0, 100.0)
yaw = st.floats(-np.pi, np.pi)


def _length(path: FloatArray) -> float:
    return float(np.hypot(*np.diff(path, axis=0).T).sum())


def _tightest(path: FloatArray) -> float:
    """Smallest radius of the circles through three points in a row."""
    a, b, c = path[:-2], path[1:-1], path[2:]
    sides = [np.hypot(*(p - q).T) for p, q in ((a, b), (b, c), (a, c))]
    area = 0.5 * np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    return float((sides[0] * sides[1] * sides[2] / (4 * np.maximum(area, 1e-12))).min())


@given(x=coordinate, y=coordinate, start=yaw, end=yaw)
def test_a_turn_leaves_and_arrives_as_asked_and_is_never_too_tight(
    x: float, y: float, start: float, end: float
) -> None:
    path = dubins_path((0.0, 0.0, start), (x, y, end), RADIUS, 0.5)
    assert path[0].tolist() == [0.0, 0.0]
    assert path[-1].tolist() == pytest.approx([x, y], abs=1e-6)
    assert np.hypot(*np.diff(path, axis=0).T).max() <= 0.5 + 1e-9
    assert _length(path) >= np.hypot(x, y) - 1e-6


@given(start=yaw, end=yaw, x=st.floats(90.0, 200.0))
def test_far_goals_are_reached_by_two_turns_at_most_and_a_straight(x: float, start: float, end: float) -> None:
    # Two half circles and the straight between are always enough.
    path = dubins_path((0.0, 0.0, start), (x, 0.0, end), RADIUS, 0.5)
    assert _length(path) <= x + 4 * np.pi * RADIUS


@pytest.mark.parametrize(
    ("end", "length"),
    [
        ((50.0, 0.0, 0.0), 50.0),
        ((0.0, 40.0, np.pi), np.pi * 20.0),
        ((20.0, 20.0, np.pi / 2), np.pi * 10.0),
        ((60.0, -40.0, 0.0), 2 * 20.0 * np.pi / 2 + 20.0),
    ],
)
def test_known_shortest_paths(end: tuple[float, float, float], length: float) -> None:
    path = dubins_path((0.0, 0.0, 0.0), end, RADIUS, 0.01)
    # An S between parallel headings 40 m apart is shorter than two quarter circles and a straight.
    assert _length(path) <= length + 1e-3
    assert _length(path) >= np.hypot(end[0], end[1]) - 1e-6
    if end[1] >= 0:
        assert _length(path) == pytest.approx(length, abs=1e-3)


def test_legs_are_flown_in_order_and_turns_keep_their_radius() -> None:
    path = Legs(legs=((-50.0, 0.0, 50.0, 0.0), (50.0, 30.0, -50.0, 30.0))).path(RADIUS)
    for point in ((-50.0, 0.0), (50.0, 0.0), (50.0, 30.0), (-50.0, 30.0)):
        assert np.hypot(*(path - point).T).min() < 1e-6
    # Chords of a quarter metre.
    assert _tightest(path) > 0.98 * RADIUS
    assert np.hypot(*np.diff(path, axis=0).T).min() > 1e-6


def test_a_lawnmower_flies_its_heading_back_and_forth() -> None:
    mower = Lawnmower(heading_deg=0.0, length=100.0, spacing=50.0, n_legs=3, n_ties=0, centre=(10.0, 20.0))
    path = mower.path(RADIUS)
    assert path[0].tolist() == pytest.approx([60.0, -30.0])
    assert path[-1].tolist() == pytest.approx([-40.0, 70.0])
    first = path[: int(100.0 / 0.25)]
    np.testing.assert_allclose(first[:, 0], 60.0, atol=1e-9)
    assert np.all(np.diff(first[:, 1]) > 0)


def test_tie_lines_cross_every_leg() -> None:
    path = Lawnmower(heading_deg=90.0, length=200.0, spacing=40.0, n_legs=4, n_ties=2).path(RADIUS)
    for x in (-200.0 / 6, 200.0 / 6):
        tie = path[np.abs(path[:, 0] - x) < 1e-6]
        assert (tie[:, 1].min(), tie[:, 1].max()) == pytest.approx((-100.0, 100.0), abs=0.3)


def test_every_leg_of_a_star_passes_its_centre() -> None:
    path = Star(centre=(5.0, 7.0), length=120.0, n_legs=4).path(RADIUS)
    near = np.hypot(*(path - [5.0, 7.0]).T) < 1.0
    assert np.count_nonzero(np.diff(near.astype(int)) == 1) == 4


def test_a_polyline_cuts_its_corners_with_turns() -> None:
    path = Polyline(points=((0.0, 0.0), (100.0, 0.0), (100.0, 100.0))).path(RADIUS)
    assert _tightest(path) > 0.98 * RADIUS
    # A quarter circle instead of the corner.
    assert _length(path) == pytest.approx(200.0 - 2 * RADIUS + 0.5 * np.pi * RADIUS, abs=0.05)


def test_points_of_a_polyline_on_one_spot_are_refused() -> None:
    with pytest.raises(ValueError, match=r"points at least 0\.25 m apart wanted, got two 0\.1 m apart"):
        Polyline(points=((0.0, 0.0), (0.1, 0.0)))


def test_a_spiral_widens_by_its_spacing_each_turn() -> None:
    path = Spiral(radius=30.0, spacing=10.0, n_turns=2.0, centre=(1.0, 2.0)).path(RADIUS)
    radius = np.hypot(*(path - [1.0, 2.0]).T)
    assert (radius[0], radius[-1]) == pytest.approx((30.0, 50.0))
    assert np.all(np.diff(radius) > 0)


def test_a_figure_of_eight_meets_itself_and_closes() -> None:
    path = FigureOfEight(radius=40.0, n_rounds=2).path(RADIUS)
    assert _length(path) == pytest.approx(2 * 2 * 2 * np.pi * 40.0, rel=1e-3)
    assert path[-1].tolist() == pytest.approx([0.0, 0.0], abs=1e-6)
    assert _tightest(path) > 39.0
    assert (path[:, 1].min(), path[:, 1].max()) == pytest.approx((-80.0, 80.0), abs=0.01)


@pytest.mark.parametrize("pattern", [Spiral(radius=10.0), FigureOfEight(radius=10.0)])
def test_curves_tighter_than_the_vehicle_turns_are_refused(pattern: Spiral | FigureOfEight) -> None:
    with pytest.raises(ValueError, match=r"of radius 10\.0 m given, the vehicle turns no tighter than 20\.0 m"):
        pattern.path(RADIUS)


def test_a_single_leg_is_a_straight_line() -> None:
    path = join_legs(np.array([[0.0, 0.0, 3.0, 4.0]]), RADIUS)
    assert _length(path) == pytest.approx(5.0)


def test_a_track_from_a_file_is_centred_and_scaled(tmp_path: Path) -> None:
    (tmp_path / "track.csv").write_text("t_s,x_m,y_m\n0,100,7\n1,200,7\n2,300,7\n", encoding="utf-8")
    path = TrackFile(file=tmp_path / "track.csv", scale=2.0, smoothing=0.5).path(RADIUS)
    assert (path[:, 0].min(), path[:, 0].max()) == pytest.approx((-200.0, 200.0), abs=1.0)
    np.testing.assert_allclose(path[:, 1], 0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", r"a header with x and y \(or x_m and y_m\) and two rows at least wanted"),
        ("x,y\n1,2\n", "two rows at least wanted"),
        ("lat,lon\n1,2\n3,4\n", "a header with x and y"),
        ("x,y\n1,2\n3,here\n", r"row 3: a number wanted, got 'here'"),
        ("x,y\n1,2\n3\n", r"row 3: a number wanted, got None"),
        ("x,y\n1,2\nnan,4\n", r"row 3: a number wanted, got 'nan'"),
    ],
)
def test_a_track_file_without_positions_is_refused(tmp_path: Path, text: str, complaint: str) -> None:
    path = tmp_path / "track.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=complaint):
        read_track(path)


def test_a_track_file_that_is_not_text_or_not_there_is_refused(tmp_path: Path) -> None:
    (tmp_path / "track.csv").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(ValueError, match="not a CSV text file"):
        read_track(tmp_path / "track.csv")
    with pytest.raises(ValueError, match=r"track file .*none\.csv given, there is no such file"):
        read_track(tmp_path / "none.csv")
