"""Where the objects of a result stand now: as its node group shows them, with the target they follow and its own transform."""

from __future__ import annotations

from typing import NamedTuple

import bpy
import numpy as np

from ...engine.geometry.unit_vectors import unit_vectors
from ...engine.surface.instances import body_rotations, rotate
from ..targets.depsgraph import evaluated_depsgraph
from ..targets.evaluated_mesh import evaluated_mesh, in_world, vertices_in_world
from ..targets.mesh_attributes import read_attribute
from ..targets.target import is_mirrored
from .attributes import (
    ALIGN,
    CORNERS,
    EDGE,
    FACE_NORMAL,
    FINER_CORNERS,
    GROUND_POINT,
    HEIGHT,
    MIDDLE,
    NORMAL,
    ROTATION,
    SCALE,
    TARGET,
    TO_ORIGIN,
    WEIGHTS,
)
from .display import followed_targets, get_inputs, matrix_of_points, our_modifier
from .follow_nodes import ROUNDING, UP
from .kept_ground import body_places
from .node_group_contents import Followed

__all__ = [
    "LyingNow",
    "MovedWith",
    "StandingNow",
    "heights",
    "lying_now",
    "moved_with",
    "raised",
    "rotations",
    "standing_now",
]

# Parts of a rotation by less than this are what rounding makes [rad].
LEAST_TURN = 1e-5
# Directions whose angle has a smaller sine are parallel.
PARALLEL = 1e-6


class StandingNow(NamedTuple):
    """Objects of a result in the order of its points: positions in the world [m], ``[n, 3]``, and their axes, ``[n, 3, 3]``."""

    position: np.ndarray
    axes: np.ndarray


class LyingNow(NamedTuple):
    """Outlines of a result's objects, in the order of its points, as they lie along its surface.

    Attributes:
        position: Where bodies are on the surface, in the world [m], shape ``[n, 3]``.
        normal: Where the surface looks to there, shape ``[n, 3]``.
        along: Where the x axes of objects point along it, shape ``[n, 3]``.
        scale: Of objects, shape ``[n]``.
        middle: What of an object at scale 1 is where its body is, seen from its origin [m], shape ``[n, 2]``.
    """

    position: np.ndarray
    normal: np.ndarray
    along: np.ndarray
    scale: np.ndarray
    middle: np.ndarray


class MovedWith(NamedTuple):
    """Places with what they follow.

    Attributes:
        position: Where they are now [m], shape ``[n, 3]``.
        turned: How all that is there was turned since, and mirrored where what they follow was, shape ``[n, 3, 3]``.
    """

    position: np.ndarray
    turned: np.ndarray

    def axes(self, rotation: np.ndarray) -> np.ndarray:
        """Axes of objects that were turned so, as they are now, ``[n, 3, 3]``: what is mirrored is so along its y once more."""
        now = self.turned @ rotation
        now[:, :, 1] *= np.linalg.det(self.turned)[:, None].round()
        return now


def standing_now(result: bpy.types.Object, context: bpy.types.Context) -> StandingNow:
    """Return where all objects of a result stand, however many of them the viewport shows."""
    mesh = result.data
    position, scale = (read_attribute(mesh, name).astype(np.float64) for name in ("position", SCALE))
    rotation = rotations(result)
    now = moved_with(result, position, context, heights(result))
    world = matrix_of_points(result)
    return StandingNow(in_world(now.position, world), world[:3, :3] @ now.axes(rotation) * scale[:, None, :])


