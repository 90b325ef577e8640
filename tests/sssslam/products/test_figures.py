"""Tests of the figures: each kind of dive can be drawn, and the same dive gives the same picture."""

import io
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from PIL import Image

from frontend.heightfield import Heightfield
from frontend.recording import Quantity, Recording
from sssslam.products import figure_style as look
from sssslam.products.figure_recording import draw_waterfall
from sssslam.products.figure_submaps import choose_submaps, draw_submaps, true_surface
from sssslam.products.figure_tracks import count_reasons, draw_closure_scores, draw_tracks
from sssslam.products.figures import FIGURES, draw_figures
from sssslam.products.maps import blend_submaps
from sssslam.products.relief import exaggeration, hillshade
from sssslam.products.result import Result
from sssslam.products.run import read_run


def pixels(content: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(content)).convert("RGB")).astype(float)


def has_colour(content: bytes, colour: str) -> bool:
    wanted = np.array(matplotlib.colors.to_rgb(colour)) * 255
    return bool((np.abs(pixels(content) - wanted).max(axis=-1) < 6).any())


def test_every_figure_is_drawn(written: Path) -> None:
    assert {path.stem for path in (written / "figures").iterdir()} == set(FIGURES)
    for path in (written / "figures").iterdir():
        assert pixels(path.read_bytes()).std() > 5


def test_a_picture_names_no_software_and_no_date(written: Path) -> None:
    for path in (written / "figures").iterdir():
        assert set(Image.open(path).info) <= {"dpi"}


def test_the_same_run_gives_the_same_picture_whatever_the_users_settings(written: Path) -> None:
    once = draw_tracks(read_run(written), None)
    with matplotlib.rc_context({"font.size": 30, "lines.linewidth": 9, "savefig.bbox": "tight"}):
        assert draw_tracks(read_run(written), None) == once


def test_the_users_settings_stay(written: Path) -> None:
    with matplotlib.rc_context({"font.size": 30}):
        draw_tracks(read_run(written), None)
        assert matplotlib.rcParams["font.size"] == 30


def test_tracks_and_accepted_closures_have_their_colours(result: Result, written: Path) -> None:
    drawn = draw_tracks(read_run(written), None)
    for colour in (look.DEAD_RECKONED, look.CORRECTED, look.ACCEPTED):
        assert has_colour(drawn, colour)
    without = replace(read_run(written), loop_closures=tuple(c for c in result.loop_closures if not c.accepted))
    legend = pixels(draw_tracks(without, None)) - pixels(drawn)
    assert np.abs(legend).max() > 0


def test_a_dive_of_one_window_without_candidates_can_be_drawn(result: Result, written: Path) -> None:
    run = replace(read_run(written), loop_closures=(), sigmas=np.full((len(result.trajectory), 4), np.nan))
    bare = replace(result, submaps=(), loop_closures=(), T_world_submap=np.empty((0, 4, 4)))
    drawn = draw_figures(bare, run, blend_submaps((), bare.T_world_submap))
    assert set(drawn) == {"tracks", "waterfall"}


def test_submaps_of_the_best_closures_are_chosen_and_then_evenly(result: Result) -> None:
    chosen = [submap.number for submap in choose_submaps(result.submaps, result.loop_closures)]
    accepted = sorted((c for c in result.loop_closures if c.accepted), key=lambda c: (-c.n_inliers, c.target, c.source))
    assert {accepted[0].target, accepted[0].source} <= set(chosen)
    assert chosen == sorted(chosen)
    assert len(chosen) == 6
    assert [s.number for s in choose_submaps(result.submaps, ())][::5] == [0, result.submaps[-1].number]
    assert len(choose_submaps(result.submaps[:2], ())) == 2


def test_the_true_surface_of_a_perfect_submap_is_the_submap(result: Result) -> None:
    truth, submap = result.recording.truth, result.submaps[4]
    assert truth is not None
    assert truth.terrain is not None
    error = true_surface(submap, truth, truth.terrain).z - submap.surface.z
    scores = (error / submap.sigma)[submap.is_known]
    assert np.std(scores) == pytest.approx(1.0, abs=0.1)  # the builder's noise; some 1600 cells


