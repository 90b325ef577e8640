"""Registration: sub-cell alignment of two submaps by robust weighted least squares, with an honest covariance."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from frontend.arrays import FloatArray, IntArray
from frontend.frames import planar_parameters, planar_pose
from frontend.overlap import Layers, Overlap, lay_over
from frontend.refiners import CloudConfig, Planar, refine_by_clouds
from frontend.sampling import Descent, descend


class RegistrationConfig(BaseModel):
    """How two submaps are aligned."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    refiner: Literal["relief", "small_gicp", "kiss_icp", "open3d_icp"] = Field(
        default="relief",
        description="What refines x, y, yaw: least squares over the reliefs; or, to compare, a library's registration "
        "of their points on one thread: open3d_icp 4 times, kiss_icp 7 times, small_gicp 30 times as slow.",
    )
    clouds: CloudConfig = CloudConfig()
    n_iterations: int = Field(default=12, gt=0, description="Most Gauss-Newton steps [1]; a true place needs six.")
    max_step: float = Field(
        default=1.0, gt=0, description="Longest shift of one step [m]: a cell, or the linearisation fails."
    )
    max_turn: float = Field(
        default=0.035, gt=0, description="Largest turn of one step [rad]: a cell at the edge of a submap."
    )
    tuning: float = Field(
        default=12.0,
        gt=0,
        description="Residuals [robust standard deviations] from which Tukey's weight is 0: wild ones only. Among "
        "boulders all that tells the place stands out of the floor between them.",
    )
    block: float = Field(
        default=12.0,
        gt=0,
        description="Side of the squares [m] whose errors count as independent: beyond the errors' reach.",
    )
    sigma_factor: float = Field(
        default=1.7,
        gt=0,
        description="Sigma of x and y against that of the residuals [1]: drift bends windows. Calibrated on simulated "
        "dives.",
    )
    sigma_factor_yaw: float = Field(
        default=1.4,
        gt=0,
        description="The same for the yaw [1], which a shift that all squares share does not turn.",
    )
    min_sigma: float = Field(
        default=0.1,
        ge=0,
        description="Least standard deviation of x and y [m]: a tenth of a cell, the interpolation's error.",
    )
    min_sigma_yaw: float = Field(
        default=0.005,
        ge=0,
        description="Least standard deviation of the yaw [rad]: drift of the heading inside a window.",
    )
    misalignment: float | None = Field(
        default=None,
        ge=0,
        description="Turn of the velocity against the heading sensor [rad]: it shears windows, a place far ahead of "
        "the anchor is put aside; left open, dead_reckoning.velocity_misalignment_sd says it.",
    )
    gauge_sigma: float = Field(
        default=0.3, ge=0, description="Standard deviation of a window's height offset [m], which echoes hardly fix."
    )
    gauge_tilt: float = Field(
        default=0.02, gt=0, description="Standard deviation of a window's tilt [rad], which echoes hardly fix."
    )

    @property
    def shear(self) -> float:
        """The misalignment [rad]; that of a usual mounting where nobody has filled it in."""
        return _USUAL_MISALIGNMENT if self.misalignment is None else self.misalignment

    @property
    def descent(self) -> Descent:
        """The steps as the kernel takes them."""
        return Descent(self.n_iterations, self.max_step, self.max_turn, _STILL, _STILL_TURN, self.tuning, _DAMPING)


_USUAL_MISALIGNMENT = 0.01  # [rad], 0.6 deg
_DAMPING = 0.2  # of the step by the slopes' errors: the common slopes alone are too weak where little is common
_STILL, _STILL_TURN = 3e-3, 1e-4  # [m], [rad] of a step that ends the iteration: a thirtieth of the least sigma
_ROUGHLY_STILL, _EDGE = 0.05, 50.0  # [m] of a step that is small against a cell, and how far out a submap's edge lies


