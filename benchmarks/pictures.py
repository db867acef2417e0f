"""The pictures that experiments are made on, and how their results are put on one sheet.

The photographs are scikit-image's: "astronaut" (NASA, public domain), "camera" (Lav Varshney, CC0) and "chelsea" (Stefan van der
Walt, CC0). Figures are numbered as in Schmaltz, Gwosdek and Weickert 2012.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from skimage import data
from skimage.transform import resize

__all__ = ["astronaut", "camera", "cat", "dark_word", "face", "gaussian", "sheet"]

MARGIN = 16
CAPTION = 30


@cache
def astronaut(width: int = 256) -> np.ndarray:
    """Color photograph, square, stored values 0..1."""
    return np.clip(resize(data.astronaut(), (width, width), anti_aliasing=True), 0.0, 1.0)


@cache
def face(width: int = 200) -> np.ndarray:
    """Darkness of a portrait, 2:3, shape ``[1.5 width, width]``."""
    part = data.astronaut()[0:360, 100:340] @ np.array([0.2126, 0.7152, 0.0722]) / 255.0
    return np.clip(1.0 - resize(part, (width * 3 // 2, width), anti_aliasing=True), 0.0, 1.0)


@cache
def camera(width: int = 256) -> np.ndarray:
    """Darkness of a photograph, square."""
    return np.clip(1.0 - resize(data.camera(), (width, width), anti_aliasing=True), 0.0, 1.0)


@cache
def cat(width: int = 463, height: int = 229) -> np.ndarray:
    """Darkness of a photograph with fine fur."""
    gray = data.chelsea()[20:240] @ np.array([0.2126, 0.7152, 0.0722]) / 255.0
    return np.clip(1.0 - resize(gray, (height, width), anti_aliasing=True), 0.0, 1.0)


def gaussian(width: int = 256) -> np.ndarray:
    """A Gaussian bump, darkest in the middle."""
    x = (np.arange(width) + 0.5) / width - 0.5
    return np.exp(-0.5 * (x[None] ** 2 + x[:, None] ** 2) / 0.18**2)


def dark_word(width: int = 320, height: int = 95) -> np.ndarray:
    """Darkness of the word DARK, gray 0 on gray 10 of 255 (figure 10)."""
    image = Image.new("L", (width, height), 10)
    font = ImageFont.load_default(90)
    ImageDraw.Draw(image).text((width / 2, height / 2), "DARK", 0, font, anchor="mm")
    return 1.0 - np.where(np.asarray(image) < 5, 0.0, 10.0 / 255.0)


def sheet(path: Path, pictures: Sequence[tuple[str, np.ndarray]], columns: int) -> None:
    """Put pictures (values 0..1, gray or color) with their captions side by side and save them."""
    images = [
        Image.fromarray(np.round(255 * np.clip(_color(picture), 0, 1)).astype(np.uint8)) for _, picture in pictures
    ]
    width, height = max(i.width for i in images), max(i.height for i in images)
    rows = -(-len(images) // columns)
    canvas = Image.new(
        "RGB", (MARGIN + columns * (width + MARGIN), MARGIN + rows * (height + CAPTION + MARGIN)), (250, 249, 246)
    )
    draw = ImageDraw.Draw(canvas)
    font = ImageFont.load_default(18)
    for number, ((caption, _), image) in enumerate(zip(pictures, images, strict=True)):
        x = MARGIN + number % columns * (width + MARGIN)
        y = MARGIN + number // columns * (height + CAPTION + MARGIN)
        canvas.paste(image, (x, y + CAPTION))
        draw.text((x, y + CAPTION - 6), caption, (60, 60, 64), font, anchor="ls")
    canvas.save(path)


def _color(picture: np.ndarray) -> np.ndarray:
    return np.repeat(picture[..., None], 3, axis=2) if picture.ndim == 2 else picture
