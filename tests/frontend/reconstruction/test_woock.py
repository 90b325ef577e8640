"""The paper's method on simulated seafloors, which shares no renderer with them, and on a real dive."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from frontend.arrays import FloatArray
from frontend.bottom import Bottom, BottomConfig, find_bottom
from frontend.frames import transform
from frontend.radiometry import Radiometry, RadiometryConfig, estimate_radiometry
from frontend.reconstruction import WoockConfig
from frontend.reconstruction.woock import reconstruct
from frontend.recording import Recording
from frontend.submaps import Submap
from frontend.windows import Window
from sssslam.simulation import Scene, simulate

Floor = Callable[[FloatArray, FloatArray], FloatArray]
WOOCK = WoockConfig()
STILL = {"roll_deg": 0.0, "pitch_deg": 0.0, "yaw_deg": 0.0, "heave": 0.0}


class Seen(NamedTuple):
    """A submap beside the floor that was simulated, cell by cell: place in the submap, heights [m], true heights."""

    submap: Submap
    x: FloatArray
    y: FloatArray
    z: FloatArray
    truth: FloatArray

    def inside(self, across: float, along: float = 25.0) -> Any:
        """Known cells so far from the track at most, the ends of the line left out."""
        near = (np.abs(self.y) < across) & (np.abs(self.x) < along)
        return near & np.isfinite(self.z) & np.isfinite(self.truth)


def sound(folder: Path, floor: Floor, legs: list[list[float]] | None = None, **vehicle: Any) -> Recording:
    """A line of 60 m eastwards at z = -38, 12 m above the mean of a floor; 400 kHz, 45 m, single looks."""
    axis = np.arange(-80.0, 80.25, 0.25)
    z = np.broadcast_to(floor(axis[None, :], axis[:, None]), (axis.size, axis.size))
    np.savez(folder / "floor.npz", z=z, spacing=0.25, origin=[-80.0, -80.0])
    waves = {**STILL, **vehicle.pop("waves", {})}
    scene = {
        "seed": 4,
        "terrain": {
            "size": [150.0, 130.0],
            "depth": 50.0,
            "layers": [{"kind": "grid", "file": str(folder / "floor.npz")}],
        },
        "survey": {"pattern": "legs", "legs": legs or [[-30.0, 0.0, 30.0, 0.0]]},
        "drift": {"grade": "none"},
        "sonar": {"range_max": 45.0, "ping_rate": 4.0, "n_sub_beams": 1, "motion": "stop-and-hop"},
        "vehicle": {"keeping": "depth", "depth": 38.0, "waves": waves, **vehicle},
    }
    return simulate(Scene.model_validate(scene))


def flat_floor(x: FloatArray, y: FloatArray) -> FloatArray:
    return np.asarray(0.0 * (x + y))


def mounds(x: FloatArray, y: FloatArray) -> FloatArray:
    """Two mounds and a hollow off the track."""
    places = ((-8.0, 20.0, 1.5), (10.0, -18.0, 1.5), (5.0, 28.0, -1.0))
    return np.asarray(sum(h * np.exp(-((x - a) ** 2 + (y - b) ** 2) / 40) for a, b, h in places))


def whole(recording: Recording) -> Window:
    return Window(0, 0, recording.n_pings, recording.n_pings // 2)


def bottom_of(recording: Recording) -> Bottom:
    return find_bottom(recording, BottomConfig())


def see(recording: Recording, radiometry: Radiometry, config: WoockConfig = WOOCK) -> Seen:
    submap = reconstruct(recording, whole(recording), bottom_of(recording), radiometry, config)
    x, y = np.meshgrid(submap.surface.x, submap.surface.y)
    world = transform(submap.T_world_submap_dr, np.stack([x, y, submap.surface.z], axis=-1))
    assert recording.truth is not None
    assert recording.truth.terrain is not None
    return Seen(submap, x, y, world[..., 2], recording.truth.terrain.sample(world[..., 0], world[..., 1]))


@pytest.fixture(scope="module")
def flat(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    return sound(tmp_path_factory.mktemp("flat"), flat_floor)


@pytest.fixture(scope="module")
def radiometry(flat: Recording) -> Radiometry:
    """The sonar's, as found over the flat floor."""
    return estimate_radiometry(flat, bottom_of(flat), RadiometryConfig())


# Speckle: 18 looks a cell of 1 m or so, a twelfth of the amplitude; at 45 degrees of grazing half of that is slope, and
# the walk of such slopes over 30 cells is 0.2 m.
SPECKLE = 0.2


def test_a_flat_floor_is_flat_at_its_depth(flat: Recording, radiometry: Radiometry) -> None:
    seen = see(flat, radiometry)
    inside = seen.inside(40.0)
    assert inside.sum() > 3500
    error = (seen.z - seen.truth)[inside]
    assert abs(error.mean()) < SPECKLE
    assert error.std() < SPECKLE
    assert not seen.submap.is_shadow.any()


@pytest.mark.parametrize(
    "waves", [{"roll_deg": 8.0}, {"pitch_deg": 5.0}, {"heave": 0.4}], ids=["roll", "pitch", "heave"]
)
def test_a_flat_floor_stays_flat_under_motion(tmp_path: Path, waves: dict[str, float]) -> None:
    recording = sound(tmp_path, flat_floor, waves=waves)
    # a rolling sonar shows angles of its beam pattern that a level one hides
    seen = see(recording, estimate_radiometry(recording, bottom_of(recording), RadiometryConfig()))
    error = (seen.z - seen.truth)[seen.inside(40.0)]
    assert abs(error.mean()) < SPECKLE
    assert error.std() < SPECKLE


def test_relief_is_found_and_beats_a_flat_floor(tmp_path: Path, radiometry: Radiometry) -> None:
    seen = see(sound(tmp_path, mounds), radiometry)
    inside = seen.inside(40.0)
    error = (seen.z - seen.truth)[inside]
    assert error.std() < 0.7 * seen.truth[inside].std()
    assert np.corrcoef(seen.z[inside], seen.truth[inside])[0, 1] > 0.75
