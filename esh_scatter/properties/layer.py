"""What the sidebar holds of a layer of a class's density."""

# Properties are annotations that are calls, which Blender reads and mypy cannot.
# mypy: disable-error-code="valid-type"

from typing import TYPE_CHECKING, Any, NamedTuple

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty, PointerProperty, StringProperty
from bpy.types import PropertyGroup

from ..densities.density_curve import curve_points, curve_record, make_curve
from ..densities.kinds import (
    AltitudeDensity,
    AttributeDensity,
    CameraDensity,
    ClassDensity,
    DensityLayer,
    DistanceDensity,
    FacingDensity,
    ImageDensity,
    InsideDensity,
    NoiseDensity,
    SlopeDensity,
    VertexGroupDensity,
)
from ..targets.target import NUMBERS
from .described import shown_settings, values_from, with_properties
from .gone import gone
from .names import scatter_of
from .renamed_on_mesh import keep_names_on_mesh, name_on_mesh

if TYPE_CHECKING:
    from ..densities.kinds import Density

__all__ = ["BY_HAND", "CLASSES", "KINDS", "ESH_PG_layer", "LayerKind"]


class LayerKind(NamedTuple):
    """What a layer can read.

    Attributes:
        label: In menus, and of a layer that has no name.
        help: What it is.
        icon: In lists and menus.
        settings: The density that it is.
        prefix: Of the properties that stand for its settings.
        by_hand: Settings that have a form of their own.
    """

    label: str
    help: str
    icon: str
    settings: Any
    prefix: str = ""
    by_hand: tuple[str, ...] = ()


KINDS: dict[str, LayerKind] = {
    "IMAGE": LayerKind(
        "Image",
        "Follow an image: white means many, black means none",
        "IMAGE_DATA",
        ImageDensity,
        "image_",
        ("image", "uv_map", "invert"),
    ),
    "VERTEX_GROUP": LayerKind(
        "Vertex Group",
        "Follow the weights of a vertex group of the target",
        "GROUP_VERTEX",
        VertexGroupDensity,
        by_hand=("name", "invert"),
    ),
    "ATTRIBUTE": LayerKind(
        "Attribute",
        "Follow a painted or computed attribute of the target",
        "SPREADSHEET",
        AttributeDensity,
        by_hand=("name", "invert"),
    ),
    "SLOPE": LayerKind("Slope", "Where the ground is as steep as this", "IPO_LINEAR", SlopeDensity, "slope_"),
    "ALTITUDE": LayerKind("Altitude", "Between two heights", "EMPTY_SINGLE_ARROW", AltitudeDensity, "altitude_"),
    "FACING": LayerKind(
        "Facing", "Where the ground slopes down towards a direction", "ORIENTATION_NORMAL", FacingDensity, "facing_"
    ),
    "NOISE": LayerKind("Noise", "In random patches", "FORCE_TURBULENCE", NoiseDensity, "noise_"),
    "DISTANCE": LayerKind(
        "Near Objects",
        "Near objects or curves; inverted, away from them",
        "PROP_ON",
        DistanceDensity,
        "distance_",
        ("source",),
    ),
    "INSIDE": LayerKind("Inside Curve", "Inside closed curves", "CURVE_NCIRCLE", InsideDensity, "inside_", ("source",)),
    "CLASS": LayerKind(
        "Another Class",
        "Where another class is; inverted, where it is not",
        "POINTCLOUD_DATA",
        ClassDensity,
        by_hand=("name",),
    ),
    "CAMERA": LayerKind("Camera View", "What a camera sees", "CAMERA_DATA", CameraDensity, "camera_", ("camera",)),
}
# Settings of a layer itself that the sidebar has in a form of its own.
BY_HAND = ("density", "curve", "name")
# What inverts itself, where it is read.
_INVERT_THEMSELVES = ("IMAGE", "VERTEX_GROUP", "ATTRIBUTE")


def _curve_switched(layer: "ESH_PG_layer", _context: object) -> None:
    """Make the curve where it is asked for first."""
    if layer.use_curve and layer.curve is None:
        layer.curve = make_curve()


def _name_of_class(layer: "ESH_PG_layer") -> str:
    return layer.other_class.name if layer.other_class else ""


def _choose_class(layer: "ESH_PG_layer", name: str) -> None:
    other = scatter_of(layer).classes.get(name)
    layer.class_uid = other.uid if other else 0


def _other_classes(layer: "ESH_PG_layer", _context: object, _text: str) -> list[str]:
    """Name the classes that a layer can follow: not its own."""
    return [c.name for c in scatter_of(layer).classes if all(one != layer for one in c.layers)]


def _attributes(layer: "ESH_PG_layer", _context: object, _text: str) -> list[str]:
    """Name the attributes of the target that can be densities; those that Blender keeps to itself begin with a period."""
    target = scatter_of(layer).first_target
    if target is None or target.type != "MESH":
        return []
    return [a.name for a in target.data.attributes if a.data_type in NUMBERS and not a.name.startswith(".")]


