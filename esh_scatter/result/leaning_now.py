"""What leans into each other on a result as it stands by now: settings that are shown at once and hands change that.

What a result keeps tells whether it stands as it did when the run counted; if not, what is there is read, and counted in any thread.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Callable, Sequence

import bpy
import numpy as np

from ...engine.errors import ProblemError
from ...engine.surface.mesh_hull import hull_corners
from ...engine.surface.triangle_mesh import TriangleMesh
from ..classes.object_outline import read_source
from ..targets import checksums
from ..targets.mesh_attributes import read_attribute
from .attributes import INSTANCE_INDEX, LAID, MIDDLE, NORMAL, ROTATION, SCALE, TO_ORIGIN
from .display import get_inputs, our_modifier, shown_objects
from .kept_ground import body_places
from .leaning import Leaning, SizeHulls, StandingObjects, count_leaning

__all__ = [
    "COMPARED",
    "LEANING_OF",
    "LeaningNow",
    "compared_told",
    "factor_shown",
    "number_of_leaning",
    "number_of_shown",
    "number_told",
    "read_leaning",
]

# Custom properties of a result's mesh: how its objects stood when those were counted that lean into each other, empty where that has
# not been counted yet; and which are compared for that, as JSON.
LEANING_OF = "esh_scatter_leaning_of"
COMPARED = "esh_scatter_compared"
_NEEDED = ("position", "class_index", "size_index", INSTANCE_INDEX, ROTATION, SCALE, NORMAL, TO_ORIGIN)
# Hulls by the numbers of what they are around: to read and measure an object takes longer than to know that it is the same.
_hulls: dict[tuple[int, int], np.ndarray] = {}
MOST_HULLS = 512


def compared_told(rooms: Sequence[Sequence[float | None]], apart: np.ndarray | None) -> str:
    """Return what a result keeps of which objects are compared.

    Args:
        rooms: By class and size the factor on outlines while they are kept apart; None where objects are not compared.
        apart: Which classes keep apart, shape ``[classes, classes]``, bool; None where all do.
    """
    return json.dumps({"rooms": rooms, "apart": None if apart is None else apart.astype(int).tolist()})


def number_of_leaning(result: bpy.types.Object) -> str:
    """Return what tells whether objects still stand as they did, whatever carries them all; empty where nothing is compared."""
    mesh = result.data
    standing = checksums.of_standing(result) if isinstance(mesh, bpy.types.Mesh) and COMPARED in mesh else 0
    if not standing:
        return ""
    return number_told(standing, [number_of_shown(item) for item in shown_objects(result)], factor_shown(result))


def number_told(standing: int, shown: Sequence[int], factor: float = 1.0) -> str:
    """Return :func:`number_of_leaning` of what is known by numbers; whole numbers of a file's properties have 32 bits with a sign."""
    return f"{standing} {zlib.crc32(repr(list(shown)).encode())} {factor:g}"


def number_of_shown(item: bpy.types.Object | bpy.types.Collection | None) -> int:
    """Return the number of what an object that is shown looks like; 0 where it was removed."""
    if item is None:
        return 0
    return checksums.of_collection(item) if isinstance(item, bpy.types.Collection) else checksums.of_object(item)


def factor_shown(result: bpy.types.Object) -> float:
    """Return how much larger the modifier of a result shows its objects than they were placed."""
    modifier = our_modifier(result)
    return 1.0 if modifier is None else float(get_inputs(modifier).get("Scale", 1.0))


class LeaningNow:
    """What was read of a result, to be counted."""

    def __init__(self, result: bpy.types.Object, context: bpy.types.Context) -> None:
        mesh = result.data
        told = json.loads(mesh[COMPARED])
        self._rooms = [room for of_class in told["rooms"] for room in of_class]
        self._first = np.concatenate([[0], np.cumsum([len(of_class) for of_class in told["rooms"]])])
        self._apart = None if told["apart"] is None else np.array(told["apart"], bool)
        self._factor = factor_shown(result)
        self._values = {name: read_attribute(mesh, name) for name in _NEEDED}
        self._values |= {name: read_attribute(mesh, name) for name in (LAID, MIDDLE) if name in mesh.attributes}
        self._ground = body_places(mesh)
        used = set(np.unique(self._values[INSTANCE_INDEX]).tolist())
        self._shown = {
            number: _known_or_read(item, context)
            for number, item in enumerate(shown_objects(result))
            if item is not None and number in used
        }

    def count(self, told: bool, ask: Callable[[], None] | None = None) -> Leaning | None:
        """Count; None where nothing leans. In any thread.

        Args:
            told: Whether pairs that overlap on the ground are counted elsewhere.
            ask: Called now and then; what it raises ends the count.
        """
        hulls = {}
        for number, found in self._shown.items():
            if ask is not None:
                ask()
            if (hull := _hull(found)) is not None:
                hulls[number] = hull
        objects = self._objects()
        sizes: list[SizeHulls | None] = []
        for number, room in enumerate(self._rooms):
            of_size = np.unique(objects.source[objects.size_number == number]).tolist() if room is not None else ()
            which = tuple(one for one in of_size if one in hulls)
            sizes.append(SizeHulls(which, tuple(hulls[one] for one in which), room) if which else None)
        return count_leaning(objects, sizes, self._apart, told=told, factor=self._factor, ask=ask)

    def _objects(self) -> StandingObjects:
        values = self._values
        count = len(self._ground)
        class_index = np.clip(values["class_index"], 0, len(self._first) - 2)
        return StandingObjects(
            values["position"],
            values[ROTATION],
            values[SCALE][:, 0],
            values[INSTANCE_INDEX],
            self._ground,
            values[NORMAL],
            values.get(LAID, np.zeros(count, bool)),
            values[MIDDLE][:, :2] if MIDDLE in values else np.zeros((count, 2), np.float32),
            self._first[class_index] + values["size_index"],
            class_index,
        )


def read_leaning(result: bpy.types.Object, context: bpy.types.Context) -> LeaningNow | None:
    """Read a result as it stands by now; None where too little is known of it, or it cannot be read: in Edit Mode."""
    mesh = result.data
    if not isinstance(mesh, bpy.types.Mesh) or mesh.is_editmode or COMPARED not in mesh:
        return None
    if not all(name in mesh.attributes for name in _NEEDED):
        return None
    return LeaningNow(result, context)


def _known_or_read(
    item: bpy.types.Object | bpy.types.Collection, context: bpy.types.Context
) -> np.ndarray | tuple[tuple[int, int], TriangleMesh] | None:
    """Return the hull of an object, or where that is not known by what it will be, and its mesh; None where it has no faces."""
    key = item.session_uid, number_of_shown(item)
    # A thread may forget it at any time.
    known = _hulls.get(key)
    if known is not None:
        return known
    try:
        return key, read_source(item, context, "`area`")
    except ProblemError:
        return None


def _hull(found: np.ndarray | tuple[tuple[int, int], TriangleMesh] | None) -> np.ndarray | None:
    """Return a hull, and know it from now on; in any thread."""
    if not isinstance(found, tuple):
        return found
    key, mesh = found
    if len(_hulls) >= MOST_HULLS:
        _hulls.clear()
    _hulls[key] = hull = hull_corners(mesh)
    return hull
