"""How even bodies are along a border, as Markdown tables: rows along it, and coverage errors.

    python benchmarks/borders.py
    python benchmarks/borders.py --boundaries open natural mirror --seeds 8

It needs ``pip install '.[test]'``.
The peak is the largest number of bodies at any distance from the border, in tenths of a spacing up to two spacings, over the number
that an even placement has there. Borders are those of the domain and of the density. All numbers are means over the seeds, but the
peak is that of all seeds together.
"""

from __future__ import annotations

import argparse
from typing import NamedTuple

import numpy as np
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.domain import Domain
from esh.engine.problem.placement import Placement
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.quality.coverage import coverage_error
from esh.engine.quality.spacing import HEXAGONAL_SPACING
from esh.engine.solve import solve
from pictures import camera
from scipy import ndimage, spatial

LENGTH, PIXELS = 64.0, 256
# Points along a pixel's side at which distances from the border are measured.
FINER = 16
# Bins per spacing, and how far from the border they go, in spacings.
BINS, FARTHEST = 10, 2.0
ERRORS = (1.0, 2.0)


class Measured(NamedTuple):
    """What a placement has: numbers of bodies at distances from the border, coverage errors, and the smallest spacing."""

    number: np.ndarray
    errors: list[float]
    smallest: float


def cases() -> dict[str, tuple[np.ndarray, int]]:
    """Densities, shape ``[height, width]``, and numbers of bodies."""
    row, column = (np.indices((PIXELS, PIXELS)) + 0.5) / PIXELS - 0.5
    away = np.hypot(row, column)
    halves = (np.abs(np.abs(column) - 0.25) < 0.2) & (np.abs(row) < 0.3) | (np.abs(column) < 0.1) & (np.abs(row) < 0.03)
    angular = (np.maximum(np.abs(row), np.abs(column)) < 0.4) & ~((row < 0.0) & (column > 0.0))
    densities = {
        "uniform square": (np.ones((PIXELS, PIXELS)), 4096),
        "photograph": (camera(PIXELS) + 0.05, 4096),
        "disc": (away < 0.4, 2048),
        "around a lake": (away > 0.2, 2048),
        "the letter L": (angular, 2048),
        "two halves and an isthmus": (halves, 2048),
    }
    return {name: (density.astype(np.float32), count) for name, (density, count) in densities.items()}


def even_numbers(density: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distances of fine points from the border [m], edges of the bins [m], and the even number of bodies in each bin."""
    ground = np.pad(np.kron(density > 0.0, np.ones((FINER, FINER), bool)), 1)
    step = LENGTH / (PIXELS * FINER)
    # From the middle of a point to the edge of the next one outside.
    depth = (ndimage.distance_transform_edt(ground)[1:-1, 1:-1] - 0.5) * step
    spacing = np.sqrt(LENGTH**2 * (density > 0.0).mean() / count)
    edges = spacing / BINS * np.arange(int(BINS * FARTHEST) + 1)
    share = np.kron(density, np.ones((FINER, FINER))) / (density.sum(dtype=np.float64) * FINER**2)
    return depth, edges, count * np.histogram(depth, edges, weights=share)[0]


def measured(placement: Placement, density: np.ndarray, depth: np.ndarray, edges: np.ndarray) -> Measured:
    """Measure a placement; ``depth`` and ``edges`` are as :func:`even_numbers` returns them."""
    at = placement.position / LENGTH * np.array(depth.shape) - 0.5
    own = ndimage.map_coordinates(depth, [depth.shape[0] - 1.0 - at[:, 1], at[:, 0]], order=1, mode="nearest")
    errors = [coverage_error(placement.position, placement.area, density, Domain((LENGTH, LENGTH)), k) for k in ERRORS]
    apart = spatial.cKDTree(placement.position).query(placement.position, k=2)[0][:, 1]
    where = np.minimum((placement.position / LENGTH * PIXELS).astype(int), PIXELS - 1)
    here = density[PIXELS - 1 - where[:, 1], where[:, 0]] / density.mean(dtype=np.float64)
    lattice = HEXAGONAL_SPACING * LENGTH / np.sqrt(len(own) * np.maximum(here, 1e-9))
    return Measured(np.histogram(np.maximum(own, 0.0), edges)[0], errors, float((apart / lattice)[here > 0.0].min()))


def line(boundary: str, density: np.ndarray, count: int, seeds: int, device: str) -> str:
    """Cells of a row: peak, errors, smallest spacing."""
    depth, edges, even = even_numbers(density, count)
    body_class = BodyClass("a", [Size("s", 1e-6 * LENGTH**2, count)], density)
    problems = [Problem(Domain((LENGTH, LENGTH), boundary), [body_class], seed=seed) for seed in range(seeds)]
    found = [measured(solve(problem, device=device), density, depth, edges) for problem in problems]
    peak = (np.sum([one.number for one in found], axis=0) / (seeds * even)).max()
    at_one, at_two = np.mean([one.errors for one in found], axis=0)
    return f"{peak:.1f} | {at_one:.4f} | {at_two:.4f} | {np.mean([one.smallest for one in found]):.2f}"


def main() -> None:
    """Print a line for every case."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--boundaries", nargs="+", default=["open", "natural"])
    parser.add_argument("--seeds", metavar="N", type=int, default=4)
    parser.add_argument("--device", default="auto")
    options = parser.parse_args()
    heads = " | ".join(f"{boundary}: peak | k = 1 | k = 2 | smallest spacing" for boundary in options.boundaries)
    print(f"| case | {heads} |\n|---" + "|---" * 4 * len(options.boundaries) + "|")
    for name, (density, count) in cases().items():
        cells = [line(boundary, density, count, options.seeds, options.device) for boundary in options.boundaries]
        print(f"| {name} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
