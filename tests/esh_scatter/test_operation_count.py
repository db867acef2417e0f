"""What Blender's side does in Python takes as many operations for many vertices, pixels and bodies as for few: none is looped over."""

import sys

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh.engine.problem.placement import Placement  # noqa: E402
from esh.engine.problem.report import Report  # noqa: E402
from esh.esh_scatter.api import (  # noqa: E402
    AttributeDensity,
    ImageDensity,
    ScatterClass,
    ScatterJob,
    ScatterSize,
    VertexGroupDensity,
)
from esh.esh_scatter.classes import lent_survey  # noqa: E402

NOT_MEASURED = Report(0, False, 0.0, "", 0.0, None, 0, 0.0, ())


def operations(run):
    """Return what ``run()`` returns, and how many Python instructions and calls into compiled code that took."""
    count = 0

    def trace(frame, event, _):
        nonlocal count
        frame.f_trace_lines, frame.f_trace_opcodes = False, True
        count += event == "opcode"
        return trace

    def profile(_frame, event, _):
        nonlocal count
        count += event == "c_call"

    before = sys.gettrace(), sys.getprofile()
    sys.settrace(trace)
    sys.setprofile(profile)
    try:
        result = run()
    finally:
        sys.settrace(before[0])
        sys.setprofile(before[1])
    return result, count


def ground(side):
    """A hilly triangle, so that some of its bounding rectangle is beside it, of about ``side``² / 2 quads."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=side, y_subdivisions=side, size=20.0)
    item = bpy.context.object
    position = np.empty((len(item.data.vertices), 3), np.float32)
    item.data.vertices.foreach_get("co", position.ravel())
    position[:, 1] *= 0.05 * (position[:, 0] + 10.0)
    position[:, 2] = np.sin(position[:, 0])
    item.data.vertices.foreach_set("co", position.ravel())
    soil = item.data.attributes.new("soil", "FLOAT_COLOR", "FACE")
    soil.data.foreach_set("color", np.ones(4 * len(item.data.polygons), np.float32))
    item.vertex_groups.new(name="meadow").add(list(range(len(position) // 2)), 0.5, "REPLACE")
    return item


def image(pixels):
    made = bpy.data.images.new("forest", pixels, pixels)
    made.pixels.foreach_set(np.ones(4 * pixels * pixels, np.float32))
    return made


def source(width):
    mesh = bpy.data.meshes.new("source")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (1, width, 0), (0, width, 0)], [], [(0, 1, 2, 3)])
    item = bpy.data.objects.new("source", mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


def reading_and_writing(side, pixels, bodies):
    """Operations of both for a target of so many vertices along a side, a texture and so many bodies."""
    bpy.ops.wm.read_homefile(use_empty=True)
    lent_survey.detach()
    target, round_one, long_one = ground(side), source(1.0), source(0.1)
    densities = ImageDensity(image(pixels), mapping="UV"), VertexGroupDensity("meadow"), AttributeDensity("soil")
    classes = [
        ScatterClass(
            str(number),
            [
                ScatterSize("dot", bodies, round_one, area=(0.001, 0.002)),
                ScatterSize("line", bodies, long_one, area=0.001),
            ],
            density,
        )
        for number, density in enumerate(densities)
    ]
    job, reading = operations(lambda: ScatterJob(target, classes, device="cpu"))
    problem = job.problem
    zero = np.zeros(problem.body_count)
    # Everywhere in the rectangle, also where rays pass the mesh by.
    position = np.random.default_rng(0).random((problem.body_count, 2)) * problem.domain.size
    job.placement = Placement(problem, position, *problem.body_indices(), zero, zero, zero, NOT_MEASURED)
    result, writing = operations(job.write)
    assert len(result.object.data.vertices) == 6 * bodies
    return reading, writing


def test_no_vertex_pixel_or_body_is_looped_over():
    reading_and_writing(20, 16, 1000)
    few, many = reading_and_writing(20, 16, 1000), reading_and_writing(200, 160, 10_000)
    # Ten times as many: a loop would be seen, a few launches on a second thread are not meant.
    np.testing.assert_allclose(many, few, rtol=0.3)


def test_what_is_written_was_worked_out_where_the_window_does_not_wait(monkeypatch):
    """The values of 100,000 points took a third of the time that the window stood still at the end of a run."""
    bpy.ops.wm.read_homefile(use_empty=True)
    job = ScatterJob(ground(10), [ScatterClass("a", [ScatterSize("a", 30, source(1.0))])], device="cpu", max_steps=3)
    job.solve()
    worked_out = []
    for name in ("point_attributes", "result_points"):
        monkeypatch.setattr(sys.modules[ScatterJob.__module__], name, lambda *_, name=name: worked_out.append(name))
    assert len(job.write().object.data.vertices) == 30 and not worked_out
