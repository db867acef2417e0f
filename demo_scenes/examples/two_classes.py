"""Two classes on opposite densities, in two sizes each: every class is even by itself, and so are the large ones and all."""

from pathlib import Path

import esh
import numpy as np


def main(folder: Path) -> esh.Placement:
    to_the_right = np.linspace(0.0, 1.0, 64)[None, :]  # an image of one row, stretched over the domain
    pine = esh.BodyClass("pine", [esh.Size("large", 3.0, 90), esh.Size("small", 0.8, 360)], 1.0 - to_the_right)
    beech = esh.BodyClass("beech", [esh.Size("large", 3.0, 90), esh.Size("small", 0.8, 360)], to_the_right)
    domain = esh.Domain((60.0, 34.0))
    placement = esh.solve(esh.Problem(domain, [pine, beech], esh.Balance(class_separation=0.5), avoid_overlap=True))
    esh.draw_plan(placement, folder / "two_classes.png")
    return placement


def test_final(placement: esh.Placement) -> None:
    assert np.bincount(placement.class_index).tolist() == [450, 450]
    assert placement.report.overlaps == 0
    middle = [placement.position[placement.class_index == c, 0].mean() for c in (0, 1)]
    assert np.allclose(middle, [20.0, 40.0], atol=1.0)  # where the densities have their means


if __name__ == "__main__":
    test_final(main(Path()))
