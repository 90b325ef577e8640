"""Figure of what went in: the waterfall of the recording."""

import numpy as np

from frontend.arrays import FloatArray
from frontend.recording import Quantity, Recording
from sssslam.products import figure_style as look

_DECIBELS = {Quantity.INTENSITY: 10.0, Quantity.AMPLITUDE: 20.0}


def draw_waterfall(recording: Recording, first_bottom_return: FloatArray | None = None) -> bytes:
    """The echoes of both sides against distance run, port above.

    Parameters
    ----------
    recording : Recording
        The recording.
    first_bottom_return : ndarray, shape (N, 2), optional
        Slant range of the first echo from the seafloor, port and starboard [m], to be drawn over the echoes.

    Returns
    -------
    content : bytes
        A PNG; intensity and amplitude in decibels, other quantities as they are.
    """
    image, unit = _image(recording)
    low, high = look.percentile_limits(image, 2.0, 99.5)
    reach = float(np.median(recording.slant_range_max))
    edges = (0.0, float(max(recording.trajectory_dr.distance[-1], 1.0)), -reach, reach)
    with look.style():
        figure = look.new_figure(11, 4.4)
        axes = figure.subplots()
        drawn = axes.imshow(image, origin="lower", extent=edges, aspect="auto", cmap="copper", vmin=low, vmax=high)
        if first_bottom_return is not None:
            lines = first_bottom_return * [1.0, -1.0]
            axes.plot(np.linspace(0.0, edges[1], len(lines)), lines, color="#56B4E9", lw=0.8)
            axes.plot([], [], color="#56B4E9", label="first bottom return")
            axes.legend(loc="upper right")
        axes.set_facecolor(look.UNKNOWN)
        axes.set(xlabel="distance run, pings evenly spread [m]", ylabel="slant range, port up [m]", title="Recording")
        axes.grid(False)
        figure.colorbar(drawn, ax=axes, label=unit, extend="both", pad=0.01)
        return look.png(figure)


def _image(recording: Recording) -> tuple[FloatArray, str]:
    """Rows from far starboard over nadir to far port, one column a block of pings."""
    block = (-(-recording.n_pings // look.MAX_PIXELS), -(-2 * recording.n_samples // look.MAX_PIXELS))
    starboard, port = (
        look.block_mean(side.astype(np.float64), block) for side in (recording.starboard, recording.port)
    )
    image = np.concatenate([starboard[:, ::-1], port], axis=1).T
    factor = _DECIBELS.get(recording.sonar.quantity)
    if factor is None:
        return image, f"echo, {recording.sonar.quantity.value} scale"
    positive = np.where(image > 0, image, np.nan)
    return factor * np.log10(positive), f"{recording.sonar.quantity.value} [dB]"
