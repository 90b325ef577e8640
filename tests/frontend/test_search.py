from itertools import pairwise

import numpy as np
import pytest

from frontend import search as module
from frontend.frames import invert, planar_parameters, planar_pose
from frontend.priors import Prior
from frontend.relief import extract_relief
from frontend.search import SearchConfig, propose, search
from frontend.turning import TurnedRelief
from tests.frontend.seafloor_scenes import cut_submap, rippled_seafloor, rough_seafloor


def prior_at(x, y, yaw, sigma=8.0, sigma_yaw=0.035):
    return Prior(planar_pose(x, y, yaw), np.diag([1e-4, 1e-4, sigma_yaw**2, sigma**2, sigma**2, 1.0]))


def reliefs(seed, relative, error=0.06, seafloor=None):
    rng = np.random.default_rng(seed)
    seafloor = seafloor or rough_seafloor(rng)
    start = planar_pose(150.0, 150.0, 0.2)
    poses = (planar_parameters(start), planar_parameters(start @ planar_pose(*relative)))
    return [extract_relief(cut_submap(seafloor, pose, rng, k, error)) for k, pose in enumerate(poses)]


@pytest.mark.parametrize("turn", [0.0, 0.5, np.pi / 4, np.pi / 2, np.pi])
def test_the_best_peak_is_the_true_place_at_every_heading(turn):
    relative = (10.0, -15.0, turn)
    target, source = reliefs(int(10 * turn), relative)
    peaks = propose(target, source, prior_at(18.0, -9.0, turn + 0.03))
    x, y, yaw = planar_parameters(invert(planar_pose(*relative)) @ peaks[0].T_target_source)
    assert np.hypot(x, y) < 2.9  # the diagonal of a search cell
    assert abs(yaw) < 0.036
    assert peaks[0].significance > peaks[1].significance + 1.5


def test_peaks_lie_inside_the_gate_apart_and_in_order():
    target, source = reliefs(3, (10.0, -15.0, 0.3))
    prior = prior_at(12.0, -15.0, 0.3)
    peaks = propose(target, source, prior, SearchConfig(n_peaks=5))
    places = np.array([peak.T_target_source[:2, 3] for peak in peaks])
    assert len(peaks) == 5
    assert all(prior.admits(peak.T_target_source) for peak in peaks)
    assert all(a.significance >= b.significance for a, b in pairwise(peaks))
    apart = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
    assert apart[np.triu_indices(5, 1)].min() > 8.0


def test_a_truth_outside_the_gate_is_not_found():
    relative = (0.0, 40.0, 0.0)
    target, source = reliefs(4, relative)
    peaks = propose(target, source, prior_at(0.0, 0.0, 0.0, sigma=4.0))
    assert all(np.hypot(*(peak.T_target_source[:2, 3] - [0.0, 40.0])) > 10 for peak in peaks)


def test_no_peak_where_the_gate_holds_no_overlap():
    target, source = reliefs(5, (0.0, 0.0, 0.0))
    assert propose(target, source, prior_at(200.0, 0.0, 0.0)) == []


def test_ripples_have_peaks_one_wavelength_apart_nearly_as_good_as_the_first():
    target, source = reliefs(6, (3.0, 0.0, 0.0), error=0.02, seafloor=rippled_seafloor(wavelength=12.0))
    peaks = propose(target, source, prior_at(3.0, 0.0, 0.0))
    assert peaks[1].correlation > 0.9 * peaks[0].correlation


def test_the_same_input_gives_the_same_peaks():
    target, source = reliefs(7, (10.0, -15.0, 0.3))
    first, second = (propose(target, source, prior_at(12.0, -15.0, 0.3)) for _ in range(2))
    assert [p.significance for p in first] == [p.significance for p in second]
    assert all(np.array_equal(a.T_target_source, b.T_target_source) for a, b in zip(first, second, strict=True))


def test_peaks_overlap_as_much_as_is_asked():
    target, source = reliefs(8, (0.0, 60.0, 0.0))
    prior = prior_at(0.0, 60.0, 0.0, sigma=12.0)
    few, many = (propose(target, source, prior, SearchConfig(min_overlap=share, n_peaks=8)) for share in (0.6, 0.1))
    # tracks 60 m apart share 40 of 100 m; 60 % want them 40 m apart at most
    assert all(abs(peak.T_target_source[1, 3]) < 43 for peak in few)
    assert any(abs(peak.T_target_source[1, 3]) > 50 for peak in many)


def test_the_axes_that_partners_share_do_not_matter():
    relative = (10.0, -15.0, 0.5)
    target, source = reliefs(9, relative)
    config, prior = SearchConfig(), prior_at(18.0, -9.0, 0.53)
    for heading in (0.0, 1.1, -2.4):
        turned = [
            TurnedRelief(relief, yaw, config.yaw_step, config.search_spacing)
            for relief, yaw in ((target, heading), (source, heading + 0.51))
        ]
        best = search(*turned, prior)[0]
        x, y, yaw = planar_parameters(invert(planar_pose(*relative)) @ best.T_target_source)
        assert np.hypot(x, y) < 2.9  # the diagonal of a search cell
        assert abs(yaw) < 0.036


def test_shifts_are_admitted_as_the_gate_admits_poses():
    rng = np.random.default_rng(0)
    A = rng.normal(size=(6, 6))
    gate = module._gate(Prior(planar_pose(3.0, -2.0, 0.4), A @ A.T * 10 + np.eye(6), 2.0), 0.7)
    x, y, yaw = np.arange(-20.0, 21.0, 2.0), np.arange(-16.0, 17.0, 2.0), 0.9
    area = rng.uniform(0, 100, (len(y), len(x)))
    correlation, limits = rng.uniform(size=(2, *area.shape)), np.array([3.0, -2.0, 0.5, gate.prior.limit, 40.0])
    found = [np.empty((6, area.size)) for _ in range(2)]
    for f, out in zip((module._admitted, getattr(module._admitted, "py_func", module._admitted)), found, strict=True):
        n = f(correlation, area, x, y, gate.R, gate.information, limits, out)
    at = np.stack(np.meshgrid(x, y), axis=-1) @ gate.R
    inside = (gate.prior.squared_distance(at[..., 0], at[..., 1], yaw) <= gate.prior.limit) & (area >= 40.0)
    assert 0 < n == inside.sum() < (area >= 40.0).sum()
    expected = np.stack([*correlation, area, at[..., 0], at[..., 1]])[:, inside]
    for out in found:
        assert out[:5, :n] == pytest.approx(expected, abs=1e-12)
