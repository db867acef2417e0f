"""Which parts of a surface see each other, and where the surface really ends."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..geometry.connected import connected
from ..geometry.unit_vectors import unit_vectors
from ..problem.surface import Surface
from . import kernels_facets
from .continuations import continued_parts
from .edge_places import places_along
from .relations import CRUMBS, Relations
from .standing import standing_pairs
from .surface_edges import SurfaceEdges

__all__ = ["Parts", "joined_parts"]

# Where a side is open, the surface is looked for this far beyond it, in units; what is nearer to that than the second goes on there.
BEYOND = 0.05
NEAR = 0.02
# Two borders meet that are nearer than so many times the first.
MEETS = 2.0
# One border lies above another where this is less than the cosines between both parts' normals and ways into them: within 60 degrees.
ABOVE = 0.5
# Directions that are looked into: straight on, and turned towards the front and the back [rad].
TURNS = np.radians([0.0, 30.0, -30.0, 60.0, -60.0, 90.0, -90.0])
# Places along a side that are looked at: one for every unit of its length, but at most so many.
MOST_PLACES = 32


class Parts(NamedTuple):
    """What a surface is made of.

    Attributes:
        label: Of every triangle, shape ``[t]``: parts of different labels do not see each other, unless one stands on the other.
        open_side: Whether the surface ends at the side opposite of each corner, shape ``[t, 3]``.
        relations: Which labels stand on one another.
        part: Number of the part that each triangle is in, shape ``[t]``: parts that hold only a few bodies have one label.
        continues: Whether parts go on on others across creases, as bricks do that stand side by side.
        crumbs: Label of the parts that hold only a few bodies, where a surface has several parts; -1 for none.
    """

    label: np.ndarray
    open_side: np.ndarray
    relations: Relations
    part: np.ndarray
    continues: bool
    crumbs: int


def joined_parts(launcher: Launcher, surface: Surface, unit: float) -> Parts:
    """Join the parts that touch, and find those that stand on one another. Crumbs see each other, and nothing else.

    Args:
        launcher: Where to run.
        surface: The surface.
        unit: Meters per unit.
    """
    part, open_side = surface.part.copy(), surface.open_side.copy()
    triangle, corner = np.nonzero(open_side)
    if len(triangle):
        found, number = _beyond(launcher, surface, unit, triangle, corner)
        hit = found >= 0
        part = connected(int(part.max()) + 1, part[triangle[number[hit]]], part[found[hit]])[part]
        goes_on = np.bincount(number, weights=hit, minlength=len(triangle)) > 0.5 * np.bincount(number)
        open_side[triangle[goes_on], corner[goes_on]] = False
    edges = SurfaceEdges(launcher, surface, unit)
    part, continues = continued_parts(edges, part, NEAR)
    open_side &= ~continues
    area = np.bincount(part, surface.triangle_area / unit**2)
    crumb = area < CRUMBS
    pair, place = standing_pairs(edges, part)
    pair = pair[~crumb[pair].any(axis=1)]
    known, label = np.unique(np.where(crumb[part], len(area), part), return_inverse=True)
    relations = Relations(np.searchsorted(known, pair), area[pair].min(axis=1, initial=np.inf), place)
    continued = bool((continues & ~surface.open_side).any())
    crumbs = len(known) - 1 if crumb.any() and len(area) > 1 else -1
    return Parts(label.ravel(), open_side, relations, part, continued, crumbs)


def _beyond(
    launcher: Launcher, surface: Surface, unit: float, triangle: np.ndarray, corner: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Look beyond open sides; return what triangle goes on at every place that was looked at, or -1, and the number of its side."""
    device = launcher.device
    middle = 0.5 * (surface.low + surface.high)
    place = (surface.position - middle) / unit
    start, end, apex = (place[surface.triangle[triangle, (corner + k) % 3]] for k in (1, 2, 0))
    along = end - start
    out = np.cross(along / np.linalg.norm(along, axis=1)[:, None], surface.normal[triangle])
    out *= np.sign(((start - apex) * out).sum(axis=1))[:, None]
    number, point, _ = places_along(start, end, 1.0, MOST_PLACES)
    mesh = wp.Mesh(
        wp.array(place.astype(np.float32), dtype=wp.vec3, device=device),
        wp.array(surface.triangle.astype(np.int32).ravel(), dtype=wp.int32, device=device),
    )
    result = np.full(len(number), -1)
    for turn in TURNS:
        left = np.flatnonzero(result < 0)
        if not len(left):
            break
        own = number[left]
        probe = point[left] + BEYOND * (math.cos(turn) * out[own] + math.sin(turn) * surface.normal[triangle[own]])
        face = launcher.empty(len(left), wp.int32)
        launcher.launch(
            kernels_facets.find_faces,
            len(left),
            [mesh.id, wp.array(probe.astype(np.float32), dtype=wp.vec3, device=device), NEAR],
            [face],
        )
        found = face.numpy()
        # Where a side ends on the middle of another part, as a sticker does, the two only touch: borders must meet.
        hit = np.flatnonzero(found >= 0)
        away, inward = _nearest_open_side(place, surface, found[hit], probe[hit])
        # And where both go the same way from there, one lies above the other.
        side = own[hit]
        alike = (surface.normal[triangle[side]] * surface.normal[found[hit]]).sum(axis=1) > ABOVE
        meets = (away < MEETS * BEYOND) & ~(alike & ((inward * out[side]).sum(axis=1) < -ABOVE))
        result[left[hit[meets]]] = found[hit[meets]]
    return result, number


def _nearest_open_side(
    place: np.ndarray, surface: Surface, triangle: np.ndarray, point: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Distance from points to the nearest open side of a triangle each, infinite where it has none; and the way into it from there."""
    nearest, inward = np.full(len(point), np.inf), np.zeros((len(point), 3))
    for k in range(3):
        apex, start, end = (place[surface.triangle[triangle, (k + step) % 3]] for step in (0, 1, 2))
        way = end - start
        along = ((point - start) * way).sum(axis=1) / np.maximum((way**2).sum(axis=1), 1e-30)
        distance = np.linalg.norm(start + np.clip(along, 0.0, 1.0)[:, None] * way - point, axis=1)
        nearer = surface.open_side[triangle, k] & (distance < nearest)
        nearest = np.where(nearer, distance, nearest)
        direction = unit_vectors(way)
        up = apex - start
        up = unit_vectors(up - direction * (up * direction).sum(axis=1)[:, None])
        inward = np.where(nearer[:, None], up, inward)
    return nearest, inward
