"""Bodies on their way, drawn over the viewport as points: nothing in the file changes until they have arrived."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np

from ..result.local_views import shows_any
from ..targets.references import Reference
from .redrawing import redraw_viewports

if TYPE_CHECKING:
    from ...engine.solver.progress import Progress
    from .job import ScatterJob

__all__ = ["MovingBodies"]

# Bodies are drawn so often in a second, and so many of them, at most.
MOST_PER_SECOND, MOST_DRAWN = 15.0, 50_000
# Size of a point [pixels]: this over the square root of their number, within limits, so that many do not cover the ground.
POINT_SIZE, SMALLEST_POINT, LARGEST_POINT = 300.0, 2.0, 7.0
# How far above the surface points are drawn, as a share of its extent.
HEIGHT = 0.002


class MovingBodies:
    """What the viewport shows of a run.

    Args:
        job: Which run.
    """

    def __init__(self, job: ScatterJob) -> None:
        self._job = job
        self._ground = [Reference(item, "target") for item in getattr(job, "ground", ())]
        self._seen = 0.0
        self._colors: np.ndarray | None = None
        self._batch: Any = None
        self._drawn: np.ndarray | None = None
        self._handle: Any = None
        # Points in the world [m], shape [n, 3]: made by the solver's thread, drawn by the main one.
        self.points: np.ndarray | None = None

    def see(self, progress: Progress) -> None:
        """Look where bodies are; called by the solver's thread after every step."""
        now = time.monotonic()
        if now - self._seen < 1.0 / MOST_PER_SECOND:
            return
        # It is a copy, made when it is asked for.
        position = getattr(progress, "position", None)
        if position is not None:
            self._seen = now
            chosen = slice(None, None, -(-len(position) // MOST_DRAWN) or 1)
            if self._colors is None:
                self._colors = self._job.colors_of_bodies()[chosen]
            self.points = self._job.positions_in_world(position[chosen], HEIGHT)

    def show(self) -> bool:
        """Have the viewports drawn where something has moved, and tell whether it has; on the main thread."""
        if self.points is self._drawn or bpy.app.background:
            return False
        if self._handle is None:
            self._handle = bpy.types.SpaceView3D.draw_handler_add(self._draw, (), "WINDOW", "POST_VIEW")
        redraw_viewports()
        return True

    def end(self) -> None:
        """Show nothing any more."""
        if self._handle is not None:
            bpy.types.SpaceView3D.draw_handler_remove(self._handle, "WINDOW")
            self._handle = None
            redraw_viewports()

    def _draw(self) -> None:
        import gpu
        from gpu_extras.batch import batch_for_shader

        points, colors = self.points, self._colors
        if points is None or colors is None or not shows_any(self._ground, bpy.context):
            return
        shader = gpu.shader.from_builtin("POINT_FLAT_COLOR")
        if self._drawn is not points:
            self._batch = batch_for_shader(
                shader, "POINTS", {"pos": np.ascontiguousarray(points, np.float32), "color": colors}
            )
            self._drawn = points
        gpu.state.depth_test_set("LESS_EQUAL")
        size = min(max(POINT_SIZE / len(points) ** 0.5, SMALLEST_POINT), LARGEST_POINT)
        gpu.state.point_size_set(size * bpy.context.preferences.system.pixel_size)
        self._batch.draw(shader)
        gpu.state.depth_test_set("NONE")
