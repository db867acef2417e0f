"""What the sidebar holds of a scatter's target: an object, or a collection of objects."""

# Properties are annotations that are calls, which Blender reads and mypy cannot.
# mypy: disable-error-code="valid-type"

import bpy
from bpy.props import EnumProperty, PointerProperty

from ..targets.in_scenes import is_in, is_in_layer
from ..targets.shown_instances import instead_of_instance, shown_by
from .gone import not_found

__all__ = ["WithTarget"]


class WithTarget:
    """Properties of a group that has a target."""

    target_kind: EnumProperty(
        name="Target Kind",
        description="What is scattered on",
        items=(
            ("OBJECT", "Object", "Scatter on one mesh", "OBJECT_DATA", 0),
            (
                "COLLECTION",
                "Collection",
                "Scatter on all meshes of a collection that are visible. Where they touch, they are one surface",
                "OUTLINER_COLLECTION",
                1,
            ),
        ),
        default="OBJECT",
    )
    target: PointerProperty(
        type=bpy.types.Object,
        name="Target",
        description="The mesh to scatter on. What is visible from above counts, unless the panel Surface says otherwise",
        poll=lambda _self, candidate: candidate.type == "MESH",
    )
    target_collection: PointerProperty(
        type=bpy.types.Collection,
        name="Target",
        description="The collection whose meshes are scattered on",
    )

    @property
    def chosen_target(self) -> bpy.types.Object | bpy.types.Collection | None:
        """The object or the collection, or None while none is chosen."""
        return self.target if self.target_kind == "OBJECT" else self.target_collection

    @property
    def targets(self) -> list[bpy.types.Object]:
        """The meshes that are scattered on, by name; empty while there is none."""
        from ..targets.target import is_result

        if self.target_kind == "OBJECT":
            return [self.target] if self.target is not None and self.target.type == "MESH" else []
        if self.target_collection is None:
            return []
        found = [item for item in self.target_collection.all_objects if item.type == "MESH" and not is_result(item)]
        return sorted(found, key=lambda item: item.name_full)

    def bare_targets(self) -> list[bpy.types.Object]:
        """Return the targets that are known to have no faces: what else is in their collection is scattered on."""
        from ..targets.top import lacks_faces

        return [item for item in self.targets if lacks_faces(item)]

    def targets_with_faces(self) -> list[bpy.types.Object]:
        """Return the targets that are scattered on, as far as is known; where some have no faces, hidden ones do not count."""
        from ..targets.target import is_shown_in

        bare, layer = self.bare_targets(), bpy.context.view_layer
        others = [item for item in self.targets if item not in bare]
        return [item for item in others if is_shown_in(layer, item)] if bare else others

    @property
    def first_target(self) -> bpy.types.Object | None:
        """The mesh whose UV maps, vertex groups and attributes there are to choose from, or None."""
        return next(iter(self.targets), None)

    def target_obstacle(self, scene: bpy.types.Scene) -> str | None:
        """Return what keeps the target from being scattered on, as one sentence that says what to do, or None."""
        if self.target_kind == "COLLECTION":
            if self.target_collection is None:
                return "Choose a collection: the meshes to scatter on"
            if not any(is_in(scene, item) for item in self.targets):
                return f'Collection "{self.target_collection.name}" has no mesh in this scene; choose another target'
            return self._hidden_obstacle(scene) or self._faces_obstacle()
        if self.target is None:
            return "Choose a target: the mesh to scatter on"
        if text := not_found(self.target):
            return f"{text}; choose another target"
        if self.target.type != "MESH":
            return f'"{self.target.name}" is not a mesh; choose a mesh as the target'
        if not is_in(scene, self.target):
            if shown := shown_by(self.target, scene):
                return instead_of_instance(shown)
            return f'"{self.target.name}" is no longer in this scene; choose another target'
        return self._hidden_obstacle(scene) or self._faces_obstacle()

    def _hidden_obstacle(self, scene: bpy.types.Scene) -> str | None:
        """Return that nothing of the target is shown, so that Blender does not evaluate it, as one sentence, or None."""
        from ..targets.target import is_shown_in

        layer = bpy.context.view_layer
        # What the view layers of other scenes show may be out of date.
        if layer is None or scene != bpy.context.scene or any(is_shown_in(layer, item) for item in self.targets):
            return None
        if self.target_kind == "COLLECTION":
            return f'No mesh of collection "{self.target_collection.name}" is visible; show one to scatter on it'
        if is_in_layer(layer, self.target):
            return f'"{self.target.name}" is hidden; make it visible to scatter on it'
        return (
            f'"{self.target.name}" is excluded from view layer "{layer.name}"; include its collection to scatter on it'
        )

    def _faces_obstacle(self) -> str | None:
        """Return that there is nothing to stand on, as one sentence that says what to do, or None."""
        bare = next(iter(self.bare_targets()), None)
        if bare is None:
            return None
        if self.target_kind == "COLLECTION":
            if self.targets_with_faces():
                return None
            return f'No visible mesh of collection "{self.target_collection.name}" has faces to stand on; choose another target'
        if any(modifier.type == "NODES" for modifier in bare.modifiers):
            return f'"{bare.name}" has no faces to stand on; Realize Instances, in its geometry nodes, gives it those of instances'
        return f'"{bare.name}" has no faces to stand on; choose another target'
