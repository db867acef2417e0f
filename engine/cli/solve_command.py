"""The command ``esh-scatter solve``: from a recipe to a placement."""

from __future__ import annotations

import argparse
import contextlib
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, NamedTuple, NoReturn

from ..errors import EshError, ProblemError
from ..files.placement_files import (
    WRITERS,
    check_assets_fit,
    check_ending,
    check_writable,
    one_of,
    placement_writer,
    write_files,
)
from .argument_types import positive_number, whole_number
from .compiled_code import ends_in_compiled_code
from .first_signals import ENDING, INTERRUPTING
from .progress_bar import progress_bar
from .signals import after_all_is_written, loading, on_signals, received, writing
from .signals import end as end_by_signal
from .streams import complain, say

if TYPE_CHECKING:
    from ..device.profile import Profile
    from ..files.recipe import ParsedRecipe
    from ..problem.placement import Placement
    from ..problem.problem import Problem
    from ..solver.progress import Progress

__all__ = ["add_solve", "solve"]

HELP = """\
Read a recipe, place its bodies, and write their positions.

Exit status: 0 if everything was written. 2 if something in the input is wrong or cannot be written; one sentence says what.
130 if Ctrl-C stopped the run, 143 and 129 if SIGTERM or SIGHUP did. After all of these nothing was written, and older files are
unchanged; only where the sentence is that the report could not be printed, all files are there.
"""


def add_solve(commands: argparse._SubParsersAction) -> None:
    """Add the command to the parser."""
    formats = one_of(f"{ending} ({writer.what})" for ending, writer in WRITERS.items())
    parser = commands.add_parser(
        "solve",
        help="place the bodies that a recipe describes",
        description=HELP,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "recipe", metavar="RECIPE.toml", type=Path, help="the recipe; images that it names lie in the same folder"
    )
    parser.add_argument(
        "-o",
        "--output",
        metavar="OUT",
        type=Path,
        action="append",
        required=True,
        help=f"file for the placement: {formats}; may be given several times",
    )
    parser.add_argument(
        "--asset",
        metavar="CLASS[/SIZE[/VARIANT]]=FILE",
        type=_asset,
        action="append",
        default=[],
        help="file of the object itself, for .usd and .glb; may be given several times",
    )
    parser.add_argument("--report", metavar="R.json", type=Path, help="also write the report, as JSON")
    parser.add_argument(
        "--plot", metavar="P.png", type=Path, help="draw a plan: each body's outline, or a disc of its size"
    )
    parser.add_argument(
        "--halftone",
        metavar="H",
        type=Path,
        help="draw the bodies as ink on paper: a .png or .svg file",
    )
    parser.add_argument(
        "--scale",
        metavar="S",
        type=positive_number,
        default=4.0,
        help="pixels per meter of a .png halftone (default: 4)",
    )
    parser.add_argument("--seed", metavar="N", type=whole_number(0), help="use this seed instead of the recipe's")
    parser.add_argument(
        "--device",
        metavar="D",
        default="auto",
        help='"auto" (default: an NVIDIA GPU if there is one), "cpu" or "cuda:0"',
    )
    parser.add_argument(
        "--max-steps", metavar="N", type=whole_number(1), default=100, help="largest number of steps (default: 100)"
    )
    parser.add_argument("--profile", action="store_true", help="print how long each phase took")
    parser.add_argument("--quiet", action="store_true", help="show no progress bar and no report")


def _asset(text: str) -> tuple[str, Path]:
    name, equals, file = text.partition("=")
    if not (name and equals and file):
        raise argparse.ArgumentTypeError(f"must be CLASS=FILE or CLASS/SIZE=FILE; got {text!r}")
    return name, Path(file)


