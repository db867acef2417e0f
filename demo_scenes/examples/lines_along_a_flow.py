"""Lines along a flow: water around a stone. An image of vectors gives the directions, an image of numbers the lengths."""

from pathlib import Path

import esh
import numpy as np

X, Y = np.meshgrid(np.linspace(-3.0, 3.0, 240), np.linspace(1.7, -1.7, 136))  # row 0 is the top
Z = X + 1j * Y
OUTSIDE = abs(Z) > 1.0
SPEED = np.where(OUTSIDE, np.conj(1.0 - 1.0 / np.where(OUTSIDE, Z, 2.0) ** 2), 0.0)  # around a disc of radius 1


def main(folder: Path) -> esh.Placement:
    flow = np.stack([SPEED.real, SPEED.imag], axis=-1) / abs(SPEED).max()
    line = esh.Line(length=0.7 + 0.9 * abs(SPEED), direction=flow, width=0.2)
    water = esh.BodyClass("water", [esh.Size("line", 0.3, 1700, line=line)], OUTSIDE * (0.4 + abs(SPEED)))
    placement = esh.solve(esh.Problem(esh.Domain((60.0, 34.0)), [water]))
    picture = folder / "lines_along_a_flow.png"
    esh.write_halftone_png(picture, placement, pixels_per_metre=25.0, colors=[(0.10, 0.33, 0.48)])
    return placement


def test_final(placement: esh.Placement) -> None:
    x, y = (placement.position / 10.0 - [3.0, 1.7]).T
    z = x + 1j * y
    assert abs(z).min() > 0.99  # none in the stone
    turned = np.angle(np.exp(1j * placement.angle) / np.conj(1.0 - 1.0 / z**2))
    assert np.median(abs((turned + np.pi / 2) % np.pi - np.pi / 2)) < np.radians(4.0)


if __name__ == "__main__":
    test_final(main(Path()))
