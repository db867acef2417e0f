"""Where rare classes start on a surface: spread by themselves first, as :mod:`.rare_start` does in the plane."""

from __future__ import annotations

from functools import partial

import numpy as np

from ..descent.surface_descent import Start, SurfaceDescent
from ..descent.surface_placement import points_of
from ..device.launcher import Launcher
from ..model.model import Model
from ..problem.problem import Problem
from ..problem.surface import Surface
from .rare_start import STEPS, rare_problems

__all__ = ["rare_start_on_surface"]


# Every triangle of a surface takes time, however few bodies are spread: with more of them than bodies and this, these start as
# all others do.
# Measured with 4,000, 400 and 40: 0.8 s of processor time of a run's 6.7 with 20,000 triangles, 9 s with 330,000.
MOST_TRIANGLES = 100_000


def rare_start_on_surface(launcher: Launcher, problem: Problem) -> Start | None:
    """Return what puts the bodies of rare classes where they start; None where no class is rare, or where it takes too long.

    Args:
        launcher: Where to run.
        problem: On a surface. Classes of lines, and those of which bodies are fixed, start as all others.
    """
    surface = problem.domain
    assert isinstance(surface, Surface)
    if len(surface.triangle) > MOST_TRIANGLES + problem.body_count:
        return None
    triangle, barycentric = np.full(problem.body_count, -1), np.zeros((problem.body_count, 3))

    def put(of_bodies: np.ndarray, descent: SurfaceDescent) -> None:
        """Put those of some bodies whose place is known there; a descent has them in their order."""
        row = np.flatnonzero(triangle[of_bodies] >= 0)
        place = of_bodies[row]
        if len(row):
            descent.put_some(row, surface.points(triangle[place], barycentric[place]))

    # Who is too near to an obstacle would stay there.
    for rare, own in rare_problems(problem, surface, problem.obstacles, avoid_overlap=problem.avoid_overlap):
        bodies = np.flatnonzero(own)
        descent = SurfaceDescent(Model(rare), launcher, partial(put, bodies))
        descent.step.play(STEPS)
        points = points_of(launcher, descent.facets, descent.state)
        triangle[bodies], barycentric[bodies] = points.triangle, points.barycentric
        launcher.release(descent.step)
    if (triangle < 0).all():
        return None
    return partial(put, np.arange(problem.body_count))
