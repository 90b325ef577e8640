"""sssslam: from a side-scan sonar recording to a corrected track and a map of the seafloor."""

from importlib.util import find_spec as _find_spec
from pathlib import Path as _Path

_ROOM = _Path(__file__).resolve().parent.parent
for _name in ("frontend", "backend"):
    _spec = _find_spec(_name)
    _found = _Path(_spec.origin).resolve() if _spec and _spec.origin else None
    if _found is None or _found.parent.parent != _ROOM:
        raise ImportError(
            f"sssslam needs its own package {_name!r} from {_ROOM}, but Python finds {_found}; "
            "move or rename that one, or run from another folder"
        )

from frontend.features import Features
from frontend.loop_closures import LoopClosure
from frontend.recording import Quantity, Recording, SonarGeometry, Truth
from frontend.submaps import Submap
from frontend.trajectory import Trajectory
from sssslam.api import describe, reconstruct
from sssslam.config import Config, load_config
from sssslam.pipeline import Slam, slam
from sssslam.products.result import Result
from sssslam.readers import read
from sssslam.simulation import load_scene, simulate

__version__ = "0.1.0"

__all__ = [
    "Config",
    "Features",
    "LoopClosure",
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
    "reconstruct",
    "simulate",
    "slam",
]