@with_properties(DensityLayer, BY_HAND)
@with_properties(ImageDensity, KINDS["IMAGE"].by_hand, "image_")
@with_properties(SlopeDensity, (), "slope_")
@with_properties(AltitudeDensity, (), "altitude_")
@with_properties(FacingDensity, (), "facing_")
@with_properties(NoiseDensity, (), "noise_")
@with_properties(DistanceDensity, KINDS["DISTANCE"].by_hand, "distance_")
@with_properties(InsideDensity, KINDS["INSIDE"].by_hand, "inside_")
@with_properties(CameraDensity, KINDS["CAMERA"].by_hand, "camera_")
class ESH_PG_layer(PropertyGroup):
    """One layer of a density: what it reads, and how it acts on those above it."""

    KIND = "Layer"

    name: StringProperty(
        name="Name", description="Name of this layer. If it is empty, the layer is named after what it follows"
    )
    use: BoolProperty(name="Use", description="Whether this layer is used", default=True)
    kind: EnumProperty(
        name="Follow",
        description="What this layer reads",
        items=[(name, kind.label, kind.help, kind.icon, number) for number, (name, kind) in enumerate(KINDS.items())],
        default="IMAGE",
    )
    use_curve: BoolProperty(
        name="Curve",
        description="Remap the values of this layer with a curve: across the value that is read, up what it becomes",
        default=False,
        update=_curve_switched,
    )
    # Blender has no curve among properties: one lies in a node of a hidden node group.
    curve: PointerProperty(type=bpy.types.NodeTree, name="Curve", options={"HIDDEN"})
    image: PointerProperty(
        type=bpy.types.Image,
        name="Image",
        description="Density image: white means many, black means none. It is read at every point, however coarse the mesh is",
    )
    uv_map: StringProperty(
        name="UV Map",
        description="UV map of the target. If this is empty, the one that is active for rendering is used",
        update=keep_names_on_mesh,
    )
    vertex_group: StringProperty(
        name="Vertex Group",
        description="Vertex group of the target. Its weights are the density",
        update=keep_names_on_mesh,
    )
    # What groups or maps the targets had when the chosen one was last among them.
    names_on_mesh: StringProperty(options={"HIDDEN"})
    attribute: StringProperty(
        name="Attribute",
        description="Attribute of the target. Its values are the density and must be 0 or more",
        search=_attributes,
    )
    source_kind: EnumProperty(
        name="Source",
        description="Which objects or curves the layer follows",
        items=(
            ("OBJECT", "Object", "One object, for example a curve", "OBJECT_DATA", 0),
            ("COLLECTION", "Collection", "All objects of a collection", "OUTLINER_COLLECTION", 1),
        ),
        default="OBJECT",
    )
    source_object: PointerProperty(
        type=bpy.types.Object,
        name="Object",
        description="The object: a curve, a mesh, or the result of another scatter",
    )
    source_collection: PointerProperty(
        type=bpy.types.Collection, name="Collection", description="The collection whose objects are used"
    )
    class_uid: IntProperty(name="Class", options={"HIDDEN"})
    class_name: StringProperty(
        name="Class",
        description="The class whose density is used",
        get=_name_of_class,
        set=_choose_class,
        search=_other_classes,
        search_options={"SORT"},
    )
    camera: PointerProperty(
        type=bpy.types.Object,
        name="Camera",
        description="The camera. If this is empty, the camera of the scene is used",
        poll=lambda _self, candidate: candidate.type == "CAMERA",
    )

    @property
    def told(self) -> LayerKind:
        """What is known of its kind."""
        return KINDS[self.kind]

    @property
    def source(self) -> bpy.types.Object | bpy.types.Collection | None:
        """The object or collection that is looked at, or None while none is chosen."""
        return self.source_object if self.source_kind == "OBJECT" else self.source_collection

    @property
    def label(self) -> str:
        """Its name, or what it reads in a few words."""
        if self.name:
            return self.name
        found: Any = {
            "IMAGE": self.image.name if self.image else "",
            "VERTEX_GROUP": name_on_mesh(self, "vertex_group"),
            "ATTRIBUTE": self.attribute,
            "DISTANCE": f"Near {self.source.name}" if self.source else "",
            "INSIDE": f"Inside {self.source.name}" if self.source else "",
            "CLASS": self.other_class.name if self.other_class else "",
            "CAMERA": self.camera.name if self.camera else "",
        }.get(self.kind)
        return found or self.told.label

    @property
    def other_class(self) -> Any:
        """The class that it follows, or None."""
        uid = self.class_uid
        return next((c for c in scatter_of(self).classes if uid and c.uid == uid), None)

    def obstacle(self, target: bpy.types.Object, scene: bpy.types.Scene) -> str | None:
        """Return what it lacks, as the end of a sentence, or None."""
        kind = self.kind
        if kind == "IMAGE":
            return self._image_obstacle(target)
        if kind == "VERTEX_GROUP" and name_on_mesh(self, "vertex_group") not in target.vertex_groups:
            if not self.vertex_group:
                return f'choose a vertex group of "{target.name}"'
            return f'"{target.name}" has no vertex group "{self.vertex_group}"; choose another one'
        if kind == "ATTRIBUTE" and not self.attribute:
            return f'choose an attribute of "{target.name}"'
        if kind in ("DISTANCE", "INSIDE"):
            what = "an object" if self.source_kind == "OBJECT" else "a collection"
            near = "to be near" if kind == "DISTANCE" else "to be inside"
            if self.source is None:
                return f"choose {what} {near}"
            if text := self.gone(scene):
                return f"{text}; choose another object {near}"
            if self.source_kind == "COLLECTION" and not self.source.all_objects:
                return f'collection "{self.source.name}" is empty; add objects to it'
        if kind == "CLASS":
            other = self.other_class
            if other is None:
                return "choose the class that it follows"
            if other.mute:
                return f'it follows "{other.name}", which is muted'
        if kind == "CAMERA":
            if self.camera is None and scene.camera is None:
                return "choose a camera, or give the scene one"
            if text := self.gone(scene):
                return f"{text}; choose another camera"
        return None

    def gone(self, scene: bpy.types.Scene) -> str:
        """Say what has become of what it follows, as the beginning of a sentence; an empty text where that is there."""
        if self.kind == "CAMERA":
            return gone(self.camera or scene.camera)
        return gone(self.source) if self.kind in ("DISTANCE", "INSIDE") else ""

    def _image_obstacle(self, target: bpy.types.Object) -> str | None:
        from ..densities.image_pixels import only_shown

        if self.image is None:
            return "choose its density image"
        if why := only_shown(self.image):
            return f'"{self.image.name}" {why}'
        if self.image_mapping == "UV":
            if not target.data.uv_layers:
                return f'"{target.name}" has no UV map; add one, or choose From Above as its mapping'
            if self.uv_map and name_on_mesh(self, "uv_map") not in target.data.uv_layers:
                return f'"{target.name}" has no UV map "{self.uv_map}"; choose another one'
        return None

    def density(self) -> "Density":
        """Return what it reads as :func:`~esh.scatter` takes it."""
        kind = self.told
        # What was chosen for another mapping is kept, and does not count.
        uv_map = name_on_mesh(self, "uv_map") if self.image_mapping == "UV" else ""
        named: dict[str, dict[str, Any]] = {
            "IMAGE": {"image": self.image, "uv_map": uv_map, "invert": self.invert},
            "VERTEX_GROUP": {"name": name_on_mesh(self, "vertex_group"), "invert": self.invert},
            "ATTRIBUTE": {"name": self.attribute, "invert": self.invert},
            "DISTANCE": {"source": self.source},
            "INSIDE": {"source": self.source},
            "CAMERA": {"camera": self.camera},
        }
        values = named.get(self.kind, {})
        if self.kind == "CLASS":
            values = {"name": self.other_class.name}
        return kind.settings(**values, **values_from(self, kind.settings, kind.by_hand, kind.prefix))

    def as_argument(self) -> DensityLayer:
        """Return this layer as :func:`~esh.scatter` takes it."""
        values = values_from(self, DensityLayer, BY_HAND)
        if self.kind in _INVERT_THEMSELVES:
            values["invert"] = False
        curve = curve_points(self.curve) if self.use_curve and self.curve else None
        return DensityLayer(self.density(), curve=curve, name=self.name, **values)

    @property
    def is_plain(self) -> bool:
        """Whether a density of this layer alone is what the layer reads."""
        inverted = self.invert and self.kind not in _INVERT_THEMSELVES
        return self.strength == 1.0 and self.blend != "SUBTRACT" and not self.use_curve and not inverted

    @staticmethod
    def influential_of(name: str) -> tuple[str, ...]:
        """Return the names of the properties that count for a layer of a kind."""
        kind = KINDS[name]
        own: dict[str, tuple[str, ...]] = {
            "IMAGE": ("image", "uv_map"),
            "VERTEX_GROUP": ("vertex_group",),
            "ATTRIBUTE": ("attribute",),
            "DISTANCE": ("source_kind", "source_object", "source_collection"),
            "INSIDE": ("source_kind", "source_object", "source_collection"),
            "CLASS": ("class_uid",),
            "CAMERA": ("camera",),
        }
        shown = (shown.name for shown in shown_settings(kind.settings, kind.by_hand, kind.prefix))
        return (*own.get(name, ()), *shown, "blend", "strength", "invert")

    def curve_record(self) -> list[Any]:
        """Return what its curve says, as plain data; nothing where it has none."""
        return curve_record(self.curve) if self.use_curve and self.curve else []


CLASSES = (ESH_PG_layer,)
