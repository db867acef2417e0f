"""Join the pictures that ``film_driver.py`` took: ``python film_strip.py FOLDER docs/stroke.jpg``."""

import sys
from pathlib import Path

import numpy as np
from PIL import Image

# What of a screenshot is shown, in pixels: left, upper, right, lower; and how large each picture is.
PART = (150, 118, 1312, 936)
SIZE = (624, 439)
COLUMNS, ROWS = 3, 2
GAP = 6


def main(folder: Path, target: Path) -> None:
    """Write the strip, in rows: before the stroke, when the result had followed parts of it, and after it."""
    during = sorted(folder.glob("film-[0-9]*.png"), key=lambda path: int(path.stem.partition("-")[2]))
    chosen = np.linspace(0, len(during), COLUMNS * ROWS)[1:-1]
    pictures = [folder / "film-before.png", *(during[round(k) - 1] for k in chosen), folder / "film-after.png"]
    width, height = SIZE
    strip = Image.new("RGB", (COLUMNS * (width + GAP) - GAP, ROWS * (height + GAP) - GAP), "white")
    for number, path in enumerate(pictures):
        row, column = divmod(number, COLUMNS)
        with Image.open(path) as picture:
            part = picture.convert("RGB").crop(PART).resize(SIZE, Image.Resampling.LANCZOS)
        strip.paste(part, (column * (width + GAP), row * (height + GAP)))
    strip.save(target, quality=80, optimize=True)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
