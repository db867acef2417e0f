"""The points of a result: where the placed objects stand in the world, and the attributes that say what they are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...engine.problem.look_at import LookAt
from ...engine.problem.placement import Placement
from ...engine.problem.problem import Problem
from ...engine.problem.scatter_settings import ScatterSettings, Standing
from ...engine.problem.slopes import normal_of_slope, slope_at
from ...engine.surface.chart import Chart
from ...engine.surface.instances import Instances
from ...engine.surface.mesh_outline import Outline
from ...engine.surface.surface_points import SurfacePoints
from ...engine.surface.whole_surface import WholeSurface
from ..classes.on_whole_surface import headings
from ..classes.scatter_class import ScatterClass, color_of, standing_of
from ..classes.sources import SizeShape, lowest_points, standing_on, variants_of
from ..classes.standing import Ground, Stand, draw, stand, turns_towards
from ..targets.subdivision import Subdivision
from ..targets.targets import stuck_attributes
from .attributes import BODY_ANGLE, BODY_LENGTH, INSTANCE_INDEX, OVERLAPPING, OVERLAPPING_ON_GROUND, ROTATION, SCALE
from .following import finer_attributes, follow_attributes
from .kept_ground import ground_attributes
from .pins import add_pins

__all__ = ["ResultPoints", "overlap_attributes", "point_attributes", "result_points"]


class ResultPoints(NamedTuple):
    """Where objects stand, and what is known of their points.

    Attributes:
        instances: The objects, in the placement's order.
        ground: What they stand on.
        to_origin: The way from point to origin [m], shape ``[n, 3]``, float32.
        height: The part of it that goes along the objects' own axes [m], shape ``[n, 3]``, float32.
        surface: The points on the target's mesh.
        stuck: Attributes that tell where on that mesh they are.
    """

    instances: Instances
    ground: Ground
    to_origin: np.ndarray
    height: np.ndarray
    surface: SurfacePoints
    stuck: dict[str, tuple[str, np.ndarray]]


def result_points(
    placement: Placement,
    problem: Problem,
    chart: Chart | WholeSurface,
    classes: Sequence[ScatterClass],
    shapes: Sequence[SizeShape],
    settings: ScatterSettings,
) -> ResultPoints:
    """Choose every point's variant, and stand it on the surface.

    Args:
        placement: Where the bodies are.
        problem: What it answers.
        chart: What they stand on.
        classes: What was asked.
        shapes: Of the sizes of all classes, one after the other.
        settings: How the scatter is made.
    """
    surface = (
        chart.surface_points(placement) if isinstance(chart, WholeSurface) else chart.surface_points(placement.position)
    )
    ground = _ground(placement, surface, chart)
    first = np.concatenate([[0], np.cumsum([len(c.sizes) for c in classes])])
    outlined = [size.footprint is not None for c in problem.classes for size in c.sizes]
    group = first[placement.class_index] + placement.size_index
    source = np.empty(len(placement.position), np.int32)
    for number, shape in enumerate(shapes):
        own = np.flatnonzero(group == number)
        if len(own):
            asked = classes[int(placement.class_index[own[0]])]
            # Long objects lie along their bodies, whatever they would look at.
            look = asked.look_at if shape.line is None else None
            size = _Size(shape, outlined[number], standing_of(asked, settings), look, settings.seed)
            variant = _variants(size, placement, own)
            source[own] = np.array(shape.objects)[variant]
            if size.outlined and isinstance(chart, Chart):
                _take_known_normals(ground, size, placement, chart, own)
            _fit(ground, size, placement, own, variant)
            ground.lowest[own] = np.array(lowest_points(shape, size.standing.scale), np.float32)[variant]
            _put_onto(ground, size, own, variant)
            if size.look is not None:
                # Outlines were parted as they are turned, and what is pinned has the turn that it has.
                free = own[:0] if size.outlines_of_variants else own[~placement.fixed[own]]
                _look(ground, size.look, size, surface.position, own, free)
    stands = _stand(ground, placement, classes, settings)
    position = (surface.position + stands.to_origin).astype(np.float32)
    instances = Instances(position, stands.rotation, stands.scale, source)
    return ResultPoints(instances, ground, stands.to_origin, stands.height, surface, stuck_attributes(surface))


class _Size(NamedTuple):
    """What is known of a size before its points are looked at.

    Attributes:
        shape: Of what it places.
        outlined: Whether its bodies had outlines while they were placed; they were discs or lines otherwise.
        standing: How its objects stand.
        look: What they look at.
        seed: Of what is drawn for each.
    """

    shape: SizeShape
    outlined: bool
    standing: Standing
    look: LookAt | None
    seed: int

    @property
    def outlines_of_variants(self) -> bool:
        """Whether these were those of its objects, as large and as turned as each of them."""
        return self.outlined and self.shape.outlines_of_variants

    @property
    def outlines(self) -> list[Outline]:
        """Those of its objects that have been measured."""
        return [outline for outline in self.shape.outlines if outline is not None]


def _ground(placement: Placement, surface: SurfacePoints, chart: Chart | WholeSurface) -> Ground:
    """Return what objects stand on, as long as nothing is known of what they are."""
    count = len(placement.position)
    return Ground(
        placement.id.astype(np.int32),
        surface.normal,
        _headings(surface, placement),
        np.zeros(count, bool),
        np.ones(count, np.float32),
        np.zeros((count, 2), np.float32),
        np.zeros(count, np.float32),
        np.full(count, isinstance(chart, WholeSurface)),
        np.zeros(count, bool),
        np.zeros(count, np.float32),
    )


def _variants(size: _Size, placement: Placement, own: np.ndarray) -> np.ndarray:
    """Return which of a size's objects stands on each of its points; where the outline is a disc, any may."""
    if size.outlines_of_variants:
        return placement.variant[own]
    return variants_of(placement.id[own], len(size.shape.objects), size.shape.weights, size.seed)


