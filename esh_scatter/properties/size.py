"""What the sidebar holds of a size of a class."""

# Properties are annotations that are calls, which Blender reads and mypy cannot.
# mypy: disable-error-code="valid-type"

from typing import TYPE_CHECKING

import bpy
from bpy.props import BoolProperty, CollectionProperty, EnumProperty, FloatProperty, PointerProperty, StringProperty
from bpy.types import PropertyGroup

from ...engine.problem.settings import settings_of
from ...engine.problem.size import Size
from ..targets.in_scenes import in_a_scene
from ..targets.target import FAMILY_OF, is_result, members_of
from .described import property_of, values_from
from .gone import not_found
from .names import class_of, keep_name_unused, name_class_after
from .shown_at_once import choose_variants_anew, place_others

if TYPE_CHECKING:
    from ..api import ScatterSize

__all__ = ["CLASSES", "ESH_PG_size", "can_be_placed"]

_SIZE = settings_of(Size)


def can_be_placed(_size: "ESH_PG_size", item: bpy.types.Object) -> bool:
    """Tell whether an object can be chosen: it has a geometry to instance, and is no scatter's result."""
    return bool(members_of(item)) and not is_result(item)


def remember_source(size: "ESH_PG_size", context: object) -> None:
    """Note whether the object to place is in a scene: if it no longer is later, it was deleted there."""
    size.source_was_in_scene = size.source_object is not None and in_a_scene(size.source_object)
    _stand_as_first(size)
    name_class_after(size)
    place_others(size, context)


def _stand_as_first(size: "ESH_PG_size") -> None:
    """Have a class that was added by hand stand upright where the first thing that it places does, unless that was set already."""
    body_class = class_of(size)
    if size.source is None or not body_class.waits_for_first:
        return
    from ..classes.upright_objects import align_of

    body_class.waits_for_first = False
    # The objects of a collection are most likely alike, and measuring takes a moment.
    item = next(iter(members_of(size.source)), None) if size.source_kind == "COLLECTION" else size.source
    if item is not None and not body_class.is_property_set("align_to_normal"):
        align = align_of(item, bpy.context)
        if align is not None:
            body_class.align_to_normal = align


def list_variants(size: "ESH_PG_size", context: object) -> None:
    """Have an entry for each object of the collection; those that were there before keep their weights."""
    weights = {entry.item: entry.weight for entry in size.variants if entry.item is not None}
    size.variants.clear()
    for item in members_of(size.source_collection):
        entry = size.variants.add()
        entry.item = item
        if item in weights:
            entry.weight = weights[item]
    _stand_as_first(size)
    name_class_after(size)
    place_others(size, context)


class ESH_PG_variant(PropertyGroup):
    """An object of a collection that is placed, and how often."""

    item: PointerProperty(type=bpy.types.Object, name="Object", description="An object of the collection")
    weight: FloatProperty(
        name="Weight",
        description="How often this object is placed, compared with the others of the collection. 0 leaves it out",
        default=1.0,
        min=0.0,
        soft_max=10.0,
        update=choose_variants_anew,
    )


