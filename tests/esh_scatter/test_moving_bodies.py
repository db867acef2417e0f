"""What the viewport shows of a run: where bodies are by now, not too often and not too many."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh.esh_scatter.api import ScatterClass, ScatterJob, ScatterSize  # noqa: E402
from esh.esh_scatter.solving import moving_bodies  # noqa: E402
from esh.esh_scatter.solving.moving_bodies import MovingBodies  # noqa: E402


@pytest.fixture
def job():
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.mesh.primitive_cube_add(size=0.2, location=(50, 0, 0))
    tree = bpy.context.object
    bpy.ops.mesh.primitive_grid_add(size=20, x_subdivisions=40, y_subdivisions=40, location=(7, -3, 0))
    ground = bpy.context.object
    for vertex in ground.data.vertices:
        vertex.co.z = 0.3 * vertex.co.x
    classes = [
        ScatterClass("red", [ScatterSize("s", 30, tree)], color=(1, 0, 0)),
        ScatterClass("blue", [ScatterSize("s", 20, tree)], color=(0, 0, 1)),
    ]
    return ScatterJob(ground, classes, device="cpu", max_steps=8)


def test_bodies_are_seen_on_the_surface_in_the_colors_of_their_classes(job, monkeypatch):
    monkeypatch.setattr(moving_bodies, "MOST_PER_SECOND", 1e9)
    bodies, at_step = MovingBodies(job), {}

    def progress(now):
        bodies.see(now)
        # Of few bodies, starts are tried before the first step; on a slow machine the last step is told of again.
        if now.step:
            at_step[now.step] = bodies.points.copy()

    job.solve(progress)
    seen = list(at_step.values())
    assert len(seen) == 8 and all(points.shape == (50, 3) for points in seen)
    assert np.abs(seen[1] - seen[0]).max() > 0.0, "they move"
    end = job.chart.surface_points(job.placement.position).position
    assert np.abs(seen[-1][:, :2] - end[:, :2]).max() < 2.0
    slope = 0.3 * (seen[-1][:, 0] - 7.0)
    assert np.abs(seen[-1][:, 2] - slope).max() < 0.002 * 25.0 + 0.3 * 20.0 / 1024.0
    assert bodies._colors[:30, 0].tolist() == [1.0] * 30 and bodies._colors[30:, 2].tolist() == [1.0] * 20


def test_they_are_looked_at_fifteen_times_a_second_and_not_all_of_very_many(job, monkeypatch):
    clock, asked = [0.0], []
    monkeypatch.setattr(moving_bodies.time, "monotonic", lambda: clock[0])
    monkeypatch.setattr(moving_bodies, "MOST_DRAWN", 20)

    class Progress:
        @property
        def position(self):
            asked.append(clock[0])
            return np.full((50, 2), 5.0)

    bodies = MovingBodies(job)
    for number in range(1, 201):
        clock[0] = 100.0 + 0.01 * number
        bodies.see(Progress())
    assert 25 <= len(asked) <= 30 and len(bodies.points) == len(bodies._colors) == 17
    bodies.show()
    bodies.end()
