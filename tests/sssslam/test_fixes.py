"""Fixes at the surface: they hold a track that drifted, and one that is wrong bends nothing."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from backend.dead_reckoning import DeadReckoning, DeadReckoningConfig
from backend.do_no_harm import DoNoHarmConfig
from backend.sensor_reckoning import SensorReckoning
from frontend.georeference import Georeference
from frontend.heightfield import Heightfield
from frontend.recording import Recording
from frontend.submaps import Submap
from frontend.trajectory import Trajectory
from sssslam.config import Config
from sssslam.fixes import AnchorFix, Fixes, Rejection, fixes_at_anchors
from sssslam.graph import anchor_pings, make_graph, solve_at_fixes
from sssslam.stages import correct

N, STEP = 401, 50  # pings a metre and a second apart; every 50th is an anchor
TURN = 0.03  # rad: the track as recorded is turned by 1.5 standard deviations of the default heading bias
ANCHORS = np.arange(25, N, STEP)


def track(turn: float) -> Trajectory:
    """A straight line from the origin, 400 m at 1 m/s and 10 m depth."""
    s, zero = np.arange(float(N)), np.zeros(N)
    return Trajectory(1e9 + s, s * np.cos(turn), s * np.sin(turn), zero - 10.0, zero, zero, zero + turn)


def dive(seen: dict[int, tuple[float, float]], noise: float = 0.0) -> Recording:
    """A dive along x that was recorded turned, with fixes at some pings, off the truth by so much."""
    echo, known = np.ones((N, 1), dtype=np.float32), np.full(N, 1500.0)
    pings, off = np.array(sorted(seen), dtype=np.int64), np.reshape([seen[k] for k in sorted(seen)], (-1, 2))
    off = off + noise * np.random.default_rng(1).standard_normal(off.shape)
    truth = track(0.0)
    gnss = {"time": truth.time[pings], "position_x": truth.x[pings] + off[:, 0], "position_y": off[:, 1]}
    return Recording(echo, echo, known / 1e3, known, track(TURN), known, known, known, sensors={"gnss": gnss})


def submaps(trajectory_dr: Trajectory) -> list[Submap]:
    """Flat ones, for the sake of their anchors."""
    flat, no = np.zeros((4, 4)), np.zeros((4, 4), dtype=bool)
    floor = Heightfield(flat, 1.0, (-2.0, -2.0))
    T = trajectory_dr.poses[ANCHORS]
    return [
        Submap(k, p - 25, p + 26, int(p), trajectory_dr.time[p], T[k], np.eye(4), floor, flat + 0.1, flat, no)
        for k, p in enumerate(ANCHORS)
    ]


def solve(recording: Recording):
    """The corrected track and the fixes, as a run gives them."""
    config, parts = Config(), submaps(recording.trajectory_dr)
    reckoning = DeadReckoning(recording.ping_time, recording.trajectory_dr.poses, config.dead_reckoning)
    graph = make_graph(parts, (), reckoning, config)
    seen = fixes_at_anchors(recording, anchor_pings(parts), reckoning, config.do_no_harm)
    solution, fixes = solve_at_fixes(graph, seen, reckoning, config)
    return *correct(recording.trajectory_dr, parts, solution, reckoning), fixes


def errors(trajectory: Trajectory) -> np.ndarray:
    return np.hypot(trajectory.x - track(0.0).x, trajectory.y - track(0.0).y)


AT_THE_END = dict.fromkeys(range(N - 10, N), (0.0, 0.0))


def test_fixes_at_the_end_turn_the_track_back() -> None:
    recording = dive(AT_THE_END, noise=1.0)
    trajectory, sigmas, fixes = solve(recording)
    assert errors(recording.trajectory_dr)[-1] == pytest.approx(400.0 * 2 * np.sin(TURN / 2))  # 12 m
    # middle of ten fixes of 1 m, held against dead reckoning of some 10 m
    assert errors(trajectory)[-1] < 1.5
    # a turn about the start is what most of it is: the middle comes back too, but for what the walk may have done
    assert errors(trajectory)[N // 2] < 0.4 * errors(recording.trajectory_dr)[N // 2]
    # the constant error of the speed is added by the model of the sigmas: 1 % of 400 m
    assert np.hypot(*sigmas[-1, :2]) < 6.0
    assert fixes.counts == {"fixes": 10, "fixes_rejected": 0}
    assert fixes.notes == ("Fixes at the surface: 10 of 10 hold the track, at 1 of its anchors.",)


def test_a_perfect_track_is_not_bent_by_perfect_fixes() -> None:
    recording = replace(dive(AT_THE_END), trajectory_dr=track(0.0))
    trajectory, _, fixes = solve(recording)
    assert fixes.counts["fixes"] == 10
    np.testing.assert_allclose(trajectory.positions, track(0.0).positions, atol=1e-6)


def test_a_wild_fix_leaves_the_track_as_it_was_bit_for_bit() -> None:
    recording = dive({N - 1: (800.0, -300.0)})
    trajectory, sigmas, fixes = solve(recording)
    assert trajectory is recording.trajectory_dr
    np.testing.assert_array_equal(sigmas, solve(dive({}))[1])
    assert fixes.counts == {"fixes": 0, "fixes_rejected": 1}
    reason = "they lie farther off than dead reckoning can be wrong"
    assert fixes.notes == (f"Fixes at the surface: 0 of 1 hold the track, at 0 of its anchors; 1 rejected: {reason}.",)


def test_one_wild_fix_among_good_ones_is_the_only_one_rejected() -> None:
    recording = dive({**AT_THE_END, N - 5: (30.0, 40.0)}, noise=0.5)
    trajectory, _, fixes = solve(recording)
    assert errors(trajectory)[-1] < 1.5
    assert fixes.rejected == {str(Rejection.DISAGREES): 1}
    assert fixes.counts == {"fixes": 9, "fixes_rejected": 1}


def test_two_fixes_that_disagree_are_both_rejected() -> None:
    recording = dive({N - 2: (0.0, 0.0), N - 1: (60.0, 0.0)})
    trajectory, _, fixes = solve(recording)
    assert trajectory is recording.trajectory_dr
    assert fixes.rejected == {str(Rejection.DISAGREES): 2}


def test_the_middle_of_fixes_that_all_disagree_is_no_fix():
    _, _, fixes = solve(dive({N - 3: (0.0, 0.0), N - 2: (60.0, 0.0), N - 1: (130.0, 0.0)}))
    assert fixes.rejected == {str(Rejection.DISAGREES): 3}


def test_surfacings_that_contradict_one_another_are_told_apart_by_the_many() -> None:
    places = dict.fromkeys((225, 275, 375), (0.0, 0.0))
    trajectory, _, fixes = solve(dive({**places, 325: (0.0, 60.0)}))
    assert fixes.rejected == {str(Rejection.CONTRADICTS): 1}
    assert [fix.ping for fix in fixes.taken] == [225, 275, 375]
    assert errors(trajectory)[325] < 2.0


def test_of_two_surfacings_that_contradict_one_another_neither_is_believed() -> None:
    recording = dive({325: (0.0, 60.0), 375: (0.0, 0.0)})
    trajectory, _, fixes = solve(recording)
    assert fixes.rejected == {str(Rejection.CONTRADICTS): 2}
    assert trajectory is recording.trajectory_dr


def test_fixes_at_both_ends_of_a_perfect_track_agree() -> None:
    recording = replace(dive(dict.fromkeys((0, 1, N - 2, N - 1), (0.0, 0.0))), trajectory_dr=track(0.0))
    _, _, fixes = solve(recording)
    assert [fix.anchor for fix in fixes.taken] == [0, len(ANCHORS) - 1]
    assert fixes.counts == {"fixes": 4, "fixes_rejected": 0}


def test_a_fix_is_moved_to_its_anchor_by_dead_reckoning() -> None:
    recording = replace(dive({N - 1: (1.0, -2.0)}), trajectory_dr=track(0.0))
    config = DeadReckoningConfig()
    reckoning = DeadReckoning(recording.ping_time, recording.trajectory_dr.poses, config)
    (fix,) = fixes_at_anchors(recording, ANCHORS, reckoning, DoNoHarmConfig()).taken
    assert (fix.anchor, fix.ping) == (7, 375)
    np.testing.assert_allclose(fix.position, [375.0 + 1.0, -2.0], atol=1e-9)
    # 25 m of drift: the fix's own metre, the drift, and the heading of 0.02 rad and more over the arm
    drift = reckoning.drift_variances([375], [400])[0, :2].max()
    heading = (25.0 * reckoning.sigmas[400, 3]) ** 2
    assert fix.sigma**2 == pytest.approx(config.sensors.gnss_sd**2 + drift + heading)
    assert fix.sigma > 1.1


def test_the_way_from_a_fix_to_its_anchor_turns_with_the_track() -> None:
    trajectory, _, _ = solve(dive({N - 1: (0.0, 0.0)}))
    # 25 m from fix to anchor, recorded 0.03 rad off: 0.75 m at the end if the way had kept its direction
    assert errors(trajectory)[-1] < 0.4


def test_a_track_that_began_a_little_off_is_shifted_to_its_fixes() -> None:
    true, seen = track(0.0), dict.fromkeys((0, 1, N - 2, N - 1), (0.0, 0.0))
    trajectory, _, _ = solve(replace(dive(seen), trajectory_dr=replace(true, x=true.x - 2.0)))
    # its beginning is known to 1 m, as each fix is to 1 m and a little more: two against one take most of it
    assert 1.0 < np.median(trajectory.x - (true.x - 2.0)) < 2.0


def test_a_quarter_turn_of_a_fix_turns_its_arm_and_not_where_it_was_seen() -> None:
    fix = AnchorFix(1, 75, np.array([10.0, 20.0]), np.array([3.0, 0.0]), 1.0, 1)
    (turned,) = Fixes((fix,)).turned(np.array([0.0, np.pi / 2])).taken
    np.testing.assert_allclose(turned.position, [10.0, 23.0], atol=1e-12)


def test_fixes_in_degrees_are_as_good_as_those_in_metres() -> None:
    place, recording = Georeference(47.0, 8.0), dive(AT_THE_END)
    gnss = recording.sensors["gnss"]
    latitude, longitude = place.to_geographic(gnss["position_x"], gnss["position_y"])
    degrees = {"gnss": {"time": gnss["time"], "latitude": latitude, "longitude": longitude}}
    ours = solve(replace(recording, sensors=degrees, georeference=place))[0]
    np.testing.assert_allclose(ours.positions, solve(recording)[0].positions, atol=1e-3)


def test_a_track_from_the_sensors_has_taken_the_fixes_itself() -> None:
    reckoning = object.__new__(SensorReckoning)
    assert fixes_at_anchors(dive(AT_THE_END), ANCHORS, reckoning, DoNoHarmConfig()) == Fixes()


def test_a_dive_without_fixes_says_nothing_of_them() -> None:
    recording = replace(dive({}), sensors={})
    trajectory, _, fixes = solve(recording)
    assert trajectory is recording.trajectory_dr
    assert (fixes.counts, fixes.notes) == ({}, ())


@pytest.mark.parametrize(("n_left", "is_believed"), [(4, True), (2, True), (1, False), (0, False)])
def test_fixes_that_cost_most_of_the_loop_closures_are_rejected(
    monkeypatch: pytest.MonkeyPatch, n_left: int, is_believed: bool
) -> None:
    recording, config = dive(AT_THE_END), Config()
    reckoning = DeadReckoning(recording.ping_time, recording.trajectory_dr.poses, config.dead_reckoning)
    graph = make_graph(submaps(recording.trajectory_dr), (), reckoning, config)
    solved = [replace(graph.solve(), closure_weights=np.arange(4) < n) for n in (4, n_left, n_left)]
    monkeypatch.setattr("sssslam.graph.DiveGraph.solve", lambda _: solved.pop(0))
    before, _, after = solved
    seen = fixes_at_anchors(recording, ANCHORS, reckoning, config.do_no_harm)
    solution, fixes = solve_at_fixes(graph, seen, reckoning, config)
    assert solution is (after if is_believed else before)
    assert fixes.rejected == ({} if is_believed else {str(Rejection.AGAINST_CLOSURES): 10})


@settings(max_examples=10, deadline=None)
@given(east=st.floats(-300.0, 300.0), north=st.floats(-300.0, 300.0))
def test_a_fix_draws_the_track_towards_it_or_leaves_it_alone(east: float, north: float) -> None:
    recording = dive({N - 1: (east, north)})
    trajectory, _, fixes = solve(recording)
    place = np.array([N - 1 + east, north])
    after, before = (np.hypot(*(t.positions[-1, :2] - place)) for t in (trajectory, recording.trajectory_dr))
    assert after <= before
    assert (trajectory is recording.trajectory_dr) == (not fixes.taken)
