"""Colors that classes are drawn in where nobody has chosen any."""

from __future__ import annotations

import numpy as np

__all__ = ["PALETTE", "Color", "class_colors"]

Color = tuple[int, int, int]

# Told apart by lightness as well as by hue, so that neither print nor color blindness merges two neighbors.
PALETTE: tuple[Color, ...] = (
    (38, 92, 74),
    (226, 150, 52),
    (62, 112, 168),
    (196, 78, 62),
    (132, 186, 150),
    (122, 88, 150),
    (240, 200, 110),
    (96, 170, 190),
    (214, 140, 160),
    (110, 82, 60),
)
# Further colors are chosen among so many along each of red, green and blue, of lightnesses that stand out from paper and from ink.
LEVELS = 12
DARKEST, LIGHTEST = 25.0, 85.0
# Of linear red, green and blue, to X, Y and Z over those of white (IEC 61966-2-1).
TO_XYZ = np.array([[0.4339, 0.3762, 0.1899], [0.2126, 0.7152, 0.0722], [0.0177, 0.1095, 0.8728]])


def class_colors(count: int) -> list[Color]:
    """Return a color for every class: those of the palette, then each as unlike all before it as can be.

    Of more than about a thousand classes some share one.
    """
    step = np.linspace(0.0, 255.0, LEVELS).round()
    choice = np.stack(np.meshgrid(step, step, step), axis=-1).reshape(-1, 3)
    seen = _as_seen(choice)
    usable = (seen[:, 0] > DARKEST) & (seen[:, 0] < LIGHTEST)
    choice, seen = choice[usable], seen[usable]
    colors = list(PALETTE)
    away = np.min([np.linalg.norm(seen - _as_seen(np.array(color)), axis=1) for color in PALETTE], axis=0)
    for _ in range(len(PALETTE), min(count, len(choice))):
        best = int(np.argmax(away))
        red, green, blue = choice[best].astype(int).tolist()
        colors.append((red, green, blue))
        away = np.minimum(away, np.linalg.norm(seen - seen[best], axis=1))
    return [colors[number % len(colors)] for number in range(count)]


def _as_seen(color: np.ndarray) -> np.ndarray:
    """CIELAB of colors in sRGB, 0..255: distances are about how unlike they look."""
    share = color / 255.0
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    light = linear @ TO_XYZ.T
    x, y, z = np.moveaxis(np.where(light > 216.0 / 24389.0, np.cbrt(light), 841.0 / 108.0 * light + 4.0 / 29.0), -1, 0)
    return np.stack([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)], axis=-1)
