"""What is scattered on: one object, several, or a collection, read as one mesh, less the faces that are left out."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from typing import ClassVar

import bpy
import numpy as np

from ...engine.errors import ProblemError
from ...engine.problem.given_values import show
from ...engine.problem.scatter_settings import TargetSettings
from ...engine.surface.chart import RESOLUTION, Chart
from ...engine.surface.joined_mesh import joined, part_of_mesh, two_sided
from ...engine.surface.surface_points import SurfacePoints
from ...engine.surface.triangle_mesh import TriangleMesh
from ...engine.surface.whole_surface import WholeSurface
from .references import Reference
from .target import (
    CORNERS,
    TARGET,
    WEIGHTS,
    check_exists,
    check_target,
    is_mirrored,
    is_result,
    is_shown_in,
    read_target,
)
from .top import lacks_faces

__all__ = ["Target", "Targets", "chart_of", "check_targets", "read_targets", "stuck_attributes"]

Target = bpy.types.Object | bpy.types.Collection | Sequence[bpy.types.Object]

# A target is one that is seen from above if its upper side has this share of its area: what a raster of it leaves of a hilly terrain.
UPPER_SIDE = 0.98
# Above this weight or value a face is chosen; what rounding adds does not count.
CHOSEN, ROUNDED = 0.5, 1e-6


class Targets:
    """The objects that are scattered on, found anew whenever they are asked for.

    Args:
        target: An object, several, or a collection, whose meshes count.
        context: Whose view layer.

    Raises:
        ProblemError: Something else, no mesh, or one that cannot be scattered on.
    """

    def __init__(self, target: object, context: bpy.types.Context) -> None:
        objects, whole = check_targets(target, context)
        self._references = [Reference(item, "target") for item in objects]
        self._whole = None if whole is None else Reference(whole, "target")

    @property
    def objects(self) -> list[bpy.types.Object]:
        """All of them; raises ProblemError once one is no longer in the file."""
        return [reference.get() for reference in self._references]

    @property
    def owner(self) -> bpy.types.Object | bpy.types.Collection:
        """What a result remembers that it stands on: the collection, or the first of the objects."""
        return self._references[0].get() if self._whole is None else self._whole.get()


def check_targets(
    target: object, context: bpy.types.Context
) -> tuple[list[bpy.types.Object], bpy.types.Collection | None]:
    """Return the mesh objects that a target stands for, and the collection that holds them if it is one.

    Of a collection, what is no mesh, what is hidden, meshes without faces beside others and results of scatters are passed over.
    """
    if isinstance(target, bpy.types.Collection):
        check_exists(target, "`target`")
        for item in target.all_objects:
            _check_no_instancer(item)
        members = [item for item in target.all_objects if item.type == "MESH" and not is_result(item)]
        layer = context.view_layer
        if layer is not None:
            layer.update()
            members = [item for item in members if is_shown_in(layer, item)]
        if not members:
            raise ProblemError(
                f'target collection "{target.name}" must hold mesh objects that are visible; it has none'
            )
        # Where none has faces, reading them says so.
        members = [item for item in members if not lacks_faces(item)] or members
        return sorted((check_target(item, context) for item in members), key=lambda item: item.name_full), target
    if isinstance(target, Sequence) and not isinstance(target, str):
        if not target:
            raise ProblemError("`target` must be a mesh object, several or a collection; got an empty list")
        objects = []
        for item in target:
            if isinstance(item, bpy.types.Object):
                check_exists(item, "`target`")
                _check_no_instancer(item)
            objects.append(check_target(item, context))
        twice = next((item for number, item in enumerate(objects) if item in objects[:number]), None)
        if twice is not None:
            raise ProblemError(f'`target` must not hold an object twice; it holds "{twice.name}" twice')
        return objects, None
    if not isinstance(target, bpy.types.Object):
        raise ProblemError(f"`target` must be a mesh object, several or a collection; got {show(target)}")
    check_exists(target, "`target`")
    _check_no_instancer(target)
    return [check_target(target, context)], None


def read_targets(
    objects: Sequence[bpy.types.Object],
    context: bpy.types.Context,
    names: set[str],
    settings: TargetSettings,
    vectors: Collection[str] = (),
) -> TriangleMesh:
    """Read targets as one mesh, of which only the faces count that the settings choose.

    Args:
        objects: Mesh objects that have been checked.
        context: Whose view layer.
        names: Vertex groups and attributes that densities need.
        settings: Which faces.
        vectors: Attributes that directions need.

    Raises:
        ProblemError: A mesh that cannot be read, or no face is left.
    """
    wanted = names | ({settings.face_group, settings.face_attribute} - {""})
    read = [_outward(read_target(item, context, wanted, vectors), item, context) for item in objects]
    mesh = joined(read, _name_of(objects))
    if settings.face_material:
        mesh = _of_material(mesh, settings.face_material)
    if settings.face_group:
        mesh = _chosen(mesh, settings.face_group, "face_group", SurfacePoints.vertex_group)
    if settings.face_attribute:
        mesh = _chosen(mesh, settings.face_attribute, "face_attribute", SurfacePoints.attribute)
    return two_sided(mesh) if settings.both_sides else mesh


def chart_of(mesh: TriangleMesh, settings: TargetSettings, resolution: int = RESOLUTION) -> Chart | WholeSurface:
    """Return the part of a target that is scattered on, as the settings choose it; with so many cells along a chart's longer side.

    Raises:
        ProblemError: There is nothing of it.
    """
    if settings.surface == "whole" or settings.both_sides:
        return WholeSurface(mesh)
    if settings.surface == "above":
        return Chart(mesh, resolution)
    try:
        chart = Chart(mesh, resolution)
    except ProblemError:  # nothing is seen from above
        return WholeSurface(mesh)
    return chart if chart.area.sum() > UPPER_SIDE * mesh.areas().sum() else WholeSurface(mesh)


def stuck_attributes(points: SurfacePoints) -> dict[str, tuple[str, np.ndarray]]:
    """Return the attributes that tell where on the targets' meshes points are, so that they can follow a mesh that bends.

    ``esh_face`` is the face of the evaluated mesh, ``esh_vertex_0`` and so on are the corners of the triangle within it, and
    ``esh_barycentric`` their weights: the sum of these vertices' positions times their weights is the point. Where there are several
    targets, ``esh_target`` says which of them it is, in the order of their names.
    """
    mesh = points.view.mesh
    face = mesh.face[points.triangle]
    target = np.searchsorted(mesh.first_face, face, side="right") - 1
    vertex = mesh.triangle[points.triangle] - mesh.first_vertex[target][:, None]
    found = {
        "esh_face": ("INT", face - mesh.first_face[target]),
        WEIGHTS: ("FLOAT_VECTOR", points.weight),
        **{name: ("INT", vertex[:, k]) for k, name in enumerate(CORNERS)},
    }
    if len(mesh.first_face) > 1:
        found[TARGET] = ("INT", target)
    return found


class _Faces:
    """A mesh's faces, wherever they look; what densities ask of a view."""

    from_above: ClassVar[bool] = False

    def __init__(self, mesh: TriangleMesh) -> None:
        self.mesh = mesh
        self.low = self.high = np.zeros(3)

    def normals(self, triangle: np.ndarray, _weight: np.ndarray) -> np.ndarray:
        return np.zeros((len(triangle), 3), np.float32)


