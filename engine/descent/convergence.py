"""When a run has come to its end: by how far bodies still want to move."""

from __future__ import annotations

from ..model.model import Model
from ..problem.cover import cover_of

__all__ = ["LAST_STEPS", "TOLERANCE", "is_settled"]

# RMS move over local spacing at which a run has converged: later steps change no figure of the report.
TOLERANCE = 2e-4
# What counts as converged where the steps run out: bodies want to move by less than half a hundredth of their spacing.
SETTLED = 5e-3
# The median over so many last steps tells, not one of them: one in fifty stands out, as some body has gone round an edge in it or
# taken another's place.
LAST_STEPS = 3
# The same where outlines that keep apart cover more than this of their ground, or lie between obstacles: contact grants little of what
# forces ask for there, and who gives way here presses elsewhere, so that points go on jostling by 0.004 to 0.015 of their spacing
# however many steps are taken. Measured on planks, boxes and discs at 80 %, and on quads between triangles at 42 %; ten steps come to
# 0.03 to 0.05. Planks at 70 % come to 0.001. Soft bodies ask for less: boxes, discs and triangles at 80 % come to 0.001 to 0.004,
# after ten steps to 0.008 to 0.011, after five to 0.014 to 0.017.
JOSTLED = 0.75
SETTLED_WHERE_JOSTLED, SETTLED_WHERE_SOFT = 2e-2, 1e-2


def is_settled(model: Model, residual: float) -> bool:
    """Whether bodies count as settled whose steps have run out.

    Args:
        model: What is placed.
        residual: How far bodies would still move, over their spacing: the median over the last steps.
    """
    return residual < SETTLED or residual < _settled_in_contact(model)


def _settled_in_contact(model: Model) -> float:
    """What counts as settled where bodies that keep apart cover so much ground that contact decides how far they move."""
    problem = model.problem
    if problem.avoid_overlap and (bool(problem.obstacles) or cover_of(problem).covered > JOSTLED):
        return SETTLED_WHERE_JOSTLED if problem.obstacles or model.may_tangle else SETTLED_WHERE_SOFT
    return SETTLED
