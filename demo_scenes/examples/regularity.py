"""Two dials: `regularity`, from nearly a lattice to organic, and `clustering`, from even to clumps; counts and densities stay."""

from pathlib import Path

import esh
import numpy as np
from PIL import Image

FEWER = np.linspace(1.0, 0.3, 64)[None, :]  # to the right


def meadow(regularity: float, clustering: float) -> esh.Placement:
    flowers = esh.BodyClass("flower", [esh.Size("one", 0.11, 700)], FEWER, clustering=clustering, clump_size=3.5)
    return esh.solve(esh.Problem(esh.Domain((30.0, 20.0)), [flowers], regularity=regularity, seed=4))


def main(folder: Path) -> list[esh.Placement]:
    found = [meadow(*dials) for dials in ((1.0, 0.0), (0.4, 0.0), (0.0, 0.0), (0.6, 0.3), (0.6, 0.6), (0.6, 1.0))]
    drawn = [esh.render_halftone(one, pixels_per_metre=12.0, colors=[(0.1, 0.4, 0.2)]) for one in found]
    panels = [np.pad(one, ((6, 6), (6, 6), (0, 0)), constant_values=0.8) for one in drawn]
    picture = np.vstack([np.hstack(panels[:3]), np.hstack(panels[3:])])
    Image.fromarray(np.uint8(np.round(255.0 * picture))).save(folder / "regularity.png")
    return found


def test_final(found: list[esh.Placement]) -> None:
    assert all(len(one.position) == 700 for one in found)
    assert all(abs((one.position[:, 0] < 10.0).mean() - 0.4511) < 0.01 for one in found)
    apart = [one.report.smallest_spacing for one in found]
    assert apart[0] > apart[1] > apart[2] > apart[5]


if __name__ == "__main__":
    test_final(main(Path()))
