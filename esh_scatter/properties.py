"""What a user sets in the sidebar: property groups on the scene, so that it is saved, undone and copied with it.

``Scene.esh_scatter`` holds any number of scatters, each with its target, classes, sizes and last report. They live on
the scene rather than on the target because a target is often linked from a library and then cannot be edited. Objects,
collections and images are held as pointers, so renaming them breaks nothing and deleting them leaves an empty field.
"""

# Properties are annotations that are calls, which Blender reads and mypy cannot.
# mypy: disable-error-code="valid-type"

import json
import random
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)
from bpy.types import PropertyGroup

from ..engine.problem.problem import ClassSettings, Size
from ..engine.problem.scatter_settings import ScatterSettings, Standing
from ..engine.problem.settings import settings_of
from . import settings_record
from .described_properties import property_of, values_from, with_properties
from .versions import VERSION

if TYPE_CHECKING:
    from .api import ScatterClass, ScatterSize

__all__ = [
    "AT_ONCE",
    "BY_HAND",
    "CLASSES",
    "DERIVED_COUNTS",
    "active_scatter",
    "attach",
    "detach",
    "selected_class",
    "selected_scatter",
    "unused_name",
]

# Told apart by most people with a colour vision deficiency (after Okabe and Ito), and pleasant beside each other.
CLASS_COLORS = (
    (0.000, 0.342, 0.171),
    (0.791, 0.347, 0.000),
    (0.093, 0.456, 0.815),
    (0.604, 0.191, 0.386),
    (0.871, 0.776, 0.054),
    (0.665, 0.112, 0.000),
    (0.000, 0.168, 0.445),
    (0.350, 0.350, 0.350),
)

# Settings of a scatter that the sidebar has in a form of its own: names of classes that may overlap, and standing by class.
BY_HAND = ("non_overlap", *settings_of(Standing))
# What needs no solving: it is changed in the result at once.
AT_ONCE = {*settings_of(Standing), "color", "show_viewport", "show_render"}
# What has no influence on a result that is solved: what is changed at once, names, what the lists show, and what is known of the
# last run. Whatever else a group has, has.
WITHOUT_INFLUENCE = AT_ONCE | {
    "name",
    "class_index",
    "size_index",
    "result",
    "report_json",
    "ran_with",
    "uid",
    "known_name",
    "source_was_in_scene",
}
# Ways to say how many that need the ground to become a number.
DERIVED_COUNTS = {"PER_AREA": "per_area", "DISTANCE": "distance", "SHARE": "cover_share"}

_SIZE = settings_of(Size)


def unused_name(name: str, taken: set[str]) -> str:
    """Return ``name``, or ``name.001`` and so on where it is taken, as Blender names its data."""
    stem, _, number = name.rpartition(".")
    stem = stem if stem and number.isdigit() else name
    candidate, index = name, 1
    while candidate in taken:
        candidate, index = f"{stem}.{index:03d}", index + 1
    return candidate


def _keep_name_unused(item: PropertyGroup, _context: object) -> None:
    """Give ``item`` a name that no neighbour in its list has; an empty name becomes its kind's."""
    path, _, index = item.path_from_id().rpartition("[")
    siblings = item.id_data.path_resolve(path)
    position = int(index.rstrip("]"))
    taken = {sibling.name for number, sibling in enumerate(siblings) if number != position}
    name = unused_name(item.name.strip() or item.KIND, taken)
    if name != item.name:
        item.name = name


def _class_renamed(item: "ESH_PG_class", context: object) -> None:
    """Keep the name unused, and have the classes that may overlap this one know it by its new name."""
    _keep_name_unused(item, context)
    before, item.known_name = item.known_name, item.name
    if before and before != item.name:
        for other in _scatter_of(item).classes:
            if before in other.names_that_may_overlap:
                others = other.names_that_may_overlap - {before} | {item.name}
                other.may_overlap = ", ".join(sorted(others))


def _scatter_renamed(item: "ESH_PG_scatter", context: object) -> None:
    """Keep the name unused, and rename the result."""
    from .result import rename_result

    _keep_name_unused(item, context)
    result = item.result_in(item.id_data)
    if result is not None and result.library is None:
        rename_result(result, item.name)


