"""What a reconstruction by itself leaves: submaps and two figures."""

import os
from collections.abc import Sequence
from pathlib import Path

from frontend.arrays import FloatArray
from frontend.recording import Recording
from frontend.submaps import Submap
from sssslam.products.figure_recording import draw_waterfall
from sssslam.products.figure_submaps import choose_submaps, draw_submaps
from sssslam.products.files import staged
from sssslam.products.ply import format_ply
from sssslam.products.write import OWNED


def write_shape(
    recording: Recording, submaps: Sequence[Submap], first_bottom_return: FloatArray, out: str | os.PathLike[str]
) -> None:
    """Write submaps, at their dead-reckoned poses, with a figure of some of them and one of the recording.

    Parameters
    ----------
    recording : Recording
        What the submaps were made of.
    submaps : sequence of Submap
        The submaps.
    first_bottom_return : ndarray, shape (N, 2)
        Slant range of the first echo from the seafloor, port and starboard [m].
    out : path-like
        The folder; products of an earlier run in it are replaced or removed.

    Raises
    ------
    ValueError
        If the folder cannot be made.
    """
    with staged(Path(out), OWNED, last="figures/waterfall.png") as stage:
        (stage / "submaps").mkdir()
        (stage / "figures").mkdir()
        for submap in submaps:
            content = format_ply(submap, submap.T_world_submap_dr)
            (stage / "submaps" / f"{submap.number:04d}.ply").write_bytes(content)
        if submaps:
            drawn = draw_submaps(choose_submaps(submaps, ()), recording.truth)
            (stage / "figures" / "submaps.png").write_bytes(drawn)
        (stage / "figures" / "waterfall.png").write_bytes(draw_waterfall(recording, first_bottom_return))