class ESH_PG_size(PropertyGroup):
    """One size of a class: what is placed, how often, and how much room each takes."""

    KIND = "Size"

    name: StringProperty(
        name="Name",
        description="Name of this size. No two sizes of a class have the same name",
        update=keep_name_unused,
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
            (
                "ASSET",
                "Collection as One",
                "Place a whole collection at each point. Its objects keep their places: a trunk with leaves stays a tree",
                "ASSET_MANAGER",
                2,
            ),
        ),
        default="OBJECT",
    )
    source_object: PointerProperty(
        type=bpy.types.Object,
        name="Object",
        description="The object to place. It is instanced, not copied, and stays as it is",
        poll=can_be_placed,
        update=remember_source,
    )
    source_was_in_scene: BoolProperty(options={"HIDDEN"})
    # The class was named after what it places.
    names_class: BoolProperty(options={"HIDDEN"})
    source_collection: PointerProperty(
        type=bpy.types.Collection,
        name="Collection",
        description="The collection whose objects are placed. Each point gets one of them, chosen at random",
        update=list_variants,
    )
    variants: CollectionProperty(type=ESH_PG_variant, name="Weights")
    count: property_of(_SIZE["count"], default=100, min=1)
    share: property_of(
        _SIZE["share"],
        description="The part of the class's total footprint area that this size gets. Shares need not add up to 1",
        default=1.0,
        min=0.001,
        max=1000.0,
        soft_max=1.0,
    )
    area_kind: EnumProperty(
        name="Footprint",
        description="How much ground one object takes up. Larger footprints keep more distance",
        items=(
            ("MESH", "From Mesh", "Measure the object, seen from above", "MESH_DATA", 0),
            ("VALUE", "Area", "Enter the area", "FIXED_SIZE", 1),
            ("RANGE", "Range", "Give each object an area of its own, and scale it to fit", "ARROW_LEFTRIGHT", 2),
        ),
        default="MESH",
    )
    area: property_of(
        _SIZE["area"],
        description="Ground that one object takes up. No other object stands on it if there is enough room",
        default=1.0,
        min=1e-6,
        soft_min=0.01,
        soft_max=1000.0,
        precision=3,
    )
    area_largest: FloatProperty(
        name="Largest",
        description="Ground that the largest object takes up",
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
            ("AUTO", "From Mesh", "Long if the outline is more than 2.5 times as long as wide", "MESH_DATA", 0),
            ("DOT", "Round", "The object is not turned along the direction, however long it is", "MESH_CIRCLE", 1),
            ("LINE", "Long", "Treat the object as a rod along the longer side of its outline", "FIXED_SIZE", 2),
        ),
        default="AUTO",
    )

    @property
    def unused(self) -> set[str]:
        """Settings that have no influence as the others are."""
        return {"source_collection" if self.source_kind == "OBJECT" else "source_object"}

    @property
    def source(self) -> bpy.types.Object | bpy.types.Collection | None:
        """The object or collection to place, or None while none is chosen."""
        return self.source_object if self.source_kind == "OBJECT" else self.source_collection

    @property
    def placed_as_one(self) -> bool:
        """Whether all of a collection is placed on every point."""
        return self.source_kind == "ASSET"

    def place(self, item: bpy.types.Object | bpy.types.Collection) -> None:
        """Place an object from now on, or a collection as one."""
        if isinstance(item, bpy.types.Collection):
            self.source_kind, self.source_collection = "ASSET", item
        else:
            self.source_kind, self.source_object = "OBJECT", item

    @property
    def weights(self) -> dict[str, float]:
        """How often each object of the collection is placed, by its name; those with the usual weight are left out."""
        if self.source_kind != "COLLECTION":
            return {}
        return {entry.item.name: entry.weight for entry in self.variants if entry.item and entry.weight != 1.0}

    def choices(self) -> tuple[list[bpy.types.Object], list[float]]:
        """Return the objects of the collection, and how often each is placed."""
        weights = {entry.item: entry.weight for entry in self.variants}
        items = members_of(self.source) if self.source_kind == "COLLECTION" and self.source else []
        return items, [weights.get(item, 1.0) for item in items]

    @property
    def gone(self) -> str:
        """What has become of what is placed, as the beginning of a sentence, where it is not there any more; or an empty text."""
        deleted = self._deleted
        return f'"{deleted}" was deleted' if deleted else not_found(self.source)

    @property
    def _deleted(self) -> str:
        """Name of what was deleted from its scene of what is placed, or an empty text; while it is chosen, it stays in the file."""
        item = self.source_object
        if self.source_kind == "OBJECT":
            return item.name if item is not None and self.source_was_in_scene and not in_a_scene(item) else ""
        collection = self.source_collection
        if self.source_kind != "ASSET" or collection is None or FAMILY_OF not in collection:
            return ""
        # Objects with what hangs on them are in a collection of their own, which is in no scene.
        return next((one.name for one in collection.objects if not in_a_scene(one)), "")

    def obstacle(self, target: bpy.types.Object) -> str | None:
        """Return what keeps this size from being scattered on ``target``, or None."""
        if self.source is None:
            return f"choose {'an object' if self.source_kind == 'OBJECT' else 'a collection'} to place"
        if text := self.gone:
            return f"{text}; choose something else to place"
        if self.source_kind != "OBJECT" and not self.source.all_objects:
            return f'collection "{self.source.name}" is empty; add objects to place'
        if self.area_kind == "RANGE" and self.area_largest < self.area:
            return "the largest area is smaller than the smallest"
        if self.source == target:
            return "the target cannot be placed on itself"
        return None

    def as_argument(self, share: float | None = None) -> "ScatterSize":
        """Return this size as :func:`~esh.scatter` takes it; with a ``share`` where the class has the count."""
        from ..api import ScatterSize

        area = {"VALUE": self.area, "RANGE": (self.area, self.area_largest)}.get(self.area_kind)
        line = {"DOT": False, "LINE": True}.get(self.shape)
        count = self.count if share is None else None
        spread = values_from(self, Size, set(_SIZE) - {"distribution"})
        return ScatterSize(
            self.name,
            count,
            self.source,
            area=area,
            share=share,
            line=line,
            as_one=self.placed_as_one,
            weights=self.weights or None,
            **spread,
        )


CLASSES = (ESH_PG_variant, ESH_PG_size)