def solve(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    with loading():
        _check_outputs(options)
        from ..device.profile import Profile

        asked = _read(options)
        _start_warp()
        profile = Profile() if options.profile else None
    placement = _run(asked.problem, options, profile)
    writers = _writers(options, asked, placement)
    with writing() as settle:
        write_files(writers, still_wanted=settle)
    with after_all_is_written():
        say(*([] if options.quiet else [placement.report]), *([] if profile is None else [profile]))
    return 0


class _Asked(NamedTuple):
    """What a run is to solve: the recipe, its problem, and the files of its objects by the names of classes and sizes."""

    recipe: ParsedRecipe
    problem: Problem
    assets: dict[str, list[Path]]


def _read(options: argparse.Namespace) -> _Asked:
    """Read the recipe, and check that what is asked for can be done and written."""
    from ..files.recipe import parse_recipe, read_recipe, recipe_densities
    from ..problem.cover import cover_of
    from ..problem.domain import Domain

    recipe = parse_recipe(options.recipe)
    problem = read_recipe(recipe, seed=options.seed)
    assets: dict[str, list[Path]] = {}
    for name, path in options.asset:
        assets.setdefault(name, []).append(path)
    _check_not_inputs(options, [options.recipe, *recipe_densities(recipe), *(path for _, path in options.asset)])
    for option in ("plot", "halftone"):
        if getattr(options, option) is not None and not isinstance(problem.domain, Domain):
            raise EshError(f"--{option} draws what lies in a rectangle; {options.recipe} has a surface")
    if assets:
        check_assets_fit(problem, assets, options.output)
    warning = cover_of(problem).warning if problem.avoid_overlap and not options.quiet else None
    if warning is not None:
        complain(f"{options.recipe}: {warning}")
    return _Asked(recipe, problem, assets)


def _writers(
    options: argparse.Namespace, asked: _Asked, placement: Placement
) -> dict[Path, Callable[[BinaryIO], None]]:
    """Return what writes each of the files that are asked for."""
    writers = {path: placement_writer(path, placement, assets=asked.assets) for path in options.output}
    if options.report is not None:
        from ..files.report_files import write_report

        writers[options.report] = lambda file: write_report(file, placement)
    if options.plot is not None:
        from ..drawing.plan import draw_plan

        writers[options.plot] = lambda file: draw_plan(placement, file)
    if options.halftone is not None:
        writers[options.halftone] = _halftone_writer(options, placement, asked.recipe)
    return writers


def _halftone_writer(
    options: argparse.Namespace, placement: Placement, recipe: ParsedRecipe
) -> Callable[[BinaryIO], None]:
    from ..drawing.halftone import write_halftone_png, write_halftone_svg
    from ..files.recipe import recipe_colors

    colors = recipe_colors(recipe, placement.problem)
    if options.halftone.suffix.lower() == ".svg":
        return lambda file: write_halftone_svg(file, placement, colors=colors)
    return lambda file: write_halftone_png(file, placement, pixels_per_metre=options.scale, colors=colors)


def _start_warp() -> None:
    """Start Warp without a word on the streams that are the report's and ours, but for where kernels are kept."""
    import warp

    from ..device.devices import resolve_device
    from ..device.kernel_cache import CacheWarning
    from ..native_output import muted

    # Warp tells of every kernel it loads on the stream that the report goes to, and of a missing GPU on the other.
    warp.config.log_level = warp.LOG_ERROR
    with warnings.catch_warnings(record=True) as caught, muted():
        warnings.simplefilter("always", CacheWarning)
        resolve_device("cpu")
    for note in caught:
        if issubclass(note.category, CacheWarning):
            complain(str(note.message))


def _run(problem: Problem, options: argparse.Namespace, profile: Profile | None) -> Placement:
    with loading():
        from ..solve import solve as solve_problem

    show_bar = sys.stderr is not None and sys.stderr.isatty() and not options.quiet
    pressed: list[bool] = []
    reached = ""

    def press(number: int, frame: object) -> NoReturn:
        pressed.append(True)
        received.append(number)
        raise KeyboardInterrupt(reached)

    def end(number: int, frame: object) -> NoReturn:
        pressed.append(True)
        end_by_signal(number, frame)

    with (
        on_signals(INTERRUPTING, press),
        on_signals(ENDING, end),
        ends_in_compiled_code(lambda: bool(pressed)),
        _progress_bar(problem.body_count) if show_bar else contextlib.nullcontext() as bar,
    ):

        def on_progress(progress: Progress) -> bool:
            nonlocal reached
            reached = f" after {progress.step} of {progress.steps} steps"
            if bar is not None:
                bar(progress)
            # Where Python cannot raise (in a destructor, say), the press would be lost.
            return not pressed

        try:
            placement = solve_problem(
                problem, device=options.device, max_steps=options.max_steps, progress=on_progress, profile=profile
            )
        except ProblemError as error:
            raise ProblemError(f"{options.recipe}: {error}") from None
    if pressed:
        raise KeyboardInterrupt(reached)
    return placement


@contextlib.contextmanager
def _progress_bar(body_count: int) -> Iterator[Any]:
    with progress_bar("steps", "preparing (the first run compiles)") as change:

        def show(progress: Any) -> None:
            change(
                description=f"placing {body_count:,} bodies",
                completed=progress.step,
                total=progress.steps,
                note=f"residual {progress.residual:.1e}",
            )

        yield show


def _check_outputs(options: argparse.Namespace) -> None:
    """Find out before the run, not after it, that something cannot be written."""
    endings = {"-o": tuple(WRITERS), "--report": (".json",), "--plot": (".png",), "--halftone": (".png", ".svg")}
    seen: dict[Path, Path] = {}
    for option, path in _outputs(options):
        ending = check_ending(path, endings[option], option)
        if option == "-o":
            WRITERS[ending].check()
        check_writable(path)
        target = path.resolve()
        if target in seen:
            raise EshError(
                f"{option} {path} is the same file as {seen[target]}, which was given before; choose another name"
            )
        seen[target] = path


def _check_not_inputs(options: argparse.Namespace, inputs: list[Path]) -> None:
    for option, path in _outputs(options):
        for source in inputs:
            if path.resolve() == source.resolve() or (path.exists() and source.exists() and path.samefile(source)):
                raise EshError(f"{option} {path} would overwrite {source}, which this run reads; choose another name")


def _outputs(options: argparse.Namespace) -> list[tuple[str, Path]]:
    named = [("-o", path) for path in options.output]
    more = [(f"--{n}", getattr(options, n)) for n in ("report", "plot", "halftone")]
    return named + [(option, path) for option, path in more if path is not None]