@dataclass(frozen=True)
class Registration:
    """An alignment and how good it is.

    Parameters
    ----------
    T_target_source : ndarray, shape (4, 4)
        Level: yaw and shift. The height brings the surfaces together.
    sigmas : ndarray, shape (6,)
        Standard deviations in the target frame [rad, rad, rad, m, m, m]; infinite where nothing fixes the pose.
    tilt : ndarray, shape (2,)
        Slope along the source's x and y of what is left between the two surfaces [1].
    height_residual : float
        Root mean square of the height difference after offset and tilt [its standard deviations].
    overlap : Overlap
        The cells compared.
    """

    T_target_source: FloatArray
    sigmas: FloatArray
    tilt: FloatArray
    height_residual: float
    overlap: Overlap


def register(
    target: Layers, source: Layers, T_target_source: FloatArray, config: RegistrationConfig | None = None
) -> Registration:
    """Align two submaps, starting from a transform within about a relief wavelength of the truth.

    Parameters
    ----------
    target, source : Layers
        The two submaps.
    T_target_source : ndarray, shape (4, 4)
        Where to start.
    config : RegistrationConfig, optional
        Steps and floors.

    Returns
    -------
    registration : Registration
        x, y and yaw from the reliefs; height and tilt, the gauge of a reconstruction, from the heights.

    Notes
    -----
    With ``e = z_source - z_target(T p)`` the Jacobian of x, y, yaw is ``-[s_x, s_y, s_y u - s_x v]`` where ``s`` is the
    target's slope and ``(u, v)`` the turned source point: x and y are fixed by slope alone. The covariance is that of
    clustered errors, ``H^-1 (sum_b g_b g_b^T) H^-1`` with the score ``g_b`` of each square of the overlap, as errors of
    neighbouring cells are not independent. H is made of the slopes of both reliefs, ``J_target^T W J_source``: with one
    relief's alone the slopes of its errors would count as shape.
    """
    config = config or RegistrationConfig()
    if config.refiner == "relief":
        planar = _refine_by_relief(target, source, T_target_source, config)
    else:
        planar = refine_by_clouds((target, source), T_target_source, config.refiner, config.clouds)
    overlap = lay_over(target, source, planar)
    offset, tilt, height_residual = _gauge(overlap, config)
    sigmas = _sigmas(overlap, planar[2], config)
    return Registration(planar_pose(*planar, z=offset), sigmas, tilt, height_residual, overlap)


def align_roughly(
    target: Layers, source: Layers, T_target_source: FloatArray, config: RegistrationConfig | None = None
) -> FloatArray:
    """Align two submaps by a part of their cells: enough to choose between starts, at a part of the time.

    Parameters
    ----------
    target, source : Layers
        The two submaps.
    T_target_source : ndarray, shape (4, 4)
        Where to start.
    config : RegistrationConfig, optional
        Steps.

    Returns
    -------
    T_target_source : ndarray, shape (4, 4)
        Level: yaw and shift, to a fraction of a cell.
    """
    config = config or RegistrationConfig()
    descent = config.descent._replace(still=_ROUGHLY_STILL, still_turn=_ROUGHLY_STILL / _EDGE)
    return planar_pose(*_descend(target, source.thinned_cells, planar_parameters(T_target_source), descent))


def _refine_by_relief(target: Layers, source: Layers, T_start: FloatArray, config: RegistrationConfig) -> Planar:
    """x, y, yaw by Gauss-Newton steps over the reliefs."""
    return _descend(target, source.shape_cells, planar_parameters(T_start), config.descent)


def _descend(target: Layers, cells: FloatArray, start: Planar, descent: Descent) -> Planar:
    """Gauss-Newton steps over some of a source's cells."""
    return descend(target.shape, cells, (*target.relief.origin, target.relief.spacing), start, descent)


