"""Bodies of a part of the domain that look at a point; see :mod:`~esh.engine.problem.look_at`."""

from __future__ import annotations

import math

import numpy as np

from ..model.looking import angle_within
from ..problem.look_at import facing
from .bodies import PartBodies
from .plan import Plan

__all__ = ["looking_bodies", "looking_turns"]


def looking_bodies(plan: Plan, identity: np.ndarray) -> np.ndarray:
    """Which bodies of these numbers look at a point, bool, shape ``[k]``: of its class, no lines, and put there by nobody."""
    groups = plan.groups
    looks = [
        plan.problem.classes[c].look_at is not None and size.line is None
        for c, size in zip(groups.class_index.tolist(), groups.sizes, strict=True)
    ]
    if not any(looks):
        return np.zeros(len(identity), bool)
    return np.array(looks)[groups.group_of(identity)] & ~groups.is_fixed(identity)


def looking_turns(plan: Plan, bodies: PartBodies, turn: np.ndarray) -> np.ndarray:
    """Turns of bodies [rad], shape ``[n]``, of which those that look at a point are turned so that they do."""
    looking = looking_bodies(plan, bodies.identity)
    if not looking.any():
        return turn
    result = turn.copy()
    class_index = plan.groups.class_index[plan.groups.group_of(bodies.identity)]
    for c in np.unique(class_index[looking]).tolist():
        own = np.flatnonzero(looking & (class_index == c))
        look = plan.problem.classes[c].look_at
        assert look is not None
        # Windows may see bodies beyond the edges of a periodic domain.
        place = plan.layout.in_domain(bodies.position[own])
        result[own] = angle_within(facing(look, place, bodies.identity[own], plan.problem.seed), 2.0 * math.pi)
    return result
