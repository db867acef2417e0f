"""Draw the density images of meadow.toml: a brook that winds through a meadow.

Run it in any folder: the images go beside this file.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

WIDTH, HEIGHT = 256, 192
DOMAIN = (40.0, 30.0)


def main() -> None:
    """Write meadow-dry.png and meadow-banks.png, 16 bits of gray each."""
    x = (np.arange(WIDTH) + 0.5) / WIDTH * DOMAIN[0]
    y = DOMAIN[1] - (np.arange(HEIGHT)[:, None] + 0.5) / HEIGHT * DOMAIN[1]
    brook = 14.0 + 4.5 * np.sin(x / 5.2) + 1.6 * np.sin(x / 2.3 + 1.0)
    slope = 4.5 / 5.2 * np.cos(x / 5.2) + 1.6 / 2.3 * np.cos(x / 2.3 + 1.0)
    # Distance from the brook's middle, measured across it rather than along y [m].
    distance = np.abs(y - brook) / np.sqrt(1.0 + slope**2)
    land = np.clip((distance - 0.9) / 0.3, 0.0, 1.0)
    banks = land * (np.exp(-(((distance - 1.2) / 2.2) ** 2)) + 0.04)
    dry = land * np.clip((distance - 2.5) / 6.0, 0.0, 1.0) ** 1.5
    for name, density in (("dry", dry), ("banks", banks)):
        gray = np.round(65535 * density / density.max()).astype(np.uint16)
        Image.fromarray(gray).save(Path(__file__).parent / f"meadow-{name}.png", optimize=True)


if __name__ == "__main__":
    main()
