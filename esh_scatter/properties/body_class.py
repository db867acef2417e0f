"""What the sidebar holds of a class."""

# Properties are annotations that are calls, which Blender reads and mypy cannot.
# mypy: disable-error-code="valid-type"

from dataclasses import replace
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

from ...engine.problem.body_class import ClassSettings
from ...engine.problem.look_at import LookAt
from ...engine.problem.scatter_settings import Standing
from ...engine.problem.settings import settings_of
from ..classes.amount import Amount
from ..classes.name_lists import names_in
from ..result.scene_units import area_unit, in_scene_units
from ..targets.target import DOMAINS, VECTOR
from .described import property_of, values_from, with_properties
from .entries import entry_at
from .gone import gone
from .layer import ESH_PG_layer
from .names import class_renamed, scatter_of, unused_name
from .shown_at_once import paint_class_anew, show_class_anew, stand_class_anew
from .size import ESH_PG_size

if TYPE_CHECKING:
    from ..api import ScatterClass
    from ..densities.kinds import Density

__all__ = ["CLASSES", "CLASS_COLORS", "DERIVED_COUNTS", "ESH_PG_class"]

# Told apart by most people with a color vision deficiency (after Okabe and Ito), and pleasant beside each other.
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


# Ways to say how many that need the ground to become a number.
DERIVED_COUNTS = {"PER_AREA": "per_area", "DISTANCE": "distance", "SHARE": "cover_share"}
_AMOUNT = settings_of(Amount)


def _vector_attributes(body_class: "ESH_PG_class", _context: object, _text: str) -> list[str]:
    """Name the attributes of the target that long objects can lie along."""
    target = scatter_of(body_class).first_target
    if target is None or target.type != "MESH":
        return []
    found = [a.name for a in target.data.attributes if a.data_type == VECTOR and a.domain in DOMAINS]
    return [name for name in found if name != "position" and not name.startswith(".")]


