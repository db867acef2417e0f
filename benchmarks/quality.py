"""How even placements are, beside those of the paper's scheme, as a Markdown table.

The paper is Schmaltz, Gwosdek and Weickert 2012.

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
# On which tone is compared; a multiple of the sizes of all images.
TONE_CELLS = 1024
COUNTS = (4000, 400, 40)
# The smallest of thousands of distances differs from seed to seed by some hundredths.
SEEDS = 4


def photograph() -> np.ndarray:
    """Density of scikit-image's "camera" (CC0), 128 x 128: dark = many."""
    return 1.0 - resize(data.camera(), (128, 128), anti_aliasing=True)


def quality_cases(
    seed: int,
) -> list[tuple[str, Problem, list[tuple[str, object, np.ndarray, tuple[float, float, float] | None]]]]:
    """Problems, and of each the parts to score beside the direct sum's scores after 1,000 steps of the paper's scheme."""
    image = photograph()
    return [
        (
            "uniform, 4,096",
            Problem(SQUARE, [BodyClass("a", [Size("s", 1.0, 4096)])], seed=seed),
            [("all", lambda p: slice(None), UNIFORM, (0.0223, 0.0033, 0.0010))],
        ),
        (
            "photograph, 4,096",
            Problem(SQUARE, [BodyClass("a", [Size("s", 1.0, 4096)], image)], seed=seed),
            [("all", lambda p: slice(None), image, (0.0663, 0.0053, 0.0013))],
        ),
        *[
            (
                f"photograph, regularity {dial:g}",
                Problem(SQUARE, [BodyClass("a", [Size("s", 1.0, 4096)], image)], seed=seed, regularity=dial),
                [("all", lambda p: slice(None), image, (0.0663, 0.0053, 0.0013))],
            )
            for dial in (1.0, 0.0)
        ],
        (
            "classes of 4,000, 400 and 40, separation 0.5",
            Problem(
                SQUARE, [BodyClass(name, [Size("s", 1.0, n)]) for name, n in zip("abc", COUNTS, strict=True)], seed=seed
            ),
            [
                ("union", lambda p: slice(None), UNIFORM, None),
                ("the 400", lambda p: p.class_index == 1, UNIFORM, None),
                ("the 40", lambda p: p.class_index == 2, UNIFORM, None),
            ],
        ),
        (
            "two classes of 1,024, separation 0.5",
            Problem(SQUARE, [BodyClass(name, [Size("s", 1.0, 1024)]) for name in "ab"], Balance(0.5), seed=seed),
            [
                ("union", lambda p: slice(None), UNIFORM, (0.070, 0.0069, 0.0017)),
                ("one class", lambda p: p.class_index == 0, UNIFORM, (0.076, 0.019, 0.0067)),
            ],
        ),
        (
            "areas 1 and 3, 1,536 and 256, emphasis 2",
            Problem(
                SQUARE,
                [BodyClass("a", [Size("s", 1.0, 1536), Size("l", 3.0, 256)])],
                Balance(size_emphasis=2.0),
                seed=seed,
            ),
            [
                ("all", lambda p: slice(None), UNIFORM, (0.180, 0.020, 0.0055)),
                ("large", lambda p: p.size_index == 1, UNIFORM, (0.091, 0.032, 0.017)),
            ],
        ),
        (
            "classes of 1,067 and 133, areas 0.1 and 4, separation 0.5",
            Problem(SQUARE, [BodyClass("a", [Size("s", 0.1, 1067)]), BodyClass("b", [Size("s", 4.0, 133)])], seed=seed),
            [
                ("union", lambda p: slice(None), UNIFORM, None),
                ("the small", lambda p: p.class_index == 0, UNIFORM, None),
                ("the large", lambda p: p.class_index == 1, UNIFORM, None),
            ],
        ),
    ]


def nearest_distances(placement: Placement, chosen: object) -> tuple[float, float]:
    """Smallest and mean distance to the nearest neighbor, hexagonal = 1."""
    from scipy.spatial import cKDTree

    position = placement.position[chosen]
    distance = cKDTree(position).query(position, 2)[0][:, 1]
    distance = distance / (HEXAGONAL_SPACING * np.sqrt(placement.problem.domain.area / len(position)))
    return distance.min(), distance.mean()


