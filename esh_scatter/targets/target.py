"""Reading meshes from Blender: every modifier applied, in world space, as triangles."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from contextlib import nullcontext

import bpy
import numpy as np
from mathutils import Matrix

from ...engine.errors import ProblemError
from ...engine.problem.given_values import show
from ...engine.surface.triangle_mesh import TriangleMesh
from .depsgraph import evaluated_depsgraph
from .evaluated_mesh import in_world, vertex_positions
from .in_scenes import is_in_layer
from .mesh_attributes import read_attribute
from .mesh_triangles import corners_of_triangles
from .vertex_groups import read_vertex_groups

__all__ = [
    "CORNERS",
    "DOMAINS",
    "INSTANCE_INDEX",
    "NUMBERS",
    "RESULT_TAG",
    "RESULT_TARGET",
    "ROTATION",
    "SCALE",
    "TARGET",
    "VECTOR",
    "WEIGHTS",
    "check_exists",
    "check_target",
    "corners_of",
    "extent_of",
    "head_of",
    "is_mirrored",
    "is_result",
    "is_shown_in",
    "members_of",
    "origin_of",
    "put_offset",
    "read_target",
    "read_triangles",
    "shown_collection",
    "shown_members_of",
    "with_shown",
    "world_matrix",
]

# Custom property that marks the object, mesh and node group of a result; names mean nothing.
RESULT_TAG = "esh_scatter"
# And that of the object which says what it stands on.
RESULT_TARGET = "esh_scatter_target"
# And that of a collection which holds an object with all that hangs on it: which object.
FAMILY_OF = "esh_family_of"
# What the points of every result have, as properties alone are copied from anything to anything: which of its objects stands there,
# and how it is turned and scaled.
INSTANCE_INDEX, ROTATION, SCALE = "instance_index", "rotation", "scale"
_RESULT_ATTRIBUTES = {INSTANCE_INDEX: "INT", ROTATION: "QUATERNION", SCALE: "FLOAT_VECTOR"}
# And what ties them to a target: the vertices and weights of the triangle that each stands on, and which of several targets.
CORNERS, WEIGHTS, TARGET = ("esh_vertex_0", "esh_vertex_1", "esh_vertex_2"), "esh_barycentric", "esh_target"

VECTOR = "FLOAT_VECTOR"
NUMBERS = {"FLOAT": 1, "INT": 1, "INT8": 1, "BOOLEAN": 1, "FLOAT_COLOR": 4, "BYTE_COLOR": 4}
_READ_AS = {"BOOLEAN": bool, "INT": np.int32, "INT8": np.int32}
DOMAINS = ("POINT", "FACE", "CORNER")
# Objects that have a geometry to instance; lights, cameras and empties in a collection are passed over. Blender's nodes give
# nothing of metaballs.
_INSTANCED_TYPES = {"MESH", "CURVE", "SURFACE", "FONT", "CURVES", "POINTCLOUD", "VOLUME", "GREASEPENCIL"}


def members_of(source: bpy.types.Object | bpy.types.Collection | None) -> list[bpy.types.Object]:
    """Return the objects that a size instances: the source itself if it has geometry, or the variants in a collection, by name."""
    if source is None:
        return []
    items = source.all_objects if isinstance(source, bpy.types.Collection) else [source]
    return sorted((item for item in items if _can_be_instanced(item)), key=lambda item: item.name_full)


def shown_members_of(collection: bpy.types.Collection) -> list[bpy.types.Object]:
    """Return those of a collection's members that instances of it show in a render, or all where that shows none.

    What else there is beside a model, as meshes that it collides with, is hidden from renders.
    """
    members = members_of(collection)
    return [item for item in members if not item.hide_render] or members


def head_of(item: bpy.types.Object | bpy.types.Collection) -> bpy.types.Object | None:
    """Return the object that a collection holds with all that hangs on it, or None where it is anything else."""
    head = item.get(FAMILY_OF) if isinstance(item, bpy.types.Collection) else None
    return head if isinstance(head, bpy.types.Object) else None


def origin_of(collection: bpy.types.Collection, context: bpy.types.Context) -> np.ndarray:
    """Return what of a collection as one stands on the points, in the world [m], shape ``[3]``: where its offset is, or its head."""
    head = head_of(collection)
    return np.array(collection.instance_offset) if head is None else world_matrix(head, context)[:3, 3]


def put_offset(collection: bpy.types.Collection, context: bpy.types.Context) -> None:
    """Have a collection's offset where its origin is, which moves with the object that the others hang on."""
    if head_of(collection) is not None and collection.is_editable:
        collection.instance_offset = origin_of(collection, context)


