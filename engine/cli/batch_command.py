"""The command ``esh-scatter batch``: many variations of a recipe."""

from __future__ import annotations

import argparse
import contextlib
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from .argument_types import whole_number
from .long_runs import add_run_options, following
from .progress_bar import progress_bar
from .signals import loading
from .streams import complain, say

if TYPE_CHECKING:
    from ..scenes.batch import BatchState

__all__ = ["add_batch", "batch"]

HELP = """\
Solve many variations of a recipe, each into a folder of its own, and list them in a table, manifest.parquet.

The same command continues a batch that was stopped or killed: scenes that are done stay, and none is made twice. Scenes that cannot
be solved are listed, and the others go on.

Exit status: 0 if all scenes were solved, or with --part and --collect. 1 if some could not be. 2 if something in the input is
wrong. 130 after Ctrl-C.
"""
FAILED = 1
# Failures that are listed one by one.
LISTED = 10


def add_batch(commands: argparse._SubParsersAction) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "batch",
        help="solve many variations of a recipe",
        description=HELP,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("recipe", metavar="RECIPE.toml", type=Path, help="the recipe that is varied")
    parser.add_argument("-o", "--output", metavar="FOLDER", type=Path, required=True, help="where the scenes go")
    parser.add_argument(
        "--seeds", metavar="A:B", type=_seeds, required=True, help="seeds from A to B - 1, one scene for each: 0:1000"
    )
    parser.add_argument(
        "--set",
        metavar="KEY=VALUES",
        action="append",
        default=[],
        help="vary a key of the recipe, for example class[pine].count=100:200 (a range), class[1].density=a.png,b.png (a list) or "
        "balance.class_separation=normal(0.5,0.1); may be given several times",
    )
    parser.add_argument(
        "--design",
        choices=("latin", "grid"),
        default="latin",
        help="latin (default): one combination of values for each seed, each value spread evenly (a Latin hypercube); grid: all "
        "combinations with all seeds, of lists and of ranges LOW:HIGH:NUMBER",
    )
    parser.add_argument(
        "--as",
        metavar="ENDING",
        dest="endings",
        action="append",
        help="format of placements: .npz (default), .usdc, ...",
    )
    parser.add_argument(
        "--part", metavar="I/N", type=_part, default=(1, 1), help="make only every N-th scene, from the I-th on"
    )
    parser.add_argument("--collect", action="store_true", help="make no scene; write the table if all are done")
    parser.add_argument("--retry", action="store_true", help="try scenes again that failed")
    parser.add_argument(
        "--max-steps", metavar="N", type=whole_number(1), default=100, help="largest number of steps (default: 100)"
    )
    add_run_options(parser, "a scene")


def batch(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    with loading():
        from ..scenes.batch import Batch, run_batch

    asked = Batch(
        options.recipe,
        options.output,
        options.seeds,
        tuple(options.set),
        options.design,
        tuple(dict.fromkeys(options.endings or [".npz"])),
        options.max_steps,
    )
    with following(options, _progress_bar, _done) as follow:
        state = run_batch(
            asked,
            device=options.device,
            workers=options.workers,
            ray=options.ray,
            gpus=options.gpus,
            part=options.part,
            collect=options.collect,
            retry=options.retry,
            progress=follow,
        )
    if not options.quiet:
        say(_summary(state, options.output))
    for number, why in list(state.failed.items())[:LISTED]:
        complain(f"scene {number:06d} failed: {why}")
    if len(state.failed) > LISTED:
        complain(f"and {len(state.failed) - LISTED:,} more; the manifest has them all")
    return FAILED if state.failed and options.part == (1, 1) and not options.collect else 0


def _summary(state: BatchState, folder: Path) -> str:
    failed = f", {len(state.failed):,} of them failed" if state.failed else ""
    if state.done == state.scenes:
        return f"{state.scenes:,} scenes are done ({state.made:,} in this run){failed}; the table is {folder / 'manifest.parquet'}"
    return f"{state.done:,} of {state.scenes:,} scenes are done ({state.made:,} in this run){failed}; the table comes with the last"


def _done(state: BatchState) -> str:
    return f"{state.done:,} of {state.scenes:,} scenes are done"


@contextlib.contextmanager
def _progress_bar() -> Iterator[Callable[[BatchState], None]]:
    with progress_bar("scenes", "solving") as change:

        def show(state: BatchState) -> None:
            change(completed=state.made, total=state.mine, note=f"{len(state.failed):,} failed" if state.failed else "")

        yield show


def _seeds(text: str) -> range:
    match = re.fullmatch(r"(\d{1,18}):(\d{1,18})", text)
    if not match or int(match[1]) >= int(match[2]):
        raise argparse.ArgumentTypeError(f"must be A:B, whole numbers with A below B; got {text!r}")
    return range(int(match[1]), int(match[2]))


def _part(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d{1,9})/(\d{1,9})", text)
    if not match or not 1 <= int(match[1]) <= int(match[2]):
        raise argparse.ArgumentTypeError(f"must be I/N, whole numbers with I from 1 to N; got {text!r}")
    return int(match[1]), int(match[2])
