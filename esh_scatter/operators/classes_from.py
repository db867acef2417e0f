"""Classes made from what is there: the inks of an image, the selected objects, the objects of a collection."""

# Blender shows an operator's docstring as its tooltip and ends it with a period of its own.
# ruff: noqa: D415

# Properties are annotations that are calls, which Blender reads and mypy cannot.
# mypy: disable-error-code="valid-type"

from collections.abc import Iterable, Sequence

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty, StringProperty

from ...engine.errors import EshError
from ...engine.problem.ink_models import DEFAULT_MODEL, INK_MODELS
from ...engine.problem.scatter_settings import TargetSettings
from ..densities.image_pixels import any_image
from ..properties.described import values_from
from ..properties.scene import active_scatter, selected_scatter
from ..result.scene_units import sentence
from .edit import Edit, warn_of_unplaced

__all__ = ["CLASSES", "ClassesFromObjects"]


class ESH_OT_classes_from_image(Edit):
    """Split a color image into inks. Each ink becomes a class of colored dots with its own density"""

    bl_idname = "esh.classes_from_image"
    bl_label = "Classes from Image"

    image: StringProperty(name="Image", description="Color image. It is stretched over the target, seen from above")
    model: EnumProperty(
        name="Inks",
        description="Which inks the image is split into",
        items=[(name, name, f"Use the inks {name}") for name in INK_MODELS],
        default=DEFAULT_MODEL,
    )
    dots: IntProperty(
        name="Dots",
        description="How many dots a black image would get. The area of a dot follows from this number",
        default=20_000,
        min=10,
        soft_max=200_000,
    )
    filepath: StringProperty(
        name="File", description="A file to open the image from", subtype="FILE_PATH", options={"SKIP_SAVE"}
    )
    # What the file dialog shows.
    filter_image: BoolProperty(default=True, options={"HIDDEN", "SKIP_SAVE"})
    filter_folder: BoolProperty(default=True, options={"HIDDEN", "SKIP_SAVE"})

    @staticmethod
    def _needs(context: bpy.types.Context) -> object:
        scatter = active_scatter(context)
        return (scatter and scatter.targets) or None

    _missing = "Choose a target first"

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        """Ask for image and inks; where there is no image yet, for its file."""
        if bpy.data.images.get(self.image) is None:
            found = any_image()
            self.image = found.name if found is not None else ""
        if not self.image:
            context.window_manager.fileselect_add(self)
            return {"RUNNING_MODAL"}
        return context.window_manager.invoke_props_dialog(self, width=320)

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the dialog, or the settings beside the files."""
        layout = self.layout
        layout.use_property_split = True
        if context.area is None or context.area.type != "FILE_BROWSER":
            layout.prop_search(self, "image", bpy.data, "images")
        layout.prop(self, "model")
        layout.prop(self, "dots")

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add the classes."""
        from ...engine.surface.chart import Chart
        from ..classes.inks import add_ink_classes
        from ..targets.targets import check_targets, read_targets

        scatter = selected_scatter(context)
        if self.filepath and not self.image:
            try:
                self.image = bpy.data.images.load(self.filepath, check_existing=True).name
            except RuntimeError:
                self.report({"ERROR"}, f'"{self.filepath}" cannot be read as an image')
                return {"CANCELLED"}
        image = bpy.data.images.get(self.image)
        if image is None:
            self.report({"ERROR"}, f'There is no image "{self.image}". Open one first')
            return {"CANCELLED"}
        try:
            objects, _ = check_targets(scatter.chosen_target, context)
            chart = Chart(read_targets(objects, context, set(), TargetSettings(**values_from(scatter, TargetSettings))))
            count = add_ink_classes(scatter, image, self.model, self.dots, chart)
        except EshError as error:
            self.report({"ERROR"}, sentence(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"Added {count} classes, one for each ink of {self.model}")
        return {"FINISHED"}


class ClassesFromObjects(Edit):
    """Base of what adds a class for each of some objects."""

    count: IntProperty(
        name="Count", description="How many of each object to place", default=100, min=1, soft_max=100_000
    )

    def _add_families(self, context: bpy.types.Context, candidates: Iterable[bpy.types.Object]) -> set[str]:
        """Add a class for each of some objects, with what hangs on it."""
        from ..editing.families import as_placed, heads_in

        targets = selected_scatter(context).targets
        candidates = list(candidates)
        heads = heads_in(candidates, targets)
        warn_of_unplaced(self, candidates, heads)
        return self._add(context, as_placed(heads, targets))

    def _add(self, context: bpy.types.Context, items: Sequence[bpy.types.Object | bpy.types.Collection]) -> set[str]:
        from ..editing.left_out import nothing_left, told
        from ..editing.selection import add_classes, measure

        scatter = selected_scatter(context)
        measured, left_out = measure(items, context)
        add_classes(scatter, measured, [self.count] * len(measured))
        if not measured:
            self.report({"ERROR"}, nothing_left(left_out))
            return {"CANCELLED"}
        for text in told(left_out):
            self.report({"WARNING"}, text)
        return {"FINISHED"}


class ESH_OT_classes_from_selection(ClassesFromObjects):
    """Add a class for each selected object, named after it"""

    bl_idname = "esh.classes_from_selection"
    bl_label = "Classes from Selection"

    @staticmethod
    def _needs(context: bpy.types.Context) -> object:
        from ..editing.families import heads_in

        scatter = active_scatter(context)
        return (scatter and heads_in(context.selected_objects, scatter.targets)) or None

    _missing = "Select objects to place, other than the target"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add them."""
        return self._add_families(context, context.selected_objects)


class ESH_OT_classes_from_collection(ClassesFromObjects):
    """Add a class for each object of a collection, named after it"""

    bl_idname = "esh.classes_from_collection"
    bl_label = "Classes from Collection"

    collection: StringProperty(name="Collection", description="Each of its objects becomes a class")

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        """Ask for the collection."""
        if not self.collection and context.collection != context.scene.collection:
            self.collection = context.collection.name
        return context.window_manager.invoke_props_dialog(self, width=280)

    def draw(self, _context: bpy.types.Context) -> None:
        """Draw the dialog."""
        layout = self.layout
        layout.use_property_split = True
        layout.prop_search(self, "collection", bpy.data, "collections")
        layout.prop(self, "count")

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add them."""
        collection = bpy.data.collections.get(self.collection)
        if collection is None:
            self.report({"ERROR"}, f'There is no collection "{self.collection}"')
            return {"CANCELLED"}
        return self._add_families(context, collection.all_objects)


CLASSES = (
    ESH_OT_classes_from_image,
    ESH_OT_classes_from_selection,
    ESH_OT_classes_from_collection,
)
