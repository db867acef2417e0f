"""The footprint is the area of the outline seen from above, to 1 %."""

import math

import pytest

bpy = pytest.importorskip("bpy")

from esh.engine.errors import EshError  # noqa: E402
from esh.esh_scatter.footprint import footprint_area  # noqa: E402


@pytest.fixture(autouse=True)
def empty_file():
    bpy.ops.wm.read_homefile(use_empty=True)


def area():
    return footprint_area(bpy.context.object, bpy.context, "`area`")


def test_cube_turned_and_scaled():
    bpy.ops.mesh.primitive_cube_add(size=2.0)
    assert area() == pytest.approx(4.0, rel=1e-6)
    bpy.context.object.rotation_euler = (0, 0, 0.6)
    bpy.context.object.scale = (1, -3, 1)
    assert area() == pytest.approx(12.0, rel=0.01)
    bpy.context.object.rotation_euler = (math.pi / 4, 0, 0)
    bpy.context.object.scale = (1, 1, 1)
    assert area() == pytest.approx(4.0 * math.sqrt(2.0), rel=0.01)


def test_cylinder_and_a_ring_whose_hole_is_free():
    bpy.ops.mesh.primitive_cylinder_add(vertices=256, radius=1.5)
    assert area() == pytest.approx(math.pi * 2.25, rel=0.01)
    bpy.ops.mesh.primitive_torus_add(major_radius=2.0, minor_radius=0.5, major_segments=256, minor_segments=32)
    assert area() == pytest.approx(math.pi * (2.5**2 - 1.5**2), rel=0.01)


def test_what_stands_upright_takes_no_ground():
    bpy.ops.mesh.primitive_plane_add(rotation=(math.pi / 2, 0, 0.5))
    with pytest.raises(EshError, match="Plane"):
        area()
