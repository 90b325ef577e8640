"""The map of the seafloor after the track is corrected: patches that all passes over them explain together."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from frontend.bottom import Bottom
from frontend.patches import patches
from frontend.radiometry import Radiometry
from frontend.reconstruction import ReconstructionConfig
from frontend.reconstruction.joint import JointConfig, reconstruct_together
from frontend.recording import Recording
from frontend.submaps import Submap
from frontend.threads import in_order
from frontend.windows import Window
from sssslam.watch import Watch


class MapConfig(BaseModel):
    """How the map is made of what was seen."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    method: Literal["blended", "together"] = Field(
        default="blended",
        description="blended: the submaps by their inverse variance; together: patch by patch, one surface by the "
        "method joint that explains the echoes of all passes; sharper, and about as long again as the submaps take.",
    )
    most_pings: int = Field(
        default=4000,
        ge=100,
        description="Pings [1] of a patch; where more look at it its shortest passes are left out, for memory.",
    )


def reconstruct_patches(
    recording: Recording,
    windows: Sequence[Window],
    known: tuple[Bottom, Radiometry],
    config: tuple[MapConfig, JointConfig],
    watch: Watch,
) -> list[Submap]:
    """Reconstruct the seafloor patch by patch, all passes over a patch together.

    Parameters
    ----------
    recording : Recording
        The dive; its track says how the passes lie to each other.
    windows : sequence of Window
        Pings that can be reconstructed.
    known : tuple of Bottom and Radiometry
        What was found for the whole dive.
    config : tuple of MapConfig and JointConfig
        Size of a patch, settings of the method.
    watch : Watch
        Told of progress.

    Returns
    -------
    submaps : list of Submap
        One a patch, numbered from 0, in frames of the recording's track; none where submaps are to be blended.
    """
    settings, joint = config
    if settings.method == "blended":
        return []
    found = patches(recording.trajectory_dr, windows, float(recording.slant_range_max.max()), settings.most_pings)
    submaps = in_order(lambda passes: reconstruct_together(recording, passes, *known, joint), found)
    return [replace(next(submaps), number=number) for number in watch.track("map", range(len(found)))]


def check_shape_method(config: MapConfig, reconstruction: ReconstructionConfig) -> None:
    """Refuse to call patches the work of another method than the one that makes them.

    Parameters
    ----------
    config : MapConfig
        Whether patches are wanted.
    reconstruction : ReconstructionConfig
        The method that is asked for.

    Raises
    ------
    ValueError
        If patches are wanted of a method that takes one pass at a time.
    """
    if config.method == "together" and reconstruction.method != "joint":
        raise ValueError(
            f"all passes together by the method {reconstruction.method} given; joint is wanted, or each pass alone: "
            f"{reconstruction.method} knows no second pass"
        )


def map_notes(submaps: Sequence[Submap]) -> tuple[str, ...]:
    """How the map was made, where it was not blended.

    Parameters
    ----------
    submaps : sequence of Submap
        What `reconstruct_patches` gave.

    Returns
    -------
    notes : tuple of str
        A sentence, or none.
    """
    return (f"Map of {len(submaps)} patches, each one surface for all passes over it.",) if submaps else ()
