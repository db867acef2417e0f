"""Draw the images of the recipes beside this file: small, and of every kind that a recipe can name.

Run it in any folder: the images go beside this file.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

FOLDER = Path(__file__).parent


def grid(width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    """Middles of pixels, x to the right and y up, both -1..1; shapes ``[1, width]`` and ``[height, 1]``."""
    return 2.0 * (np.arange(width)[None] + 0.5) / width - 1.0, 1.0 - 2.0 * (np.arange(height)[:, None] + 0.5) / height


def hills() -> np.ndarray:
    """Soft, of another aspect than most domains, and nowhere 0."""
    x, y = grid(64, 48)
    return 0.08 + 0.6 * np.exp(-6.0 * ((x + 0.4) ** 2 + (y - 0.3) ** 2)) + 0.3 * np.exp(-9.0 * ((x - 0.6) ** 2 + y**2))


def slope() -> np.ndarray:
    """A density of any scale: 0.2 at the left to 3 at the upper right."""
    x, y = grid(32, 32)
    return 1.6 + 1.1 * x + 0.3 * x * y


def islands() -> np.ndarray:
    """Four islands and a single pixel, in emptiness that is nine tenths of the whole."""
    x, y = grid(64, 64)
    result = np.zeros((64, 64))
    for left, up, radius, most in (
        (-0.7, 0.6, 0.2, 1.0),
        (0.5, 0.7, 0.14, 0.5),
        (0.1, -0.2, 0.17, 0.8),
        (0.8, -0.8, 0.15, 1.0),
    ):
        distance = np.hypot(x - left, y - up) / radius
        result = np.where(distance < 1.0, most * (1.0 - 0.6 * distance), result)
    result[50, 6] = 1.0
    return result


def specks() -> np.ndarray:
    """Three single pixels: whoever draws places at random in a larger cell hardly ever hits one."""
    result = np.zeros((64, 64))
    result[[9, 30, 52], [50, 12, 37]] = 1.0, 0.5, 1.0
    return result


def plates() -> np.ndarray:
    """A grid of plates with sharp edges, with empty gaps between them."""
    x, y = np.arange(40)[None] % 10, np.arange(40)[:, None] % 8
    return np.where((x < 8) & (y < 7), 0.4 + 0.6 * ((np.arange(40)[None] // 10 + np.arange(40)[:, None] // 8) % 2), 0.0)


def rings() -> np.ndarray:
    """Rings with edges in all directions."""
    x, y = grid(64, 64)
    return 0.5 + 0.4 * np.sign(np.sin(9.0 * np.hypot(x, y)))


def tones() -> np.ndarray:
    """Gray and alpha: from white to black, the whole range, with a transparent corner."""
    x, y = grid(48, 48)
    gray = 0.5 + 0.5 * np.sin(2.5 * x + 1.5 * y)
    return np.stack([gray, np.where(x + y < -1.2, 0.0, 1.0)], axis=-1)


def angles() -> np.ndarray:
    """Directions around the middle; gray 0..1 is half a turn."""
    x, y = grid(32, 32)
    return np.mod(np.arctan2(x, -y), np.pi) / np.pi


def flow() -> np.ndarray:
    """Vectors in red and green of a saddle, fading to none at the left."""
    x, y = grid(48, 48)
    vectors = np.stack([x + 0 * y, -y + 0 * x]) / np.hypot(x, y) * np.clip(x + 1.0, 0.0, 1.0)
    return np.stack([*(0.5 + 0.5 * vectors), np.full((48, 48), 0.5)], axis=-1)


def lengths() -> np.ndarray:
    """Short at the top, long at the bottom, in steps."""
    x, y = grid(32, 32)
    return np.round(4.0 * (0.5 - 0.5 * y + 0.0 * x)) / 4.0


def colors() -> np.ndarray:
    """All hues around the middle, darker towards the right, white in a corner."""
    x, y = grid(64, 64)
    hue = np.arctan2(y, x)
    rgb = (
        np.stack([0.5 + 0.45 * np.cos(hue - turn) for turn in (0.0, 2.1, 4.2)], axis=-1) * (0.75 - 0.25 * x)[..., None]
    )
    return np.where((x - y > 1.4)[..., None], 1.0, rgb)


def save(name: str, values: np.ndarray, bits: int = 8) -> None:
    """Write numbers 0..1 as a PNG file."""
    whole = np.round(np.clip(values, 0.0, 1.0) * (2**bits - 1)).astype(np.uint16 if bits == 16 else np.uint8)
    Image.fromarray(whole).save(FOLDER / f"{name}.png", optimize=True)


def main() -> None:
    """Write all of them."""
    save("hills", hills(), bits=16)
    np.save(FOLDER / "slope.npy", slope().astype(np.float32))
    for draw in (islands, specks, plates, rings, tones, angles, flow, lengths, colors):
        save(draw.__name__, draw())


if __name__ == "__main__":
    main()
