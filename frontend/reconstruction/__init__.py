"""From echoes to seafloor shape: methods with one signature."""

from collections.abc import Callable
from dataclasses import replace
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from frontend.bottom import Bottom
from frontend.frames import invert, transform
from frontend.radiometry import Radiometry
from frontend.reconstruction import coiras, joint, woock
from frontend.reconstruction.calibration import calibrate
from frontend.reconstruction.coiras import CoirasConfig
from frontend.reconstruction.joint import JointConfig
from frontend.reconstruction.woock import WoockConfig
from frontend.recording import Recording
from frontend.submaps import Submap
from frontend.windows import Window

__all__ = ["CoirasConfig", "JointConfig", "Method", "ReconstructionConfig", "WoockConfig", "calibrate", "method_of"]

Method = Callable[[Recording, Window, Bottom, Radiometry], Submap]

# name of a method and of its section -> what does it
_METHODS: dict[str, Callable[..., Submap]] = {
    "coiras": coiras.reconstruct,
    "joint": joint.reconstruct,
    "woock": woock.reconstruct,
}


class ReconstructionConfig(BaseModel):
    """Which method, and its settings."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    method: Literal["coiras", "joint", "woock"] = Field(
        default="joint",
        description="joint: height and reflectivity by analysis by synthesis; coiras: lines stacked to an image; "
        "woock: lines in their true place in space.",
    )
    coiras: CoirasConfig = CoirasConfig()
    joint: JointConfig = JointConfig()
    woock: WoockConfig = WoockConfig()


def method_of(config: ReconstructionConfig) -> Method:
    """The configured method.

    Parameters
    ----------
    config : ReconstructionConfig
        Names the method and holds its settings.

    Returns
    -------
    method : callable
        Takes a recording, a window, the dive's bottom and radiometry; gives a Submap.
    """
    reconstruct, section = _METHODS[config.method], getattr(config, config.method)

    def reconstruct_with_track(recording: Recording, window: Window, bottom: Bottom, radiometry: Radiometry) -> Submap:
        submap = reconstruct(recording, window, bottom, radiometry, section)
        pings = recording.trajectory_dr.positions[submap.first_ping : submap.end_ping]
        return replace(submap, track=transform(invert(submap.T_world_submap_dr), pings))

    return reconstruct_with_track
