"""Overrides: loop closures that a user accepts or rejects, read from a table and put over the front end's decisions."""

import csv
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from frontend.loop_closures import LoopClosure
from sssslam.regular_files import read_head

Pair = tuple[int, int]  # submap numbers, the earlier first

REJECTED = "rejected by the user"
_COLUMNS = ("target", "source", "decision")


@dataclass(frozen=True)
class Overrides:
    """What a user decided.

    Parameters
    ----------
    is_accepted : mapping of (int, int) to bool
        By the submap numbers of the pair, the earlier first: True to accept, False to reject.
    source : str
        Where that is written, for messages.
    """

    is_accepted: Mapping[Pair, bool] = field(default_factory=dict)
    source: str = "the overrides"

    def accepts(self, closure: LoopClosure) -> bool:
        """Whether the user accepts a closure.

        Parameters
        ----------
        closure : LoopClosure
            Any candidate.

        Returns
        -------
        accepts : bool
            False where the user rejects it or says nothing.
        """
        return self.is_accepted.get(_pair_of(closure), False)


def read_overrides(path: str | os.PathLike[str]) -> Overrides:
    """Read a user's decisions.

    Parameters
    ----------
    path : path-like
        A table of comma-separated values with the columns ``target``, ``source`` (submap numbers, in either order) and
        ``decision``: ``accept``, ``reject``, or empty for none. Other columns are ignored, so that it can be a copy of
        ``loop_closures.csv`` with a column more.

    Returns
    -------
    overrides : Overrides
        The decisions, for the ``overrides`` of `sssslam.slam`.

    Raises
    ------
    ValueError
        If the file cannot be read, lacks a column, or a row is none of this or contradicts another.
    """
    read_head(Path(path), 1, f"a table {','.join(_COLUMNS)}")
    try:
        with open(path, encoding="utf-8-sig", newline="") as file:  # spreadsheets put a mark at the start
            rows = [[cell.strip() for cell in row] for row in csv.reader(file)]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{path}: a table {','.join(_COLUMNS)} is wanted, cannot read it ({error})") from None
    header = rows[0] if rows else []
    missing = [name for name in _COLUMNS if header.count(name) != 1]
    if missing:
        raise ValueError(f"{path}: a header with {','.join(_COLUMNS)} once each is wanted, check {','.join(missing)}")
    is_accepted: dict[Pair, bool] = {}
    for line, cells in enumerate(rows[1:], start=2):
        try:
            _add_row(is_accepted, dict(zip(header, cells, strict=False)))
        except ValueError as error:
            raise ValueError(f"{path}, row {line}: {error}") from None
    return Overrides(is_accepted, str(path))


def override(closures: Sequence[LoopClosure], overrides: Overrides) -> list[LoopClosure]:
    """Put a user's decisions over those of the front end.

    Parameters
    ----------
    closures : sequence of LoopClosure
        The candidates as the front end left them.
    overrides : Overrides
        The user's decisions.

    Returns
    -------
    closures : list of LoopClosure
        The same with the front end's measurements, accepted or rejected as the user wants.

    Raises
    ------
    ValueError
        If a pair was never compared, or one to be accepted has no measurement.
    """
    by_pair = {_pair_of(closure): closure for closure in closures}
    for pair, is_accepted in overrides.is_accepted.items():
        name = f"{overrides.source}: submaps {pair[0]} and {pair[1]}"
        if pair not in by_pair:
            raise ValueError(f"{name} were not compared in this run; a pair of its loop_closures.csv is wanted")
        if is_accepted and not _is_measured(by_pair[pair]):
            raise ValueError(f"{name} cannot be accepted: no alignment was measured ({by_pair[pair].reason})")
    return [_decided(closure, overrides.is_accepted.get(_pair_of(closure))) for closure in closures]


def override_notes(found: Sequence[LoopClosure], final: Sequence[LoopClosure], overrides: Overrides) -> tuple[str, ...]:
    """Say what a user decided, and against whom.

    Parameters
    ----------
    found : sequence of LoopClosure
        The candidates as the front end left them.
    final : sequence of LoopClosure
        The same after all decisions.
    overrides : Overrides
        The user's decisions.

    Returns
    -------
    notes : tuple of str
        A sentence for what was accepted, one for what was rejected, one for what had to be withdrawn all the same.
    """
    pairs = list(zip(found, final, strict=True))
    accepted = [_against(before) for before, after in pairs if overrides.accepts(before) and after.accepted]
    rejected = [_name(after) for _, after in pairs if after.reason == REJECTED]
    withdrawn = [_against(after) for before, after in pairs if overrides.accepts(before) and not after.accepted]
    said = {"accepted": accepted, "rejected": rejected, "accepted but withdrawn": withdrawn}
    return tuple(f"Loop closures by the user {how}: {', '.join(names)}." for how, names in said.items() if names)


def _add_row(is_accepted: dict[Pair, bool], row: Mapping[str, str]) -> None:
    """Add the decision of a row, if it holds one."""
    decision = row.get("decision", "").lower()
    if not decision:
        return
    if decision not in ("accept", "reject"):
        raise ValueError(f"decision is accept, reject or empty, got {row['decision']!r:.60}")
    pair = _parse_pair(row.get("target", ""), row.get("source", ""))
    if is_accepted.setdefault(pair, decision == "accept") != (decision == "accept"):
        raise ValueError(f"one decision a pair is wanted, submaps {pair[0]} and {pair[1]} are accepted and rejected")


def _parse_pair(target: str, source: str) -> Pair:
    """Two submap numbers, the earlier first."""
    for text in (target, source):
        if not (text.isascii() and text.isdigit()):
            raise ValueError(f"target and source are submap numbers, got {text!r:.60}")
    first, last = sorted((int(target), int(source)))
    if first == last:
        raise ValueError(f"target and source are two different submaps, got {first} twice")
    return first, last


def _pair_of(closure: LoopClosure) -> Pair:
    return min(closure.target, closure.source), max(closure.target, closure.source)


def _is_measured(closure: LoopClosure) -> bool:
    return bool(np.isfinite(closure.T_target_source).all() and np.isfinite(closure.sigmas).all())


def _decided(closure: LoopClosure, is_accepted: bool | None) -> LoopClosure:
    if is_accepted is None:
        return closure
    return replace(closure, accepted=is_accepted, reason="" if is_accepted else REJECTED)


def _name(closure: LoopClosure) -> str:
    return f"{closure.target}-{closure.source}"


def _against(closure: LoopClosure) -> str:
    return _name(closure) + (f" (against: {closure.reason})" if closure.reason else "")
