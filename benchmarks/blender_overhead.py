"""What Blender's side adds to the solver: reading the target and its densities, the chart, and writing the result.

    python benchmarks/blender_overhead.py --bodies 100000 1000000 [--solve 100000]

Prints a Markdown table of medians. Needs pip's bpy. The target has 490,000 vertices; one class follows a texture of 2048² pixels,
one a vertex group, one an attribute. The solver does not run: bodies stay where it would start them. With --solve it does, once
more for so many bodies, to be compared with everything else.
"""

from __future__ import annotations

import argparse
import cProfile
import pstats
import statistics
import time
from pathlib import Path

import bpy
import numpy as np
from esh.engine.descent.initial_placement import initial_placement
from esh.engine.problem.placement import Placement
from esh.engine.problem.problem import Problem
from esh.engine.problem.report import Report
from esh.esh_scatter.api import (
    AttributeDensity,
    ImageDensity,
    ScatterClass,
    ScatterJob,
    ScatterSize,
    VertexGroupDensity,
    scatter,
)
from esh.esh_scatter.classes.survey import Survey

# Meters and vertices along a side of the target, and pixels along a side of the texture.
SIDE = 64.0
VERTICES = 700
PIXELS = 2048
# Seconds that everything may take for a million instances on two cores.
LIMIT = 2.0
NOT_MEASURED = Report(0, False, 0.0, "", 0.0, None, 0, 0.0, ())

# What is timed, as functions of files of esh_scatter, none of which calls another.
PHASES = {
    "reading the mesh": [("targets", "read_targets")],
    "chart": [("targets", "chart_of")],
    "densities at its points": [("survey", "density")],
    "classes": [("preparation", "_prepare_classes")],
    "lifting back to the ground, rotations": [("result_points", "result_points")],
    "writing points, attributes, node group": [("result", "write_result")],
}


def hills() -> bpy.types.Object:
    """Make a target with an attribute and a vertex group."""
    along = np.linspace(-0.5 * SIDE, 0.5 * SIDE, VERTICES)
    x, y = np.meshgrid(along, along)
    z = 3.0 * np.sin(0.3 * x) * np.cos(0.2 * y)
    first = np.arange(VERTICES * VERTICES).reshape(VERTICES, VERTICES)[:-1, :-1].ravel()
    corner = first[:, None] + np.array([0, 1, VERTICES + 1, VERTICES])
    mesh = bpy.data.meshes.new("Hills")
    mesh.vertices.add(x.size)
    mesh.vertices.foreach_set("co", np.stack([x, y, z], axis=-1).astype(np.float32).ravel())
    mesh.loops.add(corner.size)
    mesh.loops.foreach_set("vertex_index", corner.astype(np.int32).ravel())
    mesh.polygons.add(len(first))
    mesh.polygons.foreach_set("loop_start", 4 * np.arange(len(first), dtype=np.int32))
    mesh.update(calc_edges=True)
    mesh.attributes.new("soil", "FLOAT", "POINT").data.foreach_set("value", (z + 3.0).astype(np.float32).ravel())
    item = bpy.data.objects.new("Hills", mesh)
    bpy.context.scene.collection.objects.link(item)
    group = item.vertex_groups.new(name="meadow")
    # Half of the vertices, in sixteen weights: a group takes one weight at a time.
    step = np.rint(32.0 * np.clip(x / SIDE, 0.0, 0.5)).astype(int).ravel()
    for weight in range(1, 17):
        group.add(np.flatnonzero(step == weight).tolist(), weight / 16.0, "REPLACE")
    return item


def texture() -> bpy.types.Image:
    """Make an image of 8 bits per channel."""
    image = bpy.data.images.new("Forest", PIXELS, PIXELS)
    wave = 0.5 + 0.5 * np.sin(np.linspace(0.0, 40.0, PIXELS))
    pixels = np.ones((PIXELS, PIXELS, 4), np.float32)
    pixels[..., :3] = (wave[:, None] * wave)[..., None]
    image.pixels.foreach_set(pixels.ravel())
    return image