def test_submaps_without_truth_have_three_columns(result: Result) -> None:
    alone, with_truth = (draw_submaps(result.submaps[:1], truth) for truth in (None, result.recording.truth))
    assert alone != with_truth


def quantity(recording: Recording, value: Quantity) -> Recording:
    return replace(recording, sonar=replace(recording.sonar, quantity=value))


def test_a_recording_of_any_quantity_and_with_holes_can_be_drawn(result: Result) -> None:
    recording = result.recording[:40]
    port = recording.port.copy()
    port[10:20] = np.nan
    drawn = [draw_waterfall(quantity(replace(recording, port=port), value)) for value in Quantity]
    assert len(set(drawn)) == len(drawn)


def test_a_silent_recording_can_be_drawn(result: Result) -> None:
    silent = replace(
        result.recording[:3], port=np.zeros((3, 200), np.float32), starboard=np.zeros((3, 200), np.float32)
    )
    assert draw_waterfall(silent)


def test_port_is_up_and_the_bottom_lies_on_its_edge(result: Result) -> None:
    n = 40
    dark, bright = (np.full((n, 200), v, np.float32) for v in (1.0, 100.0))
    recording = replace(quantity(result.recording[:n], Quantity.LOG), port=bright, starboard=dark)
    drawn = pixels(draw_waterfall(recording))
    height, width = drawn.shape[:2]
    assert drawn[height // 4, width // 2].sum() > drawn[3 * height // 4, width // 2].sum() + 100
    assert has_colour(draw_waterfall(recording, np.full((n, 2), 12.0)), "#56B4E9")


def test_reasons_that_differ_in_their_numbers_are_one_kind(result: Result) -> None:
    first, *others = (c for c in result.loop_closures if not c.accepted)
    closures = [replace(first, reason=f"inliers {n} below 8.5") for n in (2, 3)] + [replace(first, reason="flat")]
    assert count_reasons(closures) == {"inliers … below …": 2, "flat": 1}
    assert count_reasons([replace(first, reason="")]) == {"no reason given": 1}
    assert others


def test_many_kinds_of_reasons_can_be_drawn(result: Result) -> None:
    rejected = next(c for c in result.loop_closures if not c.accepted)
    kinds = [replace(rejected, reason=f"{letter} is wrong") for letter in "abcdefgh"]
    assert draw_closure_scores(kinds) != draw_closure_scores(kinds[:2])


def test_light_comes_from_the_north_west() -> None:
    x, y = np.meshgrid(np.arange(30.0), np.arange(30.0))
    towards, away = (Heightfield(sign * 0.5 * (x - y), 1.0, (0.0, 0.0)) for sign in (1.0, -1.0))
    assert hillshade(towards, 1.0)[15, 15] > 0.9
    assert hillshade(away, 1.0)[15, 15] < 0.5


def test_a_gentle_floor_is_steepened_and_a_steep_one_is_not() -> None:
    x, _ = np.meshgrid(np.arange(30.0), np.arange(30.0))
    factors = [exaggeration(Heightfield(slope * x, 1.0, (0.0, 0.0))) for slope in (0.0, 0.1, 1.0)]
    assert factors == pytest.approx([8.0, 3.5, 1.0])
    assert exaggeration(Heightfield(np.full((3, 3), np.nan), 1.0, (0.0, 0.0))) == 8.0


def test_thinning_keeps_means_and_places() -> None:
    x, y = np.meshgrid(np.arange(4000.0), np.arange(10.0))
    thinned = look.thin(Heightfield(x + y, 0.5, (7.0, 3.0)))
    assert max(thinned.z.shape) <= look.MAX_PIXELS
    assert thinned.spacing == 1.5
    assert thinned.z[0, 0] == pytest.approx(2.0)
    assert thinned.origin == (7.5, 3.5)


def test_means_of_blocks_leave_the_unknown_out() -> None:
    image = np.array([[1.0, np.nan, 5.0], [3.0, np.nan, np.nan]])
    np.testing.assert_array_equal(look.block_mean(image, (2, 2)), [[2.0, 5.0]])
    assert np.isnan(look.block_mean(np.full((2, 2), np.nan), (2, 2))).all()


def test_limits_differ_whatever_the_values_are() -> None:
    for values in (np.array([np.nan]), np.zeros(5), np.arange(100.0)):
        low, high = look.percentile_limits(values)
        assert high > low