def lying_now(result: bpy.types.Object, context: bpy.types.Context) -> LyingNow:
    """Return how the outlines of all objects of a result lie along its surface now: as they do while they are parted."""
    mesh = result.data
    axes = standing_now(result, context).axes
    world = matrix_of_points(result)
    known = TO_ORIGIN in mesh.attributes and NORMAL in mesh.attributes
    place = body_places(mesh) if known else read_attribute(mesh, "position").astype(np.float64)
    now = moved_with(result, place, context)
    up = unit_vectors(axes[:, :, 2])
    normal = up
    if known:
        # Of what is scaled unevenly planes turn otherwise than lines.
        cofactors = np.cross(world[[1, 2, 0], :3], world[[2, 0, 1], :3])
        looks = np.einsum("nij,nj->ni", now.turned, read_attribute(mesh, NORMAL).astype(np.float64))
        mirrored = -1.0 if np.linalg.det(world[:3, :3]) < 0.0 else 1.0
        normal = unit_vectors(mirrored * looks @ cofactors.T)
    middle = read_attribute(mesh, MIDDLE)[:, :2] if MIDDLE in mesh.attributes else np.zeros((len(axes), 2))
    length = np.linalg.norm(axes[:, :, :2], axis=1)
    along = _leant(unit_vectors(axes[:, :, 0]), up, normal)
    return LyingNow(
        in_world(now.position, world), normal, along, np.sqrt(length.prod(axis=1)), middle.astype(np.float64)
    )


def _leant(vector: np.ndarray, old: np.ndarray, new: np.ndarray) -> np.ndarray:
    """Return vectors turned as the shortest way from one direction to another does; half a turn is about y, ``[n, 3]`` each."""
    axis = np.cross(old, new)
    cosine = (old * new).sum(axis=1, keepdims=True)
    once = np.cross(axis, vector)
    turned = vector + once + np.cross(axis, once) / np.maximum(1.0 + cosine, 1e-12)
    return np.where(cosine < -1.0 + 1e-9, vector * [-1.0, 1.0, -1.0], turned)


def heights(result: bpy.types.Object) -> np.ndarray:
    """Return the part of the ways to origins that goes along the objects' own axes [m], ``[n, 3]``; older results have none."""
    mesh = result.data
    known = HEIGHT in mesh.attributes
    return read_attribute(mesh, HEIGHT).astype(np.float64) if known else np.zeros((len(mesh.vertices), 3))


def moved_with(
    result: bpy.types.Object, position: np.ndarray, context: bpy.types.Context, height: np.ndarray | float = 0.0
) -> MovedWith:
    """Return where places beside the points of a result [m] are now with its target, if it follows that; seen from it.

    Args:
        result: The result.
        position: The places, shape ``[n, 3]``.
        context: Where it is looked at.
        height: The part of the ways to them that leans as the objects do [m], shape ``[n, 3]``; the rest leans as the ground does.
    """
    mesh = result.data
    turned = np.broadcast_to(np.eye(3), (len(position), 3, 3))
    modifier = our_modifier(result)
    if modifier is not None and get_inputs(modifier).get("Follow", True) and WEIGHTS in mesh.attributes:
        followed = followed_targets(modifier)
        targets = [_target_now(one, context) for one in followed]
        # Of earlier versions: a target that has lost or got vertices is not followed, and then none is.
        known = all(one.rest is not None for one in followed) or all(len(one.vertices) for one in targets)
        if followed and known:
            position, turned = _follow(mesh, position, targets, np.broadcast_to(height, position.shape))
    return MovedWith(position, turned)


def rotations(result: bpy.types.Object) -> np.ndarray:
    """Return the rotations of the objects of a result as they were placed, seen from it, ``[n, 3, 3]``."""
    return _matrices(read_attribute(result.data, ROTATION).astype(np.float64))


def raised(axes: np.ndarray) -> np.ndarray:
    """Return axes ``[n, 3, 3]`` turned the shortest way until the third one is vertical: outlines are of what stands upright."""
    up = unit_vectors(axes[:, :, 2])
    leaning = body_rotations(np.where(up[:, 2:] < 0.0, -up, up), 1.0, np.zeros(len(up)))
    back = leaning * [1.0, -1.0, -1.0, -1.0]
    return np.stack([rotate(back, axes[:, :, k]) for k in range(3)], axis=2)


class _TargetNow(NamedTuple):
    """What points follow, as it is now.

    Attributes:
        vertices: In the world, shape ``[n, 3]``; none where these are others than points were placed on.
        times: How many times more parts its edges are cut into than they were.
        over: Whether it was mirrored since.
        way: Where it is now from where its rest was: how directions are turned and scaled, ``[3, 3]``, the place then and the place
            now, ``[3]`` each; None where nobody knows.
    """

    vertices: np.ndarray
    times: int
    over: bool
    way: tuple[np.ndarray, np.ndarray, np.ndarray] | None


