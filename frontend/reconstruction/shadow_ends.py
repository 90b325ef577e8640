"""Shadows that tell a height: where one begins and where it ends lie on one ray, that over the crest which casts it."""

from dataclasses import dataclass, replace

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from frontend.arrays import BoolArray, FloatArray, IntArray
from frontend.reconstruction.forward import Raster
from frontend.reconstruction.measured_heights import MeasuredHeights, bilinear, rows_of, share_of_length
from frontend.reconstruction.posterior import Posterior
from frontend.shadows import ShadowConfig, expected_echo, label_shadows

Runs = tuple[IntArray, IntArray, IntArray, IntArray]

_LEAST_WEIGHT = 0.1  # of a crest's cells; the others are beside it
_N_PLACES = 3  # times that the end of a shadow is looked for on the surface; its height changes the place by little


class ShadowEndsConfig(BaseModel):
    """Which shadows are believed, and how well their ends are known."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    darkest: float = Field(
        default=0.03,
        ge=0,
        lt=1,
        description="Share [1] of its line's brightness a shadow may have; slopes that face away have more. 0: none.",
    )
    shortest: float = Field(
        default=2.0,
        gt=0,
        description="Shortest shadow [cells of slant range]; a bin more or less is too much of a shorter one.",
    )
    edge_sigma: float = Field(
        default=0.3, gt=0, description="Either end of a shadow [m slant range]; speckle blurs it."
    )
    crest_sigma: float = Field(
        default=0.15, gt=0, description="Crest against the surface of cells [cells]; it is sharp."
    )
    length: float = Field(
        default=1.0, gt=0, description="Track over which errors repeat [m]: neighbours see one crest."
    )
    tail: float = Field(
        default=20.0, gt=0, description="Variances [1] by which a crest that counts half is off; some are no shadows."
    )
    object_share: float = Field(
        default=0.1,
        ge=0,
        description="Share [1] of the height that a crest lacks which may be an object's; else smooth floor rises too.",
    )


@dataclass(frozen=True)
class ShadowEnds:
    """Crest and end of shadows, in the submap frame.

    Parameters
    ----------
    sensor : ndarray, shape (N, 3)
        Transducers [m].
    outward, forward : ndarray, shape (N, 2)
        Horizontal directions across and along the line.
    slope, advance, turn : ndarray, shape (N,)
        Tangent of the pitch (nose down), and how far the place runs along with the vehicle, as in `Beams`.
    crest, end : ndarray, shape (N,)
        Slant ranges [m].
    precision : ndarray, shape (N,)
        Of the height of each crest [1/m^2].
    object_share, tail : float
        As in `ShadowEndsConfig`.
    """

    sensor: FloatArray
    outward: FloatArray
    forward: FloatArray
    slope: FloatArray
    advance: FloatArray
    turn: FloatArray
    crest: FloatArray
    end: FloatArray
    precision: FloatArray
    object_share: float
    tail: float

    def __len__(self) -> int:
        """Number of shadows."""
        return len(self.crest)

    def crests(self, z: FloatArray, raster: Raster) -> MeasuredHeights:
        """What the shadows say of the heights of crests and ends, at the places that a surface gives them.

        Parameters
        ----------
        z : ndarray, shape (n_y, n_x)
            Heights of the surface [m].
        raster : Raster
            Its grid.

        Returns
        -------
        measured : MeasuredHeights
            One row a shadow.

        Notes
        -----
        Sensor, crest and end lie on one ray: ``(s - z_crest) / crest = (s - z_end) / end``, so with slant ranges given
        it is linear in the heights; only the places depend on them, and those of the crest on the height that follows.
        """
        share, s = self.crest / self.end, self.sensor[:, 2]
        height = np.full(len(self), np.median(z))
        for _ in range(_N_PLACES):
            cells_end, weights_end = bilinear(raster, self._place(self.end, height))
            height = (z.ravel()[cells_end] * weights_end).sum(axis=1)
        cells_crest, weights_crest = bilinear(raster, self._place(self.crest, s - share * (s - height)))
        cells = np.concatenate([cells_crest, cells_end], axis=1)
        weights = np.concatenate([weights_crest, -share[:, None] * weights_end], axis=1)
        return MeasuredHeights(rows_of(raster, cells, weights), s * (1 - share), self.precision)

    def robust(self, crests: MeasuredHeights, z: FloatArray) -> MeasuredHeights:
        """What the shadows say, that which a surface contradicts said more softly.

        Parameters
        ----------
        crests : MeasuredHeights
            What `crests` gave for the surface.
        z : ndarray, shape (n_y, n_x)
            Heights of the surface [m].

        Returns
        -------
        measured : MeasuredHeights
            With less precision the more variances a row misses by: it may be no shadow, or that of another crest.
        """
        squares = crests.precision * crests.miss(z) ** 2
        return replace(crests, precision=crests.precision / (1 + squares / self.tail))

    def _place(self, slant_range: FloatArray, height: FloatArray) -> FloatArray:
        """Shape (N, 2): where the line is at a height at a slant range."""
        down = self.sensor[:, 2] - height
        u = np.sqrt(np.maximum(slant_range**2 - down**2, 0.0))
        v = -self.slope * down + u * (self.advance + self.turn * u)
        return np.asarray(self.sensor[:, :2] + u[:, None] * self.outward + v[:, None] * self.forward)


def find_shadow_ends(posterior: Posterior, config: ShadowEndsConfig) -> ShadowEnds:
    """Shadows of a window whose two ends are seen.

    Parameters
    ----------
    posterior : Posterior
        The window at its finest resolution; lines that it keeps aside are not looked at.
    config : ShadowEndsConfig
        Which shadows are believed.

    Returns
    -------
    ends : ShadowEnds
        In order of lines, sides and ranges.
    """
    bins, tables, width = posterior.bins, posterior.tables, posterior.bins.width
    altitude = _altitude(posterior)
    excess = np.where(bins.looks > 0, bins.intensity - bins.floor, np.nan)
    expected = _expected(posterior, altitude)
    dark = label_shadows(
        excess + tables.noise[:, None], expected, np.full(len(excess), width), tables.noise, ShadowConfig()
    )
    runs = _runs(dark)
    line, side, first, after = runs
    is_long = after - first >= config.shortest * posterior.raster.spacing / width
    is_whole = np.isfinite(excess)[line, side, np.minimum(after, excess.shape[2] - 1)] & (after < excess.shape[2])
    is_dark = _brightness(excess / expected, runs) < config.darkest
    keep = is_long & is_whole & is_dark & (first * width > altitude[line])
    return _ends(posterior, (line[keep], side[keep]), (width * first[keep], width * after[keep]), config)


def hear(ends: ShadowEnds, posterior: Posterior, z: FloatArray) -> Posterior:
    """A posterior that hears what shadows tell.

    Parameters
    ----------
    ends : ShadowEnds
        The shadows.
    posterior : Posterior
        Without them.
    z : ndarray, shape (n_y, n_x)
        Surface that says which cells cast them [m].

    Returns
    -------
    posterior : Posterior
        With a height measured for every crest, and objects as likely there as it takes.

    Notes
    -----
    A belief in objects that is heavy-tailed about zero holds them down as long as they are small: without a word that
    there is one, a crest would be raised by all of the floor around it.
    """
    crests = ends.robust(ends.crests(z, posterior.raster), z)
    lack = np.maximum(-ends.object_share * crests.miss(z), 0.0)
    rows = crests.weights.tocoo()
    shadow, cell = rows.coords
    standing = np.zeros(posterior.raster.n_cells)
    np.maximum.at(standing, cell, np.where(rows.data > _LEAST_WEIGHT, lack[shadow], 0.0))
    measured, there = posterior.measured.and_also(crests), standing.reshape(posterior.raster.shape)
    return replace(posterior, measured=measured, standing=np.maximum(posterior.standing, there))


def _altitude(posterior: Posterior) -> FloatArray:
    """Shape (P,): height of each line above the smooth surface that it starts from [m]."""
    place = posterior.beams.sensor.mean(axis=1)
    cells, weights = bilinear(posterior.raster, place[:, :2])
    return np.asarray(place[:, 2] - (posterior.expected.ravel()[cells] * weights).sum(axis=1))


def _expected(posterior: Posterior, altitude: FloatArray) -> FloatArray:
    """Shape (P, 2, B): what a flat floor would return to a level vehicle."""
    n_lines, _, n_bins = posterior.bins.intensity.shape
    slant_range = np.tile(posterior.bins.width * (np.arange(n_bins) + 0.5), (n_lines, 1))
    level = np.zeros(n_lines)
    return expected_echo(slant_range, altitude, (level, level), posterior.tables)


def _runs(dark: BoolArray) -> Runs:
    """Line, side, first bin and the bin after the last of every run."""
    change = np.diff(np.pad(dark, ((0, 0), (0, 0), (1, 1))).astype(np.int8), axis=2)
    line, side, first = np.nonzero(change == 1)
    return line, side, first, np.nonzero(change == -1)[2]


def _brightness(ratio: FloatArray, runs: Runs) -> FloatArray:
    """Mean brightness of runs but for the bins at their ends, over the median of their lines and sides."""
    line, side, first, after = runs
    known = np.isfinite(ratio)
    sums = np.cumsum(np.pad(np.where(known, ratio, 0.0), ((0, 0), (0, 0), (1, 0))), axis=2)
    inside = sums[line, side, np.maximum(after - 1, first)] - sums[line, side, np.minimum(first + 1, after)]
    usual = np.nanmedian(np.where(known.any(axis=2, keepdims=True), ratio, 1.0), axis=2)
    return np.asarray(inside / np.maximum(after - first - 2, 1) / np.maximum(usual[line, side], 1e-12))


def _ends(
    posterior: Posterior,
    where: tuple[IntArray, IntArray],
    ranges: tuple[FloatArray, FloatArray],
    config: ShadowEndsConfig,
) -> ShadowEnds:
    """The shadows of lines and sides, from slant range to slant range."""
    beams, (line, side), (crest, end) = posterior.beams, where, ranges
    horizontal = np.hypot(beams.forward[line, 0], beams.forward[line, 1])
    forward = beams.forward[line, :2] / horizontal[:, None]
    to_port = np.where(side == 0, 1.0, -1.0)
    outward = to_port[:, None] * np.stack([-forward[:, 1], forward[:, 0]], axis=1)
    share = share_of_length(beams.sensor[:, 0, :2], config.length)
    edges = np.sqrt(2.0) * config.edge_sigma * _altitude(posterior)[line] / end
    variance = edges**2 + (config.crest_sigma * posterior.raster.spacing) ** 2
    return ShadowEnds(
        beams.sensor[line, side],
        outward,
        forward,
        -beams.forward[line, 2] / horizontal,
        beams.advance[line],
        -to_port * beams.turn[line],
        crest,
        end,
        share[line] / variance,
        config.object_share,
        config.tail,
    )
