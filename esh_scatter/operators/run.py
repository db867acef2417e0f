"""The button that runs the scatter shown in the sidebar."""

# Blender shows an operator's docstring as its tooltip and ends it with a period of its own.
# ruff: noqa: D415

# Properties are annotations that are calls, which Blender reads and mypy cannot.
# mypy: disable-error-code="valid-type"

import bpy
from bpy.props import FloatProperty

from ...engine.problem.scatter_settings import ScatterSettings
from ...engine.problem.settings import settings_of
from ..editing.forecast import scale_counts
from ..properties.described import property_of
from ..properties.scatter import ESH_PG_scatter
from ..properties.scene import active_scatter, selected_scatter
from .edit import settings_editable
from .run_operator import MODES, RunOperator

__all__ = ["CLASSES", "ESH_OT_scatter"]

_SETTINGS = settings_of(ScatterSettings)


class ESH_OT_scatter(RunOperator):
    """Place all classes and sizes. Counts are exact. Esc stops the run and leaves the scene as it is"""

    bl_idname = "esh.scatter"
    bl_label = "Scatter"

    amount: FloatProperty(
        name="Amount",
        description="Factor on how many objects the classes have",
        default=1.0,
        min=0.001,
        max=1000.0,
        soft_min=0.1,
        soft_max=4.0,
        options={"SKIP_SAVE"},
    )
    seed: property_of(_SETTINGS["seed"], options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Say in the button's tooltip why it is gray."""
        if not settings_editable(cls, context):
            return False
        scatter = active_scatter(context)
        obstacle = scatter.obstacle(context.scene) if scatter else "Add a scatter first"
        if context.mode not in MODES:
            obstacle = "Switch to Object Mode first"
        if obstacle:
            cls.poll_message_set(obstacle)
        return not obstacle

    def draw(self, _context: bpy.types.Context) -> None:
        """Draw the panel of the last operation: the same again, with more or fewer, or otherwise."""
        layout = self.layout
        layout.use_property_split = True
        for name in ("amount", "seed"):
            layout.prop(self, name)

    def _settings(self, context: bpy.types.Context) -> ESH_PG_scatter | None:
        scatter = selected_scatter(context)
        if not self.properties.is_property_set("seed"):
            # The panel of the last operation begins with it.
            self.seed = scatter.seed
        self._before = scale_counts(scatter.ready_classes(), self.amount)
        if scatter.seed != self.seed:
            self._before.append((scatter, "seed", scatter.seed))
            scatter.seed = self.seed
        return scatter

    def _undo(self, _context: bpy.types.Context) -> None:
        for group, name, value in self._before:
            setattr(group, name, value)


CLASSES = (ESH_OT_scatter,)
