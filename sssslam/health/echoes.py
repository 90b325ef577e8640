"""Health of the echoes: which side is dark, how far they spread, whether they are cut off or compressed."""

from dataclasses import replace

import numpy as np

from frontend.arrays import FloatArray
from frontend.recording import Quantity, Recording
from frontend.speckle import measure_speckle
from frontend.transfer import estimate_transfer
from sssslam.health.finding import Finding, Lines, thinned

_SATURATED_SHARE, _SIDE_RATIO = 0.01, 3.0
_SILENT_SHARE, _LEAST_LEVELS = 0.3, 32
_SURE = 0.9  # probability above which a recording is contradicted


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
            continue
        levels[side] = float(np.mean(np.abs(known)))
        yield from _spread(side, known)
        yield from _cut(side, known)
    yield from _silence([side for side in sides if side not in levels])
    yield from _balance(levels)
    yield from _compression(recording)


def _silence(silent: list[str]) -> Lines:
    """Sides without any echo."""
    if len(silent) == 1:
        yield Finding(f"{silent[0]} holds no echoes", "the channel was off; only one side can be reconstructed")
    elif silent:
        yield Finding("neither side holds echoes", "the sonar was off, or other channels hold them (--channels)")


def _spread(side: str, known: FloatArray) -> Lines:
    """Percentiles, dynamic range, and in how many steps it comes."""
    low, middle, high = np.percentile(known, [1, 50, 99])
    positive = known[known > 0]
    text = f"1 %, 50 %, 99 % of samples below {low:.5g}, {middle:.5g}, {high:.5g}"
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
            f"{saturated:.1%} of the {side} samples are at the greatest value, {known.max():.6g}",
            "the receiver or recorder saturates: brightness above is lost",
        )
    if silent > _SILENT_SHARE:
        yield Finding(
            f"{silent:.0%} of the {side} samples are 0",
            "gain too low or range too long: no shape is known where nothing comes back",
        )


def _compression(recording: Recording) -> Lines:
    """How the spread of speckle follows brightness, and what the run would take the numbers for by that alone."""
    speckle, said = measure_speckle(recording), recording.sonar.quantity
    if speckle is None:
        return
    unsaid = replace(recording, sonar=replace(recording.sonar, quantity=Quantity.UNKNOWN))
    guess = estimate_transfer(unsaid)
    power = f"spread follows brightness to the power {speckle.exponent:.2f} +- {speckle.exponent_sigma:.2f}"
    yield "compression", f"{power}: like {guess.quantity}, probability {guess.confidence:.0%}"
    if guess.quantity is Quantity.LOG and said in (Quantity.INTENSITY, Quantity.AMPLITUDE) and guess.confidence > _SURE:
        yield Finding(
            f"the samples are called {said} and look like a logarithm of it",
            "the recorder compressed them: convert with the right quantity, or shape comes out flat",
        )
    if said is Quantity.LOG and guess.quantity is not Quantity.LOG:
        yield Finding(
            "the samples are called logarithmic and look linear", "bright slopes come out too steep: check the format"
        )


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