def triangle(name: str) -> bpy.types.Object:
    """Make an object to instance that is in no scene."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(0, 0, 0), (0.05, 0, 0), (0, 0.05, 0)], [], [(0, 1, 2)])
    return bpy.data.objects.new(name, mesh)


def three_classes(bodies: int) -> list[ScatterClass]:
    """Each of two sizes; a third of the target is covered."""
    mean_area = SIDE**2 / bodies / 3.0
    densities = ImageDensity(texture()), VertexGroupDensity("meadow"), AttributeDensity("soil")
    classes = []
    for number, density in enumerate(densities):
        small, large = (bodies // 6 + (k < bodies % 6) for k in (2 * number, 2 * number + 1))
        sizes = [
            ScatterSize("small", small, triangle("small"), area=0.5 * mean_area, line=False),
            ScatterSize("large", large, triangle("large"), area=1.5 * mean_area, line=False),
        ]
        classes.append(ScatterClass(str(number), sizes, density))
    return classes


def unsolved(problem: Problem) -> Placement:
    """Return where the solver would start."""
    zero = np.zeros(problem.body_count)
    position = initial_placement(problem)
    return Placement(problem, position, *problem.body_indices(), zero, zero, zero, NOT_MEASURED)


def seconds_of_phases(profile: cProfile.Profile) -> dict[str, float]:
    """Return what every phase took, and all together; there are so few Python calls that being watched costs nothing."""
    stats = pstats.Stats(profile)
    spent = {
        (Path(file).stem, name): cumulative
        for (file, _, name), (_, _, _, cumulative, _) in stats.stats.items()
        if Path(file).parent.parent.name == "esh_scatter"
    }
    phases = {phase: sum(spent[function] for function in functions) for phase, functions in PHASES.items()}
    return {**phases, "the rest": stats.total_tt - sum(phases.values()), "**together**": stats.total_tt}


def measure(bodies: int, repeat: int) -> dict[str, float]:
    """Return the median seconds of every phase."""
    bpy.ops.wm.read_homefile(use_empty=True)
    target, classes = hills(), three_classes(bodies)
    bpy.context.view_layer.update()
    placement, runs = None, []
    # Once more than is counted: kernels are compiled and caches filled.
    for _ in range(repeat + 1):
        profile = cProfile.Profile()
        job = profile.runcall(ScatterJob, target, classes, survey=Survey())
        placement = job.placement = placement or unsolved(job.problem)
        item = profile.runcall(job.write).object
        start = time.perf_counter()
        bpy.context.view_layer.update()
        evaluation = time.perf_counter() - start
        assert len(item.data.vertices) == bodies
        runs.append({**seconds_of_phases(profile), "evaluation by Blender": evaluation})
    return {phase: statistics.median(run[phase] for run in runs[1:]) for phase in runs[0]}


def solve_and_compare(bodies: int) -> str:
    """Return a sentence about a whole esh.scatter."""
    bpy.ops.wm.read_homefile(use_empty=True)
    target, classes = hills(), three_classes(bodies)
    # Pushing footprints apart comes on top of the solver, and would only make the share smaller.
    scatter(target, classes, avoid_overlap=False, max_steps=2)
    bpy.context.view_layer.update()
    start = time.perf_counter()
    solver = scatter(target, classes, avoid_overlap=False).report.seconds
    rest = time.perf_counter() - start - solver
    return f"{bodies:,} instances: solver {solver:.2f} s, everything else {rest:.2f} s ({rest / solver:.0%} of it)."


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bodies", type=int, nargs="+", default=[100_000, 1_000_000])
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--solve", type=int)
    options = parser.parse_args()
    medians = [measure(bodies, options.repeat) for bodies in options.bodies]
    columns = " | ".join(f"{bodies:,} instances" for bodies in options.bodies)
    print(f"| Blender {bpy.app.version_string} | {columns} |")
    print("|---|" + "---|" * len(medians))
    for phase in medians[0]:
        print(f"| {phase} | " + " | ".join(f"{median[phase]:.3f} s" for median in medians) + " |")
    print(
        f"\nTogether, {LIMIT:g} s are allowed for 1,000,000 instances on two cores; Blender's own evaluation is beside it."
    )
    if options.solve:
        print(solve_and_compare(options.solve))


if __name__ == "__main__":
    main()
