"""How long an edit takes, how well it is followed, and how much it stirs.

    python benchmarks/live_edits.py                    # 10,000 and 100,000 bodies
    python benchmarks/live_edits.py --bodies 4096 --device cuda:0

A brush stroke over a twentieth of a photograph multiplies its density, by 3, by a fifth or by 0. Either the count follows the
density, or it stays and the bodies are spread anew. From the edit to the new state, 5 steps: the time, beside that of solving
afresh; the coverage error at a spacing over that after 100 steps more; and the share of bodies, more than two spacings from the
stroke, that moved by less than a tenth of a spacing. Times are the smallest of several, and of processors as well: on a busy
machine only those mean something.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass

import numpy as np
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.domain import Domain
from esh.engine.problem.placement import Placement
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.quality.coverage import coverage_error
from esh.engine.solver.solver import Solver
from pictures import camera

DOMAIN = Domain((100.0, 100.0))
PIXELS = 256
# Spacings from the stroke from which on a body counts as away from it, and by which it may move to count as unmoved.
AWAY, UNMOVED = 2.0, 0.1
SETTLED_STEPS, MORE_STEPS = 150, 100


@dataclass(frozen=True)
class Edited:
    """What one kind of edit comes to.

    Attributes:
        seconds: From the edit to the new state.
        processor_seconds: The same, of all processors together.
        error: Coverage error at k = 1, over that after many more steps.
        unmoved: Share of bodies away from the stroke that stayed.
        changed: Bodies that came or went.
    """

    seconds: float
    processor_seconds: float
    error: float
    unmoved: float
    changed: int


def stroke() -> np.ndarray:
    """A wavy line over a twentieth of the image, bool."""
    y, x = np.mgrid[:PIXELS, :PIXELS] / PIXELS
    return (np.abs(y - 0.5 - 0.3 * np.sin(6.0 * (x - 0.2))) < 0.035) & (x > 0.12) & (x < 0.85)


def problem_of(density: np.ndarray, count: int) -> Problem:
    """So many small bodies that follow a density."""
    return Problem(DOMAIN, [BodyClass("a", [Size("s", 1e-6 * DOMAIN.area, count)], density)], seed=1)


def edit(density: np.ndarray, factor: float, count: int, follows: bool, device: str, repeat: int) -> Edited:
    """Settle, paint and measure; see the module."""
    mask = stroke()
    painted = np.where(mask, factor * density, density).astype(np.float32)
    after_count = round(count * painted.mean() / density.mean()) if follows else count
    seconds, processor_seconds = [], []
    with Solver(problem_of(density, count), device=device) as solver:
        solver.run(SETTLED_STEPS)
        before, state = solver.placement(), solver.state.copy()
        for _ in range(repeat + 1):
            # From the settled state, as often as needed; the first one warms up.
            solver.edit(problem_of(density, count), steps=0)
            if solver.model.body_count == state.pose.shape[0]:
                solver.start_from(state)
            start, start_processor = time.perf_counter(), time.process_time()
            changes = solver.edit(problem_of(painted, after_count))
            seconds.append(time.perf_counter() - start)
            processor_seconds.append(time.process_time() - start_processor)
    with Solver(problem_of(density, count), device=device, state=state) as solver:
        changes = solver.edit(problem_of(painted, after_count))
        after = solver.placement()
        solver.run(MORE_STEPS)
        settled = solver.placement()
    return Edited(
        min(seconds[1:]),
        min(processor_seconds[1:]),
        _error(after, painted) / _error(settled, painted),
        _unmoved(before, after, mask),
        max(len(changes.added), len(changes.removed)),
    )


def solve_afresh(density: np.ndarray, count: int, device: str, repeat: int) -> tuple[float, float]:
    """Seconds of a run from the start, and of all processors."""
    seconds, processor_seconds = [], []
    for _ in range(repeat + 1):
        start, start_processor = time.perf_counter(), time.process_time()
        with Solver(problem_of(density, count), device=device) as solver:
            solver.run(100)
        seconds.append(time.perf_counter() - start)
        processor_seconds.append(time.process_time() - start_processor)
    return min(seconds[1:]), min(processor_seconds[1:])


def _error(placement: Placement, density: np.ndarray) -> float:
    return coverage_error(placement.position, placement.area, density, DOMAIN)


def _unmoved(before: Placement, after: Placement, mask: np.ndarray) -> float:
    spacing = np.sqrt(DOMAIN.area / len(after.position))
    _, i, j = np.intersect1d(before.id, after.id, return_indices=True)
    # The stroke, blown up by as many pixels as those spacings are.
    reach = int(np.ceil(AWAY * spacing / DOMAIN.size[0] * PIXELS))
    wide = np.pad(mask, reach)
    near = np.zeros_like(mask)
    for row in range(-reach, reach + 1):
        for column in range(-reach, reach + 1):
            if row * row + column * column <= reach * reach:
                near |= wide[reach + row : reach + row + PIXELS, reach + column : reach + column + PIXELS]
    place = np.clip(before.position[i] / DOMAIN.size[0] * PIXELS, 0, PIXELS - 1).astype(int)
    away = ~near[PIXELS - 1 - place[:, 1], place[:, 0]]
    way = np.linalg.norm(after.position[j] - before.position[i], axis=1) / spacing
    return float((way[away] < UNMOVED).mean())


def main() -> None:
    """Print a line for every number of bodies and kind of edit."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bodies", metavar="N", type=int, nargs="*", default=[10_000, 100_000])
    parser.add_argument("--device", default="auto")
    parser.add_argument("--repeat", type=int, default=3)
    options = parser.parse_args()
    density = (camera(PIXELS) + 0.1).astype(np.float32)
    print(
        "| bodies | stroke | count | came or went | edit [s] | of processors | afresh [s] | of processors | error | unmoved |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|")
    for count in options.bodies:
        afresh = solve_afresh(density, count, options.device, options.repeat)
        for factor in (0.0, 0.2, 3.0):
            for follows in (True, False):
                one = edit(density, factor, count, follows, options.device, options.repeat)
                print(
                    f"| {count:,} | × {factor:g} | {'follows' if follows else 'stays'} | {one.changed:,} | {one.seconds:.3f} | "
                    f"{one.processor_seconds:.3f} | {afresh[0]:.3f} | {afresh[1]:.3f} | {one.error:.2f} | {one.unmoved:.0%} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
