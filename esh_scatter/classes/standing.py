"""How objects stand on their points: turned, tilted, moved along the normal and scaled; needs no solving.

A result keeps with every point what this needs to know (:class:`Ground`), so that another standing can be given to it at once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from ...engine.problem.look_at import LookAt, facing_on_surface
from ...engine.problem.scatter_settings import Standing
from ...engine.problem.slopes import LEVEL, lengthened, slope_of_normal, tilts
from ...engine.surface.instances import body_rotations, rotate

__all__ = ["LOWEST", "STEEPEST", "Ground", "Stand", "Unread", "draw", "stand", "turns_any_way", "turns_towards"]

# What touches the ground where it is not the origin.
LOWEST = "lowest"
# Where the normal points up by less than this, the ground is a wall.
STEEPEST = 0.3


class Unread(IntEnum):
    """How much of how objects stand has no influence on where they are: nothing, their turns, or also how they lean."""

    NOTHING, TURNS, LEANS = 0, 1, 2


@dataclass(frozen=True, eq=False)
class Ground:
    """What is known of the points that objects stand on.

    Attributes:
        identity: Number of the point, which its random numbers follow, shape ``[n]``, int32.
        normal: Of the surface, of length 1, shape ``[n, 3]``, float32.
        heading: Turn about the object's own axis that the placement asks for [rad], shape ``[n]``, float32; of a long one as it is
            seen from above.
        long: Whether the object lies along a direction, so that it is not turned at random, shape ``[n]``, bool.
        fit: Scale that fits an object of its class's scale to its footprint, shape ``[n]``, float32.
        middle: What of an object at scale 1 lies on the point, seen from its origin [m], shape ``[n, 2]``, float32.
        axis: Of a long object, where its longer side points before it is turned [rad], shape ``[n]``, float32.
        laid: Whether the heading of a long object is the turn about its own axis all the same, as on a whole surface, which is not
            seen from above, shape ``[n]``, bool.
        looks: Whether it looks somewhere, so that its heading is its whole turn, shape ``[n]``, bool.
        lowest: Height of the lowest point of an object at scale 1 above its origin [m], shape ``[n]``, float32.
    """

    identity: np.ndarray
    normal: np.ndarray
    heading: np.ndarray
    long: np.ndarray
    fit: np.ndarray
    middle: np.ndarray
    axis: np.ndarray
    laid: np.ndarray
    looks: np.ndarray
    lowest: np.ndarray

    def part(self, chosen: np.ndarray) -> Ground:
        """Return some of the points."""
        return Ground(*(getattr(self, name)[chosen] for name in self.__dataclass_fields__))


class Stand(NamedTuple):
    """How objects stand; all float32.

    Attributes:
        rotation: Unit quaternions (w, x, y, z), shape ``[n, 4]``.
        scale: Shape ``[n]``.
        to_origin: The way from point to origin [m], shape ``[n, 3]``.
        height: The part of it that goes along the object's own axis, whichever way the ground leans [m], shape ``[n, 3]``.
    """

    rotation: np.ndarray
    scale: np.ndarray
    to_origin: np.ndarray
    height: np.ndarray


def turns_any_way(standing: Standing) -> bool:
    """Tell whether objects may be turned in any direction: then those that are parted turn on from what was drawn for them."""
    # The sidebar keeps 32 bits of an angle.
    return standing.random_turn >= float(np.nextafter(np.float32(2.0 * math.pi), np.float32(0.0)))


def draw(standing: Standing, identity: np.ndarray, long: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return what is random about points, whether they have a place yet or not: a factor of their scale, and their turn [rad]."""
    random = np.random.default_rng([seed, 1]).random((int(identity.max(initial=-1)) + 1, 3))[identity]
    # A line has no front: half of the objects look the other way.
    back = np.where(random[:, 1] < 0.5, 0.0, math.pi)
    turn = np.where(long, back, standing.random_turn * (random[:, 1] - 0.5))
    return 1.0 + standing.scale_jitter * (2.0 * random[:, 2] - 1.0), turn