def _target_now(told: Followed, context: bpy.types.Context) -> _TargetNow:
    """Return a target as it is shown; nothing of one that is gone or not evaluated."""
    nothing = _TargetNow(np.empty((0, 3)), 0, False, None)
    if told.target is None:
        return nothing
    evaluated = told.target.evaluated_get(evaluated_depsgraph(context))
    if not evaluated.is_evaluated:
        return nothing
    matrix = np.array(evaluated.matrix_world, np.float64)
    with evaluated_mesh(told.target, context) as mesh:
        if mesh is None or not len(mesh.vertices):
            return nothing
        count = len(mesh.vertices)
        finer = told.finer.vertices if told.finer is not None else ()
        times = 2 ** (finer.index(count) + 1) - 1 if count in finer else 0
        same = times or count == told.vertices
        vertices = vertices_in_world(mesh, matrix) if same else nothing.vertices
    over = told.mirrored is not None and told.mirrored != is_mirrored(told.target, context)
    if told.rest is None:
        return _TargetNow(vertices, times, over, None)
    place, *rows = (np.array(row, np.float64) for row in told.rest)
    return _TargetNow(vertices, times, over, (matrix[:3, :3] @ np.array(rows), place, matrix[:3, 3]))


class _Triangles(NamedTuple):
    """Triangles in the world: one corner, the edges from there, ``[n, 3]`` each, and which of them there are, ``[n]``."""

    corner: np.ndarray
    edge: np.ndarray
    side: np.ndarray
    there: np.ndarray


def _triangles_now(mesh: bpy.types.Mesh, number: np.ndarray, targets: list[_TargetNow]) -> _Triangles:
    """Return the triangles of points now; of other meshes than points were placed on those that were there, moved with the target.

    The corners of these are the points of the ground themselves, and their edges are moved there: no weights count.
    """
    before, edge_before, normal_before = (
        read_attribute(mesh, name).astype(np.float64) for name in (GROUND_POINT, EDGE, FACE_NORMAL)
    )
    weights = read_attribute(mesh, WEIGHTS).astype(np.float64)
    # Points that are not tied to the ground have no weights.
    tied = np.linalg.norm(weights, axis=1) > 0.0
    ground, edge, side = before.copy(), edge_before.copy(), np.cross(normal_before, edge_before)
    there = np.zeros(len(before), bool)
    for which, target in enumerate(targets):
        own = np.flatnonzero(tied & (number == which))
        if len(target.vertices):
            a, b, c = (target.vertices[one] for one in _corners_now(mesh, own, target.times))
            edge[own], side[own] = b - a, c - a
            ground[own] = a + weights[own, 1:2] * edge[own] + weights[own, 2:3] * side[own]
        elif target.way is not None:
            turned, place, now = target.way
            ground[own] = now + (before[own] - place) @ turned.T
            edge[own], side[own] = edge[own] @ turned.T, side[own] @ turned.T
        there[own] = len(target.vertices) > 0 or target.way is not None
    return _Triangles(ground, edge, side, there)


def _corners_now(mesh: bpy.types.Mesh, own: np.ndarray, times: int) -> list[np.ndarray]:
    """Return the numbers of the vertices around some points of a result where edges are cut into so many times more parts."""
    found = []
    for names in zip(CORNERS, *FINER_CORNERS, strict=True):
        vertex, *finer = (read_attribute(mesh, name)[own] for name in (names if times else names[:1]))
        found.append(vertex + times * (finer[0] + times * finer[1]) if times else vertex)
    return found


