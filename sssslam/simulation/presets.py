"""Named starting points of a section: what the section itself says comes on top."""

from typing import Any


def lay_over_preset(values: Any, key: str, presets: dict[str, dict[str, Any]]) -> Any:
    """Fill in from the preset a section names what the section leaves out.

    Parameters
    ----------
    values : Any
        The section as given; anything but a table is passed on for the model to refuse.
    key : str
        The section's key that holds the preset's name.
    presets : dict
        The presets by name.

    Returns
    -------
    values : Any
        The section with the preset's values beneath its own.
    """
    if not isinstance(values, dict):
        return values
    name = values.get(key, next(iter(presets)))
    if not isinstance(name, str) or name not in presets:
        raise ValueError(f"{key} {name!r} given, one of {', '.join(presets)} wanted")
    return {**presets[name], key: name, **values}