def _jacobians(overlap: Overlap, yaw: float) -> tuple[FloatArray, FloatArray]:
    """Derivatives by x, y, yaw of both reliefs at the source cells, each shape (K, 3)."""
    cosine, sine = np.cos(yaw), np.sin(yaw)
    u, v = cosine * overlap.x - sine * overlap.y, sine * overlap.x + cosine * overlap.y
    s_x, s_y = overlap.slope_source.T
    source = np.column_stack([cosine * s_x - sine * s_y, sine * s_x + cosine * s_y])
    target = overlap.slope_target
    columns = [np.column_stack([s, s[:, 1] * u - s[:, 0] * v]) for s in (target, source)]
    return columns[0], columns[1]


def _weights(overlap: Overlap, config: RegistrationConfig) -> FloatArray:
    """Trust times Tukey's biweight of the residual."""
    residual = overlap.z_source - overlap.z_target
    scale = 1.4826 * float(np.median(np.abs(residual))) + 1e-9
    return np.asarray(overlap.weight * np.maximum(1 - (residual / (config.tuning * scale)) ** 2, 0.0) ** 2)


def _sigmas(overlap: Overlap, yaw: float, config: RegistrationConfig) -> FloatArray:
    """Standard deviations of the transform, rotation first."""
    factors = np.array([config.sigma_factor, config.sigma_factor, config.sigma_factor_yaw])
    planar = factors * _clustered(overlap, yaw, config) if len(overlap.x) >= 3 else np.full(3, np.inf)
    floor = np.array([config.min_sigma, config.min_sigma, config.min_sigma_yaw])
    x, y, turn = np.hypot(planar, floor)
    tilt, offset = np.sqrt(2) * config.gauge_tilt, np.sqrt(2) * config.gauge_sigma
    return np.array([tilt, tilt, turn, x, y, offset])


def _clustered(overlap: Overlap, yaw: float, config: RegistrationConfig) -> FloatArray:
    """Standard deviations of x, y, yaw when errors are independent between blocks only, shape (3,)."""
    (J, J_source), weight = _jacobians(overlap, yaw), _weights(overlap, config)
    H = np.einsum("ki,kj->ij", J * weight[:, None], J_source)
    H = (H + H.T) / 2
    values, block = np.linalg.eigvalsh(H), _blocks(overlap, config.block)
    n_blocks = int(np.count_nonzero(np.bincount(block)))
    if n_blocks <= 3 or not values[0] > 1e-12 * np.abs(values).max():
        return np.full(3, np.inf)
    pull = J * (weight * (overlap.z_source - overlap.z_target))[:, None]
    scores = np.stack([np.bincount(block, column) for column in pull.T], axis=1)
    inverse = np.linalg.inv(H)
    covariance = inverse @ (scores.T @ scores) @ inverse * n_blocks / (n_blocks - 3)
    return np.asarray(np.sqrt(np.diag(covariance)))


def _blocks(overlap: Overlap, side: float) -> IntArray:
    """Number of the square that each source cell lies in, shape (K,)."""
    column, row = (np.floor((a - a.min()) / side).astype(np.int64) for a in (overlap.x, overlap.y))
    return np.asarray(row * (int(column.max()) + 1) + column)


def _gauge(overlap: Overlap, config: RegistrationConfig) -> tuple[float, FloatArray, float]:
    """Offset, tilt and what is left of target minus source heights; the tilt held near 0 by its prior."""
    if len(overlap.x) < 3:
        return 0.0, np.zeros(2), float("nan")
    A = np.column_stack([np.ones_like(overlap.x), overlap.x, overlap.y])
    difference, weight = overlap.height_target - overlap.height_source, 1 / np.maximum(overlap.sigma, 1e-3) ** 2
    prior = np.diag([0.0, 1.0, 1.0]) / (2 * config.gauge_tilt**2)
    weighted = A * weight[:, None]
    normal, right = np.einsum("ki,kj->ij", weighted, A), np.einsum("ki,k->i", weighted, difference)
    offset, *tilt = np.linalg.solve(normal + prior, right)
    left = difference - np.einsum("ki,i", A, [offset, *tilt])
    return float(offset), np.array(tilt), float(np.sqrt(np.mean(weight * left**2)))
