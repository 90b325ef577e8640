"""Where the local ENU frame lies on the Earth: a transverse Mercator projection centred on the first good ping."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from pyproj import CRS, Transformer

from frontend.arrays import FloatArray


@dataclass(frozen=True)
class Georeference:
    """Origin of the local frame; true north is up, scale is 1 at the origin.

    Parameters
    ----------
    latitude, longitude : float
        The origin [deg], WGS 84.
    """

    latitude: float
    longitude: float

    @cached_property
    def crs(self) -> CRS:
        """The projected coordinate reference system whose easting and northing are x and y."""
        return CRS.from_proj4(
            f"+proj=tmerc +lat_0={self.latitude:.12f} +lon_0={self.longitude:.12f} +k=1 +x_0=0 +y_0=0 "
            "+ellps=WGS84 +datum=WGS84 +units=m +no_defs"
        )

    @cached_property
    def _forward(self) -> Transformer:
        return Transformer.from_crs(CRS.from_epsg(4326), self.crs, always_xy=True)

    def to_local(self, latitude: ArrayLike, longitude: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Project geographic positions.

        Parameters
        ----------
        latitude, longitude : array_like, shape (N,)
            Positions [deg], WGS 84.

        Returns
        -------
        x, y : ndarray, shape (N,)
            East and north of the origin [m].
        """
        x, y = self._forward.transform(np.asarray(longitude), np.asarray(latitude))
        return np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)

    def to_geographic(self, x: ArrayLike, y: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Unproject local positions.

        Parameters
        ----------
        x, y : array_like, shape (N,)
            East and north of the origin [m].

        Returns
        -------
        latitude, longitude : ndarray, shape (N,)
            Positions [deg], WGS 84.
        """
        longitude, latitude = self._forward.transform(np.asarray(x), np.asarray(y), direction="INVERSE")
        return np.asarray(latitude, dtype=np.float64), np.asarray(longitude, dtype=np.float64)