def _scatter_of(item: PropertyGroup) -> "ESH_PG_scatter":
    """Return the scatter that a class belongs to."""
    return item.id_data.path_resolve(item.path_from_id().rpartition(".classes[")[0])


def _points_of_class(body_class: "ESH_PG_class") -> tuple[bpy.types.Object, int] | None:
    """Return the result and the number that a class has in it, or None where it has no points."""
    from .kept_ground import CLASSES_OF_POINTS

    result = _scatter_of(body_class).result_in(body_class.id_data)
    if result is None or result.type != "MESH":
        return None
    uids = list(result.data.get(CLASSES_OF_POINTS, ()))
    return (result, uids.index(body_class.uid)) if body_class.uid in uids else None


def _stand_anew(body_class: "ESH_PG_class", _context: object) -> None:
    """Change in the result how the objects of a class stand; where that cannot be done, the result is out of date."""
    from .kept_ground import can_stand_anew, stand_anew

    found = _points_of_class(body_class)
    if found and can_stand_anew(found[0]):
        stand_anew(*found, body_class.standing())
    elif _scatter_of(body_class).report_json and not body_class.mute:
        _scatter_of(body_class).ran_with = "{}"


def _paint_anew(body_class: "ESH_PG_class", _context: object) -> None:
    """Give the points of a class its colour."""
    from .kept_ground import paint_points

    if found := _points_of_class(body_class):
        paint_points(*found, tuple(body_class.color))


def _show_anew(body_class: "ESH_PG_class", _context: object) -> None:
    """Show or hide the objects of a class."""
    from .kept_ground import hide_points

    if found := _points_of_class(body_class):
        hide_points(*found, viewport=not body_class.show_viewport, render=not body_class.show_render)


def _remember_source(size: "ESH_PG_size", _context: object) -> None:
    """Note whether the object to place is in a scene: if it no longer is later, it was deleted there."""
    size.source_was_in_scene = size.source_object is not None and _in_a_scene(size.source_object)


def _in_a_scene(item: bpy.types.Object) -> bool:
    """Tell whether an object is in any scene."""
    return any(scene.objects.get(item.name) == item for scene in bpy.data.scenes)


