"""Outlines that are parted, as kernels take them, with room for corners as somebody else sees them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from . import kernels_outlines
from .footprint_tables import FootprintTables

__all__ = ["CrowdOutlines", "crowd_outlines"]

# On a GPU, where many threads try the places of one body, all together have room for the corners of so many outlines.
ROOMS_ON_GPU = 16_384


class CrowdOutlines(NamedTuple):
    """Outlines for kernels, and the room behind their corners.

    Attributes:
        outlines: As kernels take them.
        corner_count: Corners that they have; behind these is room for others.
        trial_corners: Corners in each room.
        rooms: How many rooms there are.
    """

    outlines: kernels_outlines.Outlines
    corner_count: int
    trial_corners: int
    rooms: int


def crowd_outlines(
    launcher: Launcher,
    tables: FootprintTables,
    order: np.ndarray,
    unit: float,
    *,
    sees_copies: bool,
    skin: np.ndarray,
    lightness: np.ndarray,
    ease: np.ndarray,
    length: np.ndarray,
    offset: np.ndarray,
) -> CrowdOutlines:
    """Outlines in the order in which bodies lie in space; all others that are given have the order of the tables, shape ``[n]``.

    Args:
        launcher: Where to run.
        tables: The outlines.
        order: Numbers of the bodies in the tables, shape ``[n]``.
        unit: Length of a unit [m].
        sees_copies: Whether every body needs room for corners of the others that it sees, and not only those that may turn, for trials
            of how they are turned.
        skin: How far bodies may move before their pairs are listed anew, in units.
        lightness: 1 over their masses, 0 of those that do not move.
        ease: How easily they turn, 0 of those that do not.
        length: Lengths of the axes of lines, in units.
        offset: How outlines are turned from these axes [rad].
    """

    def numbers(values: np.ndarray) -> wp.array:
        return launcher.array(values.astype(np.float32)[order], float)

    def whole(values: np.ndarray) -> wp.array:
        return launcher.array(values.astype(np.int32), wp.int32)

    corners = np.diff(tables.start)[tables.shape][order]
    first = np.concatenate([[0], np.cumsum(corners)])
    outlines = kernels_outlines.Outlines()
    outlines.body = whole(order)
    outlines.first_corner = whole(first)
    outlines.shape = whole(tables.shape[order])
    outlines.factor = numbers(tables.factor / unit)
    outlines.rounding = numbers(tables.rounding / unit)
    outlines.reach = numbers(tables.reach / unit)
    outlines.width = numbers(tables.width / unit)
    outlines.skin, outlines.lightness, outlines.ease = numbers(skin), numbers(lightness), numbers(ease)
    outlines.length, outlines.offset = numbers(length), numbers(offset)
    outlines.slope = launcher.zeros(len(order), wp.vec2)
    outlines.shape_start = whole(tables.start)
    outlines.shape_corner = wp.array(tables.corners.astype(np.float32), dtype=wp.vec4, device=launcher.device)
    corner_count = int(first[-1])
    seen = corners if sees_copies else corners[(ease > 0.0)[order]]
    trial_corners = int(seen.max(initial=0))
    rooms = max(len(order), ROOMS_ON_GPU if launcher.device.is_cuda else 0)
    outlines.corner = launcher.empty(corner_count + rooms * trial_corners, wp.vec4)
    return CrowdOutlines(outlines, corner_count, trial_corners, rooms)
