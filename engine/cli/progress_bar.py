"""The bar that shows on a terminal how far a command has come."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import Any

__all__ = ["progress_bar"]


@contextlib.contextmanager
def progress_bar(counted: str, description: str) -> Iterator[Callable[..., None]]:
    """Show a bar on the standard error stream.

    Args:
        counted: What it counts, such as ``steps``.
        description: What is under way, at first.

    Yields:
        What changes it: ``completed``, ``total``, ``description`` and ``note``; with ``anew``, the time left is estimated from now on.
    """
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn(counted),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[note]}"),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as display:
        task = display.add_task(description, total=None, note="")

        def change(*, anew: bool = False, **now: Any) -> None:
            if anew:
                display.reset(task, total=now.get("total"))
            display.update(task, **now)

        yield change
