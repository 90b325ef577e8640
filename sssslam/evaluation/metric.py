"""A metric: value, unit and how."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Metric:
    """A number that cannot be misread.

    Parameters
    ----------
    name : str
        What was measured.
    value : float
        The number; NaN where the run gives none.
    unit : str
        Its unit; empty for a plain number.
    how : str
        All that changes the number: alignment, distance, how many poses or cells.
    """

    name: str
    value: float
    unit: str
    how: str

    def __str__(self) -> str:
        number = f"{self.value:.4g} {self.unit}".rstrip() if np.isfinite(self.value) else "unknown"
        return f"{self.name} {number} ({self.how})"


def root_mean_square(values: np.ndarray) -> float:
    """Root mean square, NaN of nothing.

    Parameters
    ----------
    values : ndarray
        The values.

    Returns
    -------
    rms : float
        In their unit.
    """
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else float("nan")
