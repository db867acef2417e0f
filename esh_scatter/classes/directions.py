"""Where long objects lie along that is known only where the target's surface is: vectors of its mesh, and curves."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Hashable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import bpy
import numpy as np

from ...engine.errors import ProblemError
from ...engine.problem.settings import Settings, described, setting
from ...engine.problem.surface_directions import along_segments
from ...engine.problem.validation import check_name
from ..densities.density_source import Known, checksum
from ..densities.scene_densities import Source
from ..densities.shapes import Shapes, check_finite, check_shapes, read_shapes, shape_objects
from ..targets.evaluated_mesh import vertices_in_world
from ..targets.target import world_matrix

if TYPE_CHECKING:
    from ...engine.surface.surface_points import SurfacePoints

__all__ = ["AttributeDirection", "CurveDirection", "DirectionSource"]


class DirectionSource(Settings, ABC):
    """Base of what directions on a target can be read from."""

    def read(self, _key: str, _known: Known) -> DirectionSource:
        """Return the same direction, which no longer needs Blender; see :meth:`.DensitySource.read`."""
        return self

    @abstractmethod
    def vectors(self, points: SurfacePoints, key: str) -> np.ndarray:
        """Return where it points at points of the target in the world, shape ``[n, 3]``; lengths up to 1 weigh. In any thread.

        Raises:
            ProblemError: What is asked for is missing; the sentence calls the direction ``key``.
        """

    @abstractmethod
    def content(self, points: SurfacePoints) -> Hashable | None:
        """Return what it says at these points, in short; None where that cannot be told."""

    def vector_names(self) -> set[str]:
        """Return the attributes of the target that are read."""
        return set()

    def _key(self, name: str) -> str:
        return f"`{name}` of {'an' if type(self).__name__[0] == 'A' else 'a'} {type(self).__name__}"


@described
@dataclass(frozen=True)
class AttributeDirection(DirectionSource):
    """Vectors that are an attribute of the target's mesh, on points, faces or face corners, in the object's own axes."""

    name: str = field(
        metadata=setting(
            "Name of the attribute", more="It holds vectors, whose length up to 1 weighs", check=check_name
        )
    )

    def vectors(self, points: SurfacePoints, key: str) -> np.ndarray:
        """Return the vectors."""
        return points.vectors(self.name, key)

    def content(self, points: SurfacePoints) -> Hashable | None:
        """Return them, in short."""
        found = points.view.mesh.vector
        if self.name not in found:
            return None
        domain, values = found[self.name]
        return "attribute", self.name, domain, checksum(values)

    def vector_names(self) -> set[str]:
        """Return its name."""
        return {self.name}


@described
@dataclass(frozen=True)
class CurveDirection(DirectionSource):
    """Along the nearest curve, measured in space: logs beside a path, leaves along a vine.

    Of a curve with a bevel its middle counts. Meshes count by those of their edges that have no faces.
    """

    source: Source = field(
        metadata=setting("The curve", more="An object, a collection, or a list of them", check=check_shapes)
    )

    def read(self, key: str, known: Known) -> DirectionSource:
        """Return the curves' straight pieces in the world."""
        pieces = []
        for item in shape_objects(self.source, key):
            if _is_thick(item):
                pieces.append(_middle_of(item))
                check_finite(pieces[-1], item, key)
            else:
                pieces.append(_segments(read_shapes(item, key, known)))
        segment = np.concatenate(pieces)
        if not len(segment):
            raise ProblemError(f"{key} must lie along a curve, or along edges that have no faces; there are none")
        return _Pieces(segment)

    def vectors(self, _points: SurfacePoints, _key: str) -> np.ndarray:
        """Cannot be told before it is read."""
        raise AssertionError("the curve is read first, on the main thread")

    def content(self, _points: SurfacePoints) -> Hashable | None:
        """Cannot be told before it is read."""
        return None


@dataclass(frozen=True, eq=False)
class _Pieces(DirectionSource):
    """Straight pieces, the nearest of which tells where to point; ``segment`` has their ends [m], shape ``[s, 2, 3]``, float64."""

    segment: np.ndarray

    def vectors(self, points: SurfacePoints, _key: str) -> np.ndarray:
        return along_segments(self.segment, points.position)

    def content(self, _points: SurfacePoints) -> Hashable | None:
        return "pieces", checksum(self.segment)


def _segments(shapes: Shapes) -> np.ndarray:
    """Return the ends of edges without faces that have a length, shape ``[s, 2, 3]``, float64."""
    corner = shapes.solid.astype(np.float64)
    # The second corner of an edge is there twice.
    is_edge = (corner[:, 1] == corner[:, 2]).all(axis=1)
    return _with_length(corner[is_edge][:, :2])


def _with_length(segment: np.ndarray) -> np.ndarray:
    return segment[(segment[:, 0] != segment[:, 1]).any(axis=1)]


def _is_thick(item: bpy.types.Object) -> bool:
    """Tell whether a curve is shown as a tube or a band, of which Blender tells the faces only."""
    curve = item.data
    return item.type == "CURVE" and bool(curve.bevel_depth or curve.extrude or curve.bevel_object)


def _middle_of(item: bpy.types.Object) -> np.ndarray:
    """Return the pieces of a thick curve's middle in the world, without its modifiers, shape ``[s, 2, 3]``, float64."""
    curve = item.data.copy()
    curve.bevel_depth = curve.extrude = curve.offset = 0.0
    curve.bevel_object = curve.taper_object = None
    bare = bpy.data.objects.new(curve.name, curve)
    try:
        mesh = bare.to_mesh()
        position = vertices_in_world(mesh, world_matrix(item, bpy.context))
        edge = np.empty((len(mesh.edges), 2), np.int32)
        mesh.edges.foreach_get("vertices", edge.ravel())
        return _with_length(position[edge].astype(np.float64))
    finally:
        bare.to_mesh_clear()
        bpy.data.objects.remove(bare)
        bpy.data.curves.remove(curve)
