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
from ..engine.problem.given_values import check_progress
from ..engine.problem.line import Line
from ..engine.problem.scatter_settings import ScatterSettings, Standing
from ..engine.problem.settings import belongs_to, takes
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


@belongs_to("scatter")
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
        target: A mesh object of the current view layer, several of them, or a collection of them. They are read with their modifiers
            and their transforms in the world. Meshes that touch form one surface. Seen from above, the topmost surface counts.
        classes: The classes to place, with their objects, counts and densities.
        settings: Settings of the run; None has all of the following settings at their defaults.
        name: Name of the result object. A result that a run of this name made on this target in this scene is replaced.
        result: Result to replace instead. None looks for one by ``name``, and makes a new object if there is none.
        obstacles: Obstacles that objects stay out of: objects, collections, results of other scatters, or a
            :class:`~esh.ScatterObstacle` of these, which gives curves a width and keeps a margin free.
        pinned: Whether those objects of the replaced result stay in place that were pinned, or moved by hand. They are part of the
            counts. A sequence instead has, for each class of that result, the index of the class that it is now, or None. If
            ``target`` is another one now, objects that are not on it do not stay, and the report says so.
        progress: Called after every step with a :class:`Progress`. Returning False stops the run, and the placement reached so far is
            written.
        changes: Any of the following settings, by name. They replace those in ``settings``.

    Returns:
        The result object, the report, the placement, and the transforms of all objects.

    Raises:
        EshError: The message is one sentence that says what is wrong. Nothing in the file was changed.
    """
    check_progress(progress)
    job = ScatterJob(target, classes, settings, name=name, result=result, obstacles=obstacles, pinned=pinned, **changes)
    job.solve(progress)
    return job.write()
