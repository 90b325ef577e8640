"""Layout: numpy dtypes from tables of byte offsets, as format descriptions print them."""

import numpy as np


def layout(size: int, fields: dict[str, tuple[int, str]]) -> np.dtype[np.void]:
    """Make the dtype of a structure of which only some fields matter.

    Parameters
    ----------
    size : int
        Size of the structure [bytes].
    fields : dict of str to (int, str)
        Of each field, its offset [bytes] and its type with byte order.

    Returns
    -------
    dtype : dtype
        The structure.
    """
    offsets, formats = [offset for offset, _ in fields.values()], [kind for _, kind in fields.values()]
    return np.dtype({"names": list(fields), "formats": formats, "offsets": offsets, "itemsize": size})  # type: ignore[call-overload]