def _follow(
    mesh: bpy.types.Mesh, position: np.ndarray, targets: list[_TargetNow], height: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Move places with their triangles, and tell how objects turn with them, as the node group's part does that is called "Follow".

    Triangles of targets that were mirrored since are turned over; they look to the side that they looked to. What was is mirrored
    along y there, from where a turn leads to what is.
    """
    before, edge_before, normal_before = (
        read_attribute(mesh, name).astype(np.float64) for name in (GROUND_POINT, EDGE, FACE_NORMAL)
    )
    number = read_attribute(mesh, TARGET) if TARGET in mesh.attributes else np.zeros(len(position), np.int32)
    ground, edge, side, there = _triangles_now(mesh, number, targets)
    over = np.array([one.over for one in targets])[number]
    moved = np.linalg.norm(ground - before, axis=1) > ROUNDING * np.linalg.norm(before, axis=1)
    ground = np.where(moved[:, None], ground, before)
    looking = np.where(over[:, None], -side, side)
    mirror = np.where(over[:, None], [1.0, -1.0, 1.0], 1.0)
    edge_before, normal_before = mirror * edge_before, mirror * normal_before
    turned = _frames(np.cross(edge, looking), edge) @ _frames(normal_before, edge_before).transpose(0, 2, 1)
    up = np.broadcast_to(np.array(UP), edge.shape)
    upright = _frames(up, edge) @ _frames(up, edge_before).transpose(0, 2, 1)
    leaning = _part_of(upright.transpose(0, 2, 1) @ turned, read_attribute(mesh, ALIGN).astype(np.float64))
    along = upright @ leaning * mirror[:, None, :]
    place = ground + np.einsum("nij,nj->ni", turned, mirror * (position - before - height))
    place += np.einsum("nij,nj->ni", along, height)
    # What has not moved stays to the last digit.
    keep = there & (moved | over | (np.abs(turned - np.eye(3)).max(axis=(1, 2)) > LEAST_TURN))
    return np.where(keep[:, None], place, position), np.where(keep[:, None, None], along, np.eye(3))


def _frames(main: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return rotations ``[n, 3, 3]`` whose third axis is ``main``, and whose first one is as near to ``second`` as can be.

    Where these are parallel, as a vertical edge of a wall is with what is upright, it is as near to x or y.
    """
    z = unit_vectors(main)
    x = second - (second * z).sum(axis=1, keepdims=True) * z
    parallel = np.linalg.norm(x, axis=1) <= PARALLEL * np.linalg.norm(second, axis=1)
    if parallel.any():
        other = np.where(np.abs(z[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
        x = np.where(parallel[:, None], other - (other * z).sum(axis=1, keepdims=True) * z, x)
    x = unit_vectors(x)
    return np.stack([x, np.cross(z, x), z], axis=2)


def _part_of(rotation: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Return rotations ``[n, 3, 3]`` about the same axes by a share of the angle."""
    axis = np.stack([rotation[:, k - 1, k - 2] for k in range(3)], axis=1)
    axis = 0.5 * (axis - np.stack([rotation[:, k - 2, k - 1] for k in range(3)], axis=1))
    sine, cosine = np.linalg.norm(axis, axis=1), 0.5 * (np.trace(rotation, axis1=1, axis2=2) - 1.0)
    angle = share * np.arctan2(sine, cosine)
    # About half a turn, as that of a mirrored target is, the sine says nothing: what a rotation leaves as it is does.
    kept = rotation + rotation.transpose(0, 2, 1) - 2.0 * cosine[:, None, None] * np.eye(3)
    longest = np.take_along_axis(kept, np.argmax(np.linalg.norm(kept, axis=1), axis=1)[:, None, None], axis=2)[:, :, 0]
    longest = np.where((longest * axis).sum(axis=1, keepdims=True) < 0.0, -longest, longest)
    x, y, z = unit_vectors(np.where(cosine[:, None] < 0.0, longest, axis)).T
    zero = np.zeros_like(x)
    cross = np.stack([np.stack(row, axis=1) for row in ((zero, -z, y), (z, zero, -x), (-y, x, zero))], axis=1)
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.eye(3) + s * cross + (1.0 - c) * cross @ cross


def _matrices(quaternion: np.ndarray) -> np.ndarray:
    """Return rotations ``[n, 3, 3]`` of unit quaternions (w, x, y, z), ``[n, 4]``: where they turn the axes, in columns."""
    axes = (np.broadcast_to(axis, (len(quaternion), 3)) for axis in np.eye(3))
    return np.stack([rotate(quaternion, axis) for axis in axes], axis=2)
