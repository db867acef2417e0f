"""Blender's own Distribute Points on Faces (Poisson disk) beside esh.scatter: as many points on the same plane.

    python benchmarks/blender_poisson.py --bodies 10000 100000

Prints a Markdown table of medians. Needs pip's bpy. The node's minimum distance is searched for the number of points that is wanted;
the search is not timed.
"""

from __future__ import annotations

import argparse
import statistics
import time

import bpy
import numpy as np
from esh.engine.problem.domain import Domain
from esh.engine.quality.coverage import coverage_error
from esh.esh_scatter.api import ScatterClass, ScatterSize, scatter

SIDE = 64.0
UNIFORM = np.ones((1, 1), dtype=np.float32)


def add_distribution(ground: bpy.types.Object) -> bpy.types.Node:
    """Give ``ground`` a modifier that distributes points on it, and return the node."""
    group = bpy.data.node_groups.new("Poisson", "GeometryNodeTree")
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    start, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    node = group.nodes.new("GeometryNodeDistributePointsOnFaces")
    node.distribute_method = "POISSON"
    vertices = group.nodes.new("GeometryNodePointsToVertices")
    group.links.new(start.outputs[0], node.inputs["Mesh"])
    group.links.new(node.outputs["Points"], vertices.inputs["Points"])
    group.links.new(vertices.outputs[0], end.inputs[0])
    ground.modifiers.new("Poisson", "NODES").node_group = group
    return node


def distribute(ground: bpy.types.Object, node: bpy.types.Node, distance: float) -> tuple[np.ndarray, float]:
    """Return the points [m] for a minimum distance, and the seconds that evaluating them took."""
    node.inputs["Distance Min"].default_value = distance
    # More candidates than fit: the distance alone decides.
    node.inputs["Density Max"].default_value = 20.0 / distance**2
    start = time.perf_counter()
    mesh = ground.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    points = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", points)
    seconds = time.perf_counter() - start
    return points.reshape(-1, 3)[:, :2].astype(np.float64) + SIDE / 2.0, seconds


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bodies", type=int, nargs="+", default=[10_000, 100_000])
    parser.add_argument("--repeat", type=int, default=3)
    options = parser.parse_args()
    domain = Domain((SIDE, SIDE))
    print(
        "| points asked | Blender's Poisson disk: points, seconds, coverage error | esh.scatter: points, seconds, coverage error |"
    )
    print("|---|---|---|")
    for wanted in options.bodies:
        bpy.ops.wm.read_homefile(use_empty=True)
        bpy.ops.mesh.primitive_grid_add(x_subdivisions=64, y_subdivisions=64, size=SIDE)
        ground = bpy.context.object
        node = add_distribution(ground)
        low, high = 0.4 * SIDE / wanted**0.5, 1.2 * SIDE / wanted**0.5
        for _ in range(9):
            middle = 0.5 * (low + high)
            points, seconds = distribute(ground, node, middle)
            low, high = (middle, high) if len(points) > wanted else (low, middle)
        # The last distance once more, as often as asked: a changed socket makes Blender evaluate anew.
        times = [seconds]
        for _ in range(options.repeat - 1):
            node.inputs["Distance Min"].default_value = 2.0 * middle
            bpy.context.evaluated_depsgraph_get()
            points, seconds = distribute(ground, node, middle)
            times.append(seconds)
        seconds = statistics.median(times)
        theirs = coverage_error(points, np.ones(len(points)), UNIFORM, domain)
        ground.modifiers.clear()
        bpy.ops.mesh.primitive_cube_add(size=0.1)
        cube = bpy.context.object
        classes = [ScatterClass("cube", [ScatterSize("one", wanted, cube, area=0.25 * SIDE**2 / wanted, line=False)])]
        scatter(ground, classes, max_steps=2)
        runs = []
        for _ in range(options.repeat):
            start = time.perf_counter()
            result = scatter(ground, classes)
            runs.append((time.perf_counter() - start, result.report.seconds))
        ours, solver = (statistics.median(column) for column in zip(*runs, strict=True))
        print(
            f"| {wanted:,} | {len(points):,}, {seconds:.2f} s, {theirs:.4f} | "
            f"{len(result.placement.position):,}, {ours:.2f} s (solver {solver:.2f} s), "
            f"{result.report.coverage_error:.4f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
