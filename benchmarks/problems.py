"""The problems that benchmarks solve; needs the engine only."""

from __future__ import annotations

from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.domain import Domain
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size

__all__ = ["SQUARE", "problem_of"]

SQUARE = Domain((64.0, 64.0))


def problem_of(count: int, groups: int = 1) -> Problem:
    """One group; or classes of two sizes. A third of the space is covered."""
    area = SQUARE.area / count / 3.0
    if groups == 1:
        return Problem(SQUARE, [BodyClass("a", [Size("s", area, count)])])
    each = count // groups
    sizes = [Size("s", 0.5 * area, each), Size("l", 1.5 * area, each)]
    return Problem(SQUARE, [BodyClass(f"class {c}", sizes) for c in range(groups // 2)])
