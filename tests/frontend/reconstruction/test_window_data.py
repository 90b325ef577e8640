"""A window in its own frame: poses, raster, and echoes averaged to bins."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from frontend.bottom import Bottom
from frontend.radiometry import Radiometry
from frontend.reconstruction.window_data import BinModel, WindowData, beams_and_bins, join, raster_of, window_data
from frontend.recording import Quantity, Recording, SonarGeometry
from frontend.trajectory import Trajectory
from frontend.windows import Window
from tests.frontend.reconstruction.small_window import make_tables

N, M = 12, 400
TABLES = replace(make_tables(), noise=np.array([0.5, 0.25]))
MODEL = BinModel(Radiometry(Quantity.AMPLITUDE, 1.0, TABLES), looks_most=6.0, blur=0.0)


def make_recording(yaw: float = 0.0) -> Recording:
    """Twelve pings half a metre apart along a heading, arms 0.2 m out, echoes all 4."""
    along, zero = 0.5 * np.arange(N), np.zeros(N)
    rng = np.random.default_rng(1)
    track = Trajectory(
        along + 100.0,
        7.0 + along * np.cos(yaw),
        -3.0 + along * np.sin(yaw),
        zero - 30.0,
        rng.normal(0, 0.05, N),
        rng.normal(0, 0.05, N),
        zero + yaw,
    )
    echoes = np.full((N, M), 2.0, dtype=np.float32)
    nothing = np.full(N, np.nan)
    sonar = SonarGeometry(lever_arm_port=(0.0, 0.2, 0.0), lever_arm_starboard=(0.0, -0.2, 0.0))
    return Recording(
        echoes, echoes.copy(), np.full(N, 0.1), np.full(N, 1500.0), track, nothing, nothing, nothing, sonar=sonar
    )


def make_data(recording: Recording, window: Window | None = None) -> WindowData:
    n = recording.n_pings
    bottom = Bottom(np.full((n, 2), 12.0), np.full(n, 12.0), 1.0)
    radiometry = Radiometry(Quantity.AMPLITUDE, 1.0, make_tables())
    return window_data(recording, window or Window(0, 2, 10, 6), bottom, radiometry)


@given(st.floats(-3.1, 3.1))
def test_the_anchor_is_the_origin_of_a_level_frame_along_its_heading(yaw: float) -> None:
    recording = make_recording(yaw)
    data = make_data(recording)
    T_anchor = recording.trajectory_dr.poses[6]
    np.testing.assert_array_equal(data.T_world_submap[:3, 3], T_anchor[:3, 3])
    np.testing.assert_allclose(data.T_submap_pings[4][:3, 3], 0.0, atol=1e-12)
    np.testing.assert_allclose(data.T_world_submap @ data.T_submap_body, T_anchor, atol=1e-12)
    # the pings run along x through the anchor, half a metre apart
    np.testing.assert_allclose(data.T_submap_pings[:, 0, 3], 0.5 * (np.arange(8) - 4), atol=1e-12)
    np.testing.assert_allclose(data.T_submap_pings[:, 1:3, 3], 0.0, atol=1e-12)


def test_port_is_first_and_lies_at_positive_y() -> None:
    data = make_data(make_recording(yaw=2.0))
    assert (data.sensors[:, 0, 1] > 0.19).all()
    assert (data.sensors[:, 1, 1] < -0.19).all()


def test_a_windows_arrays_are_its_pings() -> None:
    recording = make_recording()
    recording.port[2:10, 5] = np.arange(8)
    data = make_data(recording)
    np.testing.assert_array_equal(data.intensity[:, 0, 5], np.arange(8) ** 2)  # amplitudes
    assert data.intensity.shape == (8, 2, M)
    assert data.slant_range_max == pytest.approx(40.0)


@pytest.mark.parametrize("spacing", [0.5, 1.0, 3.0])
def test_the_raster_holds_transducers_and_swath(spacing: float) -> None:
    data = make_data(make_recording(yaw=0.3))
    raster = raster_of(data, spacing)
    ends = [raster.origin[k] + spacing * (n - 1) for k, n in enumerate((raster.n_x, raster.n_y))]
    reach = np.sqrt(40.0**2 - 6.0**2)
    assert raster.origin[1] < -reach < reach < ends[1]
    assert raster.origin[0] < data.sensors[..., 0].min() < data.sensors[..., 0].max() < ends[0]
    np.testing.assert_allclose(np.array(raster.origin) / spacing, np.round(np.array(raster.origin) / spacing))


def test_a_raster_that_fits_in_no_memory_is_refused() -> None:
    with pytest.raises(ValueError, match=r"cells of 0\.001 m given, at most 2e\+07 wanted: larger cells"):
        raster_of(make_data(make_recording()), 1e-3)


def test_the_mean_of_equal_echoes_is_their_value() -> None:
    _beams, bins = beams_and_bins(make_data(make_recording()), 0.5, 2, MODEL)
    seen = bins.looks > 0
    assert bins.intensity.shape == (4, 2, 80)
    np.testing.assert_allclose(bins.intensity[seen], 4.0)
    # what lies before 0.6 of the first bottom return says nothing: 7.2 m
    assert not seen[:, :, : int(7.0 / 0.5)].any()
    assert seen[:, :, int(7.5 / 0.5) :].all()
    np.testing.assert_array_equal(bins.floor, np.repeat([[0.5], [0.25]], 80, axis=1))


def test_looks_add_up_to_the_most_a_bin_may_count() -> None:
    _, bins = beams_and_bins(make_data(make_recording()), 0.5, 2, MODEL)
    # ten samples of one look: 1 / (1 / 10 + 1 / 6)
    np.testing.assert_allclose(bins.looks[:, :, 40], 3.75)
    _, wide = beams_and_bins(make_data(make_recording()), 4.0, 8, MODEL)
    assert 5.8 < wide.looks[0, 0, 5] < 6.0


def test_samples_that_are_missing_do_not_count() -> None:
    recording = make_recording()
    # bin 40 has its middle at 20.25 m; samples 0.1 m apart weigh 0.6, 0.8, 1, 0.8, 0.6, their neighbours the rest of 5
    recording.port[:, 200:203] = np.nan
    recording.starboard[:, 200:205] = np.nan
    _, bins = beams_and_bins(make_data(recording), 0.5, 2, MODEL)
    np.testing.assert_allclose(bins.intensity[:, 0, 40], 4.0)
    np.testing.assert_allclose(bins.looks[:, :, 40], np.tile([1 / (1 / 5.2 + 1 / 6), 1 / (1 / 2.4 + 1 / 6)], (4, 1)))
    np.testing.assert_array_equal(bins.looks[:, 1, 38], bins.looks[:, 0, 38])
    assert np.isfinite(bins.intensity).all()


def test_sides_are_not_mixed() -> None:
    recording = make_recording()
    recording.starboard[:] = 3.0
    _, bins = beams_and_bins(make_data(recording), 0.5, 2, MODEL)
    np.testing.assert_allclose(bins.intensity[:, 0, 20:], 4.0)
    np.testing.assert_allclose(bins.intensity[:, 1, 20:], 9.0)


def test_lines_are_of_whole_groups_of_pings_and_look_to_both_sides() -> None:
    beams, _ = beams_and_bins(make_data(make_recording()), 0.5, 3, MODEL)
    assert len(beams.forward) == 2  # eight pings make two whole groups of three
    np.testing.assert_array_equal(beams.side[:, 1], -beams.side[:, 0])


def test_a_line_of_one_ping_has_its_pose() -> None:
    data = make_data(make_recording())
    beams, _ = beams_and_bins(data, 0.5, 1, MODEL)
    np.testing.assert_array_equal(beams.sensor, data.sensors)
    np.testing.assert_allclose(beams.forward, data.T_submap_pings[:, :3, 0], rtol=1e-14)
    np.testing.assert_allclose(beams.up, data.T_submap_pings[:, :3, 2], rtol=1e-14)


@pytest.mark.parametrize("group", [1, 2, 3, 4])
def test_a_line_of_several_pings_looks_from_their_mean_place(group: int) -> None:
    data = make_data(make_recording())
    beams, _ = beams_and_bins(data, 0.5, group, MODEL)
    n = len(data.sensors) // group * group
    # pings half a metre apart: whatever is grouped, lines together stand where the pings stood together
    np.testing.assert_allclose(beams.sensor.mean(axis=0), data.sensors[:n].mean(axis=0), atol=1e-12)
    np.testing.assert_allclose(np.diff(beams.sensor[:, 0, 0]), 0.5 * group, atol=0.02)
    for axis in (beams.forward, beams.side, beams.up):
        np.testing.assert_allclose(np.linalg.norm(axis, axis=-1), 1.0)


def test_blur_is_added_to_echo_and_model_alike() -> None:
    data = make_data(make_recording())
    _, plain = beams_and_bins(data, 0.5, 2, MODEL)
    _, blurred = beams_and_bins(data, 0.5, 2, replace(MODEL, blur=0.1))
    np.testing.assert_allclose((blurred.intensity - plain.intensity)[:, :, 20:], 0.4)
    np.testing.assert_allclose(blurred.floor - plain.floor, 0.4)


def test_pings_of_different_sample_spacing_meet_in_the_same_bins() -> None:
    recording = make_recording()
    recording.port[:, 250:] = 6.0
    recording.sample_spacing[5:] = 0.05
    recording.port[5:] = 2.0
    _, bins = beams_and_bins(make_data(recording), 0.5, 4, MODEL)
    # 25 to 40 m is heard by the three first pings of the window only
    np.testing.assert_allclose(bins.intensity[0, 0, 60:], 36.0)
    assert (bins.looks[1, :, 41:] == 0).all()


def test_a_noise_floor_over_range_is_read_at_the_bins() -> None:
    over_range = np.stack([np.arange(260.0), 2 * np.arange(260.0)])  # knots every 0.25 m
    model = replace(MODEL, radiometry=replace(MODEL.radiometry, noise_floor=over_range))
    _, bins = beams_and_bins(make_data(make_recording()), 0.5, 2, model)
    np.testing.assert_allclose(bins.floor[:, 40], [81.0, 162.0])  # 20.25 m


def test_the_silent_tail_says_nothing() -> None:
    recording, radiometry = make_recording(), Radiometry(Quantity.AMPLITUDE, 1.0, make_tables())
    last = np.tile([299, 399], (N, 1))
    bottom = Bottom(np.full((N, 2), 12.0), np.full(N, 12.0), 1.0, last_usable_sample=last)
    data = window_data(recording, Window(0, 2, 10, 6), bottom, radiometry)
    assert np.isfinite(data.intensity[:, 0, :300]).all()
    assert np.isnan(data.intensity[:, 0, 300:]).all()
    assert np.isfinite(data.intensity[:, 1]).all()


def test_joined_windows_lie_in_the_frame_of_the_first_as_they_lie_in_the_world() -> None:
    recording = make_recording(yaw=0.7)
    first, second = make_data(recording, Window(0, 0, 5, 2)), make_data(recording, Window(1, 5, 12, 8))
    both = join([first, second])
    assert both.n_pings == (5, 7)
    np.testing.assert_array_equal(both.T_world_submap, first.T_world_submap)
    in_world = np.concatenate([w.T_world_submap @ w.T_submap_pings for w in (first, second)])
    np.testing.assert_allclose(both.T_world_submap @ both.T_submap_pings, in_world, atol=1e-12)
    np.testing.assert_allclose(both.T_world_submap @ both.T_submap_pings, recording.trajectory_dr.poses, atol=1e-12)
    np.testing.assert_array_equal(both.intensity, np.concatenate([first.intensity, second.intensity]))


@given(st.integers(1, 12), st.integers(1, 11))
def test_no_line_averages_pings_of_two_windows(group: int, cut: int) -> None:
    recording = make_recording()
    parts = [make_data(recording, Window(0, 0, cut, 0)), make_data(recording, Window(1, cut, N, cut))]
    beams, bins = beams_and_bins(join(parts), 0.5, group, MODEL)
    assert len(bins.intensity) == cut // group + (N - cut) // group
    alone = [beams_and_bins(part, 0.5, group, MODEL)[0] for part in parts]
    moved = [len(a.sensor) for a in alone]
    np.testing.assert_allclose(beams.sensor[: moved[0]], alone[0].sensor, atol=1e-12)
    np.testing.assert_allclose(np.diff(beams.sensor[moved[0] :], axis=0), np.diff(alone[1].sensor, axis=0), atol=1e-12)
