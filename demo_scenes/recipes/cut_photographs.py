"""Cut the photographs of hatching.toml and halftone.toml out of two that scikit-image ships.

"chelsea" is by Stefan van der Walt (CC0), "astronaut" by NASA (public domain). Run it in any folder, with scikit-image
installed: the images go beside this file.
"""

from __future__ import annotations

from pathlib import Path

from PIL import Image, ImageOps
from skimage import data


def main() -> None:
    """Write cat.png, gray, and astronaut.png, in color."""
    here = Path(__file__).parent
    cat = Image.fromarray(data.chelsea()).convert("L").crop((20, 0, 420, 300))
    # Strokes hold few shades of gray: as much contrast as there can be, and much paper.
    cat = ImageOps.autocontrast(cat.resize((240, 180), Image.Resampling.LANCZOS), cutoff=1)
    cat.point([round(255 * (1 - (1 - gray / 255) ** 1.3)) for gray in range(256)]).save(here / "cat.png", optimize=True)
    astronaut = Image.fromarray(data.astronaut()).crop((90, 0, 346, 256))
    astronaut.resize((144, 144), Image.Resampling.LANCZOS).save(here / "astronaut.png", optimize=True)


if __name__ == "__main__":
    main()
