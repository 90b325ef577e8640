"""What is known of a relative pose before the seafloor is looked at."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import chdtrc, chdtri

from frontend.arrays import FloatArray
from frontend.frames import planar_parameters, wrap_angle

_PLANAR = [3, 4, 2]  # x, y and yaw of a rotation-first 6-vector
_LEAST_SIGMAS = np.array([0.1, 0.1, 0.002])  # [m], [m], [rad] to which a window is a rigid thing at all


@dataclass(frozen=True)
class Prior:
    """A predicted relative pose and how far it may be wrong.

    Parameters
    ----------
    T_target_source : ndarray, shape (4, 4)
        Predicted transform from the source's level frame to the target's.
    covariance : ndarray, shape (6, 6)
        Its covariance in the target frame, rotation first [rad^2, rad m, m^2].
    n_sigmas : float
        Half-width of the gate [standard deviations].
    """

    T_target_source: FloatArray
    covariance: FloatArray
    n_sigmas: float = 3.0

    def __post_init__(self) -> None:
        covariance = np.asarray(self.covariance)
        if covariance.shape != (6, 6):
            raise ValueError(f"the covariance of a relative pose must be (6, 6), got {covariance.shape}")
        if not np.isfinite(covariance).all() or np.linalg.eigvalsh(covariance)[0] < -1e-9 * np.abs(covariance).max():
            raise ValueError("the covariance of a relative pose must be finite and have no negative variance")

    @cached_property
    def planar(self) -> tuple[float, float, float]:
        """Predicted x, y [m] and yaw [rad]."""
        return planar_parameters(self.T_target_source)

    @cached_property
    def planar_covariance(self) -> FloatArray:
        """Shape (3, 3): covariance of x, y and yaw, at least that of a window's own shape."""
        return np.asarray(self.covariance, dtype=np.float64)[np.ix_(_PLANAR, _PLANAR)] + np.diag(_LEAST_SIGMAS**2)

    @cached_property
    def sigma_yaw(self) -> float:
        """Standard deviation of the yaw [rad]."""
        return float(np.sqrt(self.planar_covariance[2, 2]))

    @cached_property
    def reach(self) -> FloatArray:
        """Shape (2,): half-widths of the gate along x and y [m]."""
        return self.n_sigmas * np.sqrt(np.diag(self.planar_covariance)[:2])

    @cached_property
    def limit(self) -> float:
        """Squared Mahalanobis distance in x, y, yaw that leaves out what ``n_sigmas`` do in one dimension."""
        return float(chdtri(3, chdtrc(1, self.n_sigmas**2)))

    def squared_distance(self, x: FloatArray | float, y: FloatArray | float, yaw: FloatArray | float) -> FloatArray:
        """Squared Mahalanobis distance of poses from the prediction.

        Parameters
        ----------
        x, y : array_like, shape (...)
            Shift of the source's origin in the target frame [m].
        yaw : array_like, shape (...)
            Turn of the source [rad].

        Returns
        -------
        squared_distance : ndarray, shape (...)
            Chi-square distributed with 3 degrees of freedom if the prior is right.
        """
        x_0, y_0, yaw_0 = self.planar
        error = np.stack(np.broadcast_arrays(x - x_0, y - y_0, wrap_angle(np.asarray(yaw) - yaw_0)), axis=-1)
        return np.asarray(np.einsum("...i,ij,...j", error, np.linalg.inv(self.planar_covariance), error))

    def admits(self, T_target_source: FloatArray) -> bool:
        """Whether a transform lies inside the gate.

        Parameters
        ----------
        T_target_source : ndarray, shape (4, 4)
            The transform.

        Returns
        -------
        admitted : bool
            True inside the gate or on its edge.
        """
        return bool(self.squared_distance(*planar_parameters(T_target_source)) <= self.limit)
