"""What the sidebar holds of a scene: its scatters, and which of them is shown."""

# Properties are annotations that are calls, which Blender reads and mypy cannot.
# mypy: disable-error-code="valid-type"

from itertools import count

import bpy
from bpy.props import CollectionProperty, IntProperty, PointerProperty
from bpy.types import PropertyGroup

from ..versions import VERSION
from .body_class import ESH_PG_class
from .entries import entry_at
from .scatter import ESH_PG_scatter

__all__ = ["CLASSES", "ESH_PG_scene", "active_scatter", "attach", "detach", "selected_class", "selected_scatter"]


class ESH_PG_scene(PropertyGroup):
    """Every scatter of one scene; of a result, the one that has made it."""

    version: IntProperty(options={"HIDDEN"})
    scatters: CollectionProperty(type=ESH_PG_scatter)
    scatter_index: IntProperty(name="Selected Scatter", description="The scatter that is shown below the list")

    @property
    def active(self) -> ESH_PG_scatter | None:
        """The selected scatter, or None."""
        return entry_at(self.scatters, self.scatter_index)

    def add_scatter(self, target: bpy.types.Object | bpy.types.Collection | None) -> ESH_PG_scatter:
        """Append a scatter on ``target``, select it and return it."""
        if not self.scatters:
            # Nothing is there yet that an older version could have made.
            self.version = VERSION
        seeds = {scatter.seed for scatter in self.scatters}
        scatter = self.scatters.add()
        # Two scatters of the same settings are not to stand in the same places.
        scatter.seed = next(seed for seed in count() if seed not in seeds)
        if isinstance(target, bpy.types.Collection):
            scatter.target_kind, scatter.target_collection = "COLLECTION", target
        else:
            scatter.target = target
        # It gets a number where it is taken.
        scatter.name = f"{target.name} Scatter" if target else "Scatter"
        self.scatter_index = len(self.scatters) - 1
        return scatter


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
    """Give every scene its settings, and results those that they were made with."""
    bpy.types.Scene.esh_scatter = PointerProperty(type=ESH_PG_scene, name="ESH Scatter")
    # Before Blender 5.0 it lies beside custom properties, of which a result has one of the other name.
    bpy.types.Object.esh_made_with = PointerProperty(type=ESH_PG_scene, name="ESH Scatter")


def detach() -> None:
    """Take the settings' definition away again; what a file holds stays in it."""
    # On leaving Python, Blender may have taken it away itself.
    for kind, name in ((bpy.types.Scene, "esh_scatter"), (bpy.types.Object, "esh_made_with")):
        if hasattr(kind, name):
            delattr(kind, name)


CLASSES = (ESH_PG_scene,)
