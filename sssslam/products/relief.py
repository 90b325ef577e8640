"""Relief: a heightfield under a low light."""

import numpy as np

from frontend.arrays import FloatArray
from frontend.heightfield import Heightfield
from frontend.submaps import surface_normals

_LIGHT = np.array([-1.0, 1.0, 1.4]) / np.linalg.norm([-1.0, 1.0, 1.4])  # from the north-west, 45 deg high or so
_SHADED_SLOPE = 0.35  # the median slope is exaggerated to this tangent: a picture of full contrast
_MAX_EXAGGERATION = 8.0  # a flat floor stays flat, its ripple of noise is not made a mountain range


def exaggeration(surface: Heightfield) -> float:
    """The factor by which a shaded picture steepens a surface to show it.

    Parameters
    ----------
    surface : Heightfield
        Heights [m].

    Returns
    -------
    factor : float
        At least 1, at most 8.
    """
    normals = surface_normals(surface)
    slopes = np.hypot(normals[..., 0], normals[..., 1]) / normals[..., 2]
    known = slopes[np.isfinite(slopes)]
    typical = float(np.median(known)) if known.size else 0.0
    return float(np.clip(_SHADED_SLOPE / max(typical, 1e-9), 1.0, _MAX_EXAGGERATION))


def hillshade(surface: Heightfield, factor: float) -> FloatArray:
    """Brightness of a surface lit from the north-west.

    Parameters
    ----------
    surface : Heightfield
        Heights [m].
    factor : float
        Vertical exaggeration.

    Returns
    -------
    shade : ndarray, shape (n_y, n_x)
        From 0 (turned away) to 1 (facing the light); NaN where unknown.
    """
    normals = surface_normals(Heightfield(surface.z * factor, surface.spacing, surface.origin))
    return np.asarray(np.clip(normals @ _LIGHT, 0.0, 1.0))
