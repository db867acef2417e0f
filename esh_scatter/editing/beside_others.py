"""How many objects a scatter asks for where others stand on its ground already."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import bpy
from mathutils import Matrix

from . import forecast

__all__ = ["fit_beside_others", "free_share"]

# What others cover leaves at least the rest of the ground: their objects may lie on each other.
MOST_TAKEN = 0.9
# Shapes that stand in for objects become smaller, step by step, until this share of the free ground has room for them.
ENOUGH, STEP, SMALLEST = 0.5, 0.8, 0.15
# Part of its room that a class asks for: others go there, too.
SHARED = 0.9
# Share of the free ground that all classes of a preset together can cover for sure.
SURE = 0.45


def free_share(scatter: Any) -> float:
    """Return the share of the ground that others before a scatter, which it makes room for, leave."""
    results = scatter.other_results()
    others = (other for other in scatter.id_data.esh_scatter.scatters if other.result in results)
    return 1.0 - min(sum(other.report["covered"] for other in others if other.report), MOST_TAKEN)


def fit_beside_others(scatter: Any, free: float, chosen: Sequence[bpy.types.Object | bpy.types.Collection]) -> None:
    """Have the classes of a scatter, which reckon with all ground that is free [m²], ask for what finds room between others.

    Between trees there is room for gravel everywhere, and for boulders only where it is wide. Shapes that stand in for objects become
    smaller where there is hardly any for them; objects that somebody has ``chosen`` do not.
    """
    from ...engine.problem.cover import Room

    # Without room for one of the classes there would be no problem: where their middles may be is all that is asked here.
    problem = forecast.problem_of(scatter, scatter.id_data, avoid_overlap=False)
    if problem is None or not scatter.avoid_overlap:
        return
    between, asked = Room(problem), 0.0
    for number, body_class in enumerate(scatter.ready_classes()):
        # Room for the largest of them.
        largest = 1.0 + body_class.scale_jitter
        scale, room = 1.0, between.share(number, largest)
        while room < ENOUGH and scale > SMALLEST and body_class.sizes[0].source not in chosen:
            scale *= STEP
            room = between.share(number, scale * largest)
        if scale < 1.0:
            for size in body_class.sizes:
                size.source_object.data.transform(Matrix.Scale(scale, 4))
        forecast.scale_counts([body_class], SHARED * room)
        taken = sum((size.count or 0) * size.mean_area for size in problem.classes[number].sizes)
        asked += SHARED * room * scale**2 * taken
    if asked > SURE * free:
        forecast.scale_counts_to_fit(scatter, scatter.id_data)