class ESH_PG_size(PropertyGroup):
    """One size of a class: what is placed, how often, and how much room each takes."""

    KIND = "Size"

    name: StringProperty(
        name="Name",
        description="Name of this size. No two sizes of a class have the same name",
        update=_keep_name_unused,
    )
    source_kind: EnumProperty(
        name="Place",
        description="What this size places",
        items=(
            ("OBJECT", "Object", "Place copies of one object", "OBJECT_DATA", 0),
            (
                "COLLECTION",
                "Collection",
                "Place objects of a collection. Each point gets one of them, chosen at random",
                "OUTLINER_COLLECTION",
                1,
            ),
        ),
        default="OBJECT",
    )
    source_object: PointerProperty(
        type=bpy.types.Object,
        name="Object",
        description="The object to place. It is instanced, not copied, and stays as it is",
        update=_remember_source,
    )
    source_was_in_scene: BoolProperty(options={"HIDDEN"})
    source_collection: PointerProperty(
        type=bpy.types.Collection,
        name="Collection",
        description="The collection whose objects are placed. Each point gets one of them, chosen at random",
    )
    count: property_of(_SIZE["count"], default=100, min=1)
    share: property_of(
        _SIZE["share"],
        description="The part of the class's summed footprints that this size gets. Shares need not add up to 1",
        default=1.0,
        min=0.001,
        max=1000.0,
        soft_max=1.0,
    )
    area_kind: EnumProperty(
        name="Footprint",
        description="How much ground one object takes. Larger footprints keep more distance",
        items=(
            ("MESH", "From the Mesh", "Measure the object, seen from above", "MESH_DATA", 0),
            ("VALUE", "Area", "Enter the area", "FIXED_SIZE", 1),
            ("RANGE", "Range", "Give each object an area of its own, and scale it to fit", "ARROW_LEFTRIGHT", 2),
        ),
        default="MESH",
    )
    area: property_of(
        _SIZE["area"],
        description="Ground that one object takes. No other object stands there, if there is enough room",
        default=1.0,
        min=1e-6,
        soft_min=0.01,
        soft_max=1000.0,
        precision=3,
    )
    area_largest: FloatProperty(
        name="Largest",
        description="Ground that the largest object takes",
        default=2.0,
        min=1e-6,
        soft_min=0.01,
        soft_max=1000.0,
        precision=3,
        unit="AREA",
    )
    distribution: property_of(_SIZE["distribution"])
    shape: EnumProperty(
        name="Shape",
        description="Whether the object is round or long, seen from above. Long objects are turned along the direction of the class",
        items=(
            ("AUTO", "From the Mesh", "Long if the outline is more than 2.5 times as long as wide", "MESH_DATA", 0),
            ("DOT", "Round", "Treat the object as a disc, turned at random", "MESH_CIRCLE", 1),
            ("LINE", "Long", "Treat the object as a rod along the longer side of its outline", "FIXED_SIZE", 2),
        ),
        default="AUTO",
    )

    @property
    def source(self) -> bpy.types.Object | bpy.types.Collection | None:
        """The object or collection to place, or None while none is chosen."""
        return self.source_object if self.source_kind == "OBJECT" else self.source_collection

    @property
    def source_deleted(self) -> bool:
        """Whether the object to place was deleted from its scene; as long as it is chosen here, it stays in the file."""
        chosen = self.source_kind == "OBJECT" and self.source_object is not None and self.source_was_in_scene
        return chosen and not _in_a_scene(self.source_object)

    def as_argument(self, share: float | None = None) -> "ScatterSize":
        """Return this size as :func:`~esh.scatter` takes it; with a ``share`` where the class has the count."""
        from .api import ScatterSize

        area = {"VALUE": self.area, "RANGE": (self.area, self.area_largest)}.get(self.area_kind)
        line = {"DOT": False, "LINE": True}.get(self.shape)
        count = self.count if share is None else None
        spread = values_from(self, Size, set(_SIZE) - {"distribution"})
        return ScatterSize(self.name, count, self.source, area=area, share=share, line=line, **spread)


