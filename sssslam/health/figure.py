"""Figure of a recording's health: its waterfall with the bottom that was found drawn in."""

from pathlib import Path

from frontend.bottom import BottomConfig, find_bottom
from frontend.recording import Recording
from sssslam.products.figure_recording import draw_waterfall
from sssslam.products.files import atomic_write


def draw_health(recording: Recording, path: Path) -> None:
    """Draw the waterfall of a recording.

    Parameters
    ----------
    recording : Recording
        The recording.
    path : Path
        The PNG to write; its folder is made where it is missing.
    """
    try:
        returns = find_bottom(recording, BottomConfig()).first_bottom_return
    except ValueError:
        returns = None
    path.parent.mkdir(parents=True, exist_ok=True)
    atomic_write(path, draw_waterfall(recording, returns))
