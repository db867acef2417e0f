"""Ink channels as files: one image per ink, and a recipe that prints them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ..errors import InputFileError, ProblemError
from ..problem.color_separation import MODELS, halftone_problem, separate
from .image_files import read_color
from .recipe_writer import recipe_text

__all__ = ["channel_writers"]

Writer = Callable[[BinaryIO], None]


def channel_writers(image: str | Path, model: str, folder: str | Path, *, area: float = 1.0) -> dict[Path, Writer]:
    """Return what writes the ink channels of an image and the recipe of its halftone, for :func:`write_files`.

    Args:
        image: A color image, see :func:`~esh.engine.files.image_files.read_color`.
        model: A name in :data:`~esh.engine.problem.color_separation.MODELS`.
        folder: Where the files belong: ``C.png``, ... (16 bits of gray, white = much ink) and ``recipe.toml``. A pixel of
            the image is a square meter of its domain.
        area: Area of a dot [m²].

    Raises:
        InputFileError: An image that cannot be read or holds no ink.
        ProblemError: An unknown model or an area that is none.
    """
    folder = Path(folder)
    color = read_color(image)
    channels = separate(color, model)
    try:
        problem = halftone_problem(color, model, area=area)
    except ProblemError as error:
        raise InputFileError(f"{image}: {error}") from None
    writers: dict[Path, Writer] = {}
    inks = {ink.name: ink for ink in MODELS[model].inks}
    for ink, channel in zip(inks, channels, strict=True):
        writers[folder / f"{ink}.png"] = _png_writer(channel)

    printed = [body_class.name for body_class in problem.classes]
    # A name of a file may hold what would end the comment.
    name = Path(image).name
    comments = [
        f"# {name if name.isprintable() else ascii(name)} in the inks of {model}, each beside this file; "
        "a pixel of it is a square meter.",
        *(f"# {ink} is not printed: half a dot would be enough for it." for ink in inks if ink not in printed),
    ]
    recipe = recipe_text(problem, lambda _, __, ink: f"{ink}.png", colors=[inks[ink].rgb for ink in printed])
    text = "\n".join([*comments, recipe])
    writers[folder / "recipe.toml"] = lambda file: _write_all(file, text.encode("utf-8"))
    return writers


def _png_writer(channel: np.ndarray) -> Writer:
    def write(file: BinaryIO) -> None:
        from PIL import Image

        Image.fromarray(np.round(65535.0 * channel).astype(np.uint16)).save(file, format="PNG")

    return write


def _write_all(file: BinaryIO, data: bytes) -> None:
    file.write(data)
