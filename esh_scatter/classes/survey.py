"""What was worked out of meshes and images, to be used again for as long as they say the same; asks nothing of Blender."""

from __future__ import annotations

from collections.abc import Callable, Hashable

import numpy as np

from ...engine.errors import ProblemError
from ...engine.problem.domain import Domain
from ...engine.problem.obstacles import Obstacle
from ...engine.problem.scatter_settings import BorderSettings, TargetSettings
from ...engine.problem.surface import Surface
from ...engine.surface.chart import RESOLUTION, Chart
from ...engine.surface.mesh_hull import hull_corners
from ...engine.surface.mesh_outline import Outline
from ...engine.surface.surface_points import SurfacePoints
from ...engine.surface.triangle_mesh import TriangleMesh
from ...engine.surface.whole_surface import WholeSurface
from ..densities.density_source import DensityReader, checksum
from ..targets.targets import chart_of
from .directions import DirectionSource
from .object_outline import outline_of

__all__ = ["Survey"]

# A target whose extent differs by no more than this share has the same: it was moved, and numbers were rounded.
SAME_EXTENT = 1e-5


class Survey:
    """Charts, outlines, densities and directions by what they were made of; the last ones that were asked for are kept.

    One thread at a time may use it.

    Args:
        resolution: Cells along the longer side of charts.
    """

    def __init__(self, resolution: int = RESOLUTION) -> None:
        self.resolution = resolution
        self._chart: tuple[Hashable, Chart | WholeSurface] | None = None
        self._domain: Domain | None = None
        self._drawn_obstacle: Obstacle | None = None
        self._outlines: dict[Hashable, Outline] = {}
        self._hulls: dict[Hashable, np.ndarray] = {}
        self._values: dict[Hashable, np.ndarray] = {}
        self._used: set[Hashable] = set()

    def begin(self, mesh: TriangleMesh, settings: TargetSettings) -> Chart | WholeSurface:
        """Return the part of a target that the settings choose; what nobody has asked for since the last call is let go of."""
        self._outlines = {key: value for key, value in self._outlines.items() if key in self._used}
        self._hulls = {key: value for key, value in self._hulls.items() if key in self._used}
        self._values = {key: value for key, value in self._values.items() if key in self._used}
        self._used.clear()
        content = (mesh.position, mesh.triangle, mesh.corner, mesh.corner_normal, mesh.normal_matrix)
        bounds = np.zeros((0, 3)) if mesh.bounds is None else mesh.bounds
        shape = settings.surface, settings.both_sides, checksum(*content, bounds)
        if self._chart is not None and self._chart[0] == shape:
            chart = self._chart[1].with_mesh(mesh)
        else:
            # Two of a large target are not to be there at once.
            self._chart = None
            self._values.clear()
            chart = chart_of(mesh, settings, self.resolution)
        self._chart = shape, chart
        return chart

    @property
    def shape(self) -> Hashable:
        """What the target's mesh is, in short."""
        return None if self._chart is None else self._chart[0]

    def forget_domain(self) -> None:
        """Let the next :meth:`domain` be as large as its chart, however little larger it is than the last one."""
        self._domain = None

    def domain(self, chart: Chart | WholeSurface, settings: BorderSettings) -> Domain | Surface:
        """Return where bodies lie: the rectangle of a chart, that of the one before where they differ by rounding only."""
        if isinstance(chart, WholeSurface):
            return chart.surface
        size = float(chart.size[0]), float(chart.size[1])
        before = self._domain
        if before is not None and np.allclose(size, before.size, rtol=SAME_EXTENT, atol=0.0):
            size = before.size
        self._domain = Domain(size, settings.boundary)
        return self._domain

    def outline(self, mesh: TriangleMesh, key: str) -> Outline:
        """Return the outline of an object to place."""
        content = checksum(mesh.position, mesh.triangle)
        self._used.add(content)
        if content not in self._outlines:
            self._outlines[content] = outline_of(mesh, key)
        return self._outlines[content]

    def hull(self, mesh: TriangleMesh) -> np.ndarray:
        """Return corners of the convex hull of an object to place, from its origin [m], shape ``[k, 3]``."""
        content = checksum(mesh.position, mesh.triangle)
        self._used.add(content)
        if content not in self._hulls:
            self._hulls[content] = hull_corners(mesh)
        return self._hulls[content]

    def drawn_obstacle(self, image: np.ndarray) -> Obstacle:
        """Return an obstacle of an image, bool: the one of before, of which more is known, if that was the same."""
        before = self._drawn_obstacle
        if before is None or before.image is None or not np.array_equal(before.image, image):
            self._drawn_obstacle = before = Obstacle(image=image)
        return before

    def density(self, name: str, reader: DensityReader, chart: Chart | WholeSurface) -> np.ndarray:
        """Return the density of a class over the cells of a chart, shape ``chart.shape``, or at a surface's points, ``[n]``, float32.

        Args:
            name: Of the class.
            reader: Knows what the classes follow, and the chart's points.
            chart: Of the last :meth:`begin`.
        """
        return self._kept(reader.content(name), lambda: _continued(chart, reader.class_density(name)))

    def directions(self, source: DirectionSource, chart: Chart | WholeSurface, key: str) -> np.ndarray:
        """Return where long bodies lie along at a chart's points, along the surface, shape ``[n, 3]``; lengths up to 1 weigh.

        Raises:
            ProblemError: What is asked for is missing, or it points nowhere.
        """
        points = chart.points
        content = source.content(points)
        return self._kept(content and ("direction", content), lambda: _along_surface(source, points, key))

    def _kept(self, content: Hashable | None, work: Callable[[], np.ndarray]) -> np.ndarray:
        """Return what was worked out of the same content, or work it out; what has none is worked out every time."""
        if content is None:
            return work()
        self._used.add(content)
        if content not in self._values:
            self._values[content] = work()
        return self._values[content]


def _along_surface(source: DirectionSource, points: SurfacePoints, key: str) -> np.ndarray:
    vector = source.vectors(points, key).astype(np.float64)
    if not np.isfinite(vector).all():
        raise ProblemError(f"{key} must be finite everywhere; it holds NaN or infinity on {points.target_name}")
    normal = points.normal
    vector -= (vector * normal).sum(axis=1, keepdims=True) * normal
    if not vector.any():
        raise ProblemError(f"{key} must point along {points.target_name} somewhere; it points nowhere")
    return vector / np.maximum(np.linalg.norm(vector, axis=1, keepdims=True), 1.0)


def _continued(chart: Chart | WholeSurface, values: np.ndarray) -> np.ndarray:
    return values if isinstance(chart, WholeSurface) else chart.continued(values)
