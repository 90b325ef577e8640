"""Verification: a dense check of a candidate, how well two submaps agree there."""

from dataclasses import dataclass

import numpy as np

from frontend.arrays import FloatArray
from frontend.chance import pooled, significance
from frontend.frames import planar_parameters
from frontend.overlap import Layers, correlate_at
from frontend.registration import RegistrationConfig, align_roughly, register
from frontend.relief import Relief


@dataclass(frozen=True)
class Verification:
    """What a dense comparison says of a candidate.

    Parameters
    ----------
    T_target_source : ndarray, shape (4, 4)
        The refined transform.
    sigmas : ndarray, shape (6,)
        Its standard deviations in the target frame [rad, rad, rad, m, m, m].
    correlation, significance : float
        Of the reliefs over the overlap [1], and in standard deviations above chance: fewer where a few boulders carry
        the correlation.
    reflectivity_correlation, reflectivity_significance : float
        The same of the reflectivities, a second witness.
    overlap : float
        Share of the smaller submap that the other covers [1].
    overlap_area, correlation_area, reflectivity_area : float
        Area compared, and how much of it tells one independent thing of relief and of reflectivity [m^2].
    height_residual : float
        Root-mean-square height difference after offset and tilt [its standard deviations].
    tilt : float
        Slope left between the two surfaces [1].
    middle : ndarray, shape (2,)
        Middle of the overlap in the source's frame [m].
    """

    T_target_source: FloatArray
    sigmas: FloatArray
    correlation: float
    significance: float
    reflectivity_correlation: float
    reflectivity_significance: float
    overlap: float
    overlap_area: float
    correlation_area: float
    reflectivity_area: float
    height_residual: float
    tilt: float
    middle: FloatArray

    @property
    def level(self) -> float:
        """Significance of both witnesses together [standard deviations above chance]."""
        return float(pooled(np.array(self.significance), np.array(self.reflectivity_significance)))


def verify(
    target: Layers, source: Layers, T_target_source: FloatArray, config: RegistrationConfig | None = None
) -> Verification:
    """Refine a candidate and measure how well the two submaps agree there.

    Parameters
    ----------
    target, source : Layers
        The two submaps.
    T_target_source : ndarray, shape (4, 4)
        The candidate.
    config : RegistrationConfig, optional
        Steps and floors of the refinement.

    Returns
    -------
    verification : Verification
        Numbers only; what they are worth is decided in `frontend.loop_closures`.
    """
    registration = register(target, source, T_target_source, config)
    overlap = registration.overlap
    area = joint_area(target.relief, source.relief)
    area_r = joint_reflectivity_area(target.relief, source.relief)
    return Verification(
        T_target_source=registration.T_target_source,
        sigmas=registration.sigmas,
        correlation=overlap.correlation,
        significance=_significance(overlap.correlation, overlap.area, area * overlap.concentration),
        reflectivity_correlation=overlap.reflectivity_correlation,
        reflectivity_significance=_significance(overlap.reflectivity_correlation, overlap.area, area_r),
        overlap=overlap.share,
        overlap_area=overlap.area,
        correlation_area=area,
        reflectivity_area=area_r,
        height_residual=registration.height_residual,
        tilt=float(np.hypot(*registration.tilt)),
        middle=overlap.middle,
    )


@dataclass(frozen=True)
class Preview:
    """A candidate roughly aligned, for choosing between several.

    Parameters
    ----------
    T_target_source : ndarray, shape (4, 4)
        Where it came to rest.
    significance : float
        Of the correlations there, of relief or of both witnesses [standard deviations above chance].
    """

    T_target_source: FloatArray
    significance: float


def preview(
    target: Layers, source: Layers, T_target_source: FloatArray, config: RegistrationConfig | None = None
) -> Preview:
    """Align a candidate roughly and see how significant it is; `verify` takes the chosen one further.

    Parameters
    ----------
    target, source : Layers
        The two submaps.
    T_target_source : ndarray, shape (4, 4)
        The candidate.
    config : RegistrationConfig, optional
        Steps of the refinement.

    Returns
    -------
    preview : Preview
        The alignment by part of the cells, judged by all of them.
    """
    T = align_roughly(target, source, T_target_source, config)
    return Preview(T, significance_at(target, source, T)[0])


def significance_at(target: Layers, source: Layers, T_target_source: FloatArray) -> tuple[float, float]:
    """How significant two submaps agree at a transform, by relief or by both witnesses.

    Parameters
    ----------
    target, source : Layers
        The two submaps.
    T_target_source : ndarray, shape (4, 4)
        The transform; taken as it is.

    Returns
    -------
    significance, area : float
        Standard deviations above chance, and the area compared [m^2].
    """
    correlation, correlation_r, times, area = correlate_at(target, source, planar_parameters(T_target_source))
    by_shape = _significance(correlation, area, joint_area(target.relief, source.relief) * times)
    by_echo = _significance(correlation_r, area, joint_reflectivity_area(target.relief, source.relief))
    return float(pooled(np.array(by_shape), np.array(by_echo))), area


def joint_area(target: Relief, source: Relief) -> float:
    """Floor that tells one independent thing about two reliefs together.

    Parameters
    ----------
    target, source : Relief
        The two reliefs.

    Returns
    -------
    area : float
        Geometric mean of their correlation areas [m^2], an upper bound of the integral of the product of the two
        autocorrelations (Cauchy-Schwarz).
    """
    return float(np.sqrt(target.correlation_area * source.correlation_area))


def joint_reflectivity_area(target: Relief, source: Relief) -> float:
    """Floor that tells one independent thing about two reflectivities together.

    Parameters
    ----------
    target, source : Relief
        The two submaps.

    Returns
    -------
    area : float
        As `joint_area` of the reliefs [m^2].
    """
    return float(np.sqrt(target.reflectivity_correlation_area * source.reflectivity_correlation_area))


def _significance(correlation: float, overlap_area: float, correlation_area: float) -> float:
    """Significance of one correlation."""
    return float(significance(np.array(correlation), np.array(overlap_area), correlation_area))