@with_properties(Standing, **{name: {"update": stand_class_anew} for name in settings_of(Standing)})
@with_properties(
    ClassSettings,
    unsharp_radius={
        "description": "Reach of the sharpening, in units of 1/1024 of the target's longer side",
        "default": 20.0,
        "min": 0.1,
        "soft_max": 200.0,
    },
    use_look_at={"update": stand_class_anew},
    look_at_point={"subtype": "TRANSLATION", "update": stand_class_anew},
    look_at_spread={"update": stand_class_anew},
    look_at_front={"update": stand_class_anew},
)
class ESH_PG_class(PropertyGroup):
    """One class of bodies: the density it follows and its sizes."""

    KIND = "Class"

    name: StringProperty(
        name="Name", description="Name of this class. No two classes have the same name", update=class_renamed
    )
    uid: IntProperty(options={"HIDDEN"})
    known_name: StringProperty(options={"HIDDEN"})
    # The name that it was given after what it places; another one is somebody's own.
    named_after: StringProperty(options={"HIDDEN"})
    # It was added by hand, and nothing to place has been chosen yet.
    waits_for_first: BoolProperty(options={"HIDDEN"})
    mute: BoolProperty(
        name="Mute", description="Leave this class out of the next run. Its settings stay as they are", default=False
    )
    show_viewport: BoolProperty(
        name="Show in Viewport",
        description="Show the objects of this class in the viewport",
        default=True,
        update=show_class_anew,
    )
    show_render: BoolProperty(
        name="Show in Renders",
        description="Show the objects of this class in renders",
        default=True,
        update=show_class_anew,
    )
    color: FloatVectorProperty(
        name="Color",
        description="Color of this class in the list. It is also stored as an attribute of its points",
        subtype="COLOR",
        size=3,
        min=0.0,
        max=1.0,
        default=CLASS_COLORS[0],
        update=paint_class_anew,
    )
    layers: CollectionProperty(type=ESH_PG_layer)
    layer_index: IntProperty(name="Selected Layer", description="The layer that is shown below the list")
    direction_kind: EnumProperty(
        name="Direction",
        description="Where long objects of this class point",
        items=(
            (
                "DENSITY",
                "Along Edges",
                "Along the edges in the density, for example around its bright parts",
                "IMAGE_DATA",
                0,
            ),
            ("NONE", "Free", "No preferred direction", "ORIENTATION_GIMBAL", 1),
            ("SLOPE", "Down the Slope", "Where water would run; steep ground counts more", "IPO_EASE_IN", 4),
            ("ANGLE", "Angle", "All in the same direction", "DRIVER_ROTATIONAL_DIFFERENCE", 2),
            (
                "IMAGE",
                "Flow Image",
                "Along an image whose red is x and whose green is y; 0.5 stands for 0",
                "FORCE_WIND",
                3,
            ),
            ("CURVE", "Along Curve", "Along the nearest curve, on walls and undersides too", "CURVE_PATH", 5),
            (
                "ATTRIBUTE",
                "Attribute",
                "Along vectors that are stored on the target, for example by geometry nodes",
                "SPREADSHEET",
                6,
            ),
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
    direction_object: PointerProperty(
        type=bpy.types.Object,
        name="Curve",
        description="What long objects lie along: a curve, or a mesh of edges without faces",
        poll=lambda _self, candidate: candidate.type in {"CURVE", "MESH"},
    )
    direction_attribute: StringProperty(
        name="Attribute",
        description="Attribute of the target that holds vectors, in its own axes. Where they are short, they count for less",
        search=_vector_attributes,
    )
    look_at_object: PointerProperty(
        type=bpy.types.Object,
        name="Object",
        description="The object that this class looks at: its origin. Empty: a point",
        update=stand_class_anew,
    )
    may_overlap: StringProperty(
        name="May Overlap",
        description="Names of classes that may overlap this one, separated by commas; a name with a comma is in quotation marks. "
        "For example inks that mix",
    )
    count_kind: EnumProperty(
        name="How Many",
        description="How the number of objects is given",
        items=(
            ("SIZES", "Count", "A number; where there are several sizes, one for each", "LINENUMBERS_ON", 0),
            (
                "TOTAL",
                "Total Count",
                "One number for all sizes together; each size gets a share of the ground that they take",
                "ADD",
                1,
            ),
            (
                "PER_AREA",
                "Per Area",
                "This many on each square meter of ground where the density is white. In scenes with other units, on each square "
                "of one Blender unit",
                "MESH_GRID",
                3,
            ),
            (
                "DISTANCE",
                "Distance",
                "As many as keep this distance between neighbors where the density is white",
                "DRIVER_DISTANCE",
                4,
            ),
            (
                "SHARE",
                "Share of Ground",
                "As many as it takes to cover this share of the ground where the density is white",
                "MOD_MASK",
                5,
            ),
            (
                "COVER",
                "From Density",
                "As many as it takes to cover the share of the ground that the density gives",
                "TEXTURE",
                2,
            ),
        ),
        default="SIZES",
    )
    total: IntProperty(
        name="Total Count", description="How many to place, all sizes together", default=100, min=1, soft_max=100_000
    )
    per_area: property_of(_AMOUNT["per_area"], default=0.5, min=1e-6, precision=3)
    distance: property_of(_AMOUNT["distance"], default=2.0, min=1e-3)
    cover_share: property_of(_AMOUNT["cover"], default=0.3, min=1e-4, max=1.0, subtype="FACTOR")
    sizes: CollectionProperty(type=ESH_PG_size)
    size_index: IntProperty(name="Selected Size", description="The size that is shown below the list")

    @property
    def unused(self) -> set[str]:
        """Images that have no influence as the other settings are."""
        return set() if self.direction_kind == "IMAGE" else {"direction_image"}

    @property
    def count(self) -> int:
        """Number of bodies in all sizes, as far as it is known before the run."""
        return self.total if self.count_kind == "TOTAL" else sum(size.count for size in self.sizes)

    @property
    def names_that_may_overlap(self) -> set[str]:
        """Names of the classes that may lie on this one."""
        return names_in(self.may_overlap)

    def overlaps_with(self, other: "ESH_PG_class") -> bool:
        """Tell whether this class and another may lie on each other."""
        return other.name in self.names_that_may_overlap or self.name in other.names_that_may_overlap

    @property
    def amount(self) -> str:
        """How many, in a few characters."""
        if self.count_kind in ("SIZES", "TOTAL"):
            return f"{self.count:,}"
        return {
            "PER_AREA": f"{self.per_area:.3g}/{area_unit(self.id_data)}",
            "DISTANCE": in_scene_units(self.id_data, f"{self.distance:.3g} m apart"),
            "SHARE": f"{self.cover_share:.0%} cover",
            "COVER": "by density",
        }[self.count_kind]

    def standing(self) -> Standing:
        """Return how the objects of this class stand."""
        return Standing(**values_from(self, Standing))

    def look_at(self) -> LookAt | None:
        """Return where the objects of this class look, or None."""
        from ..classes.scatter_class import point_of

        if not self.use_look_at:
            # Asked of every class whenever the sidebar is drawn.
            return None
        look: LookAt | None = values_from(self, ClassSettings)["look_at"]
        return (
            look if look is None or self.look_at_object is None else replace(look, point=point_of(self.look_at_object))
        )

    @property
    def is_round(self) -> bool:
        """Whether its objects count as discs however they are turned: none that is measured, and none that is long."""
        return all(size.area_kind == "VALUE" and size.shape == "DOT" for size in self.sizes)

    @property
    def active_size(self) -> ESH_PG_size | None:
        """The selected size, or None."""
        return entry_at(self.sizes, self.size_index)

    def add_size(self) -> ESH_PG_size:
        """Append a size, select it and return it."""
        names = {size.name for size in self.sizes}
        size = self.sizes.add()
        size.name = unused_name(next((n for n in ("Large", "Medium", "Small") if n not in names), "Size"), names)
        self.size_index = len(self.sizes) - 1
        return size

    @property
    def active_layer(self) -> ESH_PG_layer | None:
        """The selected layer of the density, or None."""
        return entry_at(self.layers, self.layer_index)

    def add_layer(self, kind: str, **values: Any) -> ESH_PG_layer:
        """Append a layer to the density, select it and return it; ``values`` are those of its properties."""
        layer = self.layers.add()
        layer.kind = kind
        for name, value in values.items():
            setattr(layer, name, value)
        self.layer_index = len(self.layers) - 1
        return layer

    def density(self) -> "Density":
        """Return the density as :func:`~esh.scatter` takes it: 1, what a plain layer reads, or a stack."""
        from ..densities.kinds import DensityStack

        layers = [layer for layer in self.layers if layer.use]
        if not layers:
            return 1.0
        if len(layers) == 1 and layers[0].is_plain:
            return layers[0].density()
        return DensityStack([layer.as_argument() for layer in layers])

    def obstacle(self, target: bpy.types.Object) -> str | None:
        """Return what keeps this class from being scattered on ``target``, as one sentence, or None."""
        for number, layer in enumerate(self.layers, start=1):
            if layer.use and (missing := layer.obstacle(target, self.id_data)):
                where = f", layer {number}" if len(self.layers) > 1 else ""
                return f'Class "{self.name}"{where}: {missing}'
        if self.direction_kind == "IMAGE" and self.direction_image is None:
            return f'Class "{self.name}": choose its flow image'
        if missing := self._direction_obstacle():
            return f'Class "{self.name}": {missing}'
        if text := self._gone_look():
            return f'Class "{self.name}": {text}; choose another object to look at'
        if not self.sizes:
            return f'Class "{self.name}": add a size'
        for size in self.sizes:
            if missing := size.obstacle(target):
                where = f', size "{size.name}"' if len(self.sizes) > 1 else ""
                return f'Class "{self.name}"{where}: {missing}'
        return None

    def _direction_obstacle(self) -> str:
        """Return what lacks of the curve or attribute that it lies along, as the end of a sentence."""
        if self.direction_kind == "CURVE" and self.direction_object is None:
            return "choose the curve that it lies along"
        if self.direction_kind == "CURVE" and (text := gone(self.direction_object)):
            return f"{text}; choose another curve to lie along"
        if self.direction_kind == "ATTRIBUTE" and not self.direction_attribute:
            return "choose the attribute that it lies along"
        return ""

    @property
    def gone(self) -> str:
        """What has become of what it places, follows, lies along or looks at, as the beginning of a sentence; empty where all is."""
        along = gone(self.direction_object) if self.direction_kind == "CURVE" else ""
        layers = (layer.gone(self.id_data) for layer in self.layers if layer.use)
        return next(filter(None, (*(size.gone for size in self.sizes), *layers, along, self._gone_look())), "")

    def _gone_look(self) -> str:
        return gone(self.look_at_object) if self.use_look_at else ""

    def as_argument(self) -> "ScatterClass":
        """Return this class as :func:`~esh.scatter` takes it."""
        from ..api import ScatterClass

        whole = sum(size.share for size in self.sizes)
        shared = self.count_kind != "SIZES"
        sizes = [size.as_argument(size.share / whole if shared else None) for size in self.sizes]
        count: Any = {"TOTAL": self.total, "COVER": "cover"}.get(self.count_kind)
        if self.count_kind in DERIVED_COUNTS:
            name = DERIVED_COUNTS[self.count_kind]
            count = Amount(**{{"cover_share": "cover"}.get(name, name): getattr(self, name)})
        return ScatterClass(
            self.name,
            sizes,
            density=self.density(),
            color=tuple(self.color),
            count=count,
            standing=self.standing(),
            direction=self._direction(),
            **{**values_from(self, ClassSettings), "look_at": self.look_at()},
        )

    def _direction(self) -> Any:
        """Return what long objects lie along, as :func:`~esh.scatter` takes it."""
        from ..classes.directions import AttributeDirection, CurveDirection

        if self.direction_kind == "CURVE":
            return CurveDirection(self.direction_object)
        if self.direction_kind == "ATTRIBUTE":
            return AttributeDirection(self.direction_attribute)
        plain = {"NONE": "none", "SLOPE": "slope", "ANGLE": self.direction_angle, "IMAGE": self.direction_image}
        return plain.get(self.direction_kind, "density")


CLASSES = (ESH_PG_class,)
