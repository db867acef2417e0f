"""Points of a target's surface: where they are, and what the mesh says there, interpolated within its faces."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, Protocol

import numpy as np

from ..errors import ProblemError
from ..problem.image_filters import luminance
from . import kernels_chart
from .launching import launch_on_cpu
from .triangle_mesh import TriangleMesh

__all__ = ["SurfacePoints", "View"]


class View(Protocol):
    """A mesh, as it is looked at.

    Attributes:
        mesh: The mesh.
        low: Smallest coordinates of its bounds [m], shape ``[3]``.
        high: Largest ones.
        from_above: Whether only what is seen from above is looked at.
    """

    mesh: TriangleMesh
    low: np.ndarray
    high: np.ndarray
    from_above: ClassVar[bool]

    def normals(self, triangle: np.ndarray, weight: np.ndarray) -> np.ndarray:
        """Return shading normals of the side that is looked at, shape ``[n, 3]``, float32, of length 1."""


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Points of a target's surface, and what its mesh says there.

    Attributes:
        view: The mesh whose surface it is: its upper side, or its outer one.
        triangle: Triangle that each lies on, shape ``[n]``.
        weight: Weights of its corners, shape ``[n, 3]``, float32.
        position: Where it is in the world [m], shape ``[n, 3]``, float64.
    """

    view: View
    triangle: np.ndarray
    weight: np.ndarray
    position: np.ndarray
    # Coordinates in UV maps that were asked for: whoever paints asks again after every stroke.
    _uv: dict[str, np.ndarray] = field(default_factory=dict, init=False, repr=False)

    @property
    def target_name(self) -> str:
        """How sentences name the target."""
        return self.view.mesh.name

    @property
    def normal(self) -> np.ndarray:
        """Shading normals, shape ``[n, 3]``, float32, of length 1; those of the upper side never point down."""
        return self.view.normals(self.triangle, self.weight)

    @cached_property
    def rectangle_coordinates(self) -> np.ndarray:
        """Where the points lie in the bounding rectangle, 0..1, y up, shape ``[n, 2]``; not to be changed."""
        extent = self.view.high[:2] - self.view.low[:2]
        # A wall has none in one of them.
        coordinates = (self.position[:, :2] - self.view.low[:2]) / np.maximum(extent, 1e-300)
        coordinates.setflags(write=False)
        return coordinates

    def seen_on(self, view: View) -> SurfacePoints:
        """Return the same points of a mesh of the same shape; what it says there may be another."""
        points = SurfacePoints(view, self.triangle, self.weight, self.position)
        if "rectangle_coordinates" in self.__dict__:
            points.__dict__["rectangle_coordinates"] = self.rectangle_coordinates
        now, before = view.mesh.uv_map, self.view.mesh.uv_map
        points._uv.update(
            (name, uv) for name, uv in self._uv.items() if np.array_equal(now.get(name, ()), before[name])
        )
        return points

    def rectangle_size(self) -> np.ndarray:
        """Return the extent of the bounding rectangle in x and y [m], shape ``[2]``."""
        return self.view.high[:2] - self.view.low[:2]

    def uv(self, name: str, key: str) -> np.ndarray:
        """Return coordinates in a UV map (the active one if ``name`` is empty), shape ``[n, 2]``; not to be changed."""
        mesh = self.view.mesh
        chosen = name or mesh.active_uv_map
        if not mesh.uv_map:
            raise ProblemError(f"{key} needs a UV map, and {mesh.name} has none; unwrap it, or map by position")
        if chosen not in mesh.uv_map:
            raise ProblemError(f'{key}: {mesh.name} has no UV map "{chosen}"; it has {_names(mesh.uv_map)}')
        if chosen not in self._uv:
            self._uv[chosen] = self._blend(mesh.uv_map[chosen], mesh.corner)
            self._uv[chosen].setflags(write=False)
        return self._uv[chosen]

    def vertex_group(self, name: str, key: str) -> np.ndarray:
        """Return the weights of a vertex group, shape ``[n]``."""
        mesh = self.view.mesh
        if name not in mesh.vertex_group:
            raise ProblemError(f'{key}: {mesh.name} has no vertex group "{name}"; it has {_names(mesh.vertex_group)}')
        return self._blend(mesh.vertex_group[name], mesh.triangle)

    def attribute(self, name: str, key: str) -> np.ndarray:
        """Return the values of an attribute, colors by their luminance, shape ``[n]``."""
        mesh = self.view.mesh
        if name in mesh.unusable_attribute:
            raise ProblemError(f'{key}: attribute "{name}" of {mesh.name} {mesh.unusable_attribute[name]}')
        if name not in mesh.attribute:
            raise ProblemError(f'{key}: {mesh.name} has no attribute "{name}"; it has {_names(mesh.attribute)}')
        domain, values = mesh.attribute[name]
        return self._stored(domain, luminance(values) if values.ndim == 2 else values)

    def vectors(self, name: str, key: str) -> np.ndarray:
        """Return the vectors of an attribute in the world, shape ``[n, 3]``."""
        mesh = self.view.mesh
        if name not in mesh.vector:
            raise ProblemError(
                f'{key}: {mesh.name} has no attribute "{name}" of vectors on points, faces or face corners; it has '
                f"{_names(mesh.vector)}"
            )
        return self._stored(*mesh.vector[name])

    def _stored(self, domain: str, values: np.ndarray) -> np.ndarray:
        """Return values of the mesh's points, faces or face corners, shape ``[n]`` or ``[n, k]`` as they are."""
        mesh = self.view.mesh
        if domain == "FACE":
            return values[mesh.face[self.triangle]]
        return self._blend(values, mesh.triangle if domain == "POINT" else mesh.corner)

    def _blend(self, values: np.ndarray, corner: np.ndarray) -> np.ndarray:
        """Return values, float32, between those at the corners of triangles, shape ``[n]`` or ``[n, k]`` as they are."""
        rows = np.ascontiguousarray(values, np.float32).reshape(len(values), -1)
        blended = np.empty((len(self.triangle), rows.shape[1]), np.float32)
        numbers = (np.ascontiguousarray(number, np.int32) for number in (corner, self.triangle))
        inputs = [*numbers, np.ascontiguousarray(self.weight, np.float32), rows]
        launch_on_cpu(kernels_chart.blend_values, len(blended), inputs, [blended])
        return blended.reshape(-1, *values.shape[1:])


def _names(mapping: dict) -> str:
    return ", ".join(f'"{name}"' for name in mapping) if mapping else "none"