def extent_of(item: bpy.types.Object | bpy.types.Collection, context: bpy.types.Context) -> np.ndarray:
    """Return how long, wide and high an object is along its own axes [m], shape ``[3]``; what is shown together, as it stands."""
    if isinstance(item, bpy.types.Object) and shown_collection(item) is None:
        return np.array(item.dimensions)
    corners = corners_of(item, np.eye(4), context)
    return np.ptp(corners, axis=0) if len(corners) else np.zeros(3)


def corners_of(
    item: bpy.types.Object | bpy.types.Collection, matrix: np.ndarray, context: bpy.types.Context
) -> np.ndarray:
    """Return the corners of the boxes around all that an object or a collection shows, moved by a matrix, shape ``[n, 3]``."""
    together: bpy.types.Collection | None
    if isinstance(item, bpy.types.Collection):
        together = item
    else:
        together, matrix = shown_collection(item), matrix @ world_matrix(item, context)
    if together is None:
        return np.array(item.bound_box) @ matrix[:3, :3].T + matrix[:3, 3]
    offset = np.eye(4)
    offset[:3, 3] = -np.array(together.instance_offset)
    parts = [corners_of(one, matrix @ offset, context) for one in shown_members_of(together)]
    return np.concatenate(parts) if parts else np.empty((0, 3))


def _can_be_instanced(item: bpy.types.Object) -> bool:
    """Tell whether an object has something to instance: a geometry, or as an empty the collection that it shows."""
    return any(one.type in _INSTANCED_TYPES for one in with_shown([item]))


def with_shown(items: Iterable[bpy.types.Object]) -> list[bpy.types.Object]:
    """Return objects, and those that empties among them show, each once; empties may show others that show others."""
    found: dict[bpy.types.Object, None] = {}
    waiting = list(items)
    while waiting:
        item = waiting.pop()
        collection = shown_collection(item)
        if item not in found and collection is not None:
            waiting += collection.all_objects
        found[item] = None
    return list(found)


def shown_collection(item: bpy.types.Object) -> bpy.types.Collection | None:
    """Return the collection that an empty shows, or None."""
    return item.instance_collection if item.type == "EMPTY" and item.instance_type == "COLLECTION" else None


def check_exists(item: bpy.types.ID, key: str) -> None:
    """Raise ProblemError if Blender has removed what ``item`` stood for."""
    try:
        item.name  # noqa: B018 - asking is what fails
    except ReferenceError:
        raise ProblemError(f"{key} must be in the file; what was given has been removed from it") from None


def is_result(item: bpy.types.Object) -> bool:
    """Tell whether an object is what a scatter made: marked as such, and nothing but points with the attributes of one."""
    if not item.get(RESULT_TAG) or item.type != "MESH" or RESULT_TARGET not in item:
        return False
    mesh = item.data
    if not mesh.get(RESULT_TAG) or len(mesh.edges) or len(mesh.polygons):
        return False
    found = {attribute.name: (attribute.data_type, attribute.domain) for attribute in mesh.attributes}
    return all(found.get(name) == (kind, "POINT") for name, kind in _RESULT_ATTRIBUTES.items())


def check_target(target: object, context: bpy.types.Context) -> bpy.types.Object:
    """Return ``target``; raise ProblemError unless it is a mesh object of the view layer and no result."""
    if not isinstance(target, bpy.types.Object):
        raise ProblemError(f"`target` must be a mesh object; got {show(target)}")
    check_exists(target, "`target`")
    name = f'target "{target.name}"'
    if target.type != "MESH":
        raise ProblemError(f"{name} must be a mesh object; it is of type {target.type}")
    if is_result(target):
        raise ProblemError(f"{name} is the result of a scatter; choose the mesh that it stands on, or another one")
    layer = context.view_layer
    if layer is not None:
        # What was linked since the last update is in the layer's list only after the next.
        layer.update()
    if layer is None or not is_in_layer(layer, target):
        where = f'"{layer.name}" of scene "{context.scene.name}"' if layer else "of the scene"
        raise ProblemError(f"{name} must be in the view layer {where}; link it to a collection that is not excluded")
    if not is_shown_in(layer, target):
        # Hidden, it is not evaluated: it may stand where it was when it was last seen.
        raise ProblemError(f"{name} must be visible in the viewport; Blender does not evaluate it while it is hidden")
    return target


