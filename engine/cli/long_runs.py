"""What commands share that run for long, on several processes or machines, and that go on where they were stopped."""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Callable, Iterator
from typing import TypeVar

from .argument_types import whole_number

__all__ = ["add_run_options", "following"]

State = TypeVar("State")


def add_run_options(parser: argparse.ArgumentParser, part: str, ray_note: str = "") -> None:
    """Add the options that say where a run takes place.

    Args:
        parser: Of the command.
        part: What is solved at a time, in words.
        ray_note: What is to be known of the machines of a cluster.
    """
    parser.add_argument(
        "--workers",
        metavar="N",
        type=whole_number(0),
        help="processes (default: one per processor; on a GPU as many as it has memory for)",
    )
    parser.add_argument(
        "--ray", metavar="ADDRESS", help=f'solve on a Ray cluster: "auto", "local" or an address{ray_note}'
    )
    parser.add_argument(
        "--gpus", metavar="G", type=_gpus, default=0.0, help=f"GPUs that {part} asks of Ray (default: 0)"
    )
    parser.add_argument("--device", metavar="D", default="auto", help='"auto" (default), "cpu" or "cuda:0"')
    parser.add_argument("--quiet", action="store_true", help="show no progress and no summary")


@contextlib.contextmanager
def following(
    options: argparse.Namespace,
    bar: Callable[[], contextlib.AbstractContextManager[Callable[[State], None]]],
    done: Callable[[State], str],
) -> Iterator[Callable[[State], None]]:
    """Show how far a run has come, and say so where it is stopped.

    Args:
        options: Of the command line.
        bar: Shows a bar, and yields what changes it.
        done: Says how much is done.

    Yields:
        What the run calls with its state.

    Raises:
        KeyboardInterrupt: The run was stopped; it says what is done, and that the same command goes on.
    """
    reached: list[State] = []
    shown = sys.stderr is not None and sys.stderr.isatty() and not options.quiet
    with bar() if shown else contextlib.nullcontext() as change:

        def follow(state: State) -> None:
            reached[:] = [state]
            if change is not None:
                change(state)

        try:
            yield follow
        except KeyboardInterrupt:
            raise KeyboardInterrupt(
                f"; {done(reached[0])}, and the same command continues" if reached else ""
            ) from None


def _gpus(text: str) -> float:
    with contextlib.suppress(ValueError):
        if 0.0 <= float(text) <= 64.0:
            return float(text)
    raise argparse.ArgumentTypeError(f"must be a number from 0 to 64; got {text!r}")
