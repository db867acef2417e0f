"""In Blender: leaves near a vine that winds around a ring of stone, underneath as well, and along which they lie."""

from pathlib import Path

import bpy
import esh
import numpy as np
from blender_scene import add, render


def main(folder: Path) -> esh.ScatterResult:
    bpy.ops.wm.read_homefile(use_empty=True)
    ring = add("torus", (0.3, 0.25, 0.2), major_radius=12.0, minor_radius=4.5, major_segments=96, minor_segments=48)
    leaf = add("ico_sphere", (0.04, 0.2, 0.02), radius=0.8, scale=(1.0, 0.35, 0.08), location=(0.0, 0.0, -50.0))
    turn = np.linspace(0.0, 2.0 * np.pi, 500)
    out = 12.0 + 4.6 * np.cos(7.0 * turn)
    place = np.stack([out * np.cos(turn), out * np.sin(turn), 4.6 * np.sin(7.0 * turn), np.ones(500)], axis=-1)
    vine = bpy.data.objects.new("vine", bpy.data.curves.new("vine", "CURVE"))
    vine.data.dimensions, vine.data.bevel_depth = "3D", 0.12
    vine.data.splines.new("POLY").points.add(499)
    vine.data.splines[0].points.foreach_set("co", place.ravel())
    bpy.context.collection.objects.link(vine)
    near, along = esh.DistanceDensity(vine, near=0.5, far=3.2), esh.CurveDirection(vine)
    leaves = esh.ScatterClass("leaf", [esh.ScatterSize("all", 1300, leaf)], near, direction=along)
    result = esh.scatter(ring, [leaves], seed=2, surface="whole", align_to_normal=1.0, scale_jitter=0.3)
    render(folder / "leaves_along_a_vine.png")
    return result


def test_final(result: esh.ScatterResult) -> None:
    place, tangent = result.placement.position, result.placement.tangent
    # The vine goes round the ring seven times, so leaves lie across it rather than along it.
    along = np.cross([0.0, 0.0, 1.0], place) / np.linalg.norm(place[:, :2], axis=1, keepdims=True)
    assert np.median(np.abs((tangent * along).sum(axis=1))) < 0.6 and result.report.overlaps == 0


if __name__ == "__main__":
    test_final(main(Path()))
