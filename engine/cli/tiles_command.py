"""The command ``esh-scatter tiles``: a domain that is larger than memory."""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from .argument_types import positive_number, whole_number
from .long_runs import add_run_options, following
from .progress_bar import progress_bar
from .signals import loading
from .streams import complain, say

if TYPE_CHECKING:
    from ..tiles.tiles import TileState

__all__ = ["add_tiles", "tiles"]

HELP = """\
Place the bodies of a huge domain tile by tile, into a folder with one file for each tile and a list of them, index.json.

Densities that are .npy or GeoTIFF files are read by window, however large they are. The result is that of one solve, without seams,
and the same bytes for any number of processes. The same command continues a run that was stopped or killed.

Exit status: 0 if all tiles are there. 2 if something in the input is wrong. 130 after Ctrl-C.
"""
# What the stages are called for people.
NAMES = {"clumps": "clumping", "survey": "looking", "start": "starting", "overlaps": "counting overlaps"}


def add_tiles(commands: argparse._SubParsersAction) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "tiles",
        help="place the bodies of a huge domain, tile by tile",
        description=HELP,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "recipe", metavar="RECIPE.toml", type=Path, help="the recipe; images that it names lie beside it"
    )
    parser.add_argument("-o", "--output", metavar="FOLDER", type=Path, required=True, help="where the tiles go")
    parser.add_argument(
        "--tile",
        metavar="METERS",
        type=_length,
        help="length of a tile (default: a hundred spacings of the bodies, more where a class is rare)",
    )
    parser.add_argument("--as", metavar="ENDING", dest="ending", default=".parquet", help=".parquet (default) or .npz")
    parser.add_argument("--seed", metavar="N", type=whole_number(0), help="use this seed instead of the recipe's")
    parser.add_argument(
        "--steps",
        metavar="A,B,C",
        type=_steps,
        help="steps of the three passes (default: 50,45,60; fewer are faster and a little less even)",
    )
    add_run_options(parser, "a window", "; its machines must all see recipe and folder")


def tiles(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    from ..errors import EshError

    with loading():
        from ..tiles.plan import cover_of_tiles, read_tiled_recipe
        from ..tiles.tile_files import TILE_WRITERS
        from ..tiles.tiles import STEPS, solve_tiles

    if options.ending not in TILE_WRITERS:
        raise EshError(f"--as must be {' or '.join(TILE_WRITERS)}; got {options.ending!r}")
    scene = read_tiled_recipe(options.recipe, options.seed)
    warning = cover_of_tiles(scene).warning if scene.problem.avoid_overlap and not options.quiet else None
    if warning is not None:
        complain(f"{options.recipe}: {warning}")
    del scene
    with following(options, _progress_bar, _done) as follow:
        state = solve_tiles(
            options.recipe,
            options.output,
            tile=options.tile,
            seed=options.seed,
            steps=options.steps or STEPS,
            ending=options.ending,
            device=options.device,
            workers=options.workers,
            ray=options.ray,
            gpus=options.gpus,
            progress=follow,
        )
    if not options.quiet:
        columns, rows = state.tiles
        say(
            f"{state.bodies:,} bodies are placed in {columns * rows:,} tiles, {columns} by {rows}; their list is "
            f"{options.output / 'index.json'}",
            *state.notes,
        )
    return 0


def _done(state: TileState) -> str:
    return f"stage {state.stage} of {state.stages} is half done"


@contextlib.contextmanager
def _progress_bar() -> Iterator[Callable[[TileState], None]]:
    with progress_bar("windows", "tiles") as change:
        shown = [""]

        def show(state: TileState) -> None:
            what = NAMES.get(state.name, f"settling, pass {state.name.rpartition('-')[2]}")
            # Every stage takes another time for a part.
            change(anew=shown[0] != state.name, completed=state.done, total=state.parts, description=what)
            shown[0] = state.name

        yield show


def _length(text: str) -> float:
    return positive_number(text, "a length in meters above 0")


def _steps(text: str) -> tuple[int, int, int]:
    words = text.split(",")
    if len(words) == 3 and all(word.isdecimal() and 0 < int(word) < 10**6 for word in words):
        return int(words[0]), int(words[1]), int(words[2])
    raise argparse.ArgumentTypeError(f"must be three whole numbers above 0, as 50,45,60; got {text!r}")
