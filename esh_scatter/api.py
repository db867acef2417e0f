"""Scattering in Blender, for scripts: works in pip's ``bpy`` and in ``blender -b`` without anything registered.

:func:`scatter` does everything. :class:`ScatterJob` is the same in three phases, so that an operator can run the middle
one, which does not touch Blender, in a thread.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import bpy

from ..engine.errors import EshError
from ..engine.problem.body_class import Unsharp
from ..engine.problem.line import Line
from ..engine.problem.scatter_settings import ScatterSettings, Standing
from ..engine.problem.settings import takes
from ..engine.problem.validation import check_progress
from ..engine.solver.progress import Progress
from .classes.amount import Amount
from .classes.directions import AttributeDirection, CurveDirection
from .classes.scatter_class import ScatterClass, ScatterSize
from .densities.kinds import (
    AltitudeDensity,
    AttributeDensity,
    CameraDensity,
    ClassDensity,
    DensityLayer,
    DensityStack,
    DistanceDensity,
    FacingDensity,
    ImageDensity,
    InsideDensity,
    NoiseDensity,
    SlopeDensity,
    VertexGroupDensity,
)
from .solving.job import ScatterJob, ScatterResult
from .solving.obstacles import ObstacleSource, ScatterObstacle
from .targets.targets import Target

__all__ = [
    "AltitudeDensity",
    "Amount",
    "AttributeDensity",
    "AttributeDirection",
    "CameraDensity",
    "ClassDensity",
    "CurveDirection",
    "DensityLayer",
    "DensityStack",
    "DistanceDensity",
    "EshError",
    "FacingDensity",
    "ImageDensity",
    "InsideDensity",
    "Line",
    "NoiseDensity",
    "ScatterClass",
    "ScatterJob",
    "ScatterObstacle",
    "ScatterResult",
    "ScatterSettings",
    "ScatterSize",
    "SlopeDensity",
    "Standing",
    "Unsharp",
    "VertexGroupDensity",
    "scatter",
]


@takes(ScatterSettings)
def scatter(
    target: Target,
    classes: Sequence[ScatterClass],
    settings: ScatterSettings | None = None,
    *,
    name: str = "ESH Scatter",
    result: bpy.types.Object | None = None,
    obstacles: Sequence[ObstacleSource] = (),
    pinned: bool | Sequence[int | None] = True,
    progress: Callable[[Progress], bool | None] | None = None,
    **changes: Any,
) -> ScatterResult:
    """Place objects on a mesh, all classes and sizes at once.

    Args:
        target: Mesh object of the current view layer, several of them, or a collection of them, used with their modifiers and as
            they stand in the world. Several are one surface where they touch. Seen from above, the topmost surface counts.
        classes: What to place, how many, following which densities.
        settings: How; None has all of the following settings at their defaults.
        name: Of the result object. A result that this name left on this target in this scene is replaced.
        result: Result to replace instead; None looks for one as said above, and makes a new object if there is none.
        obstacles: What objects keep off: objects, collections, results of other scatters, or a
            :class:`~esh.ScatterObstacle` of these, which gives curves a width and keeps a margin free.
        pinned: Whether objects of the replaced result stay where they are that were pinned, or moved by hand; they count. Or, by
            class of that result, the index of the class that it is now, or None. What is not on ``target``, where that is another
            one now, does not stay, and the report says so.
        progress: Called after every step; returning False stops the run, and what is there is written.
        changes: Any of the following, by name, in place of that in ``settings``.

    Returns:
        The result object, the report, the placement, and where the objects stand.

    Raises:
        EshError: One sentence that says what is wrong; nothing was changed.
    """
    check_progress(progress)
    job = ScatterJob(target, classes, settings, name=name, result=result, obstacles=obstacles, pinned=pinned, **changes)
    job.solve(progress)
    return job.write()
