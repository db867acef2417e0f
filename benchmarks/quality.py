"""How even placements are, beside those of the paper's scheme, as a Markdown table.

python benchmarks/quality.py --device cpu
"""

from __future__ import annotations

import argparse

import numpy as np
from esh.engine.problem.balance import Balance
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.domain import Domain
from esh.engine.problem.placement import Placement
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.quality.coverage import coverage_error
from esh.engine.quality.spacing import HEXAGONAL_SPACING
from esh.engine.solve import solve
from skimage import data
from skimage.transform import resize

UNIFORM = np.ones((1, 1), dtype=np.float32)
SQUARE = Domain((64.0, 64.0))


def photograph() -> np.ndarray:
    """Density of scikit-image's "camera" (CC0), 128 x 128: dark = many."""
    return 1.0 - resize(data.camera(), (128, 128), anti_aliasing=True)


def quality_cases() -> list[tuple[str, Problem, list[tuple[str, object, np.ndarray, tuple[float, float, float]]]]]:
    """Problems, and of each the parts to score beside the direct sum's scores after 1,000 steps of the paper's scheme."""
    image = photograph()
    return [
        (
            "uniform, 4,096",
            Problem(SQUARE, [BodyClass("a", [Size("s", 1.0, 4096)])]),
            [("all", lambda p: slice(None), UNIFORM, (0.0223, 0.0033, 0.0010))],
        ),
        (
            "photograph, 4,096",
            Problem(SQUARE, [BodyClass("a", [Size("s", 1.0, 4096)], image)]),
            [("all", lambda p: slice(None), image, (0.0663, 0.0053, 0.0013))],
        ),
        (
            "two classes of 1,024, separation 0.5",
            Problem(SQUARE, [BodyClass(name, [Size("s", 1.0, 1024)]) for name in "ab"], Balance(0.5)),
            [
                ("union", lambda p: slice(None), UNIFORM, (0.070, 0.0069, 0.0017)),
                ("one class", lambda p: p.class_index == 0, UNIFORM, (0.076, 0.019, 0.0067)),
            ],
        ),
        (
            "areas 1 and 3, 1,536 and 256, emphasis 2",
            Problem(SQUARE, [BodyClass("a", [Size("s", 1.0, 1536), Size("l", 3.0, 256)])], Balance(size_emphasis=2.0)),
            [
                ("all", lambda p: slice(None), UNIFORM, (0.180, 0.020, 0.0055)),
                ("large", lambda p: p.size_index == 1, UNIFORM, (0.091, 0.032, 0.017)),
            ],
        ),
    ]


def nearest_distance(placement: Placement, chosen: object) -> str:
    """Smallest and mean distance to the nearest neighbour, hexagonal = 1."""
    from scipy.spatial import cKDTree

    position = placement.position[chosen]
    distance = cKDTree(position).query(position, 2)[0][:, 1]
    distance = distance / (HEXAGONAL_SPACING * np.sqrt(placement.problem.domain.area / len(position)))
    return f"{distance.min():.2f} / {distance.mean():.2f}"


def quality_table(device: str) -> list[str]:
    """Coverage errors, each with the direct sum's in brackets."""
    lines = [
        "| case | part | steps | k = 0.5 | k = 1 | k = 2 | smallest / mean spacing |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, problem, parts in quality_cases():
        placement = solve(problem, device=device)
        for part, choose, image, reference in parts:
            chosen = choose(placement)
            cells = []
            for k, direct in zip((0.5, 1.0, 2.0), reference, strict=True):
                own = coverage_error(placement.position[chosen], placement.area[chosen], image, SQUARE, k)
                cells.append(f"{own:.4f} ({direct:.4f})")
            # Spacing means something where all bodies are alike and the density is uniform.
            alike = image is UNIFORM and np.ptp(placement.area[chosen]) == 0.0
            spacing = nearest_distance(placement, chosen) if alike else "-"
            lines.append(f"| {name} | {part} | {placement.report.steps} | {' | '.join(cells)} | {spacing} |")
    return lines


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device", default="auto")
    options = parser.parse_args()
    print("\n".join(quality_table(options.device)))


if __name__ == "__main__":
    main()
