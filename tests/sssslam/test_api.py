"""The parts of the method alone, from Python."""

from dataclasses import replace

import numpy as np
import pytest

import sssslam
from frontend.bottom import Bottom, find_bottom
from frontend.radiometry import estimate_radiometry
from frontend.reconstruction import method_of
from frontend.recording import Quantity, Recording
from frontend.windows import Window
from sssslam.config import resolve
from tests.frontend.flat_floor import FlatFloor

FLOOR = FlatFloor(12.0 + 2.0 * np.sin(np.arange(80) / 15), strength=1e8)


@pytest.fixture(scope="module")
def recording() -> Recording:
    """A vehicle that rises and falls over a flat floor at z = -50."""
    recording = FLOOR.record(np.random.default_rng(1), Quantity.INTENSITY)
    track = replace(recording.trajectory_dr, z=FLOOR.altitude - 50.0)
    return replace(recording, trajectory_dr=track, altitude=FLOOR.altitude)


@pytest.fixture(scope="module")
def submap(recording: Recording) -> sssslam.Submap:
    """Its pings as one submap."""
    return sssslam.reconstruct(recording)


def test_pings_become_a_submap_at_the_middle_ping(recording: Recording, submap: sssslam.Submap) -> None:
    assert (submap.number, submap.first_ping, submap.end_ping, submap.anchor_ping) == (0, 0, 80, 40)
    assert submap.anchor_time == recording.ping_time[40]
    heights = submap.points[:, 2] + submap.T_world_submap_dr[2, 3]
    # half a bin, half a metre, on the whole; the echoes of this floor are drawn from the flat-floor formula
    assert heights.mean() == pytest.approx(-50.0, abs=0.25)
    assert heights.std() < 0.3


def test_a_part_of_a_recording_is_a_submap_of_its_own(recording: Recording) -> None:
    part = sssslam.reconstruct(recording[20:60], sssslam.load_config(settings=["reconstruction.joint.n_levels=1"]))
    assert part.anchor_time == recording.ping_time[40]


def test_the_cell_size_follows_the_configuration(recording: Recording) -> None:
    settings = ["reconstruction.joint.spacing=2.0", "reconstruction.joint.n_levels=1"]
    assert sssslam.reconstruct(recording, sssslam.load_config(settings=settings)).surface.spacing == 2.0


def test_features_of_a_submap_come_with_descriptors(submap: sssslam.Submap) -> None:
    features = sssslam.describe(submap)
    assert isinstance(features, sssslam.Features)


def test_a_floor_out_of_range_leaves_nothing_known(recording: Recording) -> None:
    config = resolve(sssslam.load_config(settings=["reconstruction.joint.n_levels=1"]), recording)
    window, n = Window(0, 0, recording.n_pings, recording.n_pings // 2), recording.n_pings
    radiometry = estimate_radiometry(recording, find_bottom(recording, config.bottom), config.radiometry)
    deep = Bottom(np.full((n, 2), 300.0), np.full(n, 300.0), 1.0)
    assert not method_of(config.reconstruction)(recording, window, deep, radiometry).is_known.any()


def test_silence_is_refused(recording: Recording) -> None:
    silent = np.zeros_like(recording.port)
    with pytest.raises(ValueError, match="the recording holds no echoes"):
        sssslam.reconstruct(replace(recording, port=silent, starboard=silent))


def test_one_broken_sample_does_not_spoil_the_submap(recording: Recording, submap: sssslam.Submap) -> None:
    port = recording.port.copy()
    port[50, 400] = np.inf
    broken = sssslam.reconstruct(replace(recording, port=port))
    # a bin of half a metre is known by ten looks there, nine are left
    change = broken.points[:, 2] - submap.points[:, 2]
    assert np.abs(change).max() < 0.25
    assert change.std() < 0.03


def test_every_public_name_is_there() -> None:
    for name in sssslam.__all__:
        assert getattr(sssslam, name) is not None
    assert dir(sssslam) == sorted(sssslam.__all__)


def test_a_name_that_is_not_public_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module 'sssslam' has no attribute 'slamm'"):
        sssslam.slamm  # noqa: B018