@with_properties(Standing, **{name: {"update": _stand_anew} for name in settings_of(Standing)})
@with_properties(
    ClassSettings,
    unsharp_radius={
        "description": "How far the sharpening reaches, in steps of 1/1024 of the longer side of the target",
        "default": 20.0,
        "min": 0.1,
        "soft_max": 200.0,
    },
)
class ESH_PG_class(PropertyGroup):
    """One class of bodies: the density it follows and its sizes."""

    KIND = "Class"

    name: StringProperty(
        name="Name", description="Name of this class. No two classes have the same name", update=_class_renamed
    )
    uid: IntProperty(options={"HIDDEN"})
    known_name: StringProperty(options={"HIDDEN"})
    mute: BoolProperty(
        name="Mute", description="Leave this class out of the next run. Its settings stay as they are", default=False
    )
    show_viewport: BoolProperty(
        name="Show in Viewport",
        description="Show the objects of this class in the viewport",
        default=True,
        update=_show_anew,
    )
    show_render: BoolProperty(
        name="Show in Renders", description="Show the objects of this class in renders", default=True, update=_show_anew
    )
    color: FloatVectorProperty(
        name="Color",
        description="Color of this class in the list. Its points have it as an attribute",
        subtype="COLOR",
        size=3,
        min=0.0,
        max=1.0,
        default=CLASS_COLORS[0],
        update=_paint_anew,
    )
    density_kind: EnumProperty(
        name="Density",
        description="Where many objects of this class stand, and where few",
        items=(
            ("UNIFORM", "Even", "The same density everywhere on the target", "MESH_PLANE", 0),
            ("IMAGE", "Image", "Follow an image: white means many, black means none", "IMAGE_DATA", 1),
            ("VERTEX_GROUP", "Vertex Group", "Follow the weights of a vertex group of the target", "GROUP_VERTEX", 2),
            ("ATTRIBUTE", "Attribute", "Follow a painted or computed attribute of the target", "SPREADSHEET", 3),
        ),
        default="UNIFORM",
    )
    image: PointerProperty(
        type=bpy.types.Image,
        name="Image",
        description="Density image: white means many, black means none. It is read at every point, however coarse the mesh is",
    )
    mapping: EnumProperty(
        name="Mapping",
        description="How the image lies on the target",
        items=(
            (
                "POSITION",
                "From Above",
                "Stretched over the extent of the target in x and y. The top of the image is at the largest y",
            ),
            ("UV", "UV Map", "Laid out by a UV map of the target"),
        ),
        default="POSITION",
    )
    uv_map: StringProperty(
        name="UV Map",
        description="UV map of the target. If this is empty, the one that is active for rendering is used",
    )
    vertex_group: StringProperty(
        name="Vertex Group", description="Vertex group of the target. Its weights are the density"
    )
    attribute: StringProperty(
        name="Attribute", description="Attribute of the target. Its values are the density and must be 0 or more"
    )
    invert: BoolProperty(name="Invert", description="Exchange many and none", default=False)
    direction_kind: EnumProperty(
        name="Direction",
        description="Where long objects of this class point, seen from above",
        items=(
            (
                "DENSITY",
                "Along Edges",
                "Along the edges in the density, for example around its bright parts",
                "IMAGE_DATA",
                0,
            ),
            ("NONE", "Free", "No preferred direction", "ORIENTATION_GIMBAL", 1),
            ("ANGLE", "Angle", "All along one angle", "DRIVER_ROTATIONAL_DIFFERENCE", 2),
            ("IMAGE", "Flow Image", "Along an image: red is x, green is y, and 0.5 means none", "FORCE_WIND", 3),
        ),
        default="DENSITY",
    )
    direction_angle: FloatProperty(
        name="Angle", description="Angle from the x axis, counter-clockwise", subtype="ANGLE", default=0.0
    )
    direction_image: PointerProperty(
        type=bpy.types.Image,
        name="Flow Image",
        description="Flow image. It is stretched over the extent of the target in x and y",
    )
    may_overlap: StringProperty(
        name="May Overlap",
        description="Names of classes that may overlap this one, separated by commas. For example inks that mix",
    )
    count_kind: EnumProperty(
        name="How Many",
        description="How the number of objects is said",
        items=(
            ("SIZES", "Count", "A number; where there are several sizes, one for each", "LINENUMBERS_ON", 0),
            ("TOTAL", "Total Count", "A number for all sizes together, of which each size gets a share", "FUND", 1),
            (
                "PER_AREA",
                "Per Square Meter",
                "So many on each square meter of ground, where the density is white",
                "MESH_GRID",
                3,
            ),
            (
                "DISTANCE",
                "Distance",
                "As many as leaves this distance between neighbors, where the density is white",
                "DRIVER_DISTANCE",
                4,
            ),
            (
                "SHARE",
                "Share of Ground",
                "As many as it takes to cover this share of the ground, where the density is white",
                "MOD_MASK",
                5,
            ),
            (
                "COVER",
                "From Density",
                "As many as it takes to cover the share of the ground that the density says",
                "TEXTURE",
                2,
            ),
        ),
        default="SIZES",
    )
    total: IntProperty(
        name="Total Count", description="How many to place, all sizes together", default=100, min=1, soft_max=100_000
    )
    per_area: FloatProperty(
        name="Per m²",
        description="How many to place on each square meter of ground where the density is white, all sizes together",
        default=0.5,
        min=1e-6,
        soft_max=100.0,
        precision=3,
    )
    distance: FloatProperty(
        name="Distance",
        description="How far neighbors of this class are apart where the density is white",
        default=2.0,
        min=1e-3,
        soft_min=0.05,
        soft_max=100.0,
        unit="LENGTH",
    )
    cover_share: FloatProperty(
        name="Cover",
        description="Share of the ground that the footprints of this class cover together where the density is white",
        default=0.3,
        min=1e-4,
        max=1.0,
        subtype="FACTOR",
    )
    sizes: CollectionProperty(type=ESH_PG_size)
    size_index: IntProperty(name="Selected Size", description="The size that is shown below the list")

    @property
    def count(self) -> int:
        """Number of bodies in all sizes, as far as it is known before the run."""
        return self.total if self.count_kind == "TOTAL" else sum(size.count for size in self.sizes)

    @property
    def names_that_may_overlap(self) -> set[str]:
        """Names of the classes that may lie on this one."""
        return {part.strip() for part in self.may_overlap.split(",")} - {""}

    def overlaps_with(self, other: "ESH_PG_class") -> bool:
        """Tell whether this class and another may lie on each other."""
        return other.name in self.names_that_may_overlap or self.name in other.names_that_may_overlap

    @property
    def amount(self) -> str:
        """How many, in a few characters."""
        if self.count_kind in ("SIZES", "TOTAL"):
            return f"{self.count:,}"
        return {
            "PER_AREA": f"{self.per_area:.3g} per m²",
            "DISTANCE": f"{self.distance:.3g} m apart",
            "SHARE": f"{self.cover_share:.0%} cover",
            "COVER": "by density",
        }[self.count_kind]

    def standing(self) -> Standing:
        """Return how the objects of this class stand."""
        return Standing(**values_from(self, Standing))

    @property
    def active_size(self) -> ESH_PG_size | None:
        """The selected size, or None."""
        return self.sizes[self.size_index] if 0 <= self.size_index < len(self.sizes) else None

    def add_size(self) -> ESH_PG_size:
        """Append a size, select it and return it."""
        names = {size.name for size in self.sizes}
        size = self.sizes.add()
        size.name = unused_name(next((n for n in ("Large", "Medium", "Small") if n not in names), "Size"), names)
        self.size_index = len(self.sizes) - 1
        return size

    def obstacle(self, target: bpy.types.Object) -> str | None:
        """Return what keeps this class from being scattered on ``target``, as one sentence, or None."""
        if self.density_kind == "IMAGE" and self.image is None:
            return f'Class "{self.name}": choose its density image'
        if self.density_kind == "IMAGE" and self.mapping == "UV":
            if not target.data.uv_layers:
                return (
                    f'Class "{self.name}": "{target.name}" has no UV map; add one, or choose From Above as its mapping'
                )
            if self.uv_map and self.uv_map not in target.data.uv_layers:
                return f'Class "{self.name}": "{target.name}" has no UV map "{self.uv_map}"'
        if self.direction_kind == "IMAGE" and self.direction_image is None:
            return f'Class "{self.name}": choose its flow image'
        if self.density_kind == "VERTEX_GROUP" and self.vertex_group not in target.vertex_groups:
            return f'Class "{self.name}": choose a vertex group of "{target.name}"'
        if self.density_kind == "ATTRIBUTE" and not self.attribute:
            return f'Class "{self.name}": choose an attribute of "{target.name}"'
        if not self.sizes:
            return f'Class "{self.name}": add a size'
        for size in self.sizes:
            if size.source is None:
                what = "an object" if size.source_kind == "OBJECT" else "a collection"
                return f"{self._where(size)}: choose {what} to place"
            if size.source_deleted:
                return f'{self._where(size)}: "{size.source.name}" was deleted; choose another object to place'
            if size.source_kind == "COLLECTION" and not size.source.all_objects:
                return f'{self._where(size)}: collection "{size.source.name}" is empty; put objects to place into it'
            if size.area_kind == "RANGE" and size.area_largest < size.area:
                return f"{self._where(size)}: the largest area is smaller than the smallest"
            if size.source == target:
                return f"{self._where(size)}: the target cannot be placed on itself"
        return None

    def _where(self, size: ESH_PG_size) -> str:
        return f'Class "{self.name}"' + (f', size "{size.name}"' if len(self.sizes) > 1 else "")

    def as_argument(self) -> "ScatterClass":
        """Return this class as :func:`~esh.scatter` takes it."""
        from .api import Amount, ScatterClass
        from .densities import AttributeDensity, Density, ImageDensity, VertexGroupDensity

        density: Density = 1.0
        if self.density_kind == "IMAGE":
            density = ImageDensity(self.image, mapping=self.mapping, uv_map=self.uv_map, invert=self.invert)
        elif self.density_kind == "VERTEX_GROUP":
            density = VertexGroupDensity(self.vertex_group, invert=self.invert)
        elif self.density_kind == "ATTRIBUTE":
            density = AttributeDensity(self.attribute, invert=self.invert)
        whole = sum(size.share for size in self.sizes)
        shared = self.count_kind != "SIZES"
        sizes = [size.as_argument(size.share / whole if shared else None) for size in self.sizes]
        count: Any = {"TOTAL": self.total, "COVER": "cover"}.get(self.count_kind)
        if self.count_kind in DERIVED_COUNTS:
            name = DERIVED_COUNTS[self.count_kind]
            count = Amount(**{{"cover_share": "cover"}.get(name, name): getattr(self, name)})
        direction = {"NONE": "none", "ANGLE": self.direction_angle, "IMAGE": self.direction_image}
        return ScatterClass(
            self.name,
            sizes,
            density=density,
            color=tuple(self.color),
            count=count,
            standing=self.standing(),
            direction=direction.get(self.direction_kind, "density"),
            **values_from(self, ClassSettings),
        )


