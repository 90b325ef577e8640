"""The open container's layout: which variable is called what, in which unit."""

TIME_UNITS = "seconds since 1970-01-01T00:00:00Z"
FORMAT = "sssslam recording 1"

# name: unit, long name
SIDES = {
    "port": ("1", "port echoes, near end first"),
    "starboard": ("1", "starboard echoes, near end first"),
}
POSES = {
    "x": ("m", "position east of the origin, as recorded"),
    "y": ("m", "position north of the origin, as recorded"),
    "z": ("m", "position above the surface, as recorded"),
    "roll": ("rad", "roll, positive starboard down"),
    "pitch": ("rad", "pitch, positive nose down"),
    "yaw": ("rad", "yaw, counter-clockwise from east"),
}
GEOMETRY = {
    "sample_spacing": ("m", "slant range between samples; sample i is centred at (i + 0.5) times it"),
    "sound_speed": ("m/s", "sound speed at the sonar"),
}
OPTIONAL = {
    "altitude": ("m", "height above the seafloor, as recorded"),
    "depth": ("m", "depth below the surface, as recorded"),
    "speed": ("m/s", "speed, as recorded"),
}
SLANT_RANGE_MAX = ("m", "slant range at the far edge of the last sample")
TERRAIN = {
    "terrain_x": ("m", "position east of the origin"),
    "terrain_y": ("m", "position north of the origin"),
    "terrain": ("m", "true height of the seafloor"),
}

# Attributes of the sonar: name: unit
SONAR = {
    "frequency": "Hz",
    "horizontal_beamwidth": "rad",
    "vertical_beamwidth": "rad",
    "mounting_depression": "rad",
}
LEVER_ARMS = ("lever_arm_port", "lever_arm_starboard")

# Units of raw sensor series, by the words their names hold; the first that fits.
SENSOR_UNITS = (
    (("time",), TIME_UNITS),
    (("latitude", "longitude"), "degrees"),
    (("gyro", "rate", "angular"), "rad/s"),
    (("accel", "specific_force"), "m/s2"),
    (("velocity", "speed"), "m/s"),
    (("roll", "pitch", "yaw", "heading", "angle"), "rad"),
    (("depth", "altitude", "range", "position", "sigma_x", "sigma_y", "sigma_z"), "m"),
)
_SYNONYMS = {
    "m": {"m", "metre", "metres", "meter", "meters"},
    "rad": {"rad", "radian", "radians"},
    "m/s": {"m/s", "m s-1", "m.s-1", "m s^-1", "m s**-1", "meter/second", "metre/second"},
}


def is_unit(given: str, wanted: str) -> bool:
    """Whether a unit as written in a file is the one wanted.

    Parameters
    ----------
    given : str
        Unit in the file.
    wanted : str
        Unit of the layout.

    Returns
    -------
    is_unit : bool
        True for the unit itself and its other spellings.
    """
    return given.strip().lower() in _SYNONYMS.get(wanted, {wanted.lower()})


def sensor_unit(name: str) -> str:
    """Unit of a raw sensor series.

    Parameters
    ----------
    name : str
        Name of the series.

    Returns
    -------
    unit : str
        Its unit by the words in its name; ``"1"`` where they do not tell.
    """
    return next((unit for words, unit in SENSOR_UNITS if any(word in name.lower() for word in words)), "1")
