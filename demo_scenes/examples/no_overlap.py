"""Nothing overlaps: discs of all sizes and sticks that lie as they like, two thirds of the table covered."""

from pathlib import Path

import esh
import numpy as np


def main(folder: Path) -> esh.Placement:
    stick = esh.Line(2.4, direction="none", width=0.3, stretch_weights=(0.0, 0.1))  # keeps its length
    sticks = esh.BodyClass("sticks", [esh.Size("stick", 2.4 * 0.3 + np.pi * 0.15**2, 45, line=stick)])
    coins = esh.BodyClass("coins", [esh.Size("coin", (0.1, 1.5), 140)])  # a range: every body has its own area
    domain = esh.Domain((18.0, 12.0))
    placement = esh.solve(esh.Problem(domain, [coins, sticks], seed=3, avoid_overlap=True), max_steps=200)
    esh.draw_plan(placement, folder / "no_overlap.png", colors=["#d8a13a", "#6b4a33"])
    return placement


def test_final(placement: esh.Placement) -> None:
    assert len(placement.position) == 185
    assert placement.report.overlaps == 0
    assert placement.report.covered > 0.65
    assert np.allclose(placement.length[placement.class_index == 1], 2.4, rtol=0.02)


if __name__ == "__main__":
    test_final(main(Path()))
