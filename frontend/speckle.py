"""Speckle of recorded numbers in small patches of even floor: spread, asymmetry, and how spread goes with the mean."""

from dataclasses import dataclass

import numpy as np
from scipy.special import gammaincinv

from frontend.arrays import AnyArray, BoolArray, FloatArray
from frontend.recording import Recording

_PINGS, _SAMPLES = 16, 32  # a patch: some forty independent samples even where neighbours are alike
_N_BLOCKS, _MOST = 16, 600  # blocks of pings, patches a side
_NEAR = 0.05  # share of the range left out: the transmission
_QUANTILES = (10.0, 50.0, 90.0)
_EVEN, _BAND = 25.0, 20.0  # percentile of patches' spreads: of even floor
_FEWEST = 12  # patches
_GOLDEN = 0.6180339887498949


@dataclass(frozen=True)
class Speckle:
    """Statistics of numbers X about their local mean; spread is from the 10 % to the 90 % quantile.

    Parameters
    ----------
    spread, asymmetry : float
        Of X; asymmetry is how far the median lies off the middle, as a share of the spread.
    log_spread, log_asymmetry : float
        The same of ln X.
    spread_range, log_spread_range : float
        Logarithm of the upper to the lower quartile of spread among patches; texture makes it large.
    exponent, exponent_sigma : float
        Power of the mean with which the spread of X goes, and its standard deviation.
    full_scale : float or None
        Greatest number a recorder of such whole numbers gives; None if they are no whole numbers.
    has_negative : bool
        Whether numbers are below zero.
    """

    spread: float
    asymmetry: float
    log_spread: float
    log_asymmetry: float
    spread_range: float
    log_spread_range: float
    exponent: float
    exponent_sigma: float
    full_scale: float | None
    has_negative: bool


def spread_of_looks(looks: float) -> float:
    """Distance between the 10 % and the 90 % quantile of the logarithm of a gamma distribution of so many looks."""
    low, _, high = np.log(gammaincinv(looks, np.array(_QUANTILES) / 100))
    return float(high - low)


def asymmetry_of_looks(looks: float) -> float:
    """How far the median of that logarithm lies off the middle of the quantiles, as a share of their distance."""
    low, middle, high = np.log(gammaincinv(looks, np.array(_QUANTILES) / 100))
    return float((high + low - 2 * middle) / (high - low))


def looks_of_spread(spread: float) -> float:
    """Looks at which `spread_of_looks` is so large, between 0.1 and 1000."""
    looks = np.geomspace(0.1, 1000.0, 200)
    spreads = np.array([spread_of_looks(n) for n in looks])
    return float(np.exp(np.interp(-spread, -spreads, np.log(looks))))


def measure_speckle(recording: Recording) -> Speckle | None:
    """Measure the speckle of a recording.

    Parameters
    ----------
    recording : Recording
        The dive; a few hundred pings of it are looked at.

    Returns
    -------
    speckle : Speckle or None
        None if there are too few patches with echoes.
    """
    patches = np.concatenate([_patches(side) for side in (recording.port, recording.starboard)])
    if len(patches) < _FEWEST:
        return None
    full_scale = _full_scale(patches)
    has_negative = bool(np.mean(patches < 0) > 1e-3)
    patches = patches[_usable(patches, full_scale, has_negative)]
    if len(patches) < _FEWEST:
        return None
    smooth = patches if full_scale is None else patches + _dither(patches.shape)
    positive = np.maximum(np.abs(smooth), 1e-30) if has_negative else np.maximum(smooth, 0.05 * _smallest(smooth))
    plain, logarithm = _Rest(smooth), _Rest(np.log(positive))
    return Speckle(
        *plain.spread_and_asymmetry(),
        *logarithm.spread_and_asymmetry(),
        plain.spread_range(),
        logarithm.spread_range(),
        *_exponent(np.abs(smooth.mean(axis=1)), plain.spread),
        full_scale,
        has_negative,
    )