def is_shown_in(layer: bpy.types.ViewLayer, item: bpy.types.Object) -> bool:
    """Tell whether a view layer shows an object, so that Blender evaluates it; in a local view of others it does so all the same."""
    # Asked within a viewport, Blender answers for that one, which may be in such a view, or show no meshes.
    with bpy.context.temp_override(area=None) if bpy.context.area else nullcontext():
        shown: bool = item.visible_get(view_layer=layer)
    return shown


def read_target(
    target: bpy.types.Object, context: bpy.types.Context, names: set[str], vectors: Collection[str] = ()
) -> TriangleMesh:
    """Read the target with its modifiers, and of its vertex groups and attributes those in ``names`` and ``vectors``.

    Raises:
        ProblemError: It has no faces, positions that are not finite, or it is hidden.
    """
    name = f'target "{target.name}"'
    evaluated = target.evaluated_get(evaluated_depsgraph(context))
    if not evaluated.is_evaluated:
        raise ProblemError(f"{name} must be visible in the viewport; Blender does not evaluate it while it is hidden")
    # While it is sculpted, what is evaluated lags behind.
    shown = target if target.mode == "SCULPT" and not target.modifiers else evaluated
    mesh = shown.to_mesh()
    try:
        if mesh is None or not len(mesh.polygons):
            why = "its modifiers leave none" if len(target.data.polygons) else "its mesh has none"
            if _shows_instances(target, context):
                why = "it has instances only, which Realize Instances at the end of its geometry nodes turns into faces"
            raise ProblemError(f"{name} must have faces; {why}")
        read = read_triangles(mesh, np.array(evaluated.matrix_world), name)
        _read_normals(read, mesh, evaluated.matrix_world)
        for layer in mesh.uv_layers:
            values = np.empty(2 * len(mesh.loops), np.float32)
            layer.uv.foreach_get("vector", values)
            read.uv_map[layer.name] = values.reshape(-1, 2)
        read.active_uv_map = mesh.uv_layers.active.name if mesh.uv_layers.active else ""
        wanted = [group.name for group in target.vertex_groups if group.name in names]
        read.vertex_group = {group.name: np.empty(0, np.float32) for group in target.vertex_groups}
        read.vertex_group.update(read_vertex_groups(evaluated, mesh, wanted, context))
        _read_materials(read, mesh, evaluated)
        for attribute in mesh.attributes:
            _read_attribute(read, attribute, attribute.name in names)
            if attribute.data_type == VECTOR and attribute.domain in DOMAINS:
                read.vector[attribute.name] = attribute.domain, _vectors_in_world(attribute, evaluated, vectors)
    finally:
        shown.to_mesh_clear()
    if not np.isfinite(read.position).all():
        raise ProblemError(f"{name} must have finite vertex positions; some are NaN or infinite")
    return read


def _shows_instances(item: bpy.types.Object, context: bpy.types.Context) -> bool:
    shown = evaluated_depsgraph(context).object_instances
    return any(one.is_instance and one.parent is not None and one.parent.original == item for one in shown)


def read_triangles(mesh: bpy.types.Mesh, matrix: np.ndarray, name: str) -> TriangleMesh:
    """Read positions and triangles of ``mesh``, transformed by ``matrix`` ``[4, 4]``."""
    # As an attribute, which is copied as a whole; loops are asked one after the other.
    vertex = read_attribute(mesh, ".corner_vert")
    position = vertex_positions(mesh)
    corner, face = corners_of_triangles(mesh, position, vertex)
    return TriangleMesh(
        name,
        in_world(position, matrix),
        vertex[corner],
        corner,
        face,
        np.empty((0, 3), np.float32),
        corner_count=len(mesh.loops),
        face_count=len(mesh.polygons),
    )