def _take_known_normals(ground: Ground, size: _Size, placement: Placement, chart: Chart, own: np.ndarray) -> None:
    """Take the normals that contact knew: between the chart's cells they differ a little from those of the faces."""
    align = size.standing.align_to_normal
    slope = chart.slope(align)
    if slope is not None:
        extent = placement.problem.rectangle.size
        ground.normal[own] = normal_of_slope(slope_at(slope, placement.position[own], extent), align)


def _fit(ground: Ground, size: _Size, placement: Placement, own: np.ndarray, variant: np.ndarray) -> None:
    """Say how much objects are scaled to fit their bodies, and whether they are long."""
    outlines, ranged = size.outlines, isinstance(size.shape.area, tuple)
    ground.long[own] = size.shape.line is not None and bool(outlines)
    # Of discs for objects that nobody has measured, the scale says nothing of the objects.
    if size.outlined and (outlines or not ranged):
        # The turn that was drawn before solving comes with the standing, and so does the scale; not all of them are those
        # that were drawn for this body.
        factor, turn = draw(size.standing, placement.id[own], ground.long[own], size.seed)
        if size.outlines_of_variants and size.look is None:
            ground.heading[own] -= turn.astype(np.float32)
        ground.fit[own] = placement.scale[own] / factor
    elif ranged and outlines:
        ground.fit[own] = np.sqrt(placement.area[own] / np.array([outline.area for outline in outlines])[variant])


def _put_onto(ground: Ground, size: _Size, own: np.ndarray, variant: np.ndarray) -> None:
    """Put objects onto their bodies: of lines the middle of the outline on the point, its longer side along the axis.

    Bodies of a given area are discs around the objects' origins, whatever these look like.
    """
    outlines, long = size.outlines, size.shape.line is not None
    if not outlines or not (long or size.shape.own_outlines):
        return
    if long:
        ground.axis[own] = np.array([outline.angle for outline in outlines])[variant]
        ground.heading[own] -= ground.axis[own]
    # Of an object as it is, before its class's scale.
    foot = np.array([standing_on(outline, long) for outline in outlines])
    ground.middle[own] = foot[variant] / size.standing.scale