class _Rest:
    """Patches without their trend, and the spread of each."""

    def __init__(self, patches: FloatArray) -> None:
        self.rest = np.sort(_without_trend(patches), axis=1)
        n = patches.shape[1]
        self.spread = (
            self.rest[:, round(_QUANTILES[2] / 100 * (n - 1))] - self.rest[:, round(_QUANTILES[0] / 100 * (n - 1))]
        )

    def spread_and_asymmetry(self) -> tuple[float, float]:
        """Of the patches that are about as even as most of the floor is between its marks."""
        low, high = np.percentile(self.spread, [_EVEN - _BAND, _EVEN + _BAND])
        even = self.rest[(self.spread >= low) & (self.spread <= high)]
        low, middle, high = np.percentile(even, _QUANTILES)
        spread = float(max(high - low, 1e-12))
        return spread, float(high + low - 2 * middle) / spread

    def spread_range(self) -> float:
        """Logarithm of the upper to the lower quartile of the spreads."""
        low, high = np.maximum(np.percentile(self.spread, [25.0, 75.0]), 1e-12)
        return float(np.log(high / low))


def _patches(echoes: AnyArray) -> FloatArray:
    """Shape (K, _PINGS * _SAMPLES): patches in blocks of pings spread over the dive, those with a gap left out."""
    n_blocks, first = len(echoes) // _PINGS, int(_NEAR * echoes.shape[1])
    n_columns = (echoes.shape[1] - first) // _SAMPLES
    if n_blocks == 0 or n_columns == 0:
        return np.empty((0, _PINGS * _SAMPLES))
    chosen = np.unique(np.linspace(0, n_blocks - 1, min(n_blocks, _N_BLOCKS)).astype(int))
    rows = (chosen[:, None] * _PINGS + np.arange(_PINGS)).ravel()
    block = echoes[rows, first : first + n_columns * _SAMPLES].astype(np.float64)
    cut = block.reshape(len(chosen), _PINGS, n_columns, _SAMPLES).transpose(0, 2, 1, 3).reshape(-1, _PINGS * _SAMPLES)
    cut = cut[np.isfinite(cut).all(axis=1) & (np.abs(cut) < 1e30).all(axis=1)]
    return np.asarray(cut[:: max(1, -(-len(cut) // _MOST))])


def _full_scale(patches: FloatArray) -> float | None:
    if np.any(patches != np.round(patches)):
        return None
    return float(2.0 ** max(8.0, np.ceil(np.log2(patches.max() + 1.0) / 8.0) * 8.0) - 1.0)


def _usable(patches: FloatArray, full_scale: float | None, has_negative: bool) -> BoolArray:
    """Patches without lost pings, that are neither clipped nor, in whole numbers, mostly rounding."""
    lines = patches.reshape(-1, _PINGS, _SAMPLES)
    good = (lines.max(axis=2) > lines.min(axis=2)).all(axis=1)
    good &= (patches == patches.max()).mean(axis=1) < 0.01
    if not has_negative:
        good &= (patches <= 0).mean(axis=1) < 0.05
    if full_scale is not None:
        good &= np.abs(patches.mean(axis=1)) > 8.0
    return good


def _dither(shape: tuple[int, ...]) -> FloatArray:
    """Evenly spread numbers between -0.5 and 0.5, the same every time: undo rounding."""
    return np.asarray((np.arange(np.prod(shape)) * _GOLDEN) % 1.0 - 0.5, dtype=np.float64).reshape(shape)


def _smallest(values: FloatArray) -> float:
    return float(np.percentile(values, 1.0)) if np.percentile(values, 1.0) > 0 else float(values.max()) * 1e-6


def _without_trend(patches: FloatArray) -> FloatArray:
    """Patches less the surface of second degree that fits each best."""
    v, u = (a.ravel() for a in np.meshgrid(np.linspace(-1, 1, _PINGS), np.linspace(-1, 1, _SAMPLES), indexing="ij"))
    basis, _ = np.linalg.qr(np.stack([np.ones_like(u), u, v, u * v, u**2, v**2], axis=1))
    return np.asarray(patches - (patches @ basis) @ basis.T)


def _exponent(mean: FloatArray, spread: FloatArray) -> tuple[float, float]:
    """Slope of the logarithm of spread over that of the mean, and its standard deviation."""
    order = np.argsort(mean, kind="stable")
    groups = np.array_split(order, max(4, min(20, len(order) // 20)))
    x = np.array([np.log(max(float(np.mean(mean[g])), 1e-30)) for g in groups])
    y = np.array([np.log(max(float(np.percentile(spread[g], _EVEN)), 1e-30)) for g in groups])
    x -= x.mean()
    power = float(x @ x)
    if power < 1e-6:
        return 0.5, 10.0
    slope = float(x @ y) / power
    error = y - y.mean() - slope * x
    return slope, float(np.sqrt((error @ error + 0.05) / len(x) / power * 2.0))
