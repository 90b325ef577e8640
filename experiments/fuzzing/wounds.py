"""Damage to an input of one or several files: to bytes, to the arrays of an archive, to the numbers of a text."""

import io
import re
import zipfile

import numpy as np

from tests.sssslam.readers.damage import damaged

# The files of one input by their names; the first is the one that is opened.
Files = dict[str, bytes]
_NUMBER = re.compile(r"[-+]?\d[\d.]*")
_WORDS = (
    *(
        "",
        "nan",
        "inf",
        "-inf",
        "0",
        "-0.0",
        "-1",
        "1e308",
        "-1e308",
        "1e400",
        "1e-320",
        "360",
        "90",
        "-90",
        "180",
        "91",
    ),
    *(
        "1e17",
        "4294967296",
        "-2147483648",
        "9" * 400,
        "0x10",
        "1_0",
        "\u0663",
        "1,5",
        "N/A",
        "--",
        " 7 ",
        '"7"',
        "\t",
        ";",
    ),
    *("2016-02-30", "2016-05-01T12:00:00Z", "9999-12-31T23:59:59", "0001-01-01", "23:59:60", "24:00:00", "12:61", "#"),
)


def wounded(files: Files, rng: np.random.Generator, keep: int) -> Files:
    """An input with one of its files damaged; of several, one may be empty or gone.

    Parameters
    ----------
    files : dict of str to bytes
        The whole input.
    rng : Generator
        Chooses the damage.
    keep : int
        Bytes at the start of the first file that stay.

    Returns
    -------
    files : dict of str to bytes
        The damaged input; the first file is always there.
    """
    names = list(files)
    chosen = names[rng.integers(len(names))]
    kept = keep if chosen == names[0] else 0
    fate = rng.random() if chosen != names[0] else 1.0
    if fate < 0.02:
        return {name: content for name, content in files.items() if name != chosen}
    return files | {chosen: b"" if fate < 0.04 else _wounded_content(files[chosen], rng, kept)}


def _wounded_content(content: bytes, rng: np.random.Generator, keep: int) -> bytes:
    """Damage to the bytes; in half of the archives and texts, to the numbers inside, so that more of them is read."""
    if rng.random() < 0.5:
        return damaged(content, rng, keep)
    if content.startswith(b"PK"):
        return _wounded_archive(content, rng)
    return _wounded_text(content, rng) if content.isascii() and b"\0" not in content else damaged(content, rng, keep)


def _wounded_archive(content: bytes, rng: np.random.Generator) -> bytes:
    """An array damaged before it is packed, as nothing behind a wrong checksum is read; half only in its numbers."""
    result = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as whole, zipfile.ZipFile(result, "w") as archive:
        names = whole.namelist()
        chosen, keep = names[rng.integers(len(names))], 128 * int(rng.integers(2))
        for name in names:
            archive.writestr(name, damaged(whole.read(name), rng, keep) if name == chosen else whole.read(name))
    return result.getvalue()


def _wounded_text(content: bytes, rng: np.random.Generator) -> bytes:
    """Numbers replaced by what people, programs and enemies write in their place; rows missing, repeated or moved."""
    text = content.decode("ascii")
    for _ in range(rng.integers(1, 5)):
        cells = list(_NUMBER.finditer(text))
        lines = text.splitlines()
        kind = rng.integers(0, 6)
        if kind < 4 and cells:
            cell, word = cells[rng.integers(len(cells))], _WORDS[rng.integers(len(_WORDS))]
            text = text[: cell.start()] + word + text[cell.end() :]
        elif lines:
            row = lines.pop(int(rng.integers(len(lines))))
            for place in rng.integers(0, len(lines) + 1, rng.integers(0, 3)):
                lines.insert(int(place), row)
            text = "\n".join(lines)
    return text.encode()
