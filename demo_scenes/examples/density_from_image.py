"""A photograph in dots of two sizes: its darkness is the density, and as many dots are placed as it takes to cover it."""

from pathlib import Path

import esh
import numpy as np

PHOTOGRAPH = Path(__file__).parents[1] / "recipes" / "cat.png"


def main(folder: Path) -> esh.Placement:
    darkness = esh.read_density(PHOTOGRAPH, invert=True)
    height, width = darkness.shape
    sizes = [esh.Size("large", 6.0, share=0.5), esh.Size("small", 2.0, share=0.5)]
    ink = esh.BodyClass("ink", sizes, darkness, count="cover", unsharp=esh.Unsharp(amount=1.0, radius=2.0))
    placement = esh.solve(esh.Problem(esh.Domain((width, height)), [ink]))  # a pixel is a square meter
    esh.write_halftone_png(folder / "density_from_image.png", placement, pixels_per_metre=3.0)
    return placement


def test_final(placement: esh.Placement) -> None:
    darkness = esh.read_density(PHOTOGRAPH, invert=True)
    rows, columns = np.array(darkness.shape) // 16
    drawn = 1.0 - esh.render_halftone(placement, pixels_per_metre=1.0)[..., 0]
    blocks = [image[: rows * 16, : columns * 16].reshape(rows, 16, columns, 16) for image in (drawn, darkness)]
    drawn, asked = (image.mean(axis=(1, 3)).ravel() for image in blocks)
    assert np.corrcoef(drawn, asked)[0, 1] > 0.98


if __name__ == "__main__":
    test_final(main(Path()))
