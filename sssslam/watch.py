"""Who watches a run: told of stages and progress, keeps their times."""

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TypeVar

Item = TypeVar("Item")


class Watch:
    """Keeps the time of every stage and shows nothing; a command line may show more.

    Attributes
    ----------
    seconds : dict of str to float
        Wall time of each finished stage [s].
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time a stage that cannot be counted.

        Parameters
        ----------
        name : str
            The stage.

        Yields
        ------
        None
            Once, to run the stage.
        """
        start = time.perf_counter()
        yield
        self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start

    def track(self, name: str, items: Sequence[Item]) -> Iterator[Item]:
        """Time a stage that goes through items, and say how far it is.

        Parameters
        ----------
        name : str
            The stage.
        items : sequence
            What it goes through.

        Yields
        ------
        item
            Each of the items.
        """
        with self.stage(name):
            yield from items
