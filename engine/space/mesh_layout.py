"""How a mesh lies over the domain, and what its transforms need to know of it.

Equations are those of Hockney and Eastwood 1988, Computer Simulation Using Particles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import warp as wp

from ..transforms.convolution import good_length
from ..transforms.convolution_gpu import LONGEST_ROW
from . import kernels_mesh
from .space import Space

__all__ = ["MeshLayout", "open_mesh", "periodic_mesh"]

LARGEST_MESH = 65536
# From so many times half the longest rows of a GPU on, those are worth their time, four times that of the half: 10,000,000 bodies, 1.2
# times, take 1.4 s without them and 2.7 s with them, 100,000,000, 3.7 times, 32 s and 19 s. On meshes that are too coarse by half,
# coverage errors of 100,000 bodies were twice as large.
WORTH_LONGEST = 1.3
# Open meshes have nodes beyond the domain, so that the splines of bodies on its edge find theirs.
OPEN_MARGIN = 2
# Nodes between the farthest pair and the wrap of an open mesh: the kernel has a kink there, and the optimal influence
# function spreads it over a few nodes.
WRAP_GUARD = 6
# Windows of so many lengths are kept: a field asks for the same ones ten times.
WINDOWS_KEPT = 8


@dataclass(frozen=True)
class MeshLayout:
    """A mesh of nodes over a domain, row 0 at the bottom.

    Attributes:
        space: What it lies over: all of a space, or a rectangle in it, whose origin is its own then.
        shape: Rows, an even number, and columns.
        padded: Rows and columns of the transforms that convolve it.
        spacing: Distance of nodes along x and y.
        margin: Index of the node at the origin.
        origin: Where in the whole space that is.
        whole: The whole space, which images lie over.
    """

    space: Space
    shape: tuple[int, int]
    padded: tuple[int, int]
    spacing: tuple[float, float]
    margin: int
    origin: tuple[float, float]
    whole: Space

    @property
    def node_count(self) -> int:
        """Number of nodes."""
        return self.shape[0] * self.shape[1]

    @property
    def node_area(self) -> float:
        """Area that a node stands for."""
        return self.spacing[0] * self.spacing[1]

    def for_kernels(self) -> kernels_mesh.Mesh:
        """The same as kernels take it."""
        mesh = kernels_mesh.Mesh()
        mesh.count_x, mesh.count_y = self.shape[1], self.shape[0]
        mesh.inverse_spacing = wp.vec2(1.0 / self.spacing[0], 1.0 / self.spacing[1])
        mesh.margin, mesh.origin = self.margin, wp.vec2(*self.origin)
        mesh.space = self.space.for_kernels()
        return mesh

    def in_part(self, origin: tuple[float, float], whole: Space) -> MeshLayout:
        """The same over a rectangle that begins at an origin in a larger space."""
        return replace(self, origin=origin, whole=whole)

    def windows(self) -> tuple[np.ndarray, np.ndarray]:
        """What turns a smooth kernel's transform into the optimal influence function for depositing and interpolating.

        W² / (sum of W² over all aliases)², W = sinc⁴ per axis being the transform of the cubic B-spline (Hockney and
        Eastwood, equation 8-22, where the kernel itself has no aliases): a factor for every wave number along y, shape
        ``[padded rows // 2 + 1]``, and along x. Divided by the number of elements, so that a pair of transforms is normalized.
        """
        return _window(self.padded[0]), _window(self.padded[1])


@lru_cache(maxsize=WINDOWS_KEPT)
def _window(count: int) -> np.ndarray:
    theta = 2.0 * np.pi * np.arange(count // 2 + 1) / count
    aliases = (2416.0 + 2382.0 * np.cos(theta) + 240.0 * np.cos(2.0 * theta) + 2.0 * np.cos(3.0 * theta)) / 5040.0
    window = np.sinc(theta / (2.0 * np.pi)) ** 8 / aliases**2 / count
    window.setflags(write=False)
    return window


def periodic_mesh(space: Space, wanted: float, *, on_gpu: bool) -> MeshLayout:
    """Lay a mesh with nodes at most ``wanted`` apart over a space that wraps."""
    size = space.size
    columns, rows = (_length_for(length / wanted, on_gpu) for length in size)
    shape = (rows, columns)
    return MeshLayout(space, shape, shape, (size[0] / columns, size[1] / rows), 0, (0.0, 0.0), space)


def open_mesh(space: Space, wanted: float, *, on_gpu: bool, kernel_reach: float = math.inf) -> MeshLayout:
    """Lay a mesh with nodes at most ``wanted`` apart over a space that ends, padded for a kernel that reaches so far."""
    size, longer = space.size, max(space.size)
    # Nodes that the transform holds besides those within the domain: margins, one that makes rows even, the wrap's guard and the
    # kernel's reach.
    extra = 2 * OPEN_MARGIN + 2 + WRAP_GUARD
    if kernel_reach >= longer:
        # One spacing for both axes, as small as the padded length of the longer one allows.
        step = longer / (_length_for(2.0 * (longer / wanted + extra), on_gpu) / 2 - extra)
    else:
        extra += 1  # the reach is rounded up to whole nodes
        step = (longer + kernel_reach) / (_length_for((longer + kernel_reach) / wanted + extra, on_gpu) - extra)
    columns, rows = (math.ceil(length / step - 1e-9) + 2 * OPEN_MARGIN + 1 for length in size)
    # Rows are transformed in pairs.
    rows += rows % 2

    def padding(nodes: int) -> int:
        return min(nodes, math.ceil(kernel_reach / step)) if kernel_reach < math.inf else nodes

    padded = tuple(
        _length_for(n + padding(n) + (2 if padding(n) == n else 1) * WRAP_GUARD, on_gpu) for n in (rows, columns)
    )
    padding_y, padding_x = padded
    return MeshLayout(space, (rows, columns), (padding_y, padding_x), (step, step), OPEN_MARGIN, (0.0, 0.0), space)


def _length_for(least: float, on_gpu: bool) -> int:
    if not on_gpu:
        return min(good_length(least), LARGEST_MESH)
    if LONGEST_ROW // 2 < least < WORTH_LONGEST * (LONGEST_ROW // 2):
        return LONGEST_ROW // 2
    return min(good_length(least, power_of_two=True), LONGEST_ROW)
