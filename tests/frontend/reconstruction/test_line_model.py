"""Lambert's law on lines: known brightness, exact derivatives."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from frontend.arrays import FloatArray
from frontend.reconstruction.line_image import LineImage
from frontend.reconstruction.line_model import LineModel, make_model
from frontend.reconstruction.line_operators import beam_knots
from frontend.reconstruction.lines import LineFrames
from frontend.reconstruction.neighbours import local_planes
from tests.frontend.reconstruction.small_lines import make_lines, make_window, rough


def make_small(pitch: float = 0.1, turn: float = 0.02) -> tuple[LineFrames, LineImage, LineModel]:
    """Eight turning, pitching lines with a rough relief's neighbours and a stretch of shadow."""
    frames, image = make_lines(make_window(n=32, pitch=pitch, turn=turn), 2.0)
    dark = image.is_shadow.copy()
    dark[3:5, 6:10] = True
    image = replace(image, is_shadow=dark)
    beam, _ = beam_knots(frames, image.angle, 0.1, 3.0)
    return frames, image, make_model(frames, image, local_planes(frames, rough(frames), 6), beam, 2.0)


def state(frames: LineFrames, model: LineModel, seed: int = 0) -> FloatArray:
    """Rough relief, patchy reflectivity, a beam pattern that is off."""
    rng = np.random.default_rng(seed)
    n = model.n_cells
    return np.concatenate(
        [rough(frames, seed).ravel(), 0.1 * rng.normal(size=n), 0.1 * rng.normal(size=model.size - 2 * n)]
    )


@pytest.mark.parametrize("pitch", [0.0, 0.2, -0.15])
def test_a_flat_floor_has_amplitude_one(pitch: float) -> None:
    frames, _, model = make_small(pitch=pitch, turn=0.0)
    flat = model.linearise(np.zeros(model.size)).amplitude.reshape(frames.shape)
    # neighbours are places on a rough relief, but a level floor under it has no departure from level
    np.testing.assert_allclose(flat[2:-2, np.abs(frames.cell) > 1], 1.0, atol=0.03)


def test_brightness_is_lamberts_law_for_a_patch_turned_by_hand() -> None:
    frames, image, model = make_small(pitch=0.0, turn=0.0)
    x = np.zeros(model.size)
    slope = 0.2
    x[: model.n_cells] = np.broadcast_to(slope * frames.cell, frames.shape).ravel()
    found = model.linearise(x).amplitude.reshape(frames.shape)[4]
    u, down = frames.cell, frames.vertical[4] - slope * frames.cell
    normal = np.array([-slope, 1.0]) / np.hypot(1, slope)
    to_sonar = np.stack([-u, down], axis=1) / np.hypot(u, down)[:, None]
    cosine = to_sonar @ normal
    lit = cosine > 0.3
    ground = 1 / np.sqrt(1 - cosine**2)
    seen = cosine * np.sqrt(ground) / image.scale[4]
    # the ends of a line have one neighbour, the soft edges of cosine and sine count below 0.1
    inner = lit & (np.abs(u) > 4) & (np.abs(u) < 36)
    assert inner.sum() > 15
    np.testing.assert_allclose(found[inner], seen[inner], rtol=0.02)


def test_a_surface_tangent_to_the_beam_is_all_but_silent() -> None:
    frames, _, model = make_small(pitch=0.0, turn=0.0)
    x = np.zeros(model.size)
    # from 20 m out, straight on along the ray that comes in there
    u = np.abs(frames.cell)
    falling = np.where(u > 20, -(u - 20) * 10.0 / 20.0, 0.0)
    x[: model.n_cells] = np.broadcast_to(falling, frames.shape).ravel()
    amplitude = model.linearise(x).amplitude.reshape(frames.shape)[4]
    assert amplitude[(u > 23) & (u < 38)].max() < 0.05
    assert amplitude[(u > 5) & (u < 18)].min() > 0.9


@pytest.mark.parametrize("part", [0, 1, 2], ids=["relief", "reflectivity", "beam"])
def test_the_adjoint_is_the_derivative_for_frozen_neighbours(part: int) -> None:
    frames, _, model = make_small()
    x, rng = state(frames, model), np.random.default_rng(7)
    weight = rng.normal(size=model.n_cells)
    gradient = model.linearise(x).pull(weight)
    n = model.n_cells
    unknowns = (range(n), range(n, 2 * n), range(2 * n, model.size))[part]
    largest = np.abs(gradient[unknowns.start : unknowns.stop]).max()
    for k in rng.choice(unknowns, 25):
        step = np.zeros(model.size)
        step[k] = 1e-5
        up, down = (float(weight @ model.linearise(x + sign * step).amplitude) for sign in (1, -1))
        assert gradient[k] == pytest.approx((up - down) / 2e-5, abs=1e-6 * largest)


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 100))
def test_pull_is_the_adjoint_of_push(seed: int) -> None:
    frames, _, model = make_small()
    rng = np.random.default_rng(seed)
    linear = model.linearise(state(frames, model, seed))
    x, y = rng.normal(size=model.size), rng.normal(size=model.n_cells)
    assert float(y @ linear.push(x)) == pytest.approx(float(linear.pull(y) @ x), rel=1e-9)
