"""Where rare classes start: spread by themselves before there is anybody else.

A class of few bodies among many has far to go from where a curve sets it down, and the many stand in its way: once they are even
around it, it hardly moves any more. So classes are spread from the rarest to the most frequent, each around those before it, and the
many find their places around them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..descent.descent import Descent
from ..descent.final_placement import position_in_meters
from ..device.launcher import Launcher
from ..model.model import Model
from ..motion.forces import FieldSettings
from ..problem.domain import Domain
from ..problem.obstacles import Obstacle
from ..problem.problem import Problem
from ..problem.surface import Surface
from ..space.density import move_into_support

__all__ = ["STEPS", "rare_problems", "rare_starts", "start_some"]

# A class is rare beside one of so many times as many bodies. Classes nearer to each other are spread at once. Measured over six seeds:
# of 1,000 and 100 bodies the smallest spacing of the 100 rises from 0.83 to 0.85, but of 1,000 and 300 that of the 300 by 0.003 only.
RARE = 6.0
# Measured over five seeds of 4,000, 400 and 40: smallest spacings of the 40 are 0.831 without, 0.853 after 15 steps, 0.856 after 30
# and 0.860 after 60.
STEPS = 40
# A coarse mesh will do for what attracts few bodies.
FEWEST_NODES = 2**14


def rare_starts(launcher: Launcher, problem: Problem) -> np.ndarray | None:
    """Return where the bodies of rare classes start [m], shape ``[body_count, 2]``, NaN for all others; None where no class is rare.

    Args:
        launcher: Where to run.
        problem: In a rectangle. Classes of lines, and those of which bodies are fixed, start as all others.
    """
    domain = Domain(problem.rectangle.size, problem.rectangle.boundary)
    result = None
    for rare, own in rare_problems(problem, domain):
        if result is None:
            result = np.full((problem.body_count, 2), np.nan)
        model = Model(rare)
        descent = Descent(model, launcher, field_settings=FieldSettings(fewest_nodes=FEWEST_NODES))
        there = ~np.isnan(result[own, 0])
        if there.any():
            pose = descent.state.pose.numpy().copy()
            pose[there, :2] = result[own][there] / model.unit
            descent.state.pose.assign(pose)
            descent.place_charges()
        descent.step.play(STEPS)
        result[own] = position_in_meters(model, descent.state, launcher)
        launcher.release(descent.step)
    return result


def start_some(descent: Descent, position: np.ndarray) -> None:
    """Let bodies start at positions [m], shape ``[body_count, 2]``, but for those whose position is NaN."""
    model, size = descent.model, descent.model.problem.rectangle.size
    pose = descent.state.pose.numpy().copy()
    known = ~np.isnan(position[:, 0])
    for number in np.unique(model.body.support[known]):
        own = np.flatnonzero(known & (model.body.support == number))
        # Obstacles keep larger bodies off farther than where their class may be.
        pose[own, :2] = move_into_support(model.supports[number], position[own], size) / model.unit
    descent.state.pose.assign(pose)
    descent.place_charges()


def rare_problems(
    problem: Problem, domain: Domain | Surface, obstacles: Sequence[Obstacle] = (), *, avoid_overlap: bool = False
) -> Iterator[tuple[Problem, np.ndarray]]:
    """Yield problems of rare classes, one stage after the other, and which bodies these are, a mask of shape ``[body_count]``.

    Args:
        problem: The problem that they are of.
        domain: Where these are spread.
        obstacles: What they keep away from there.
        avoid_overlap: Whether their footprints are pushed apart there.
    """
    balance, class_index = problem.balance, problem.body_indices()[0]
    for number, stage in enumerate(_stages(problem)):
        # Their densities have clumps already, and obstacles cut out of them.
        classes = [replace(problem.classes[c], base=None, clustering=0.0) for c in stage]
        rare = Problem(
            domain,
            classes,
            balance.of_some(stage, max(len(c.sizes) for c in classes)),
            obstacles=obstacles,
            seed=int(np.random.default_rng([problem.seed, 11, number]).integers(1 << 31)),
            regularity=problem.regularity,
            avoid_overlap=avoid_overlap,
        )
        yield rare, np.isin(class_index, stage)


def _stages(problem: Problem) -> list[list[int]]:
    """Which classes are spread together, the rarest first; each stage has the classes of those before it, too."""
    if problem.balance.class_separation == 1.0 or problem.balance.rare_emphasis == 0.0:
        return []
    fixed = set(problem.fixed.class_index.tolist())
    count = [c.body_count for c in problem.classes]
    most = max(count)
    rare = [
        index
        for index, c in enumerate(problem.classes)
        if RARE * count[index] <= most
        and count[index] > 1
        and index not in fixed
        and all(size.line is None for size in c.sizes)
    ]
    rare.sort(key=lambda index: count[index])
    stages: list[list[int]] = []
    for number, index in enumerate(rare):
        if number == 0 or count[index] >= RARE * count[rare[number - 1]]:
            stages.append(rare[:number])
        stages[-1].append(index)
    return [sorted(stage) for stage in stages]
