"""Triangles that are cut until none is long: on a device, all at once.

They are cut in two across their longest side, again and again. Needles, of which one side is far shorter than the others, would become
three needles half as long each time, and so ever more beside each other: they are cut into strips all along at once. What is slender
but no needle, as its shortest side leads along it, is cut at its height first.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..device.running_sum import running_sum
from ..geometry.smooth_normals import bent_sides
from ..problem.surface import Surface
from . import kernels_cut

__all__ = ["bits_of_sides", "empty_pieces", "places_of", "small_pieces", "triangles_of"]

# Pieces that one element looks at for the bounds of all.
BLOCK = 256


def empty_pieces(launcher: Launcher, count: int) -> kernels_cut.Pieces:
    """So many parts of triangles that are still to be written."""
    pieces = kernels_cut.Pieces()
    pieces.corner, pieces.weight = launcher.empty(3 * count, wp.vec3d), launcher.empty(3 * count, wp.vec3d)
    pieces.triangle = launcher.empty(count, wp.int32)
    return pieces


def small_pieces(
    launcher: Launcher, surface: Surface, middle: np.ndarray, unit: float, *, facet: float, tile: float, slender: float
) -> kernels_cut.Pieces:
    """Return parts of the triangles of a surface none of which is long, or slender and longer than a tile.

    Args:
        launcher: Where to run.
        surface: The surface.
        middle: From where they are counted [m], shape ``[3]``.
        unit: Meters per unit.
        facet: Longest side [units].
        tile: The same of one that is slender.
        slender: Its longest side over its height is more.
    """
    count = len(surface.triangle)
    pieces = empty_pieces(launcher, count)
    vertex = launcher.array(surface.position, wp.vec3d)
    corner = launcher.array(surface.triangle.astype(np.int32).ravel(), wp.int32)
    inputs = [vertex, corner, wp.vec3d(*middle.tolist()), unit]
    launcher.launch(kernels_cut.take_triangles, count, inputs, [pieces])
    done: list[kernels_cut.Pieces] = []
    while True:
        count = len(pieces.triangle)
        is_cut, parts = launcher.empty(count, wp.int32), launcher.empty(count, wp.int32)
        launcher.launch(kernels_cut.count_cuts, count, [pieces, facet, tile, slender], [is_cut, parts])
        cuts_before, cut_count = running_sum(launcher, is_cut)
        if not cut_count:
            return _joined(launcher, [*done, pieces])
        start, part_count = running_sum(launcher, parts)
        smaller, kept = empty_pieces(launcher, part_count), empty_pieces(launcher, count - cut_count)
        launcher.launch(kernels_cut.cut, count, [pieces, is_cut, cuts_before, parts, start, tile], [smaller, kept])
        if count > cut_count:
            done.append(kept)
        pieces = smaller


def places_of(launcher: Launcher, pieces: kernels_cut.Pieces, triangles: kernels_cut.Triangles) -> np.ndarray:
    """Return where pieces come along Hilbert curves, one for each of six directions that they look to, shape ``[n]``, int64."""
    count = len(pieces.triangle)
    blocks = -(-count // BLOCK)
    low, high = launcher.empty(blocks, wp.vec3d), launcher.empty(blocks, wp.vec3d)
    launcher.launch(kernels_cut.find_bounds, blocks, [pieces, BLOCK], [low, high], grain=1)
    least = low.numpy().min(axis=0)
    extent = float((high.numpy().max(axis=0) - least).max()) or 1.0
    place = launcher.empty(count, wp.int64)
    inputs = [pieces, triangles, wp.vec3d(*least.tolist()), extent]
    launcher.launch(kernels_cut.find_places, count, inputs, [place])
    return place.numpy()


def triangles_of(launcher: Launcher, surface: Surface, open_side: np.ndarray) -> kernels_cut.Triangles:
    """The triangles of a surface as kernels take them; ``open_side`` is whether it ends at a side, shape ``[t, 3]``."""
    triangles = kernels_cut.Triangles()
    triangles.normal = launcher.array(surface.normal, wp.vec3d)
    triangles.corner_normal = launcher.array(surface.corner_normal.reshape(-1, 3), wp.vec3d)
    triangles.open_sides = launcher.array(bits_of_sides(open_side), wp.int32)
    triangles.edge_sides = launcher.array(bits_of_sides(surface.edge_side), wp.int32)
    triangles.bent_sides = launcher.array(bits_of_sides(bent_sides(surface.normal, surface.sides)), wp.int32)
    return triangles


def bits_of_sides(side: np.ndarray) -> np.ndarray:
    """Masks of sides, shape ``[t, 3]``, as bits of numbers, int32, shape ``[t]``."""
    return (side @ np.array([1, 2, 4])).astype(np.int32)


def _joined(launcher: Launcher, parts: Sequence[kernels_cut.Pieces]) -> kernels_cut.Pieces:
    """Pieces, and others behind them."""
    if len(parts) == 1:
        return parts[0]
    result = empty_pieces(launcher, sum(len(part.triangle) for part in parts))
    begin = 0
    for part in parts:
        wp.copy(result.corner, part.corner, dest_offset=3 * begin)
        wp.copy(result.weight, part.weight, dest_offset=3 * begin)
        wp.copy(result.triangle, part.triangle, dest_offset=begin)
        begin += len(part.triangle)
    return result
