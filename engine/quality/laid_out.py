"""Outlines as they lie in a placement, on a device: what is measured of them starts from here."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..problem.body_footprints import CAPSULE, BodyFootprints
from ..problem.of_bodies import is_same, of_all, one_by_one
from . import kernels_overlaps

__all__ = ["BentLines", "bent_lines", "laid_out"]


class BentLines(NamedTuple):
    """Lines that are bent: their bodies ``[m]``, where the points of each begin ``[m + 1]``, and the way to these ``[points, 2]``."""

    body: np.ndarray
    start: np.ndarray
    point: np.ndarray


def bent_lines(footprints: BodyFootprints, position: np.ndarray, bends: np.ndarray | None) -> BentLines:
    """Return the lines that are bent, from the points along them that a placement has; see there."""
    if bends is None:
        return BentLines(np.zeros(0, np.int32), np.zeros(1, np.int32), np.zeros((0, 2)))
    there = np.isfinite(bends).all(axis=2)
    count = np.where(footprints.shape == CAPSULE, there.sum(axis=1), 0)
    body = np.flatnonzero(count >= 2)
    start = np.concatenate([[0], np.cumsum(count[body])])
    point = (bends[body] - position[body, None])[there[body]]
    return BentLines(body.astype(np.int32), start.astype(np.int32), point)


def laid_out(
    footprints: BodyFootprints,
    position: wp.array,
    angle: np.ndarray,
    length: np.ndarray,
    width: np.ndarray,
    smaller: np.ndarray,
    slope: np.ndarray | None,
    bent: BentLines,
    launcher: Launcher,
    spare_corners: int = 0,
) -> kernels_overlaps.Shapes:
    """What lies where, but for what is fixed; without slopes all lies in horizontal planes; corners have some room behind them."""
    n = len(position)

    def numbers(values: np.ndarray) -> wp.array:
        # Dots have neither angle nor length; what is 0 of all is there once.
        return launcher.alike(values if is_same(values) or values.any() else of_all(0.0, len(values)), wp.float64)

    outlines = footprints.shapes
    cores = [*(outline.corners for outline in outlines), np.array([[-1.0, 0.0], [1.0, 0.0]])]
    start = np.concatenate([[0], np.cumsum([len(core) for core in cores])]).astype(np.int32)
    shape = one_by_one(
        lambda number: np.where(number == CAPSULE, len(outlines), number).astype(np.int32), footprints.shape
    )
    if is_same(shape) and shape[0] < len(outlines):
        # No lines; and who is round is turned as well as not.
        length = width = of_all(0.0, n)
        if len(cores[shape[0]]) == 1:
            angle = length
    given = kernels_overlaps.Given()
    given.shape = launcher.alike(shape, wp.int32)
    given.factor, given.angle, given.length = numbers(footprints.factor), numbers(angle), numbers(length)
    given.width, given.smaller = numbers(width), numbers(smaller)
    given.start = launcher.array(start, wp.int32)
    given.corner = launcher.array(np.concatenate(cores), wp.vec2d)
    middles = np.array([*(outline.middle for outline in outlines), np.zeros(2)])
    given.middle = launcher.array(middles, wp.vec2d)
    given.shape_rounding = numbers(np.array([*(outline.rounding for outline in outlines), 0.0]))
    given.shape_reach = numbers(np.array([*(outline.circumradius for outline in outlines), 0.0]))
    given.shape_width = numbers(np.array([*(outline.width - 2.0 * outline.rounding for outline in outlines), 0.0]))
    given.capsule = len(outlines)
    given.slope = launcher.array(np.zeros((0, 2)) if slope is None else slope, wp.vec2d)
    pieces = of_all(np.int32(0), n)
    if is_same(shape) and not len(bent.body):
        first = np.diff(start)[shape[0]] * np.arange(n + 1, dtype=np.int32)
    else:
        pieces = np.zeros(n, np.int32)
        pieces[bent.body] = np.diff(bent.start) - 1
        first = np.zeros(n + 1, np.int32)
        np.cumsum(np.where(pieces > 0, 2 * pieces, np.diff(start)[shape]), out=first[1:])
    shapes = kernels_overlaps.Shapes()
    shapes.position = position
    shapes.first_corner = launcher.array(first, wp.int32)
    shapes.corner = launcher.empty(int(first[-1]) + spare_corners, wp.vec4d)
    shapes.rounding, shapes.reach, shapes.width = (launcher.empty(n, wp.float64) for _ in range(3))
    shapes.pieces = launcher.alike(pieces, wp.int32)
    launcher.launch(kernels_overlaps.lay_out, n, [given], [shapes])
    if len(bent.body):
        lines = [launcher.array(values, wp.int32) for values in (bent.body, bent.start)]
        points = launcher.array(bent.point, wp.vec2d)
        launcher.launch(kernels_overlaps.lay_out_bent, len(bent.body), [*lines, points, given.smaller], [shapes])
    return shapes
