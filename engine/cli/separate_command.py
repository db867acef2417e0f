"""The command ``esh-scatter separate``: from a color image to inks."""

from __future__ import annotations

import argparse
import contextlib
import io
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import BinaryIO

from ..errors import EshError
from ..files.placement_files import one_of, write_files
from ..problem.ink_models import DEFAULT_MODEL, INK_MODELS
from .argument_types import positive_number
from .signals import loading, writing
from .streams import say

__all__ = ["add_separate", "separate"]


def add_separate(commands: argparse._SubParsersAction) -> None:
    """Add the command to the parser."""
    models = one_of(f"{name} (default)" if name == DEFAULT_MODEL else name for name in INK_MODELS)
    parser = commands.add_parser(
        "separate",
        help="split a color image into inks",
        description="Split a color image into inks. Writes one image for each ink, and a recipe that prints them.",
    )
    parser.add_argument(
        "image", metavar="IMAGE", type=Path, help="a PNG, JPEG or EXR file; transparent places count as white"
    )
    parser.add_argument("--model", metavar="M", default=DEFAULT_MODEL, help=models)
    parser.add_argument(
        "--area",
        metavar="A",
        type=positive_number,
        default=1.0,
        help="area of a dot, in pixels of the image (default: 1)",
    )
    parser.add_argument(
        "-o",
        "--output",
        metavar="FOLDER",
        type=Path,
        required=True,
        help="folder for C.png, ... and recipe.toml; it is made if it does not exist",
    )
    parser.add_argument(
        "--overwrite", action="store_true", help="replace files of other content that lie in the folder already"
    )


def separate(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
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
        with writing() as settle:
            write_files(writers, still_wanted=settle)
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
