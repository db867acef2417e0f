"""When a run has come to its end: by how far bodies still want to move."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..model.model import Model
from ..problem.cover import cover_of

__all__ = ["TOLERANCE", "is_settled", "last_steps"]

# RMS move over local spacing at which a run has converged: later steps change no figure of the report.
TOLERANCE = 2e-4
# What counts as converged where the steps run out: bodies want to move by less than half a hundredth of their spacing.
SETTLED = 5e-3
# The median over so many last steps tells, not one of them: one in fifty stands out, as some body has gone round an edge in it or
# taken another's place. Of long runs it is over more steps.
LAST_STEPS, LAST_OF_MANY, MANY_STEPS = 3, 15, 90
# The same where outlines that keep apart cover more than this of their ground, or lie between obstacles: contact grants little of what
# forces ask for there, and who gives way here presses elsewhere, so that points go on jostling by 0.004 to 0.015 of their spacing
# however many steps are taken. Measured on planks, boxes and discs at 80 %, and on quads between triangles at 42 %; ten steps come to
# 0.03 to 0.05. Planks at 70 % come to 0.001. Soft bodies ask for less: boxes, discs and triangles at 80 % come to 0.001 to 0.004,
# after ten steps to 0.008 to 0.011, after five to 0.014 to 0.017.
JOSTLED = 0.75
SETTLED_WHERE_JOSTLED, SETTLED_WHERE_SOFT = 2e-2, 1e-2
# The same where a tenth of the bodies are asked to cover more than this of the ground where they are, as on a hill of pebbles among
# boulders. There one step in ten is ten times as long as the others, so a quarter of the last steps tells. Measured on pebbles that
# are to cover up to 0.9 beside boulders on a fifth of the ground: a quarter of the steps come to 0.01 after 50 and after 1,000, and
# no figure of the report changes from 100 to 300.
# Even ground does not do that, so the tenth is to be more crowded than all by a factor.
PRESSED, MORE_PRESSED = 0.6, 1.2


def last_steps(max_steps: int) -> int:
    """How many of the last steps tell whether bodies have settled."""
    return LAST_OF_MANY if max_steps >= MANY_STEPS else LAST_STEPS


def is_settled(model: Model, residuals: Sequence[float]) -> bool:
    """Whether bodies count as settled whose steps have run out.

    Args:
        model: What is placed.
        residuals: How far bodies would still move, over their spacing, in each of the last steps.
    """
    problem, usual = model.problem, float(np.median(residuals))
    if usual < SETTLED or not problem.avoid_overlap:
        return usual < SETTLED
    if problem.obstacles:
        return usual < SETTLED_WHERE_JOSTLED
    cover = cover_of(problem)
    if cover.covered > JOSTLED:
        return usual < (SETTLED_WHERE_JOSTLED if model.may_tangle else SETTLED_WHERE_SOFT)
    pressed = len(residuals) > LAST_STEPS and cover.pressed > max(PRESSED, MORE_PRESSED * cover.covered)
    return pressed and float(np.quantile(residuals, 0.25)) < SETTLED_WHERE_JOSTLED