@with_properties(
    ScatterSettings,
    BY_HAND,
    class_separation={
        "name": "Mix Classes",
        "description": "0: each class is even alone, wherever the others are. 1: only all classes together are even, so they mix",
    },
    size_emphasis={"name": "Large Ones First"},
    max_steps={"name": "Steps at Most"},
)
class ESH_PG_scatter(PropertyGroup):
    """One scatter: a target, what stands on it, and the report of its last run."""

    KIND = "Scatter"

    name: StringProperty(
        name="Name", description="Name of this scatter and of the object that it makes", update=_scatter_renamed
    )
    target: PointerProperty(
        type=bpy.types.Object,
        name="Target",
        description="The mesh to scatter on. It is seen from above, and slopes are taken into account",
        poll=lambda _self, candidate: candidate.type == "MESH",
    )
    classes: CollectionProperty(type=ESH_PG_class)
    class_index: IntProperty(name="Selected Class", description="The class that is shown below the list")
    result: PointerProperty(
        type=bpy.types.Object, name="Result", description="The object that the last run made. The next run replaces it"
    )
    report_json: StringProperty(options={"HIDDEN"})
    ran_with: StringProperty(options={"HIDDEN"})

    @property
    def active_class(self) -> ESH_PG_class | None:
        """The selected class, or None."""
        return self.classes[self.class_index] if 0 <= self.class_index < len(self.classes) else None

    @property
    def report(self) -> dict | None:
        """The last run's report, as :meth:`~esh.engine.problem.report.Report.to_dict` gives it, or None before the first."""
        return _parse_report(self.report_json)

    @property
    def outdated(self) -> bool:
        """Whether a setting differs from what the last run was made with. Cheap enough to ask while drawing."""
        return bool(self.report_json) and self.ran_with != self.fingerprint()

    def changes(self) -> list[str]:
        """Name what differs from what the last run was made with: "count of Pine"; empty where nothing does, or before a run."""
        if not self.outdated:
            return []
        return settings_record.changes(_parse_record(self.ran_with), json.loads(self.fingerprint()), self)

    def names_in_report(self) -> list[str]:
        """Return the names of the report's classes, as they are called now."""
        from .kept_ground import CLASSES_OF_POINTS

        entries = (self.report or {}).get("classes", [])
        result = self.result
        uids = (
            list(result.data.get(CLASSES_OF_POINTS, ())) if result and isinstance(result.data, bpy.types.Mesh) else []
        )
        now = {body_class.uid: body_class.name for body_class in self.classes}
        if len(uids) != len(entries):
            return [entry["name"] for entry in entries]
        return [now.get(uid, entry["name"]) for uid, entry in zip(uids, entries, strict=True)]

    def add_class(self) -> ESH_PG_class:
        """Append a class with one size, select it and return it."""
        body_class = self.classes.add()
        body_class.name = unused_name("Class", {other.name for other in self.classes[:-1]})
        self.give_uid(body_class)
        used = [tuple(other.color) for other in self.classes[:-1]]
        free = [color for color in CLASS_COLORS if not any(_close(color, other) for other in used)]
        body_class.color = free[0] if free else CLASS_COLORS[len(used) % len(CLASS_COLORS)]
        body_class.add_size()
        self.class_index = len(self.classes) - 1
        return body_class

    def give_uid(self, body_class: ESH_PG_class) -> None:
        """Give a class a number that no other class of this scatter has, by which results know it."""
        taken = {0, *(other.uid for other in self.classes)}
        body_class.uid = next(uid for _ in range(1000) if (uid := random.getrandbits(30)) not in taken)

    def remove_class(self, index: int) -> None:
        """Remove a class, also from what others may overlap."""
        name = self.classes[index].name
        self.classes.remove(index)
        for other in self.classes:
            if name in other.names_that_may_overlap:
                other.may_overlap = ", ".join(sorted(other.names_that_may_overlap - {name}))
        self.class_index = max(0, min(self.class_index, len(self.classes) - 1))

    def result_in(self, scene: bpy.types.Scene) -> bpy.types.Object | None:
        """Return the last run's object where it still is in ``scene``, and in no other.

        An object that was deleted in the viewport stays in the file as long as something points to it. The settings of a linked copy
        of a scene point to the result of the other scene.
        """
        from .result import is_shared
        from .target import is_result

        result = self.result
        if result is None or scene.objects.get(result.name) != result or is_shared(result) or not is_result(result):
            return None
        return result

    def obstacle(self, scene: bpy.types.Scene) -> str | None:
        """Return what keeps this from being scattered, as one sentence that says what to do, or None."""
        if self.target is None:
            return "Choose a target: the mesh to scatter on"
        if self.target.type != "MESH":
            return f'"{self.target.name}" is not a mesh; choose a mesh as the target'
        if scene.objects.get(self.target.name) != self.target:
            return f'"{self.target.name}" is no longer in this scene; choose another target'
        if self.result is not None and self.result == self.target:
            return "The target is the result of the last run; choose another target"
        if not self.classes:
            return "Add a class: what to scatter"
        if self.ready_classes():
            return None
        incomplete = (c.obstacle(self.target) for c in self.classes if not c.mute)
        return next(incomplete, None) or "All classes are muted; switch one on"

    def ready_classes(self) -> list[ESH_PG_class]:
        """Return the classes that can be scattered and are not muted."""
        return [c for c in self.classes if not c.mute and c.obstacle(self.target) is None]

    def left_out(self) -> list[str]:
        """Return what keeps classes that are not muted from being scattered, one sentence for each."""
        why = ((c.name, c.obstacle(self.target)) for c in self.classes if not c.mute)
        return [f"{name} is left out: {text.partition(': ')[2]}" for name, text in why if text]

    def arguments(self, scene: bpy.types.Scene) -> tuple[tuple, dict]:
        """Return the positional and keyword arguments of :func:`~esh.scatter` that these settings stand for.

        Classes that are muted, or that something is missing of, are left out.
        """
        return (self.target, [body_class.as_argument() for body_class in self.ready_classes()]), {
            **values_from(self, ScatterSettings, BY_HAND),
            "non_overlap": self.non_overlap(),
            "name": self.name,
            "result": self.result_in(scene),
        }

    def non_overlap(self) -> list[list[float]] | None:
        """Return which classes must keep apart as :func:`~esh.scatter` takes it; None where all must."""
        ready = self.ready_classes()
        apart = [
            [1.0 if i == j or not one.overlaps_with(two) else 0.0 for j, two in enumerate(ready)]
            for i, one in enumerate(ready)
        ]
        return None if all(all(row) for row in apart) else apart

    def remember(self, result: bpy.types.Object, report: dict) -> None:
        """Keep what a run made and reached."""
        from .kept_ground import CLASSES_OF_POINTS

        self.result = result
        self.report_json = json.dumps(report)
        self.ran_with = self.fingerprint()
        ready = self.ready_classes()
        if isinstance(result.data, bpy.types.Mesh):
            result.data[CLASSES_OF_POINTS] = [body_class.uid for body_class in ready]
        for body_class in ready:
            if not (body_class.show_viewport and body_class.show_render):
                _show_anew(body_class, None)

    def forget_deleted_result(self) -> None:
        """Remove a result that was deleted in the viewport from the file, so that the next one can have its name."""
        result = self.result
        if result is not None and not _in_a_scene(result) and result.library is None:
            from .result import remove_result

            remove_result(result)

    def fingerprint(self) -> str:
        """Return every setting that changes the result, and the target's place and vertex count, as JSON."""
        target = self.target
        mesh, ready = None, []
        if target is not None and target.type == "MESH":
            mesh = [target.name_full, len(target.data.vertices), [list(row) for row in target.matrix_world]]
            ready = self.ready_classes()
        return json.dumps(settings_record.record(self, ready, mesh), separators=(",", ":"))


