"""The map of all passes together: what it covers, what it is made of, and that it is the map that a run writes."""

import numpy as np
import pytest

import sssslam
from frontend.reconstruction import ReconstructionConfig
from sssslam.mapping import MapConfig, check_shape_method
from sssslam.products.maps import blend_submaps
from sssslam.products.result import Result
from sssslam.products.run import read_run
from sssslam.simulation import Scene

SCENE = Scene.model_validate(
    {
        "seed": 4,
        "terrain": {"size": [240.0, 160.0], "depth": 60.0, "layers": [{"kind": "fractal", "rms": 0.5}]},
        "survey": {"pattern": "legs", "legs": [[-50.0, -12.0, 50.0, -12.0], [50.0, 15.0, -50.0, 15.0]]},
        "drift": {"grade": "none"},
        "sonar": {"range_max": 50.0},
    }
)
COARSE = ["reconstruction.joint.spacing=2.0", "reconstruction.joint.n_levels=1", "radiometry.n_rounds=0"]


@pytest.fixture(scope="module")
def together() -> Result:
    return sssslam.slam(sssslam.simulate(SCENE), sssslam.load_config(settings=[*COARSE, "map.method=together"]))


def test_patches_cover_what_submaps_cover(together: Result) -> None:
    blended = blend_submaps(together.submaps, together.T_world_submap).height
    frames = np.stack([patch.T_world_submap_dr for patch in together.patches])
    known = blend_submaps(together.patches, frames).height.sample(*np.meshgrid(blended.x, blended.y))
    covered = np.isfinite(known[np.isfinite(blended.z)])
    assert covered.mean() > 0.97  # rims of both are interpolated


def test_a_patch_is_made_of_passes_that_submaps_see_one_by_one(together: Result) -> None:
    assert [patch.number for patch in together.patches] == list(range(len(together.patches)))
    widest = max(np.ptp(patch.points[:, 1]) for patch in together.patches)
    assert widest > max(np.ptp(submap.points[:, 1]) for submap in together.submaps if _is_straight(submap))


def _is_straight(submap: sssslam.Submap) -> bool:
    return bool(np.ptp(submap.track[:, 1]) < 2.0)


def test_the_map_of_a_run_is_that_of_its_patches(together: Result, tmp_path_factory: pytest.TempPathFactory) -> None:
    out = tmp_path_factory.mktemp("run")
    together.write(out)
    frames = np.stack([patch.T_world_submap_dr for patch in together.patches])
    of_patches = blend_submaps(together.patches, frames).height
    written = read_run(out).seafloor
    np.testing.assert_allclose(written.z, of_patches.z, atol=1e-4)  # 32-bit floats
    assert together.timings["map"] > 0
    assert f"Map of {len(frames)} patches, each one surface for all passes over it." in together.notes


def test_patches_by_a_method_of_single_passes_are_refused_in_one_line() -> None:
    with pytest.raises(ValueError, match="together by the method woock given; joint is wanted"):
        check_shape_method(MapConfig(method="together"), ReconstructionConfig(method="woock"))


@pytest.mark.parametrize(("how", "method"), [("together", "joint"), ("blended", "woock")])
def test_patches_by_joint_and_passes_by_any_method_are_fine(how: str, method: str) -> None:
    check_shape_method(
        MapConfig.model_validate({"method": how}), ReconstructionConfig.model_validate({"method": method})
    )
