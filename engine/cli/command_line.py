"""The command ``esh-scatter``: from a recipe to a placement, without Blender.

What takes time to load (NumPy, Warp) is imported only once the arguments are known to be good.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import math
import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, NoReturn

from ..errors import EshError, ProblemError
from ..files.placement_files import WRITERS, check_ending, check_writable, one_of, placement_writer, write_files
from ..problem.ink_models import DEFAULT_MODEL, INK_MODELS
from ..version import __version__
from .batch_command import add_batch, batch
from .progress_bar import progress_bar
from .signals import (
    ENDING,
    INTERRUPTED,
    INTERRUPTING,
    Ended,
    after_all_is_written,
    answered_here,
    loading,
    on_signals,
    received,
)
from .signals import end as end_by_signal
from .streams import close_output, complain, open_standard_streams, say
from .tiles_command import add_tiles, tiles

if TYPE_CHECKING:
    from ..device.profile import Profile
    from ..files.recipe import ParsedRecipe
    from ..problem.placement import Placement
    from ..problem.problem import Problem
    from ..solver.solver import Progress

__all__ = ["main"]

BAD_INPUT = 2
# Commands that have parts which stay.
KEPT = {
    "batch": "the scenes that are done stay, and the same command continues",
    "tiles": "the windows that are done stay, and the same command continues",
}
# Seconds that a step may go on after a signal before the process is ended in its middle.
PATIENCE = 1.0

SOLVE_HELP = """\
Read a recipe, place its bodies, and write their positions.

Exit status: 0 if everything was written. 2 if something in the input is wrong; one sentence says what. 130 if Ctrl-C
stopped the run, 143 and 129 if SIGTERM or SIGHUP did. After all of these nothing was written, and older files are unchanged.
"""


class _Parser(argparse.ArgumentParser):
    """An argument parser that answers a mistake with one sentence, as every other mistake is answered."""

    def error(self, message: str) -> NoReturn:
        """Print the sentence and leave with status 2."""
        self.exit(BAD_INPUT, f"esh-scatter: {message}; see {self.prog} --help\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit status.

    Args:
        arguments: The words after the command's name; those of this process when None.
    """
    command = ""
    try:
        open_standard_streams()
        for stream in (sys.stdout, sys.stderr):
            # A name that the terminal cannot show is no reason to fail.
            if hasattr(stream, "reconfigure"):
                stream.reconfigure(errors="replace")
        with answered_here():
            options = _options(arguments)
            command = options.command
            return {"solve": _solve, "separate": _separate, "batch": batch, "tiles": tiles}[command](options)
    except Ended as ended:
        return _answer(ended.number, command)
    except KeyboardInterrupt as interruption:
        return _answer(signal.SIGINT, command, str(interruption))
    except Exception as error:
        # What a library makes of a signal that interrupted it.
        if received:
            return _answer(received[0], command)
        return _answer_error(error, command)


def _answer(number: int, command: str, reached: str = "") -> int:
    """Say which signal stopped a command, and return the exit status."""
    name = signal.Signals(number).name
    if number != signal.SIGINT:
        complain(f"ended by {name}; {KEPT.get(command, 'nothing was written')}")
        return 128 + number
    kept = "" if command in KEPT and reached else "; nothing was written"
    complain(f"stopped by Ctrl-C{reached}{kept}")
    return INTERRUPTED


