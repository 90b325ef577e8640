"""Health of the echoes: which side is dark, how far they spread, whether they are cut off or compressed."""

import numpy as np

from frontend.arrays import FloatArray
from frontend.recording import Quantity, Recording
from sssslam.health.finding import Finding, Lines, thinned

_SATURATED_SHARE, _SIDE_RATIO = 0.01, 3.0
_SILENT_SHARE, _LEAST_LEVELS = 0.3, 32
# Samples of one group, and levels that groups are sorted into, to see how spread follows brightness.
_N_GROUPED, _N_LEVELS = 4, 20
_LEAST_CONTRAST = float(np.log(1.1))
# Exponents above are a receiver's, below a logarithm's.
_LINEAR, _LOGARITHM = 0.75, 0.35


def examine_echoes(recording: Recording) -> Lines:
    """Look at the numbers of both sides.

    Parameters
    ----------
    recording : Recording
        The recording.

    Yields
    ------
    line : tuple of str or Finding
        What and its value, or something suspicious.
    """
    few = thinned(recording)
    # Behind a tenth of the range: the transmission itself saturates any receiver.
    sides = {name: getattr(few, name)[:, recording.n_samples // 10 :] for name in ("port", "starboard")}
    levels = {}
    for side, echoes in sides.items():
        known = echoes[np.isfinite(echoes)].astype(np.float64)
        if not known.size or np.ptp(known) == 0:
            yield side, "no echoes"
            yield Finding(f"{side} holds no echoes", "the channel was off; only one side can be reconstructed")
            continue
        levels[side] = float(np.mean(np.abs(known)))
        yield from _spread(side, known)
        yield from _cut(side, known)
        yield from _compression(side, echoes.astype(np.float64), recording.sonar.quantity)
    yield from _balance(levels)


def _spread(side: str, known: FloatArray) -> Lines:
    """Percentiles, dynamic range, and in how many steps it comes."""
    low, middle, high = np.percentile(known, [1, 50, 99])
    positive = known[known > 0]
    text = f"1 %, 50 %, 99 % of samples below {low:.4g}, {middle:.4g}, {high:.4g}"
    if positive.size:
        darkest = np.percentile(positive, 1)
        text += f"; {high / darkest:.3g} to 1 ({20 * np.log10(max(high / darkest, 1.0)):.0f} dB if amplitude)"
    if np.array_equal(known, np.rint(known)) and known.min() >= 0:
        n_levels, bits = len(np.unique(known)), int(np.ceil(np.log2(known.max() + 1)))
        text += f"; {n_levels} grey levels of {bits} bit"
        if n_levels < _LEAST_LEVELS:
            yield Finding(
                f"{side} has {n_levels} grey levels only", "gain or export was coarse: fine relief is lost in the steps"
            )
    yield side, text


def _cut(side: str, known: FloatArray) -> Lines:
    """Samples at either end of the scale."""
    saturated, silent = float(np.mean(known == known.max())), float(np.mean(known == 0))
    if saturated > _SATURATED_SHARE:
        yield Finding(
            f"{saturated:.1%} of the {side} samples are at the greatest value, {known.max():.4g}",
            "the receiver or recorder saturates: brightness above is lost",
        )
    if silent > _SILENT_SHARE:
        yield Finding(
            f"{silent:.0%} of the {side} samples are 0",
            "gain too low or range too long: no shape is known where nothing comes back",
        )


def _compression(side: str, echoes: FloatArray, quantity: Quantity) -> Lines:
    """How the spread of neighbouring samples follows their level: a receiver's in proportion, a logarithm's not."""
    exponent = spread_exponent(echoes)
    if np.isnan(exponent):
        return
    kind = "linear" if exponent > _LINEAR else "logarithmic" if exponent < _LOGARITHM else "partly compressed"
    yield f"{side} compression", f"spread follows brightness to the power {exponent:.2f}: {kind}"
    if exponent < _LOGARITHM and quantity in (Quantity.INTENSITY, Quantity.AMPLITUDE):
        yield Finding(
            f"{side} is called {quantity} and looks like a logarithm of it",
            "the recorder compressed it: convert with the right quantity, or shape comes out flat",
        )
    if exponent > _LINEAR and quantity is Quantity.LOG:
        yield Finding(
            f"{side} is called logarithmic and looks linear", "bright slopes come out too steep: check the format"
        )


def spread_exponent(echoes: FloatArray) -> float:
    """How the spread of neighbouring samples follows their mean.

    Parameters
    ----------
    echoes : ndarray, shape (N, M)
        Lines of samples; NaN where there is none.

    Returns
    -------
    exponent : float
        1 where speckle multiplies, as in intensity and amplitude; 0 where it adds, as in their logarithm; NaN where the
        samples are too alike to tell.

    Notes
    -----
    Slope of log spread over log mean, both of groups of four samples, over the medians of equally filled levels.
    """
    n = echoes.shape[1] // _N_GROUPED * _N_GROUPED
    groups = echoes[:, :n].reshape(-1, _N_GROUPED)
    mean, spread = groups.mean(axis=1), groups.std(axis=1)
    # Where rounding to whole numbers is as large as the spread, spread says nothing of the echoes.
    step = 1.0 if np.array_equal(groups[np.isfinite(groups)], np.rint(groups[np.isfinite(groups)])) else 0.0
    usable = np.isfinite(mean) & (mean > 4 * step) & (spread > 0)
    if usable.sum() < 10 * _N_LEVELS:
        return float("nan")
    order = np.argsort(mean[usable], kind="stable")
    levels = np.array_split(np.stack([mean[usable], spread[usable]])[:, order], _N_LEVELS, axis=1)
    middle = np.log([np.median(level, axis=1) for level in levels])
    if np.ptp(middle[:, 0]) < _LEAST_CONTRAST:
        return float("nan")
    return float(np.polyfit(middle[:, 0], middle[:, 1], 1)[0])


def _balance(levels: dict[str, float]) -> Lines:
    """Whether one side is much darker than the other."""
    if len(levels) < 2:
        return
    ratio = levels["port"] / max(levels["starboard"], 1e-30)
    yield "port over starboard", f"{ratio:.2f} in mean brightness"
    dark = "starboard" if ratio > 1 else "port"
    if max(ratio, 1 / max(ratio, 1e-30)) > _SIDE_RATIO:
        yield Finding(
            f"{dark} is {max(ratio, 1 / ratio):.1f} times darker than the other side", "its gain or cable is off"
        )
