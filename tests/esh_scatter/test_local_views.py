"""Local views: what is scattered while the ground is alone in a viewport shows there, and where it does not, that is said."""

import sys

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh.esh_scatter import registration  # noqa: E402
from esh.esh_scatter.api import ScatterClass, ScatterJob, ScatterSize  # noqa: E402
from esh.esh_scatter.result.local_views import is_left_out  # noqa: E402
from esh.esh_scatter.sidebar import density_preview  # noqa: E402
from esh.esh_scatter.solving.moving_bodies import MovingBodies  # noqa: E402


@pytest.fixture
def viewport():
    """Blender's own first scene with a viewport, as it has one without a window, too."""
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    registration.register()
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=window, area=area, region=region):
        yield area.spaces.active
    registration.unregister()


def ground_and_pebble():
    bpy.ops.mesh.primitive_plane_add(size=20.0)
    ground = bpy.context.object
    bpy.ops.mesh.primitive_cube_add(size=0.5, location=(0.0, 0.0, 5.0))
    bpy.context.object.name = "Pebble"
    return ground, bpy.context.object


def select(*items):
    for item in bpy.context.scene.objects:
        item.select_set(item in items)
    bpy.context.view_layer.objects.active = items[0]


@pytest.mark.parametrize("shown", ["the ground", "something else"])
def test_a_new_result_is_in_the_local_views_that_show_its_ground(viewport, shown):
    ground, pebble = ground_and_pebble()
    select(*((ground, pebble) if shown == "the ground" else (bpy.data.objects["Light"],)))
    bpy.ops.view3d.localview()
    assert viewport.local_view is not None
    select(ground, pebble)
    assert bpy.ops.esh.scatter_selection() == {"FINISHED"}
    result = bpy.context.scene.esh_scatter.active.result
    bpy.context.view_layer.update()
    assert result.visible_get(viewport=viewport) == (shown == "the ground")
    assert is_left_out(result, bpy.context) == (shown != "the ground")


def test_a_result_stays_out_of_a_local_view_that_somebody_made_without_it(viewport):
    ground, pebble = ground_and_pebble()
    select(ground, pebble)
    bpy.ops.esh.scatter_selection()
    result = bpy.context.scene.esh_scatter.active.result
    assert not is_left_out(result, bpy.context)
    select(ground)
    bpy.ops.view3d.localview()
    bpy.context.scene.esh_scatter.active.seed += 1
    bpy.ops.esh.scatter()
    bpy.context.view_layer.update()
    assert bpy.context.scene.esh_scatter.active.result == result and is_left_out(result, bpy.context)
    bpy.ops.view3d.localview()
    assert not is_left_out(result, bpy.context)


def test_ground_that_a_local_view_leaves_out_is_scattered_on_and_hidden_ground_is_not(viewport):
    """Blender evaluates it all the same; of a collection, too, all of the ground is meant."""
    ground, pebble = ground_and_pebble()
    select(ground, pebble)
    bpy.ops.esh.scatter_selection()
    scatter = bpy.context.scene.esh_scatter.active
    counts = len(scatter.result.data.vertices)
    select(pebble)
    bpy.ops.view3d.localview()
    assert not ground.visible_get()
    assert bpy.ops.esh.scatter() == {"FINISHED"} and len(scatter.result.data.vertices) == counts
    scatter.target_kind, scatter.target_collection = "COLLECTION", bpy.data.collections.new("Tiles")
    scatter.target_collection.objects.link(ground)
    bpy.context.scene.collection.children.link(scatter.target_collection)
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    ground.hide_set(True)
    with pytest.raises(RuntimeError, match="visible"):
        bpy.ops.esh.scatter()


class Drawn:
    """Stands in for what Blender draws with, which there is none of without a window: counts what is drawn."""

    def __init__(self):
        self.count = 0
        self.shader = self.state = self

    def draw(self, _shader):
        self.count += 1

    def __getattr__(self, _name):
        return lambda *_values, **_named: self


def test_colors_and_moving_points_are_drawn_only_where_their_ground_may_show(viewport, monkeypatch):
    drawn = Drawn()
    monkeypatch.setitem(sys.modules, "gpu", drawn)
    monkeypatch.setitem(sys.modules, "gpu_extras.batch", drawn)
    ground, pebble = ground_and_pebble()
    select(ground, pebble)
    bpy.ops.esh.scatter_selection()
    bpy.context.window_manager.esh_scatter_show_density = True
    density_preview._look()
    bodies = MovingBodies(ScatterJob(ground, [ScatterClass("Pebble", [ScatterSize("one", 5, pebble)])], device="cpu"))
    bodies.points, bodies._colors = np.zeros((5, 3)), np.ones((5, 4))

    def count():
        before = drawn.count
        density_preview._draw()
        bodies._draw()
        return drawn.count - before

    assert count() == 2
    select(pebble)
    bpy.ops.view3d.localview()
    assert count() == 0, "a local view of something else"
    bpy.ops.view3d.localview()
    assert count() == 2
    bpy.context.window.scene = bpy.data.scenes.new("Another")
    assert count() == 0, "a window that shows another scene"
    bpy.context.window_manager.esh_scatter_show_density = False