class ESH_PG_scene(PropertyGroup):
    """Every scatter of one scene."""

    version: IntProperty(options={"HIDDEN"})
    scatters: CollectionProperty(type=ESH_PG_scatter)
    scatter_index: IntProperty(name="Selected Scatter", description="The scatter that is shown below the list")

    @property
    def active(self) -> ESH_PG_scatter | None:
        """The selected scatter, or None."""
        return self.scatters[self.scatter_index] if 0 <= self.scatter_index < len(self.scatters) else None

    def add_scatter(self, target: bpy.types.Object | None) -> ESH_PG_scatter:
        """Append a scatter on ``target``, select it and return it."""
        if not self.scatters:
            # Nothing is there yet that an older version could have made.
            self.version = VERSION
        scatter = self.scatters.add()
        scatter.name = unused_name(
            f"{target.name} Scatter" if target else "Scatter", {other.name for other in self.scatters[:-1]}
        )
        scatter.target = target
        self.scatter_index = len(self.scatters) - 1
        return scatter


def _close(color: tuple, other: tuple) -> bool:
    return all(abs(a - b) < 1e-3 for a, b in zip(color, other, strict=True))


@lru_cache(maxsize=32)
def _parse_report(text: str) -> dict | None:
    try:
        return json.loads(text) if text else None
    except json.JSONDecodeError:  # written by hand, or by another version: as good as none
        return None


