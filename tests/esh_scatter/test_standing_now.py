"""Where the objects of a result stand: as its instances do, whatever its target or the result itself went through since."""

import math

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh import ScatterClass, ScatterObstacle, ScatterSize, Standing, scatter  # noqa: E402
from esh.esh_scatter.result.display import our_modifier, set_inputs  # noqa: E402
from esh.esh_scatter.result.real_objects import _read  # noqa: E402
from esh.esh_scatter.result.standing_now import standing_now  # noqa: E402

OPTIONS = {"device": "cpu", "max_steps": 5}


@pytest.fixture
def ground():
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.mesh.primitive_grid_add(size=20, x_subdivisions=12, y_subdivisions=12, location=(5, 5, 0))
    item = bpy.context.object
    for vertex in item.data.vertices:
        vertex.co.z = 0.8 * np.sin(0.5 * vertex.co.x) + 0.3 * np.cos(vertex.co.y)
    return item


@pytest.fixture
def plank():
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(80, 0, 0))
    bpy.context.object.scale = (2.0, 0.3, 0.4)
    bpy.ops.object.transform_apply(location=False, rotation=False, scale=True)
    return bpy.context.object


def bend(item):
    for vertex in item.data.vertices:
        vertex.co.z += 0.05 * vertex.co.x**2
    item.data.update()


def alone(result, name, value):
    """Transform a result that follows no target: one that does stays on it."""
    set_inputs(our_modifier(result), {"Follow": False})
    setattr(result, name, value)


CHANGES = {
    "nothing": lambda ground, result: None,
    "the target is moved": lambda ground, result: setattr(ground, "location", (6.3, 4.3, 1.0)),
    "the target is turned": lambda ground, result: setattr(ground, "rotation_euler", (0.1, 0.2, 0.8)),
    "the target is scaled": lambda ground, result: setattr(ground, "scale", (1.5, 1.0, 0.7)),
    "the target is mirrored": lambda ground, result: setattr(ground, "scale", (-1.0, 1.2, 1.0)),
    "the target is bent": lambda ground, result: bend(ground),
    "the result is turned": lambda ground, result: alone(result, "rotation_euler", (0.0, 0.0, math.pi / 2)),
    "the result is mirrored": lambda ground, result: alone(result, "scale", (-1.0, 1.0, 1.0)),
    "the result is scaled": lambda ground, result: alone(result, "scale", (1.0, 2.0, 0.5)),
    "the result is turned as it follows": lambda ground, result: setattr(result, "rotation_euler", (0.3, 0.0, 0.8)),
}


# Those between upright and aligned are both; the ends have no code of their own but in what says how far an object leans.
CASES = [(change, 0.6) for change in CHANGES]
CASES += [(change, align) for change in ("the target is bent", "the target is mirrored") for align in (0.0, 1.0)]


@pytest.mark.parametrize(("change", "align"), CASES)
def test_objects_stand_where_their_instances_do(ground, plank, change, align):
    standing = Standing(align_to_normal=align, random_turn=1.0)
    result = scatter(
        ground, [ScatterClass("planks", [ScatterSize("s", 60, plank)], standing=standing)], **OPTIONS
    ).object
    CHANGES[change](ground, result)
    bpy.context.view_layer.update()
    shown = _read(bpy.context, result)
    stands = standing_now(result, bpy.context)
    order = np.argsort(np.array([value.value for value in result.data.attributes["id"].data]), kind="stable")
    assert np.allclose(stands.position[order], shown.matrix[:, :3, 3], atol=2e-5)
    assert np.allclose(stands.axes[order], shown.matrix[:, :3, :3], atol=2e-4)


@pytest.mark.parametrize("change", ["the target is turned", "the target is mirrored", "the result is mirrored"])
def test_another_scatter_keeps_off_what_is_shown(ground, plank, change):
    from shapely.geometry import Polygon

    ground.data.vertices.foreach_set("co", _flat(ground))
    first = scatter(ground, [ScatterClass("planks", [ScatterSize("s", 50, plank)])], name="One", **OPTIONS)
    CHANGES[change](ground, first.object)
    ground.rotation_euler[0] = ground.rotation_euler[1] = 0.0
    bpy.context.view_layer.update()
    bpy.ops.mesh.primitive_cylinder_add(vertices=12, radius=0.4, depth=0.5, location=(90, 0, 0))
    discs = [ScatterClass("discs", [ScatterSize("s", 60, bpy.context.object)])]
    more = scatter(ground, discs, name="Two", obstacles=[ScatterObstacle(first.object)], device="cpu", max_steps=60)
    corners = np.array([[-1.0, -0.15], [1.0, -0.15], [1.0, 0.15], [-1.0, 0.15]])
    circle = 0.4 * np.stack([np.cos(np.arange(12) * np.pi / 6), np.sin(np.arange(12) * np.pi / 6)], axis=1)
    planks = [Polygon(m[:2, 3] + corners @ m[:2, :2].T) for m in _read(bpy.context, first.object).matrix]
    round_ones = [Polygon(m[:2, 3] + circle @ m[:2, :2].T) for m in _read(bpy.context, more.object).matrix]
    shared = sum(a.intersection(b).area for a in planks for b in round_ones)
    assert shared < 0.02, "cells of the obstacles' picture are a hundredth of a meter"


