"""How far a command is, on standard error."""

import contextlib
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

import typer
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

__all__ = ["progress", "staged"]

EVERY = 30.0
"""Seconds from line to line where there is no terminal: what takes less says nothing."""


class Told(Progress):
    """A bar; a line now and then where it is disabled."""

    def __init__(self, *columns: ProgressColumn, **usual: Any) -> None:
        super().__init__(*columns, **usual)
        self._last = time.monotonic()

    def update(self, task_id: TaskID, **changes: Any) -> None:
        super().update(task_id, **changes)
        self._tell(task_id)

    def advance(self, task_id: TaskID, advance: float = 1) -> None:
        super().advance(task_id, advance)
        self._tell(task_id)

    def _tell(self, task_id: TaskID) -> None:
        if self.disable and time.monotonic() - self._last >= EVERY:
            self._last = time.monotonic()
            task = next(one for one in self.tasks if one.id == task_id)
            most = "" if task.total is None else f" of {task.total:.0f}"
            typer.echo(f"{task.description} {task.completed:.0f}{most}", err=True)


def progress() -> Progress:
    """A bar on standard error if that is a terminal, else a line every EVERY seconds."""
    return Told(
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
