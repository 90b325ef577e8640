"""The one place that imports open3d, with the system libraries that its wheel does not bring."""

import ctypes
import importlib
from functools import cache
from types import ModuleType

import libusb_package

_APT_PACKAGES = {
    "libusb-1.0": "libusb-1.0-0",
    "libGL.so": "libgl1",
    "libEGL": "libegl1",
    "libX11": "libx11-6",
    "libgomp": "libgomp1",
}


@cache
def load_open3d() -> ModuleType:
    """Import open3d, its libusb taken from the ``libusb-package`` wheel.

    Returns
    -------
    open3d : module
        The imported package.

    Raises
    ------
    ImportError
        If a system library is missing; the message names the command that installs it.
    """
    library = libusb_package.get_library_path()
    if library is not None:
        ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)
    try:
        return importlib.import_module("open3d")
    except (ImportError, OSError) as error:
        raise ImportError(_advice(str(error))) from error


def _advice(message: str) -> str:
    """One line that names the missing library and the command that installs it."""
    packages = [package for library, package in _APT_PACKAGES.items() if library in message]
    if not packages:
        return (
            f"open3d cannot be imported ({message}); install it again: python -m pip install --force-reinstall open3d"
        )
    command = "apt-get install --no-install-recommends libegl1 libgl1 libusb-1.0-0"
    missing = [package for package in packages if package not in command]
    return f"open3d needs a system library ({message}); on Debian: {' '.join([command, *missing])}"
