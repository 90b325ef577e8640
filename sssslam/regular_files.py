"""Regular files: what can be opened and has an end, told from folders, devices and pipes before any of it is read."""

from pathlib import Path


def read_head(path: Path, size: int, wanted: str) -> bytes:
    """Read the first bytes of a file.

    Parameters
    ----------
    path : Path
        The file.
    size : int
        How many at most [bytes].
    wanted : str
        What the file should be, with its article, as complaints name it.

    Returns
    -------
    head : bytes
        At least one byte.

    Raises
    ------
    ValueError
        If the path is a folder, a device or a pipe, or the file is missing, closed to the user or empty.
    """
    try:
        if path.is_dir():
            raise ValueError(f"{path}: this is a directory; {wanted} is wanted")
        if not path.exists():
            raise ValueError(f"{path}: there is no such file; {wanted} is wanted")
        if not path.is_file():
            raise ValueError(f"{path}: this is no regular file; {wanted} is wanted")
        with path.open("rb") as file:
            head = file.read(size)
    except OSError as error:
        raise ValueError(f"{_short(path)}: cannot be opened ({error.strerror}); {wanted} is wanted") from None
    if not head:
        raise ValueError(f"{path}: the file is empty; {wanted} is wanted")
    return head


def _short(path: Path) -> str:
    """A path as it is, its middle left out where no file name can be so long."""
    text = str(path)
    return text if len(text) <= 300 else f"{text[:40]}...{text[-40:]}"