def test_another_scatter_keeps_off_what_leans_on_a_slope(ground):
    """Seen from above a plank that lies across a slope points elsewhere than one that stands upright."""
    from shapely.geometry import Polygon

    position = _flat(ground).reshape(-1, 3)
    position[:, 2] = position[:, 0]
    ground.data.vertices.foreach_set("co", position.ravel())
    bpy.ops.mesh.primitive_plane_add(size=1.0, location=(80, 0, 0))
    plank = bpy.context.object
    plank.scale = (2.0, 0.3, 1.0)
    bpy.ops.object.transform_apply(location=False, rotation=False, scale=True)
    standing = Standing(align_to_normal=1.0, random_turn=1.0)
    size = ScatterSize("s", 80, plank, line=False)
    first = scatter(ground, [ScatterClass("planks", [size], standing=standing)], name="One", **OPTIONS)
    more = scatter(
        ground,
        [ScatterClass("planks", [size], standing=Standing(align_to_normal=1.0))],
        name="Two",
        obstacles=[first.object],
        device="cpu",
        max_steps=60,
    )
    corners = np.array([[-1.0, -0.15], [1.0, -0.15], [1.0, 0.15], [-1.0, 0.15]])
    one, two = (
        [Polygon(m[:2, 3] + corners @ m[:2, :2].T) for m in _read(bpy.context, result.object).matrix]
        for result in (first, more)
    )
    assert more.report.converged
    assert max(a.intersection(b).area for a in one for b in two) < 0.001


def _flat(ground):
    position = np.array([vertex.co for vertex in ground.data.vertices], np.float32)
    position[:, 2] = 0.0
    return position.ravel()


@pytest.mark.parametrize("surface", ["above", "whole"])
@pytest.mark.parametrize(
    "change",
    [
        *("nothing", "the target is moved", "the target is turned", "the target is bent"),
        "the result is turned",
    ],
)
def test_what_is_pinned_stays_where_it_is_shown(ground, plank, change, surface):
    standing = Standing(align_to_normal=1.0)
    classes = [ScatterClass("planks", [ScatterSize("s", 40, plank, line=False)], standing=standing)]
    first = scatter(ground, classes, surface=surface, **OPTIONS).object
    first.data.attributes.new("pinned", "BOOLEAN", "POINT").data.foreach_set("value", np.arange(40) % 2 == 0)
    CHANGES[change](ground, first)
    bpy.context.view_layer.update()

    def pinned(result):
        stands = standing_now(result, bpy.context)
        ids, pins = (np.array([v.value for v in result.data.attributes[name].data]) for name in ("id", "pinned"))
        order = np.flatnonzero(pins)[np.argsort(ids[pins], kind="stable")]
        return ids[order], stands.position[order], stands.axes[order]

    before = pinned(first)
    after = pinned(scatter(ground, classes, surface=surface, **OPTIONS).object)
    assert before[0].tolist() == after[0].tolist() and len(before[0]) == 20
    assert np.allclose(before[1], after[1], atol=2e-4)
    # Seen from above, normals are those of a smooth ground, and instances follow its flat triangles.
    smooth = surface == "above" and change in ("the target is turned", "the target is bent")
    assert np.allclose(before[2], after[2], atol=0.1 if smooth else 2e-3)


@pytest.mark.parametrize("align", [0.0, 0.6, 1.0])
def test_objects_stand_where_their_instances_do_on_walls_whose_edges_are_upright(align):
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(80, 0, 0))
    block = bpy.context.object
    block.scale = (0.4, 0.3, 0.2)
    bpy.ops.object.transform_apply(location=False, rotation=False, scale=True)
    bpy.ops.mesh.primitive_cube_add(size=1.0)
    wall = bpy.context.object
    wall.scale = (0.1, 5.0, 5.0)
    bpy.context.view_layer.update()
    classes = [ScatterClass("blocks", [ScatterSize("s", 60, block)], standing=Standing(align_to_normal=align))]
    result = scatter(wall, classes, surface="whole", **OPTIONS).object
    wall.location.z, wall.rotation_euler.z = 1.0, 0.4
    bpy.context.view_layer.update()
    now = standing_now(result, bpy.context)
    shown = bpy.context.evaluated_depsgraph_get().object_instances
    matrix = np.array([np.array(one.matrix_world) for one in shown if one.is_instance])
    assert len(matrix) == 60
    order = np.linalg.norm(now.position[None] - matrix[:, None, :3, 3], axis=2).argmin(axis=1)
    np.testing.assert_allclose(matrix[:, :3, 3], now.position[order], atol=1e-5)
    np.testing.assert_allclose(matrix[:, :3, :3], now.axes[order], atol=1e-5)
