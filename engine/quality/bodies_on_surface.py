"""Bodies of a placement on a surface, brought to a device once for all that is measured of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..problem.placement import Placement
from ..problem.surface import PointsOnSurface, Surface
from . import kernels_sheets

__all__ = ["BodiesOnSurface", "bodies_at", "bodies_on_surface"]


@dataclass(frozen=True, eq=False)
class BodiesOnSurface:
    """Where bodies are, on a device.

    Attributes:
        points: The same on the host.
        position: [m], ``wp.vec3d``, shape ``[n]``.
        normal: Where the triangles look to that they are on, ``wp.vec3d``.
        tangent: Their x axes along these, ``wp.vec3d``.
        triangle: These triangles, ``wp.int32``.
        barycentric: Weights of the corners of these, ``wp.vec3d``.
    """

    points: PointsOnSurface
    position: wp.array
    normal: wp.array
    tangent: wp.array
    triangle: wp.array
    barycentric: wp.array

    def in_units(self, launcher: Launcher, unit: float) -> wp.array:
        """Positions in a unit, from the surface's middle, ``wp.vec3``."""
        surface, n = self.points.surface, len(self.position)
        result = launcher.empty(n, wp.vec3)
        middle = wp.vec3d(*(0.5 * (surface.low + surface.high)).tolist())
        launcher.launch(kernels_sheets.take_units, n, [self.position, middle, unit], [result])
        return result


def bodies_on_surface(
    placement: Placement, launcher: Launcher, own: np.ndarray | slice = slice(None)
) -> BodiesOnSurface:
    """Bring the bodies of a placement, or some of them, to a device."""
    surface = placement.problem.domain
    assert isinstance(surface, Surface)
    assert placement.mesh is not None and placement.triangle is not None and placement.barycentric is not None
    assert placement.normal is not None and placement.tangent is not None
    points = surface.locate(placement.mesh[own], placement.triangle[own], placement.barycentric[own])
    return bodies_at(points, placement.position[own], placement.normal[own], placement.tangent[own], launcher)


def bodies_at(
    points: PointsOnSurface, position: np.ndarray, normal: np.ndarray, tangent: np.ndarray, launcher: Launcher
) -> BodiesOnSurface:
    """Bring bodies to a device.

    Args:
        points: Where they are.
        position: The same [m], shape ``[n, 3]``.
        normal: Where their triangles look to, shape ``[n, 3]``.
        tangent: Their x axes along these, shape ``[n, 3]``.
        launcher: Where to.
    """

    def vectors(values: np.ndarray) -> wp.array:
        return launcher.array(np.asarray(values, np.float64), wp.vec3d)

    return BodiesOnSurface(
        points,
        vectors(position),
        vectors(normal),
        vectors(tangent),
        launcher.array(points.triangle.astype(np.int32), wp.int32),
        vectors(points.barycentric),
    )
