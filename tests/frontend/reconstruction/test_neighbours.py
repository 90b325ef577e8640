"""Local normals: planes are found exactly, on any track; neighbours are those a slow search finds."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from frontend.reconstruction.lines import frame_lines
from frontend.reconstruction.neighbours import local_planes, on_other_lines
from tests.frontend.reconstruction.small_lines import make_window, rough


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 1000), st.integers(2, 6), st.integers(1, 8))
def test_neighbours_are_the_nearest_points_of_other_lines(seed: int, n_lines: int, n_neighbours: int) -> None:
    rng = np.random.default_rng(seed)
    line = rng.integers(0, n_lines, 40)
    points = rng.normal(size=(40, 3))
    index, found = on_other_lines(points, line, n_neighbours)
    distance = np.linalg.norm(points[:, None] - points[None], axis=2)
    distance[line[:, None] == line[None]] = np.inf
    for k in range(40):
        n = min(n_neighbours, int(np.isfinite(distance[k]).sum()))
        assert found[k].sum() == n
        np.testing.assert_allclose(distance[k][index[k][found[k]]], np.sort(distance[k])[:n])


@pytest.mark.parametrize(("pitch", "turn"), [(0.0, 0.0), (0.2, 0.0), (0.0, 0.03), (-0.15, 0.04)])
def test_a_plane_has_its_slope_along_every_line_whatever_the_yaw_and_pitch(pitch: float, turn: float) -> None:
    frames = frame_lines(make_window(pitch=pitch, turn=turn, n=20), 0.5)
    gradient = np.array([0.08, -0.05])
    flat = frames.points(np.zeros(frames.shape))
    # relief that brings each cell up or down its own line's ``up`` onto the plane z = -10 + gradient . (x, y)
    short = flat[..., :2] @ gradient
    relief = short / (frames.up[:, None, 2] - frames.up[:, None, :2] @ gradient)
    np.testing.assert_allclose(frames.points(relief)[..., 2], -10 + frames.points(relief)[..., :2] @ gradient)
    planes = local_planes(frames, relief, 8)
    normal = np.array([-gradient[0], -gradient[1], 1.0])
    expected = -(frames.forward @ normal) / (frames.up @ normal)
    inner = np.zeros(frames.shape, dtype=bool)
    inner[3:-3, np.abs(frames.cell) < 8] = True  # half way to the centre of the turn, where lines are one
    along = (planes.along @ relief.ravel() + planes.along_0).reshape(frames.shape)
    departure = (planes.departure @ relief.ravel() + planes.departure_0).reshape(frames.shape)
    # the ridge adds 0.02 squared cells to a spread of at least 0.2
    wanted = np.broadcast_to(expected[:, None], frames.shape)
    np.testing.assert_allclose(along[inner], wanted[inner], rtol=0.1)
    np.testing.assert_allclose(departure[inner], 0.0, atol=0.02)


@pytest.mark.parametrize("pitch", [0.0, 0.2])
def test_a_level_floor_is_level_however_the_neighbours_lie(pitch: float) -> None:
    frames = frame_lines(make_window(pitch=pitch, turn=0.05, n=16), 0.5)
    planes = local_planes(frames, rough(frames), 8)
    known = np.isfinite(planes.distance)
    np.testing.assert_allclose(planes.along_0[known], np.tan(pitch), atol=1e-12)
    np.testing.assert_allclose(planes.departure_0, 0.0, atol=1e-12)


def test_planes_are_linear_in_the_relief_and_blind_to_a_common_rise() -> None:
    frames = frame_lines(make_window(turn=0.05, n=16), 0.5)
    planes = local_planes(frames, rough(frames), 8)
    ones = np.ones(frames.shape).ravel()
    np.testing.assert_allclose(planes.along @ ones, 0.0, atol=1e-9)
    np.testing.assert_allclose(planes.departure @ ones, 0.0, atol=1e-9)


def test_a_line_by_itself_has_no_slope_along_the_track() -> None:
    frames = frame_lines(make_window(n=1), 1.0)
    planes = local_planes(frames, rough(frames), 8)
    assert planes.along.nnz == 0 or np.abs(planes.along.data).max() == 0
    assert np.isinf(planes.distance).all()
    assert np.isfinite(planes.along_0).all()


def test_the_slope_is_that_of_the_fitted_normal_projected_off_the_across_direction() -> None:
    frames = frame_lines(make_window(pitch=0.1, turn=0.03, n=16), 0.5)
    relief = rough(frames)
    planes = local_planes(frames, relief, 8)
    along = planes.along @ relief.ravel() + planes.along_0
    cell = 7 * frames.shape[1] + 30
    points = frames.points(relief).reshape(-1, 3)
    line = np.repeat(np.arange(frames.shape[0]), frames.shape[1])
    index, _ = on_other_lines(points, line, 8)
    near = points[index[cell]] - points[cell]
    weight = 1 / ((near**2).sum(axis=1) + frames.spacing**2)
    axes = np.stack([frames.across[7], frames.forward[7], frames.up[7]])
    a, f, u = (near @ axes.T).T
    # ridge regression written as ordinary least squares with two rows more
    root, ridge = np.sqrt(weight), np.sqrt(0.02 * weight.sum()) * frames.spacing
    rows = np.vstack([np.stack([np.ones(8), a, f], axis=1) * root[:, None], [0, ridge, 0], [0, 0, ridge]])
    level = -frames.forward[7, 2] / frames.up[7, 2]
    plane = np.linalg.lstsq(rows, np.append((u - level * f) * root, [0, 0]), rcond=None)[0] + [0, 0, level]
    normal = axes.T @ np.array([-plane[1], -plane[2], 1.0])
    projected = normal - (normal @ frames.across[7]) * frames.across[7]
    assert along[cell] == pytest.approx(-(projected @ frames.forward[7]) / (projected @ frames.up[7]), rel=1e-9)
