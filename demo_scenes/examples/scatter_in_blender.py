"""In Blender: pines on the hills and stones in the valleys, by an attribute of the mesh; rendered by Cycles."""

from pathlib import Path

import bpy
import esh
import numpy as np
from blender_scene import add, render


def main(folder: Path) -> esh.ScatterResult:
    bpy.ops.wm.read_homefile(use_empty=True)
    ground = add("grid", (0.36, 0.31, 0.2), x_subdivisions=80, y_subdivisions=80, size=40.0)
    pine = add("cone", (0.02, 0.16, 0.07), radius1=0.6, depth=3.0, location=(0.0, 0.0, -50.0))
    stone = add("ico_sphere", (0.3, 0.3, 0.34), radius=0.35, location=(0.0, 0.0, -50.0))
    x, y = np.array([vertex.co[:2] for vertex in ground.data.vertices]).T
    height = 1.6 * np.sin(0.3 * x) * np.cos(0.25 * y)
    ground.data.vertices.foreach_set("co", np.stack([x, y, height], axis=-1).ravel())
    ground.data.attributes.new("hills", "FLOAT", "POINT").data.foreach_set("value", np.clip(height, 0.0, 1.0))
    hills, valleys = esh.AttributeDensity("hills"), esh.AttributeDensity("hills", invert=True)
    pines = esh.ScatterClass("pine", [esh.ScatterSize("all", 260, pine)], hills)
    stones = esh.ScatterClass("stone", [esh.ScatterSize("all", 320, stone)], valleys)
    result = esh.scatter(ground, [pines, stones], seed=4, align_to_normal=0.3, scale_jitter=0.3)
    render(folder / "scatter_in_blender.png")
    return result


def test_final(result: esh.ScatterResult) -> None:
    height = np.array([vertex.co.z for vertex in result.object.data.vertices])
    is_pine = result.placement.class_index == 0
    assert is_pine.sum() == 260 and len(is_pine) == 580
    # Hills begin at 0 m and are whole from 1 m on; contact pushes a few over the edge.
    assert (height[is_pine] < 0.0).mean() < 0.02 and (height[~is_pine] > 1.0).mean() < 0.02
    assert result.report.overlaps == 0


if __name__ == "__main__":
    test_final(main(Path()))
