"""Show on Target: the density of the selected class as colors over the target, and on a whole surface where its objects point up.

While it is on, a timer reads what the density is made of and looks whether it says something new, at most a sixth of the time; so
strokes, moved objects and sculpted ground are seen, too. While it is off, nothing runs.
"""

from __future__ import annotations

import time
from typing import Any, NamedTuple

import bpy
import numpy as np
from bpy.props import BoolProperty

from ...engine.errors import EshError
from ...engine.geometry.morton_order import morton_order
from ...engine.problem.scatter_settings import TargetSettings
from ..densities.density_stack import ClassDensity, DensityLayer, DensityStack
from ..properties.described import values_from
from ..properties.in_english import CONTEXT
from ..result.local_views import shows_any
from ..result.refused import as_sentence
from ..solving import running
from ..solving.redrawing import redraw_viewports
from ..targets.references import Reference

__all__ = ["Colors", "attach", "density_colors", "detach", "message"]

# Cells along the longer side of what is shown.
RESOLUTION = 256
# Seconds between two looks at least, and how many times as long as a look takes.
SHORTEST_PAUSE = 0.15
PAUSE = 5.0
# How far above the ground colors are drawn, as a share of its extent.
LIFT = 0.002
# Neighboring cells that differ in height by more than so many cells are two floors, with nothing between them.
LARGEST_STEP = 12.0
# From none to many: the colors of "viridis" (S. van der Walt and N. Smith, 2015), which everybody can tell apart.
RAMP = np.array(
    [(0.267, 0.005, 0.329), (0.229, 0.322, 0.546), (0.128, 0.567, 0.551), (0.369, 0.789, 0.383), (0.993, 0.906, 0.144)]
)
OPACITY = 0.85
# How many needles show where up is, about, their length as a share of the extent, and their color, which no density has.
NEEDLES, NEEDLE = 400, 0.04
NEEDLE_COLOR = (1.0, 0.25, 0.2, 1.0)
# Where the density is below this share of its largest, there are none.
FEWEST = 0.02


class Colors(NamedTuple):
    """What is drawn.

    Attributes:
        position: Corners in the world [m], shape ``[n, 3]``, float32.
        color: Of the corners, red to alpha, shape ``[n, 4]``, float32.
        triangle: Corners of triangles, shape ``[t, 3]``, int32.
        needle: Ends of lines along which objects stand, two by two [m], shape ``[2 m, 3]``, float32; none seen from above.
    """

    position: np.ndarray
    color: np.ndarray
    triangle: np.ndarray
    needle: np.ndarray


class _Preview:
    """What is shown now; ``colors`` is None where there is nothing to show, and ``message`` says why."""

    def __init__(self) -> None:
        from ..classes.survey import Survey

        self.survey = Survey(RESOLUTION)
        self.colors: Colors | None = None
        self.message = ""
        self.content: Any = None
        # What the colors lie on.
        self.ground: list[Reference] = []
        self.batches: tuple[Any, ...] = ()
        self.handler = bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_VIEW")

    def refresh(self) -> None:
        """Look whether the density says something new."""
        colors_before, message_before = self.colors, self.message
        try:
            content, colors = density_colors(bpy.context, self.survey, self.content)
            if colors is not None or content is None:
                self.colors, self.batches = colors, ()
            scatter = bpy.context.scene.esh_scatter.active
            self.ground = [Reference(item, "target") for item in scatter.targets] if scatter else []
            self.content, self.message = content, ""
        except EshError as error:
            self.colors, self.content, self.message = None, None, as_sentence(error)
        if self.colors is not colors_before or self.message != message_before:
            redraw_viewports()

    def close(self) -> None:
        """Draw nothing any more."""
        bpy.types.SpaceView3D.draw_handler_remove(self.handler, "WINDOW")
        redraw_viewports()


_preview: _Preview | None = None


def message() -> str:
    """Return why nothing is shown, as a sentence; empty where something is, or where nothing is asked for."""
    return _preview.message if _preview else ""


def density_colors(context: bpy.types.Context, survey: Any, known: Any = None) -> tuple[Any, Colors | None]:
    """Return the density of the selected class as colors over its target.

    Args:
        context: Whose scene.
        survey: A :class:`~esh.esh_scatter.classes.survey.Survey`, which keeps what does not change.
        known: What is shown already, as the last call returned it.

    Returns:
        What is shown, in short, and the colors; None for the colors where that is what is known, None for both where there is
        nothing to show.

    Raises:
        ProblemError: Something that the density needs is missing, or it is 0 everywhere.
    """
    from ..densities.density_source import DensityReader, attribute_names
    from ..densities.image_density import stored_density
    from ..targets.targets import check_targets, read_targets

    scatter = context.scene.esh_scatter.active
    body_class = scatter.active_class if scatter else None
    if body_class is None or scatter.first_target is None:
        return None, None
    target = scatter.first_target
    objects, _ = check_targets(scatter.chosen_target, context)
    settings = TargetSettings(**values_from(scatter, TargetSettings))
    densities: dict[str, Any] = {}
    reads: dict = {}
    wanted = [body_class]
    while wanted:
        one = wanted.pop()
        if one.name in densities or any(layer.use and layer.obstacle(target, context.scene) for layer in one.layers):
            continue
        densities[one.name] = stored_density(one.density(), f'density of class "{one.name}"', reads)
        wanted += [c for name in _followed(densities[one.name]) if (c := scatter.classes.get(name)) is not None]
    if body_class.name not in densities:
        return None, None
    names: set[str] = set().union(*(attribute_names(density) for density in densities.values()))
    chart = survey.begin(read_targets(objects, context, names, settings), settings)
    reader = DensityReader(chart.points, densities)
    align = body_class.align_to_normal
    content = survey.shape, align, reader.content(body_class.name)
    if content == known:
        return content, None
    return content, _colors(chart, reader.class_density(body_class.name), reader.normal, align)