def _answer_error(error: Exception, command: str) -> int:
    """Say what is wrong, and return the exit status; raise the error again where it is a mistake of ours."""
    if isinstance(error, EshError):
        complain(str(error))
    elif isinstance(error, MemoryError):
        complain("there is not enough memory; lower the counts, or use smaller density images")
    elif isinstance(error, BrokenPipeError):
        complain(f"a stream was closed that is still written to; {KEPT.get(command, 'nothing was written')}")
        close_output()
    else:
        raise error
    return BAD_INPUT


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Read the arguments. Whoever reads the help may have had enough of it."""
    try:
        return _parser().parse_args(arguments)
    except BrokenPipeError:
        close_output()
        raise SystemExit(0) from None


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="esh-scatter",
        description="Place objects by electrostatic sampling: exact counts, density images, several classes and sizes at once.",
    )
    parser.add_argument("--version", action="version", version=f"esh-scatter {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=_Parser)
    _add_solve(commands)
    add_batch(commands, _whole)
    add_tiles(commands, _whole)
    _add_separate(commands)
    return parser


def _add_solve(commands: argparse._SubParsersAction) -> None:
    """Declare ``solve``."""
    formats = one_of(f"{ending} ({writer.what})" for ending, writer in WRITERS.items())
    solve = commands.add_parser(
        "solve",
        help="place the bodies that a recipe describes",
        description=SOLVE_HELP,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    solve.add_argument(
        "recipe", metavar="RECIPE.toml", type=Path, help="the recipe; images that it names lie in the same folder"
    )
    solve.add_argument(
        "-o",
        "--output",
        metavar="OUT",
        type=Path,
        action="append",
        required=True,
        help=f"file for the placement: {formats}; may be given several times",
    )
    solve.add_argument(
        "--asset",
        metavar="CLASS[/SIZE]=FILE",
        type=_asset,
        action="append",
        default=[],
        help="file of the object itself, for .usd and .glb; may be given several times",
    )
    solve.add_argument("--report", metavar="R.json", type=Path, help="also write the report, as JSON")
    solve.add_argument("--plot", metavar="P.png", type=Path, help="draw a plan: each body as a disc of its size")
    solve.add_argument(
        "--halftone",
        metavar="H",
        type=Path,
        help="draw the bodies as ink on paper: a .png or .svg file",
    )
    solve.add_argument(
        "--scale", metavar="S", type=_positive, default=4.0, help="pixels per meter of a .png halftone (default: 4)"
    )
    solve.add_argument("--seed", metavar="N", type=_whole(0), help="use this seed instead of the recipe's")
    solve.add_argument(
        "--device",
        metavar="D",
        default="auto",
        help='"auto" (default: an NVIDIA GPU if there is one), "cpu" or "cuda:0"',
    )
    solve.add_argument(
        "--max-steps", metavar="N", type=_whole(1), default=100, help="largest number of steps (default: 100)"
    )
    solve.add_argument("--profile", action="store_true", help="print how long each phase took")
    solve.add_argument("--quiet", action="store_true", help="show no progress bar and no report")


def _add_separate(commands: argparse._SubParsersAction) -> None:
    """Declare ``separate``."""
    models = one_of(f"{name} (default)" if name == DEFAULT_MODEL else name for name in INK_MODELS)
    separate = commands.add_parser(
        "separate",
        help="split a color image into inks",
        description="Split a color image into inks. Writes one image for each ink, and a recipe that prints them.",
    )
    separate.add_argument(
        "image", metavar="IMAGE", type=Path, help="a PNG, JPEG or EXR file; transparent places count as white"
    )
    separate.add_argument("--model", metavar="M", default=DEFAULT_MODEL, help=models)
    separate.add_argument(
        "--area", metavar="A", type=_positive, default=1.0, help="area of a dot, in pixels of the image (default: 1)"
    )
    separate.add_argument(
        "-o",
        "--output",
        metavar="FOLDER",
        type=Path,
        required=True,
        help="folder for C.png, ... and recipe.toml; it is made if it does not exist",
    )
    separate.add_argument(
        "--overwrite", action="store_true", help="replace files of other content that lie in the folder already"
    )


def _positive(text: str) -> float:
    """Type of an argument: a finite number above 0."""
    with contextlib.suppress(ValueError):
        if 0.0 < float(text) < math.inf:
            return float(text)
    raise argparse.ArgumentTypeError(f"must be a number above 0; got {text!r}")


def _asset(text: str) -> tuple[str, Path]:
    name, equals, file = text.partition("=")
    if not (name and equals and file):
        raise argparse.ArgumentTypeError(f"must be CLASS=FILE or CLASS/SIZE=FILE; got {text!r}")
    return name, Path(file)


class _whole:
    """Type of an argument: a whole number of at least ``least`` and below 2**63."""

    def __init__(self, least: int) -> None:
        self.least = least

    def __call__(self, text: str) -> int:
        shown = repr(text if len(text) <= 60 else f"{text[:57]}...")
        try:
            number = int(text)
        except ValueError:
            # Python reads no whole numbers of thousands of digits.
            number = 2**63 if text.isdecimal() else self.least - 1
        if number >= 2**63:
            raise argparse.ArgumentTypeError(f"must be below 2**63 = {2**63}; got {shown}")
        if number < self.least:
            raise argparse.ArgumentTypeError(f"must be a whole number of at least {self.least}; got {shown}")
        return number


def _solve(options: argparse.Namespace) -> int:
    with loading():
        _check_outputs(options)
        from ..device.profile import Profile
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
            from ..files.bodies import check_assets

            check_assets(problem, assets)
        warning = cover_of(problem).warning if problem.avoid_overlap and not options.quiet else None
        if warning is not None:
            complain(f"{options.recipe}: {warning}")
        _start_warp()
        profile = Profile() if options.profile else None
    placement = _run(problem, options, profile)
    writers = {path: placement_writer(path, placement, assets=assets) for path in options.output}
    if options.report is not None:
        from ..files.report_files import write_report

        writers[options.report] = lambda file: write_report(file, placement)
    if options.plot is not None:
        from ..drawing.plan import draw_plan

        writers[options.plot] = lambda file: draw_plan(placement, file)
    if options.halftone is not None:
        writers[options.halftone] = _halftone_writer(options, placement, recipe)
    # The result is there: finishing takes a moment, and half of the files would be worse than all or none.
    with on_signals(INTERRUPTING, signal.SIG_IGN):
        write_files(writers)
    with after_all_is_written():
        say(*([] if options.quiet else [placement.report]), *([] if profile is None else [profile]))
    return 0


def _separate(options: argparse.Namespace) -> int:
    with loading():
        from ..files.channel_files import channel_writers

    folder: Path = options.output
    if options.model not in INK_MODELS:
        raise EshError(f"--model must be one of {', '.join(INK_MODELS)}; got {options.model!r}")
    if folder.exists() and not folder.is_dir():
        raise EshError(f"-o {folder} must be a folder; it is a file")
    if not folder.resolve().parent.is_dir():
        raise EshError(f"-o {folder} cannot be made: there is no folder {folder.resolve().parent}")
    writers = channel_writers(options.image, options.model, folder, area=options.area)
    for path in writers:
        if path.exists() and path.samefile(options.image):
            raise EshError(f"-o {folder} would overwrite {options.image}, which this run reads; choose another folder")
    if not options.overwrite:
        _check_replaces_nothing(folder, writers)
    made = not folder.exists()
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise EshError(f"-o {folder} cannot be made: {(error.strerror or str(error)).lower()}") from None
    try:
        write_files(writers)
    except BaseException:
        if made:
            with contextlib.suppress(OSError):
                folder.rmdir()
        raise
    say(f"wrote {', '.join(path.name for path in writers)} into {folder}")
    return 0


def _check_replaces_nothing(folder: Path, writers: Mapping[Path, Callable[[BinaryIO], None]]) -> None:
    """Raise EshError where a file would be replaced whose content is another: somebody may have made or changed it."""
    for path, writer in writers.items():
        if not path.exists():
            continue
        new = io.BytesIO()
        writer(new)
        try:
            same = path.is_file() and path.read_bytes() == new.getvalue()
        except OSError:
            same = False
        if not same:
            raise EshError(
                f"-o {folder} holds another {path.name}, which would be replaced; choose another folder, or add --overwrite"
            )


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

    from ..device.kernel_cache import CacheWarning
    from ..device.launcher import resolve_device
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
        from ..solve import solve

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
        _ends_in_compiled_code(lambda: bool(pressed)),
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
            placement = solve(
                problem, device=options.device, max_steps=options.max_steps, progress=on_progress, profile=profile
            )
        except ProblemError as error:
            raise ProblemError(f"{options.recipe}: {error}") from None
    if pressed:
        raise KeyboardInterrupt(reached)
    return placement


@contextlib.contextmanager
def _ends_in_compiled_code(answered: Callable[[], bool]) -> Iterator[None]:
    """See to it that signals end the process also while Python cannot handle them, because compiled code is at work.

    Python's own handlers run between two of its instructions. Nothing is being written meanwhile.

    Args:
        answered: Whether a handler has run.
    """
    if os.name != "posix" or threading.current_thread() is not threading.main_thread():
        yield
        return
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    before = signal.set_wakeup_fd(writer, warn_on_full_buffer=False)

    def watch() -> None:
        while number := os.read(reader, 1):
            if number[0] not in (*INTERRUPTING, *ENDING):
                continue
            until = time.monotonic() + PATIENCE
            while time.monotonic() < until:
                time.sleep(0.02)
                if answered():
                    return
            name = "Ctrl-C" if number[0] == signal.SIGINT else signal.Signals(number[0]).name
            complain(f"stopped by {name} in the middle of a step; nothing was written")
            os._exit(128 + number[0])

    watcher = threading.Thread(target=watch, name="ESH Scatter signals", daemon=True)
    watcher.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        os.close(writer)
        watcher.join()
        os.close(reader)


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


if __name__ == "__main__":
    sys.exit(main())