def _chosen(
    mesh: TriangleMesh, name: str, key: str, read: Callable[[SurfacePoints, str, str], np.ndarray]
) -> TriangleMesh:
    """Return the faces of a mesh whose mean of some values is high enough."""
    count = len(mesh.triangle)
    middle = SurfacePoints(_Faces(mesh), np.arange(count), np.full((count, 3), 1.0 / 3.0, np.float32), np.empty((0, 3)))
    values = read(middle, name, f"`{key}`")
    mean = np.bincount(mesh.face, values) / np.maximum(np.bincount(mesh.face), 1)
    chosen = part_of_mesh(mesh, (mean > CHOSEN + ROUNDED)[mesh.face])
    if not len(chosen.triangle):
        raise ProblemError(f'`{key}` must leave faces of {mesh.name}; "{name}" is above {CHOSEN:g} on none of them')
    return chosen


def _of_material(mesh: TriangleMesh, name: str) -> TriangleMesh:
    """Return the faces of a mesh that have a material."""
    if name not in mesh.material:
        known = ", ".join(f'"{one}"' for one in mesh.material) or "none"
        raise ProblemError(f'`face_material`: {mesh.name} has no material "{name}"; it has {known}')
    chosen = part_of_mesh(mesh, (mesh.material_of_face == mesh.material.index(name))[mesh.face])
    if not len(chosen.triangle):
        raise ProblemError(f'`face_material` must leave faces of {mesh.name}; none of them has "{name}"')
    return chosen


def _outward(mesh: TriangleMesh, item: bpy.types.Object, context: bpy.types.Context) -> TriangleMesh:
    """Return a mesh whose triangles and normals look to the same side as its faces, also where the object is mirrored."""
    if not is_mirrored(item, context):
        return mesh
    triangle, corner = (np.ascontiguousarray(values[:, [0, 2, 1]]) for values in (mesh.triangle, mesh.corner))
    return replace(mesh, triangle=triangle, corner=corner, normal_matrix=-mesh.normal_matrix)


def _name_of(objects: Sequence[bpy.types.Object]) -> str:
    if len(objects) == 1:
        return f'target "{objects[0].name}"'
    shown = [f'"{item.name}"' for item in objects[:3]] + ["..."] * (len(objects) > 3)
    return f"targets {', '.join(shown)}"


def _check_no_instancer(item: bpy.types.Object) -> None:
    """Raise ProblemError for an object that shows copies of others and no faces of its own."""
    if item.instance_type == "NONE" or (item.type == "MESH" and item.show_instancer_for_viewport):
        return
    shown = f' of collection "{item.instance_collection.name}"' if item.instance_collection else ""
    raise ProblemError(
        f'target "{item.name}" must have faces of its own; it is an instancer, which shows copies{shown}: make them real first '
        "(Object > Apply > Make Instances Real)"
    )