def turns_towards(
    look: LookAt, align: float, normal: np.ndarray, position: np.ndarray, identity: np.ndarray, seed: int
) -> np.ndarray:
    """Return the turns about their own axes with which objects look at a point [rad], shape ``[n]``.

    Args:
        look: Where they look.
        align: How far they lean towards the normal.
        normal: Of the surface, of length 1, shape ``[n, 3]``.
        position: Where they are in the world [m], shape ``[n, 3]``.
        identity: Numbers of the points, shape ``[n]``.
        seed: Of the run.
    """
    upright = body_rotations(normal.astype(np.float64), align, np.zeros(len(normal)))
    along, beside = (rotate(upright, np.broadcast_to(axis, upright[:, 1:].shape)) for axis in np.eye(3)[:2])
    return facing_on_surface(look, position.astype(np.float64), along, beside, identity, seed)


def _turn_seen_so(direction: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """Return the turns with which axes in planes of these slopes have these directions [rad] seen from above."""
    way = lengthened(np.stack([np.cos(direction), np.sin(direction)], axis=1), slope)
    leaning = np.abs(slope).max(axis=1) > LEVEL
    return np.where(leaning, np.arctan2(way[:, 1], way[:, 0]), direction)


def _tilted(normal: np.ndarray, align: float, tilt: np.ndarray) -> np.ndarray:
    """Return the upright axes of objects that lean over from where they would stand, shape ``[n, 3]``, float64."""
    leaning = body_rotations(normal.astype(np.float64), align, np.zeros(len(normal)), (tilt[:, 0], tilt[:, 1]))
    return rotate(leaning, np.broadcast_to([0.0, 0.0, 1.0], normal.shape))


def _onto_ground(way: np.ndarray, ground: Ground) -> np.ndarray:
    """Return ways from origins to points [m], shape ``[n, 3]``, raised or lowered so that origins are on the ground, too.

    Near its point the ground is a plane. Long objects lie on their middles, and on walls nothing is raised.
    """
    normal = ground.normal.astype(np.float64)
    steep = ground.long | (np.abs(normal[:, 2]) < STEEPEST)
    way = way.copy()
    way[:, 2] -= np.where(steep, 0.0, (way * normal).sum(axis=1) / np.where(steep, 1.0, normal[:, 2]))
    return way


def stand(standing: Standing, ground: Ground, seed: int) -> Stand:
    """Return how objects stand on their points; all float32.

    A point's random numbers follow from its number and the seed: a longer list of points leaves the earlier ones as they are.
    """
    factor, turn = draw(standing, ground.identity, ground.long, seed)
    scale = (standing.scale * ground.fit * factor).astype(np.float32)
    turn = ground.heading + np.where(ground.looks, 0.0, turn)
    axis, align, tilt = ground.normal, standing.align_to_normal, None
    if standing.tilt > 0.0:
        tilt = tilts(standing.tilt, ground.identity, seed)
        axis, align = _tilted(axis, align, tilt), 1.0
    long = np.flatnonzero(ground.long & ~ground.laid)
    if len(long) and align > 0.0:
        slope = slope_of_normal(axis[long], align)
        turn[long] = _turn_seen_so(turn[long] + ground.axis[long], slope) - ground.axis[long]
    rotation = body_rotations(axis, align, turn)
    if tilt is not None and ground.laid.any():
        # There is no shortest way to all axes of a whole surface: turned as their headings ask first, objects lean over then.
        laid = body_rotations(ground.normal, standing.align_to_normal, turn, (tilt[:, 0], tilt[:, 1]))
        rotation = np.where(ground.laid[:, None], laid, rotation)
    to_origin = standing.offset * ground.normal.astype(np.float64)
    moved = np.flatnonzero(ground.middle.any(axis=1))
    if len(moved):
        middle = np.zeros((len(moved), 3))
        middle[:, :2] = scale[moved, None] * ground.middle[moved]
        to_origin[moved] -= _onto_ground(rotate(rotation[moved], middle), ground.part(moved))
    height = np.zeros_like(to_origin)
    if standing.stand_on == LOWEST and ground.lowest.any():
        up = rotate(rotation, np.broadcast_to([0.0, 0.0, 1.0], ground.normal.shape))
        height = -(scale * ground.lowest)[:, None] * up
        to_origin += height
    return Stand(rotation.astype(np.float32), scale, to_origin.astype(np.float32), height.astype(np.float32))