def regularity(placement: Placement, chosen: object) -> float:
    """Mean sixfold order of bodies' neighbors, |psi 6|: 1 for a hexagonal lattice, 0.4 for random points."""
    from scipy.spatial import cKDTree

    position = placement.position[chosen]
    way = position[cKDTree(position).query(position, 7)[1][:, 1:]] - position[:, None]
    return float(np.abs(np.exp(6j * np.arctan2(way[..., 1], way[..., 0])).mean(axis=1)).mean())


def tone(placement: Placement, chosen: object, image: np.ndarray) -> list[float]:
    """Peak signal to noise [dB] where placement and target are blurred by 1, 2 and 4 mean spacings and mirrored at the border.

    The peak is four times the mean: a dot on every pixel of an image that has a quarter as many dots as pixels.
    """
    from scipy.ndimage import gaussian_filter

    position, charge, size = placement.position[chosen], placement.area[chosen], placement.problem.domain.size
    cells = TONE_CELLS
    place = position / size * cells - 0.5
    low = np.floor(place).astype(int)
    grid = np.zeros((cells, cells))
    for a in (0, 1):
        for b in (0, 1):
            share = np.abs(1.0 - a - (place - low)[:, 0]) * np.abs(1.0 - b - (place - low)[:, 1])
            column, row = (np.clip(low[:, k] + step, 0, cells - 1) for k, step in ((0, a), (1, b)))
            np.add.at(grid, (cells - 1 - row, column), share * charge)
    target = np.kron(image, np.ones([cells // n for n in image.shape]))
    difference = grid / grid.mean() - target / target.mean()
    spacing = cells / np.sqrt(len(position))
    errors = [np.sqrt((gaussian_filter(difference, k * spacing, truncate=6.0) ** 2).mean()) for k in (1, 2, 4)]
    return [20.0 * np.log10(4.0 / error) for error in errors]


def scores(placement: Placement, chosen: object, image: np.ndarray) -> list[float]:
    """Coverage errors at k = 0.5, 1, 2; smallest and mean spacing; tone, three numbers; sixfold order."""
    position, charge = placement.position[chosen], placement.area[chosen]
    return [
        *(coverage_error(position, charge, image, SQUARE, k) for k in (0.5, 1.0, 2.0)),
        *nearest_distances(placement, chosen),
        *tone(placement, chosen, image),
        regularity(placement, chosen),
    ]


def quality_table(device: str) -> list[str]:
    """Means over a few seeds; coverage errors each with the direct sum's in brackets."""
    lines = [
        "| case | part | steps | k = 0.5 | k = 1 | k = 2 | smallest / mean spacing | PSNR [dB] | order |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    runs = []
    for seed in range(SEEDS):
        for name, problem, parts in quality_cases(seed):
            placement = solve(problem, device=device)
            for part, choose, image, reference in parts:
                # Spacing means something where all bodies are alike and the density is uniform.
                alike = image is UNIFORM and np.ptp(placement.area[choose(placement)]) == 0.0
                told = (name, part, placement.report.steps, reference or (None,) * 3, alike)
                runs.append((told, scores(placement, choose(placement), image)))
    rows = len(runs) // SEEDS
    for row in range(rows):
        name, part, steps, reference, alike = runs[row][0]
        mean = np.mean([found for _, found in runs[row::rows]], axis=0)
        cells = [
            f"{own:.4f}" + ("" if direct is None else f" ({direct:.4f})")
            for own, direct in zip(mean[:3], reference, strict=True)
        ]
        spacing = f"{mean[3]:.2f} / {mean[4]:.2f}" if alike else "-"
        decibels = " / ".join(f"{value:.0f}" for value in mean[5:8])
        lines.append(f"| {name} | {part} | {steps} | {' | '.join(cells)} | {spacing} | {decibels} | {mean[8]:.2f} |")
    return lines


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device", default="auto")
    options = parser.parse_args()
    print("\n".join(quality_table(options.device)))


if __name__ == "__main__":
    main()