def world_matrix(item: bpy.types.Object, context: bpy.types.Context) -> np.ndarray:
    """Return the object's matrix ``[4, 4]``, also where Blender does not keep it up to date (outside the view layer)."""
    if is_in_layer(context.view_layer, item):
        evaluated = item.evaluated_get(evaluated_depsgraph(context))
        if evaluated.is_evaluated:
            return np.array(evaluated.matrix_world)
    matrix = np.array(item.matrix_basis)
    if item.parent is not None:
        return world_matrix(item.parent, context) @ np.array(item.matrix_parent_inverse) @ matrix
    return matrix


def is_mirrored(item: bpy.types.Object, context: bpy.types.Context) -> bool:
    """Tell whether an object is shown as in a mirror: its triangles go round the other way then."""
    return bool(np.linalg.det(world_matrix(item, context)[:3, :3]) < 0.0)


def _read_normals(read: TriangleMesh, mesh: bpy.types.Mesh, matrix: Matrix) -> None:
    read.corner_normal = np.empty((len(mesh.loops), 3), np.float32)
    mesh.corner_normals.foreach_get("vector", read.corner_normal.ravel())
    # Cofactors are the transposed inverse times the determinant: they need no division, and a flat scale has them too.
    # Not by mathutils: `adjugated` of Blender 4.5 gives wrong numbers.
    rows = np.array(matrix)[:3, :3]
    cofactors = np.cross(rows[[1, 2, 0]], rows[[2, 0, 1]])
    read.normal_matrix = cofactors / max(np.abs(cofactors).max(), 1e-300)


def _read_materials(read: TriangleMesh, mesh: bpy.types.Mesh, evaluated: bpy.types.Object) -> None:
    slots = [slot.material.name if slot.material else None for slot in evaluated.material_slots]
    read.material = list(dict.fromkeys(name for name in slots if name is not None))
    index = np.zeros(len(mesh.polygons), np.int32)
    if "material_index" in mesh.attributes:
        mesh.attributes["material_index"].data.foreach_get("value", index)
    # Faces of a slot that is not there show the last one.
    number = np.array([-1 if name is None else read.material.index(name) for name in slots] or [-1], np.int32)
    read.material_of_face = number[np.clip(index, 0, len(number) - 1)]


def _vectors_in_world(
    attribute: bpy.types.Attribute, evaluated: bpy.types.Object, wanted: Collection[str]
) -> np.ndarray:
    """Return an attribute's vectors turned as the object is, as long as they were, shape ``[n, 3]``; none if it is not wanted."""
    if attribute.name not in wanted:
        return np.empty((0, 3), np.float32)
    own = np.empty((len(attribute.data), 3), np.float32)
    attribute.data.foreach_get("vector", own.ravel())
    # Those that are not finite stay so, and are told by whoever needs them.
    with np.errstate(invalid="ignore", over="ignore"):
        turned = own @ np.array(evaluated.matrix_world.to_3x3(), np.float32).T
        length, now = (np.linalg.norm(values, axis=1, keepdims=True) for values in (own, turned))
        return turned * (length / np.maximum(now, 1e-30))


def _kind(attribute: bpy.types.Attribute) -> str:
    """Return what an attribute holds, as its list in Blender says: "Vector"."""
    items = attribute.bl_rna.properties["data_type"].enum_items
    return f"{items[attribute.data_type].name}s".lower()


def _read_attribute(read: TriangleMesh, attribute: bpy.types.Attribute, wanted: bool) -> None:
    if attribute.name.startswith("."):
        return
    width = NUMBERS.get(attribute.data_type)
    if width is None:
        read.unusable_attribute[attribute.name] = (
            f"must hold numbers, true or false, or colors; it holds {_kind(attribute)}"
        )
    elif attribute.domain not in DOMAINS:
        read.unusable_attribute[attribute.name] = (
            f"must be stored on points, faces or face corners; it is stored on {attribute.domain}"
        )
    elif wanted:
        values = np.empty(width * len(attribute.data), _READ_AS.get(attribute.data_type, np.float32))
        attribute.data.foreach_get("color" if width == 4 else "value", values)
        values = values.astype(np.float32)
        read.attribute[attribute.name] = (attribute.domain, values.reshape(-1, 4) if width == 4 else values)
    else:
        read.attribute[attribute.name] = (attribute.domain, np.empty(0, np.float32))
