"""The terminal: where the commands print, and a watch that draws progress."""

from collections.abc import Iterator, Sequence
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from sssslam.watch import Watch

Item = TypeVar("Item")
# Paths are printed as they are: [a] in one is no markup.
out_console = Console(soft_wrap=True, highlight=False, markup=False)
progress_console = Console(stderr=True)


class Shown(Watch):
    """A watch that draws a bar with rate and time left on a terminal, and nothing in a pipe."""

    def track(self, name: str, items: Sequence[Item]) -> Iterator[Item]:
        """As `Watch.track`, with a bar.

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
        name_column, rate_column = TextColumn("{task.description:>15}"), TextColumn("{task.fields[rate]}")
        columns = (name_column, BarColumn(), MofNCompleteColumn(), rate_column, TimeRemainingColumn())
        quiet = not progress_console.is_terminal
        with Progress(*columns, console=progress_console, transient=True, disable=quiet) as progress:
            bar = progress.add_task(name, total=len(items), rate="")
            for item in super().track(name, items):
                yield item
                speed = progress.tasks[bar].speed
                progress.update(bar, advance=1, rate=f"{speed:.1f}/s" if speed else "")
