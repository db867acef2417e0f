"""Join the pictures that ``live_driver.py`` took during a stroke: ``python film_strip.py FOLDER docs/stroke.jpg``."""

import sys
from pathlib import Path

import numpy as np
from PIL import Image

# What of a screenshot is shown, in pixels: left, upper, right, lower.
PART = (430, 270, 740, 890)
GAP = 6
# Pictures from during the stroke, at most.
MOST = 4


def main(folder: Path, target: Path) -> None:
    """Write the strip: before the stroke, whenever the result had followed, and after it."""
    during = sorted(folder.glob("stroke-*.png"), key=lambda path: int(path.stem.partition("-")[2]))
    chosen = [during[round(k)] for k in np.linspace(0, len(during) - 1, min(MOST, len(during)))]
    pictures = [folder / "live-before.png", *chosen, folder / "live-after.png"]
    width, height = PART[2] - PART[0], PART[3] - PART[1]
    strip = Image.new("RGB", (len(pictures) * (width + GAP) - GAP, height), "white")
    for number, path in enumerate(pictures):
        with Image.open(path) as picture:
            strip.paste(picture.convert("RGB").crop(PART), (number * (width + GAP), 0))
    strip.save(target, quality=82, optimize=True)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