def _followed(density: Any) -> list[str]:
    """Return the classes whose densities a density reads."""
    if isinstance(density, ClassDensity):
        return [density.name]
    if isinstance(density, DensityLayer):
        return _followed(density.density)
    return [n for layer in density.layers for n in _followed(layer)] if isinstance(density, DensityStack) else []


def _colors(chart: Any, values: np.ndarray, normal: np.ndarray, align: float) -> Colors:
    whole = hasattr(chart, "pieces")
    extent = float((chart.high - chart.low).max() if whole else chart.size.max())
    position = chart.points.position + LIFT * extent * normal
    share = np.clip(values / max(1.0, float(values.max(initial=0.0))), 0.0, 1.0)
    along = np.linspace(0.0, 1.0, len(RAMP))
    color = np.column_stack([*(np.interp(share, along, channel) for channel in RAMP.T), np.full(len(share), OPACITY)])
    triangle = chart.pieces() if whole else _cells(chart, position)
    # Blender's buffers take them as they lie in memory.
    needle = _needles(position, normal, align, NEEDLE * extent, share) if whole else np.empty((0, 3))
    position, color, needle = (np.ascontiguousarray(values, np.float32) for values in (position, color, needle))
    return Colors(position, color, np.ascontiguousarray(triangle, np.int32), needle)


def _needles(position: np.ndarray, normal: np.ndarray, align: float, length: float, share: np.ndarray) -> np.ndarray:
    """Return lines along which objects stand that are aligned so far to the normals, spread over the points, shape ``[2 m, 3]``."""
    from ...engine.surface.instances import body_rotations, rotate

    chosen = morton_order(position)[:: max(1, len(position) // NEEDLES)]
    chosen = chosen[share[chosen] > FEWEST]
    upright = body_rotations(normal[chosen].astype(np.float64), align, np.zeros(len(chosen)))
    up = rotate(upright, np.broadcast_to([0.0, 0.0, 1.0], (len(chosen), 3)))
    return np.stack([position[chosen], position[chosen] + length * up], axis=1).reshape(-1, 3)


def _cells(chart: Any, position: np.ndarray) -> np.ndarray:
    """Return triangles between neighboring cells of a chart, shape ``[t, 3]``."""
    number = np.full(chart.shape, -1)
    there = chart.area > 0.0
    number[there] = np.arange(len(position))
    corner = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    quad = np.stack([one.ravel() for one in corner], axis=1)
    quad = quad[(quad >= 0).all(axis=1)]
    height = position[quad, 2]
    quad = quad[np.ptp(height, axis=1) <= LARGEST_STEP * float(chart.cell.max())]
    return np.concatenate([quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]])


def _switched(_manager: object, _context: object) -> None:
    """Begin to show, or show no more."""
    global _preview
    wanted = bpy.context.window_manager.esh_scatter_show_density
    if wanted and _preview is None:
        _preview = _Preview()
        if not bpy.app.timers.is_registered(_look):
            bpy.app.timers.register(_look, persistent=True)
    elif not wanted and _preview is not None:
        _preview.close()
        _preview = None


def _look() -> float | None:
    """Look again, and say after how many seconds the next time is; None ends it."""
    if _preview is None:
        return None
    if not bpy.context.window_manager.esh_scatter_show_density:
        # Another file was opened.
        _switched(None, None)
        return None
    start = time.perf_counter()
    if running.session is None and bpy.context.mode != "EDIT_MESH":
        _preview.refresh()
    return max(SHORTEST_PAUSE, PAUSE * (time.perf_counter() - start))


def _draw() -> None:
    """Draw the colors; Blender calls it for every viewport."""
    if _preview is None or _preview.colors is None or not shows_any(_preview.ground, bpy.context):
        return
    import gpu
    from gpu_extras.batch import batch_for_shader

    ground, lines = gpu.shader.from_builtin("SMOOTH_COLOR"), gpu.shader.from_builtin("UNIFORM_COLOR")
    if not _preview.batches:
        colors = _preview.colors
        corners = {"pos": colors.position, "color": colors.color}
        batches = [batch_for_shader(ground, "TRIS", corners, indices=colors.triangle)]
        # Blender makes no buffer of nothing.
        if len(colors.needle):
            batches.append(batch_for_shader(lines, "LINES", {"pos": colors.needle}))
        _preview.batches = tuple(batches)
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_test_set("LESS_EQUAL")
    _preview.batches[0].draw(ground)
    for needles in _preview.batches[1:]:
        lines.uniform_float("color", NEEDLE_COLOR)
        needles.draw(lines)
    gpu.state.depth_test_set("NONE")
    gpu.state.blend_set("NONE")


def attach() -> None:
    """Add the switch."""
    bpy.types.WindowManager.esh_scatter_show_density = BoolProperty(
        name="Show on Target",
        description="Show the density of the selected class as colors on the target: dark means none, yellow means many",
        default=False,
        options={"SKIP_SAVE"},
        translation_context=CONTEXT,
        update=_switched,
    )


def detach() -> None:
    """Show nothing any more, and take the switch away."""
    global _preview
    if _preview is not None:
        _preview.close()
        _preview = None
    if bpy.app.timers.is_registered(_look):
        bpy.app.timers.unregister(_look)
    if hasattr(bpy.types.WindowManager, "esh_scatter_show_density"):
        del bpy.types.WindowManager.esh_scatter_show_density
