"""Opening a page in the system's browser, where there is a display to see it on."""

import os
import sys
import webbrowser
from pathlib import Path

_DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")


def open_page(page: Path) -> bool:
    """Show a page in the system's browser.

    Parameters
    ----------
    page : Path
        The file.

    Returns
    -------
    is_shown : bool
        False where there is no display, so that no text browser takes the terminal, or no browser.
    """
    has_display = sys.platform in ("win32", "darwin") or any(os.environ.get(name) for name in _DISPLAYS)
    try:
        return has_display and webbrowser.open(page.resolve().as_uri())
    except (OSError, webbrowser.Error):
        return False