def _look(ground: Ground, look: LookAt, size: _Size, position: np.ndarray, own: np.ndarray, free: np.ndarray) -> None:
    """Turn those of a size's objects that are ``free`` towards what all of them look at."""
    ground.looks[own] = True
    ground.heading[free] = turns_towards(
        look, size.standing.align_to_normal, ground.normal[free], position[free], ground.identity[free], size.seed
    )


def _stand(ground: Ground, placement: Placement, classes: Sequence[ScatterClass], settings: ScatterSettings) -> Stand:
    """Return how all objects stand."""
    count = len(placement.position)
    stands = Stand(*(np.empty((count, *shape), np.float32) for shape in ((4,), (), (3,), (3,))))
    for number, scatter_class in enumerate(classes):
        own = np.flatnonzero(placement.class_index == number)
        found = stand(standing_of(scatter_class, settings), ground.part(own), settings.seed)
        for all_values, values in zip(stands, found, strict=True):
            all_values[own] = values
    return stands


def point_attributes(
    placement: Placement,
    points: ResultPoints,
    classes: Sequence[ScatterClass],
    settings: ScatterSettings,
    divided: Sequence[Subdivision | None],
) -> dict[str, tuple[str, np.ndarray]]:
    """Return the attributes of a result's points that do not depend on its report: type and values by name; in any thread.

    Args:
        placement: Where the bodies are.
        points: Where their objects are.
        classes: What was asked.
        settings: How the scatter is made.
        divided: How its targets are subdivided; None where they are not.
    """
    instances, ground = points.instances, points.ground
    colors = np.array([color_of(c) for c in classes], np.float32)
    align = np.array([standing_of(c, settings).align_to_normal for c in classes], np.float32)
    return {
        "id": ("INT", ground.identity),
        **({BODY_ANGLE: ("FLOAT", placement.angle)} if placement.angle.any() else {}),
        **({BODY_LENGTH: ("FLOAT", placement.length)} if placement.length.any() else {}),
        "class_index": ("INT", placement.class_index),
        "size_index": ("INT", placement.size_index),
        INSTANCE_INDEX: ("INT", instances.source),
        ROTATION: ("QUATERNION", instances.rotation),
        SCALE: ("FLOAT_VECTOR", np.repeat(instances.scale[:, None], 3, axis=1)),
        "class_color": ("FLOAT_COLOR", colors[placement.class_index]),
        **ground_attributes(ground, points.to_origin, points.height),
        **follow_attributes(points.surface, align[placement.class_index]),
        **add_pins(placement.fixed, points.instances.position),
        **points.stuck,
        **finer_attributes(points.stuck, divided),
    }


def _headings(surface: SurfacePoints, placement: Placement) -> np.ndarray:
    """Return how objects are turned about their own axes [rad], shape ``[n]``, float32."""
    if placement.tangent is None:
        return placement.angle.astype(np.float32)
    return headings(surface.normal.astype(np.float64), placement.tangent).astype(np.float32)


def overlap_attributes(placement: Placement) -> dict[str, tuple[str, np.ndarray]]:
    """Return the attributes that say of every point whether its object overlaps another or leans into it; none where no two do."""
    report = placement.report
    if report is None or not (report.overlapping or report.leaning_bodies):
        return {}
    on_ground = np.zeros(len(placement.position), bool)
    on_ground[list(report.overlapping)] = True
    overlaps = on_ground.copy()
    overlaps[list(report.leaning_bodies)] = True
    marks = {OVERLAPPING: ("BOOLEAN", overlaps)}
    if report.overlapping and report.leaning_bodies:
        marks[OVERLAPPING_ON_GROUND] = ("BOOLEAN", on_ground)
    return marks
