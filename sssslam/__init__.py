"""sssslam: from a side-scan sonar recording to a corrected track and a map of the seafloor."""

from importlib import import_module as _import_module
from importlib.metadata import version as _version
from importlib.util import find_spec as _find_spec
from pathlib import Path as _Path
from typing import TYPE_CHECKING

_ROOM = _Path(__file__).resolve().parent.parent
for _name in ("frontend", "backend"):
    _spec = _find_spec(_name)
    _found = _Path(_spec.origin).resolve() if _spec and _spec.origin else None
    if _found is None or _found.parent.parent != _ROOM:
        raise ImportError(
            f"sssslam needs its own package {_name!r} from {_ROOM}, but Python finds {_found}; "
            "move or rename that one, or run from another folder"
        )


if TYPE_CHECKING:
    from frontend.features import Features
    from frontend.loop_closures import LoopClosure
    from frontend.recording import Quantity, Recording, SonarGeometry, Truth
    from frontend.submaps import Submap
    from frontend.trajectory import Trajectory
    from sssslam.api import describe, reconstruct
    from sssslam.config import Config, load_config
    from sssslam.online import Slam
    from sssslam.overrides import Overrides, read_overrides
    from sssslam.pipeline import slam
    from sssslam.products.result import Result
    from sssslam.readers import read
    from sssslam.simulation import load_scene, simulate

__version__ = _version("sssslam")

__all__ = [
    "Config",
    "Features",
    "LoopClosure",
    "Overrides",
    "Quantity",
    "Recording",
    "Result",
    "Slam",
    "SonarGeometry",
    "Submap",
    "Trajectory",
    "Truth",
    "describe",
    "load_config",
    "load_scene",
    "read",
    "read_overrides",
    "reconstruct",
    "simulate",
    "slam",
]

# where each name lives; loaded at first use, for the optimiser and the compilers take seconds
_HOMES = {
    "frontend.features": ("Features",),
    "frontend.loop_closures": ("LoopClosure",),
    "frontend.recording": ("Quantity", "Recording", "SonarGeometry", "Truth"),
    "frontend.submaps": ("Submap",),
    "frontend.trajectory": ("Trajectory",),
    "sssslam.api": ("describe", "reconstruct"),
    "sssslam.config": ("Config", "load_config"),
    "sssslam.overrides": ("Overrides", "read_overrides"),
    "sssslam.online": ("Slam",),
    "sssslam.pipeline": ("slam",),
    "sssslam.products.result": ("Result",),
    "sssslam.readers": ("read",),
    "sssslam.simulation": ("load_scene", "simulate"),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> object:
    if name not in _HOME_OF:
        raise AttributeError(f"module 'sssslam' has no attribute {name!r}")
    return getattr(_import_module(_HOME_OF[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
