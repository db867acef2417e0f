"""A tile without seams: three classes in a domain whose opposite edges are joined, drawn three by two times."""

from pathlib import Path

import esh
import numpy as np
from PIL import Image

COLORS = [(0.16, 0.34, 0.52), (0.85, 0.45, 0.25), (0.93, 0.75, 0.36)]


def main(folder: Path) -> esh.Placement:
    turn = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
    waves = 0.5 + 0.5 * np.sin(turn[:, None]) * np.cos(turn[None, :])  # periodic, too
    densities = {"blue": waves**3, "orange": (1.0 - waves) ** 3, "sand": 1.0}
    classes = [esh.BodyClass(name, [esh.Size("dot", 0.2, 140)], image) for name, image in densities.items()]
    placement = esh.solve(esh.Problem(esh.Domain((12.0, 12.0), "periodic"), classes, avoid_overlap=True))
    tile = esh.render_halftone(placement, pixels_per_metre=25.0, colors=COLORS)
    Image.fromarray(np.round(255.0 * np.tile(tile, (2, 3, 1))).astype(np.uint8)).save(folder / "periodic_tile.png")
    return placement


def test_final(placement: esh.Placement) -> None:
    offset = placement.position[:, None] - placement.position[None]
    offset -= 12.0 * np.round(offset / 12.0)  # the shortest way, across an edge or not
    distance = np.hypot(*np.moveaxis(offset, -1, 0)) + 12.0 * np.eye(len(offset))
    assert distance.min() > 2.0 * np.sqrt(0.2 / np.pi) - 1e-6  # no two dots touch, across the edges neither
    assert placement.report.overlaps == 0


if __name__ == "__main__":
    test_final(main(Path()))
