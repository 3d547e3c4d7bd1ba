"""How far a command is, on standard error."""

import contextlib
import sys
from collections.abc import Callable, Iterator

import typer
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

__all__ = ["progress", "staged"]


def progress() -> Progress:
    """A bar on standard error, if that is a terminal."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        disable=not sys.stderr.isatty(),
    )


@contextlib.contextmanager
def staged() -> Iterator[tuple[Callable[[str, int, int], None], Callable[[str], None]]]:
    """A bar for one stage after the other, where standard error is a terminal: what is told a stage, how much of it is
    done and how much there is; and what prints a line on standard output above the bar."""
    with progress() as bar:
        task: dict[str, TaskID] = {}

        def each(stage: str, done: int, most: int) -> None:
            if stage not in task:
                for old in task.values():
                    bar.remove_task(old)
                task.clear()
                task[stage] = bar.add_task(stage, total=most)
            bar.update(task[stage], completed=done)

        def say(line: str) -> None:
            for old in task.values():
                bar.remove_task(old)
            task.clear()
            bar.refresh()
            typer.echo(line)

        yield each, say
