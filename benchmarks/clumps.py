"""How far clumps leave a density at large as it is: coverage errors at 4 spacings, without clumps and with them.

    python benchmarks/clumps.py
    python benchmarks/clumps.py --bodies 1000 --seeds 8

Means over seeds; for the strongest clumps also the worst seed, over the mean without clumps.
"""

from __future__ import annotations

import argparse

import numpy as np
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.domain import Domain
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.quality.coverage import coverage_error
from esh.engine.solver.solver import Solver
from pictures import camera

PIXELS, LENGTH = 256, 64.0
STEPS, SPACINGS = 100, 4.0
STRENGTHS = (0.0, 0.5, 1.0)


def cases() -> dict[str, tuple[Domain, np.ndarray]]:
    """Domains and densities."""
    row, column = (np.indices((PIXELS, PIXELS)) + 0.5) / PIXELS - 0.5
    lengths, away = (LENGTH, LENGTH), np.hypot(row, column)
    densities = {
        "uniform, open": np.ones((PIXELS, PIXELS)),
        "a tenfold ramp, open": 0.1 + 0.9 * (column + 0.5),
        "photograph, open": camera(PIXELS) + 0.1,
        "disc": away < 0.35,
        "square": np.maximum(abs(row), abs(column)) < 0.3,
        "around a lake": away > 0.25,
    }
    return {
        "uniform, periodic": (Domain(lengths, "periodic"), np.ones((PIXELS, PIXELS), np.float32)),
        **{name: (Domain(lengths), density.astype(np.float32)) for name, density in densities.items()},
    }


def error(domain: Domain, density: np.ndarray, strength: float, count: int, seed: int, device: str) -> float:
    """Coverage error of one run."""
    body_class = BodyClass("a", [Size("s", 1e-6 * domain.area, count)], density, clustering=strength)
    with Solver(Problem(domain, [body_class], seed=seed), device=device) as solver:
        solver.run(STEPS)
        placement = solver.placement()
    return coverage_error(placement.position, placement.area, density, domain, SPACINGS)


def main() -> None:
    """Print a line for every case."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bodies", metavar="N", type=int, default=4096)
    parser.add_argument("--seeds", metavar="N", type=int, default=6)
    parser.add_argument("--device", default="auto")
    options = parser.parse_args()
    print("| case | without | strength 0.5 | strength 1 | strength 1, worst seed |")
    print("|---|---|---|---|---|")
    for name, (domain, density) in cases().items():
        errors = np.array(
            [
                [
                    error(domain, density, strength, options.bodies, seed, options.device)
                    for seed in range(options.seeds)
                ]
                for strength in STRENGTHS
            ]
        )
        without, half, whole = errors.mean(axis=1)
        times = f"{half / without:.1f} times | {whole / without:.1f} times | {errors[-1].max() / without:.1f} times"
        print(f"| {name} | {without:.5f} | {times} |", flush=True)


if __name__ == "__main__":
    main()
