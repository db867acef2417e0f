"""What the sidebar holds of an obstacle: what it is, how wide, and how far objects keep off it."""

# Properties are annotations that are calls, which Blender reads and mypy cannot.
# mypy: disable-error-code="valid-type"

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, FloatProperty, FloatVectorProperty, PointerProperty
from bpy.types import PropertyGroup

from ...engine.problem.settings import settings_of
from ..solving.obstacles import FreePlace, ScatterObstacle
from ..targets.evaluated_mesh import evaluated_mesh
from .described import property_of
from .gone import gone
from .names import scatter_of

__all__ = ["CLASSES", "ESH_PG_free_place", "ESH_PG_obstacle"]

_SETTINGS = settings_of(ScatterObstacle)

# How wide lines are that somebody chooses to avoid [m]: as paths; on small ground this share of its extent.
PATH, OF_GROUND = 1.0, 0.05


def _has_only_lines(item: bpy.types.Object, context: bpy.types.Context) -> bool:
    with evaluated_mesh(item, context) as mesh:
        return mesh is not None and len(mesh.edges) > 0 and not mesh.polygons


def _chosen(self: "ESH_PG_obstacle", context: bpy.types.Context) -> None:
    """Give lines a width, unless somebody has given one: a line itself keeps nothing off."""
    items = self.items
    if not items or self.is_property_set("width") or not all(_has_only_lines(item, context) for item in items):
        return
    width = PATH / context.scene.unit_settings.scale_length
    targets = scatter_of(self).targets
    if targets:
        corners = [np.array(item.bound_box) @ np.array(item.matrix_world)[:2, :3].T for item in targets]
        extent = float(np.ptp(np.concatenate(corners), axis=0).max())
        # Rounded, as somebody would type it.
        width = min(width, float(f"{OF_GROUND * extent:.1g}")) or width
    self.width = width


class ESH_PG_obstacle(PropertyGroup):
    """Something that the objects of a scatter keep off."""

    use: BoolProperty(name="Use", description="Keep objects away from it", default=True)
    kind: EnumProperty(
        name="Avoid",
        description="What objects keep away from",
        items=(
            ("OBJECT", "Object", "One object: a mesh, a curve, or another scatter's result", "OBJECT_DATA", 0),
            ("COLLECTION", "Collection", "All objects of a collection", "OUTLINER_COLLECTION", 1),
        ),
        default="OBJECT",
    )
    item: PointerProperty(
        type=bpy.types.Object,
        name="Object",
        description="The obstacle. What it covers stays free: seen from above, or on a whole surface what is near it",
        update=_chosen,
    )
    collection: PointerProperty(
        type=bpy.types.Collection,
        name="Collection",
        description="The collection whose objects are obstacles. What they cover stays free: seen from above, or on a whole "
        "surface what is near them",
        update=_chosen,
    )
    width: property_of(_SETTINGS["width"])
    margin: property_of(_SETTINGS["margin"])

    @property
    def source(self) -> bpy.types.Object | bpy.types.Collection | None:
        """What it is, or None while nothing is chosen or the collection is empty."""
        if self.kind == "OBJECT":
            return self.item
        return self.collection if self.collection is not None and len(self.collection.all_objects) else None

    @property
    def items(self) -> list[bpy.types.Object]:
        """The objects that it stands for."""
        source = self.source
        if isinstance(source, bpy.types.Collection):
            return sorted(source.all_objects, key=lambda item: item.name_full)
        return [] if source is None else [source]

    @property
    def ready(self) -> bool:
        """Whether it is switched on and there is something to keep off."""
        return self.use and self.source is not None and not self.gone

    @property
    def gone(self) -> str:
        """What has become of what it is, as the beginning of a sentence, where that is kept off no longer; or an empty text."""
        return gone(self.source)

    @property
    def has_lines(self) -> bool:
        """Whether any of it is not made of faces alone, and so has a width; nothing chosen may become so."""
        items = self.items
        return not items or self.width > 0.0 or any(item.type != "MESH" or not item.data.polygons for item in items)

    def as_argument(self) -> ScatterObstacle:
        """Return it as :func:`~esh.scatter` takes it."""
        return ScatterObstacle(self.source, width=self.width, margin=self.margin)


class ESH_PG_free_place(PropertyGroup):
    """Where an object was removed by hand: the place stays free."""

    place: FloatVectorProperty(size=2, options={"HIDDEN"})
    radius: FloatProperty(options={"HIDDEN"})
    # Files of before have no heights.
    has_height: BoolProperty(options={"HIDDEN"})
    height: FloatProperty(options={"HIDDEN"})

    def as_argument(self) -> FreePlace:
        """Return it as :func:`~esh.scatter` takes it."""
        return FreePlace(self.place[0], self.place[1], self.radius, self.height if self.has_height else None)


CLASSES = (ESH_PG_obstacle, ESH_PG_free_place)