@lru_cache(maxsize=32)
def _parse_record(text: str) -> dict:
    try:
        found = json.loads(text)
    except json.JSONDecodeError:  # by another version
        return {}
    return found if isinstance(found, dict) else {}


def active_scatter(context: bpy.types.Context) -> ESH_PG_scatter | None:
    """Return the scatter that the sidebar shows, or None."""
    return context.scene.esh_scatter.active


def selected_scatter(context: bpy.types.Context) -> ESH_PG_scatter:
    """Return the scatter that the sidebar shows; for what is drawn and done only where there is one."""
    scatter = active_scatter(context)
    assert scatter is not None
    return scatter


def selected_class(context: bpy.types.Context) -> ESH_PG_class:
    """Return the class that the sidebar shows; for what is drawn and done only where there is one."""
    body_class = selected_scatter(context).active_class
    assert body_class is not None
    return body_class


def attach() -> None:
    """Give every scene its settings."""
    bpy.types.Scene.esh_scatter = PointerProperty(type=ESH_PG_scene, name="ESH Scatter")


def detach() -> None:
    """Take the settings' definition away again; what a file holds stays in it."""
    # On leaving Python, Blender may have taken it away itself.
    if hasattr(bpy.types.Scene, "esh_scatter"):
        del bpy.types.Scene.esh_scatter


CLASSES = (ESH_PG_size, ESH_PG_class, ESH_PG_scatter, ESH_PG_scene)
