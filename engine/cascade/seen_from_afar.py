"""Normals of a surface with creases or roughness, averaged over the spacing of the bodies.

How much two places see of each other depends on the normals at both. On a rock that is rough within the spacing of some bodies, that
would be chance: of 40 bodies on one whose triangles lean by 30° on average, each saw its neighbors by 0.87 ± 0.1.
Measured with 40 on that rock, alone, over six seeds: coverage errors at 0.5, 1 and 2 spacings fall from 0.0450, 0.0129 and 0.0032 to
0.0342, 0.0061 and 0.0014, and the smallest spacing rises from 0.72 to 0.78.

And across a crease normals would change all at once, so that bodies stop at either side of it and stand too close there. Averages
change within a spacing, as if the crease were rounded. Measured with 4,096 bodies, means of two to four seeds, without and with:
smallest spacings on a prism of six sides 0.79 and 0.83, on an octahedron 0.76 and 0.81, on a star of 320 triangles 0.69 and 0.80, on
Blender's Suzanne, each triangle cut in four and smoothed, 0.73 and 0.81; errors at 1 spacing on Suzanne as Blender adds her 0.0059 and
0.0046. Where there are right angles alone, and no class is rare, surfaces are better left as they are: rounded, a cube whose faces are
cut has 0.84 instead of 0.85, a cylinder 0.83 instead of 0.85.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS, Launcher
from ..surface import kernels_facets
from ..surface.facets import Facets
from . import kernels_points
from .points import chosen, empty_points, grid_of, lists_of, nearest_of, same, thinned

__all__ = ["looks_other_from_afar", "seen_from_afar"]

# Standard deviation of the Gaussian that normals are averaged by, over the spacing, and how many times. Measured with 40 bodies on the
# rock: errors at 1 and 2 spacings are .0060 and .0013 with 0.3, .0061 and .0014 with 0.6; of 40 among 4,400 others .0070 and .0013
# with 0.5, .0099 and .0026 with 1.
SMOOTHED = (0.5, 1)
# The same where there are blunt creases. With every time normals on both sides of a crease see more of each other, so that sharp
# creases are rounded, too, while the sides of a thin wall stay apart. Measured with 4,096 bodies, means of two to four seeds, once by
# 0.5, 6 times by 0.3 and 10 times by 0.24: errors at 1 spacing of Suzanne as Blender adds her .0051, .0047 and .0046, of a star .0039,
# .0035 and .0034, whose smallest spacings are .76, .78 and .80; 4 times by 0.36 Suzanne has .0056. Where the surface is only rough,
# once does as well, in less time.
ROUNDED = (0.24, 10)
# Where the Gaussian is cut off, in standard deviations; and the distance of the points that stand for the surface, over the spacing.
REACH = 2.5
STEP = 0.3
# Of more points than this those near each are looked for every time: lists of them would take more than 150 MB.
MOST_LISTED = 500_000
# A surface is rough if its normals turn by more than this in a unit [rad], as a root mean square over its area. Measured with 4,096
# bodies, from near and from afar: Suzanne, 0.40, has smallest spacings of 0.766 and 0.772 (16 seeds), a rock, 0.34, of 0.836 and
# 0.844. Spheres and tori, 0.06 and 0.16, look the same from afar, which takes time.
ROUGH = 0.3
# Turns at tiny triangles are large over tiny distances. They count as no more than this.
MOST_TURN = 9.0
# Corners of facets are the same only if they are within this distance, in units.
SAME_PLACE = 1e-3
# What the result shares with the given surface: everything but the smooth normals.
SHARED = ("mesh", "corner", "normal", "label", "open_sides", "cuts", "first_tile", "first_corner", "relations", "parts")


def looks_other_from_afar(facets: Facets) -> bool:
    """Tell whether a surface has blunt creases or is rough, so that normals are to be averaged."""
    if facets.surface.has_blunt_creases:
        return True
    return float((facets.area * facets.turns(MOST_TURN) ** 2).sum()) > ROUGH**2 * float(facets.area.sum())


def seen_from_afar(
    launcher: Launcher,
    facets: Facets,
    on_device: kernels_facets.Facets,
    length: float,
    before: kernels_facets.Facets | None = None,
) -> kernels_facets.Facets:
    """Return the surface as kernels take it, with normals averaged over a spacing.

    Neither parts of the surface nor the two sides of a sheet are averaged with each other.

    Args:
        launcher: Where to run.
        facets: The surface.
        on_device: The same facets, as kernels take them.
        length: The spacing, in units.
        before: An earlier result for the same surface, unit and spacing, whose normals are used again.
    """
    result = kernels_facets.Facets()
    for name in SHARED:
        setattr(result, name, getattr(on_device, name))
    result.corner_normal = _averages(launcher, facets, on_device, length) if before is None else before.corner_normal
    return result


def _averages(launcher: Launcher, facets: Facets, on_device: kernels_facets.Facets, length: float) -> wp.array:
    """Return averaged normals at the corners of facets, ``wp.vec3``."""
    share, rounds = ROUNDED if facets.surface.has_blunt_creases else SMOOTHED
    width = share * length
    few, area = _standing_for_all(launcher, facets, on_device, STEP * length)
    # Most corners belong to several facets.
    corners, which = _corners(launcher, facets, on_device)
    average_of_corners = _averaging(launcher, corners, few, area, width, rounds)
    average_of_few = _averaging(launcher, few, few, area, width, rounds - 1)
    corners.normal = average_of_corners()
    for _ in range(rounds - 1):
        few.normal = average_of_few()
        corners.normal = average_of_corners()
    everywhere = launcher.empty(len(which), wp.vec3)
    inputs = [which, len(corners.position), 1, corners.normal]
    launcher.launch(kernels_points.spread_vectors, len(which), inputs, [everywhere])
    return everywhere


def _averaging(
    launcher: Launcher,
    points: kernels_points.Points,
    others: kernels_points.Points,
    area: wp.array,
    width: float,
    rounds: int,
) -> Callable[[], wp.array]:
    """Return what averages the normals of ``others`` at points as these are now, which is done so many times.

    Where they are averaged more than once, those near each point are looked for and weighed once.
    """
    reach, count = REACH * width, len(points.position)
    if rounds > 1 and count <= MOST_LISTED:
        lists = lists_of(launcher, points, others, reach)
        near = launcher.empty(len(lists.entry), float)
        inputs = [points, others, lists.start, lists.entry, width]
        launcher.launch(kernels_points.weigh_near, count, inputs, [near], grain=GRAIN_OF_NEIGHBORS)
        kernel, known = kernels_points.average_listed, [lists.start, lists.entry, near]
    else:
        kernel, known = kernels_points.average_normals, [grid_of(launcher, others.position, reach), width, reach]

    def average() -> wp.array:
        result = launcher.empty(count, wp.vec3)
        launcher.launch(kernel, count, [points, others, area, *known], [result], grain=GRAIN_OF_NEIGHBORS)
        return result

    return average


def _corners(
    launcher: Launcher, facets: Facets, on_device: kernels_facets.Facets
) -> tuple[kernels_points.Points, wp.array]:
    """Return the distinct corners of facets, and which of these every corner is."""
    count = len(on_device.corner)
    all_corners = kernels_points.Points()
    all_corners.position, all_corners.normal = on_device.corner, on_device.corner_normal
    all_corners.label = launcher.empty(count, wp.int32)
    launcher.launch(kernels_points.repeat_numbers, count, [on_device.label, 3], [all_corners.label])
    cell = max(SAME_PLACE, facets.extent / (1 << 20))
    own, which = same(launcher, all_corners, -0.5 * (facets.size + cell), cell)
    return chosen(launcher, all_corners, own), which


def _standing_for_all(
    launcher: Launcher, facets: Facets, on_device: kernels_facets.Facets, distance: float
) -> tuple[kernels_points.Points, wp.array]:
    """Return points of the surface that keep a distance, with the mean normal and the area of the tiles nearest to each."""
    tiles = empty_points(launcher, facets.tile_count)
    launcher.launch(
        kernels_facets.locate_tiles,
        facets.tile_count,
        [facets.count, on_device],
        [tiles.position, tiles.normal, tiles.label],
    )
    few = chosen(launcher, tiles, thinned(launcher, tiles, distance))
    nearest = nearest_of(launcher, tiles, few, 2.0 * distance, distance).numpy()
    there, count = nearest >= 0, len(few.position)
    area, normal = facets.tile_area[there], tiles.normal.numpy()[there]
    total = np.stack([np.bincount(nearest[there], area * normal[:, axis], count) for axis in range(3)], axis=1)
    mean = total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-300)
    few.normal = launcher.array(mean.astype(np.float32), wp.vec3)
    return few, launcher.array(np.bincount(nearest[there], area, count).astype(np.float32), wp.float32)
