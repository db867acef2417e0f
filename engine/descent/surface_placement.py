"""Where bodies on a surface end: a state, in meters, and in the triangles of the meshes."""

from __future__ import annotations

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..geometry.unit_vectors import tangent_frame
from ..model.body_flags import BodyFlags
from ..model.looking import angle_within, looking_bodies, looks_at_point, somebody_looks
from ..model.model import Model
from ..model.state import SurfaceState
from ..problem.look_at import facing_on_surface
from ..problem.of_bodies import of_all, one_by_one
from ..problem.placement import Placement
from ..problem.surface import PointsOnSurface, Surface
from ..surface.facets import Facets
from . import kernels_surface_end
from .final_placement import bends_of

__all__ = ["facing_headings", "in_triangles", "placement_on_surface", "points_of"]


def points_of(launcher: Launcher, facets: Facets, state: SurfaceState) -> PointsOnSurface:
    """Where all bodies of a state are."""
    triangle, barycentric = in_triangles(launcher, facets, state.facet, state.weight)
    return facets.surface.points(triangle.numpy(), barycentric.numpy())


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


def placement_on_surface(
    model: Model, launcher: Launcher, facets: Facets, state: SurfaceState, charges: np.ndarray | None
) -> Placement:
    """The bodies of a state, less the ghosts; the report is still to be measured.

    ``charges`` is where all charges are [m], shape ``[charge_count, 3]``, if lines may bend.
    """
    body, n = model.body, model.body_count
    triangle, barycentric = in_triangles(launcher, facets, state.facet, state.weight)
    position, normal, tangent = (launcher.empty(n, wp.vec3d) for _ in range(3))
    turn = launcher.empty(n, wp.float64)
    outlined = model.footprints.is_outline if model.footprints.has_outlines else of_all(False, n)
    launcher.launch(
        kernels_surface_end.lay_down,
        n,
        [
            triangle,
            barycentric,
            _triangles(launcher, facets.surface),
            state.axis,
            state.heading,
            launcher.alike(one_by_one(lambda mask: mask.astype(np.uint8), outlined), wp.uint8),
        ],
        [position, normal, tangent, turn],
    )
    points = facets.surface.points(triangle.numpy(), barycentric.numpy())
    length, width, angle = np.zeros(n), np.zeros(n), np.zeros(n)
    if model.kinds:
        length = 2.0 * np.linalg.norm(state.axis.numpy().astype(np.float64), axis=1) * model.unit
        width = model.widths(length)
    if model.kinds or model.footprints.has_outlines:
        angle = turn.numpy()
    along, up = tangent.numpy(), normal.numpy()
    _turn_others(model, points, angle, up, along)
    mesh, of_mesh, weights = points.source()
    ghosts = (body.flags & BodyFlags.GHOST) != 0
    has_ghosts = bool(ghosts.any())

    def made(of_bodies: np.ndarray) -> np.ndarray:
        return of_bodies[~ghosts] if has_ghosts else of_bodies

    def shown(of_bodies: np.ndarray) -> np.ndarray:
        # A copy in any case: the model goes on.
        return made(of_bodies) if has_ghosts else of_bodies.copy()

    return Placement(
        model.problem,
        made(position.numpy()),
        shown(body.class_index),
        shown(body.size_index),
        made(angle),
        made(length),
        made(width),
        bends=None if charges is None else made(bends_of(model, charges)),
        id=made(body.identity.astype(np.int64)),
        fixed=shown(model.fixed),
        variant=shown(model.footprints.variant),
        scale=shown(model.footprints.scale),
        normal=made(up),
        tangent=made(along),
        mesh=made(mesh.astype(np.int32)),
        triangle=made(of_mesh.astype(np.int32)),
        barycentric=made(weights),
    )


def in_triangles(launcher: Launcher, facets: Facets, facet: wp.array, weight: wp.array) -> tuple[wp.array, wp.array]:
    """Triangles of points on facets, ``wp.int32``, and weights of their corners, ``wp.vec3d``."""
    n = len(facet)
    triangle, barycentric = launcher.empty(n, wp.int32), launcher.empty(n, wp.vec3d)
    inputs = [facet, weight, facets.on_device.triangle, facets.on_device.weight]
    launcher.launch(kernels_surface_end.find_in_triangles, n, inputs, [triangle, barycentric])
    return triangle, barycentric


def _triangles(launcher: Launcher, surface: Surface) -> kernels_surface_end.Triangles:
    """The triangles of a surface as kernels take them."""
    triangles = kernels_surface_end.Triangles()
    triangles.vertex = launcher.array(surface.position, wp.vec3d)
    triangles.corner = launcher.array(surface.triangle.astype(np.int32).ravel(), wp.int32)
    triangles.normal = launcher.array(surface.normal, wp.vec3d)
    return triangles


def _turn_others(
    model: Model, points: PointsOnSurface, angle: np.ndarray, normal: np.ndarray, tangent: np.ndarray
) -> None:
    """Turn bodies that look at a point, and those that were put there: what is put there lies as it was put."""
    turned = np.zeros(model.body_count, bool)
    if somebody_looks(model):
        turned = looks_at_point(model) & ~model.footprints.is_outline
        angle[turned] = facing_headings(model, points)[turned]
    if model.has_fixed:
        put = model.fixed & (model.footprints.is_outline | (model.body.kind < 0))
        angle[put] = model.problem.fixed.angle[put[model.fixed]]
        turned |= put
    if turned.any():
        first, second = tangent_frame(normal[turned])
        tangent[turned] = np.cos(angle[turned])[:, None] * first + np.sin(angle[turned])[:, None] * second
