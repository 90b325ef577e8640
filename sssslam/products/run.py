"""A run as it lies on the disk, read back: what evaluation judges and the report is made of."""

import csv
import os
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from rasterio.crs import CRS

from frontend.arrays import FloatArray
from frontend.heightfield import Heightfield
from frontend.loop_closures import LoopClosure
from frontend.submaps import Submap
from frontend.trajectory import Trajectory
from sssslam.products.grids import read_geotiff
from sssslam.products.loop_closures import read_loop_closures
from sssslam.products.manifest import read_manifest
from sssslam.products.ply import read_ply
from sssslam.products.tracks import SIGMA_COLUMNS, TRAJECTORY_COLUMNS
from sssslam.products.tum import read_tum


@dataclass(frozen=True)
class Run:
    """The products of one run.

    Parameters
    ----------
    out : Path
        The folder.
    manifest : dict
        ``run.json``.
    trajectory, trajectory_dr : Trajectory
        The corrected and the dead-reckoned track, at the same times.
    sigmas : ndarray, shape (N, 4)
        Standard deviations of the corrected x, y, z [m] and yaw [rad]; NaN where unknown.
    loop_closures : tuple of LoopClosure
        Every candidate.
    anchor_time : dict of int to float
        Anchor times of the submaps that the candidates name [s since 1970 UTC].
    """

    out: Path
    manifest: dict[str, Any]
    trajectory: Trajectory
    trajectory_dr: Trajectory
    sigmas: FloatArray
    loop_closures: tuple[LoopClosure, ...]
    anchor_time: dict[int, float]

    @property
    def submaps(self) -> Iterator[Submap]:
        """The submaps, read one after another."""
        return (read_ply(path)[0] for path in sorted(self.out.glob("submaps/[0-9]*.ply")))

    @property
    def seafloor(self) -> Heightfield:
        """Heights of the map [m]."""
        return self._map[0][0]

    @property
    def seafloor_sigma(self) -> FloatArray:
        """Shape (n_y, n_x): standard deviations of the map's heights [m]."""
        return self._map[0][1].z

    @property
    def crs(self) -> CRS | None:
        """Coordinate reference system of the map, where it is known."""
        return self._map[1]

    @cached_property
    def _map(self) -> tuple[tuple[Heightfield, ...], CRS | None]:
        bands, crs = read_geotiff(self.out / "seafloor.tif")
        if len(bands) != 2:
            raise ValueError(
                f"{self.out / 'seafloor.tif'}: a height and a sigma band are wanted, got {len(bands)} bands"
            )
        return bands, crs


def read_run(out: str | os.PathLike[str]) -> Run:
    """Read the products of a run.

    Parameters
    ----------
    out : path-like
        The folder that a run left.

    Returns
    -------
    run : Run
        Its products; submaps and map are read when they are asked for.

    Raises
    ------
    ValueError
        If the folder is not one of a finished run, or a product is damaged.
    """
    out = Path(out)
    if not (out / "run.json").is_file():
        raise ValueError(f"{out}: the folder of a finished run is wanted, it has no run.json")
    trajectory, trajectory_dr = read_tum(out / "trajectory.tum"), read_tum(out / "trajectory_dr.tum")
    if not np.array_equal(trajectory.time, trajectory_dr.time):
        raise ValueError(f"{out}: trajectory.tum and trajectory_dr.tum must have the same times, they differ")
    sigmas = _read_sigmas(out / "trajectory.csv", len(trajectory))
    closures = read_loop_closures(out / "loop_closures.csv")
    return Run(out, read_manifest(out / "run.json"), trajectory, trajectory_dr, sigmas, *closures)


def _read_sigmas(path: Path, n_poses: int) -> FloatArray:
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        sigmas = [[float(row[name] or "nan") for name in SIGMA_COLUMNS] for row in rows]
    except (OSError, KeyError, ValueError, TypeError) as error:
        raise ValueError(
            f"{path}: a table {','.join(TRAJECTORY_COLUMNS)} is wanted, cannot read it ({error!r})"
        ) from None
    if len(sigmas) != n_poses:
        raise ValueError(f"{path}: one row a pose of trajectory.tum is wanted, got {len(sigmas)} rows of {n_poses}")
    return np.array(sigmas, dtype=np.float64)
