"""Places for products: looked at before the work, not after it."""

import os
from pathlib import Path


def check_folder(out: Path) -> None:
    """Refuse a folder for products that cannot be one.

    Parameters
    ----------
    out : Path
        The folder; it need not exist.

    Raises
    ------
    ValueError
        If it is a file, or cannot be made or written to.
    """
    if out.exists() and not out.is_dir():
        raise ValueError(f"{out} is a file; a folder for the products is wanted")
    _check_place(out)


def check_file(out: Path, suffixes: tuple[str, ...]) -> None:
    """Refuse a file that could not be written, or whose name asks for another format.

    Parameters
    ----------
    out : Path
        The file; it need not exist.
    suffixes : tuple of str
        What its name may end in.

    Raises
    ------
    ValueError
        If it is a folder, has another ending, or lies where nothing can be written.
    """
    if out.suffix not in suffixes:
        raise ValueError(f"{out} is to be written; a name that ends in {' or '.join(suffixes)} is wanted")
    if out.is_dir():
        raise ValueError(f"{out} is a folder; a file is wanted")
    _check_place(out.parent)


def _check_place(folder: Path) -> None:
    """Refuse a folder that cannot be made or written to."""
    there = next(parent for parent in (folder.absolute(), *folder.absolute().parents) if parent.exists())
    if not there.is_dir() or not os.access(there, os.W_OK):
        raise ValueError(f"{folder} cannot be written; a folder that can is wanted")
