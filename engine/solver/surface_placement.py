"""Where bodies on a surface end: a state, in meters, and in the triangles of the meshes."""

from __future__ import annotations

import numpy as np

from ..problem.look_at import facing_on_surface
from ..problem.placement import Placement
from ..problem.surface import PointsOnSurface
from ..surface.facets import Facets
from .body_flags import BodyFlags
from .final_placement import angle_within, bends_of, looking_bodies, looks_at_point
from .model import Model
from .surface_line_rules import tangent_frame
from .surface_state import SurfaceState

__all__ = ["facing_headings", "placement_on_surface", "points_of"]


def points_of(facets: Facets, state: SurfaceState) -> PointsOnSurface:
    """Where all bodies of a state are."""
    weight = state.weight.numpy().astype(np.float64)
    weight = np.column_stack([1.0 - weight.sum(axis=1), weight])
    # Rounding may have left a side.
    weight = np.maximum(weight, 0.0)
    weight /= weight.sum(axis=1, keepdims=True)
    return facets.surface.points(*facets.in_triangle(state.facet.numpy(), weight))


def facing_headings(model: Model, points: PointsOnSurface) -> np.ndarray:
    """Angles [rad] with which bodies look where their class does, from the directions nearest to x; 0 of those that look nowhere."""
    angle = np.zeros(model.body_count)
    for look, own in looking_bodies(model):
        first, second = tangent_frame(points.normal[own])
        turn = facing_on_surface(
            look, points.position[own], first, second, model.body.identity[own], model.problem.seed
        )
        angle[own] = angle_within(turn, 2.0 * np.pi)
    return angle


def placement_on_surface(model: Model, facets: Facets, state: SurfaceState, charges: np.ndarray | None) -> Placement:
    """The bodies of a state, less the ghosts; the report is still to be measured.

    ``charges`` is where all charges are [m], shape ``[charge_count, 3]``, if lines may bend.
    """
    points = points_of(facets, state)
    body = model.body
    shown = (body.flags & BodyFlags.GHOST) == 0
    normal = points.normal
    axis = state.axis.numpy().astype(np.float64)
    half = np.linalg.norm(axis, axis=1)
    first, second = tangent_frame(normal)
    tangent = first.copy()
    tangent[half > 0.0] = axis[half > 0.0] / half[half > 0.0, None]
    tangent -= (tangent * normal).sum(axis=1, keepdims=True) * normal
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    lying = np.where(half > 0.0, np.arctan2((tangent * second).sum(axis=1), (tangent * first).sum(axis=1)), 0.0)
    # A line has no front, unless its outline has one.
    angle = angle_within(lying, np.pi)
    outlined = model.footprints.is_outline
    angle[outlined] = angle_within(lying + state.heading.numpy(), 2.0 * np.pi)[outlined]
    looking = looks_at_point(model) & ~outlined
    angle[looking] = facing_headings(model, points)[looking]
    # What is put there lies as it was put.
    put = model.fixed & (outlined | (body.kind < 0))
    angle[put] = model.problem.fixed.angle[put[model.fixed]]
    turned = looking | outlined | put
    tangent[turned] = (np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second)[turned]
    length = 2.0 * half * model.unit
    width = model.widths(length) if model.kinds else np.zeros(len(length))
    mesh, triangle, barycentric = points.source()
    return Placement(
        model.problem,
        points.position[shown],
        body.class_index[shown],
        body.size_index[shown],
        angle[shown],
        length[shown],
        width[shown],
        bends=None if charges is None else bends_of(model, charges)[shown],
        id=body.identity[shown].astype(np.int64),
        fixed=model.fixed[shown],
        variant=model.footprints.variant[shown],
        scale=model.footprints.scale[shown],
        normal=normal[shown],
        tangent=tangent[shown],
        mesh=mesh[shown].astype(np.int32),
        triangle=triangle[shown].astype(np.int32),
        barycentric=barycentric[shown],
    )
