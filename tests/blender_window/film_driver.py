"""Runs inside a windowed Blender: a path is painted through a forest, and the trees that make way for it are filmed.

``film_strip.py`` joins the pictures. A slow hand paints, as it is to be looked at rather than measured.
"""

import bpy
import numpy as np
import window_scene as scene
import window_steps as steps
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Euler, Vector
from small_forest import OBJECTS, ground, thing
from window_steps import answer

# How many of each are on the ground, and its two colors: where things grow, and where the path is painted.
COUNTS = {"Pine": 110, "Beech": 90, "Mushroom": 160, "Pebble": 240}
MEADOW, PATH = (0.46, 0.52, 0.24), (0.90, 0.78, 0.56)
PIXELS = 1024
BRUSH = 52
STROKE_SECONDS = 40.0
LONGEST_RUN = 180.0
# The path on the ground, from the front to the back [m].
WAY = [(3.4 * np.sin(0.5 * y + 0.4), y) for y in np.linspace(-5.6, 8.8, 90)]


def fill_in():
    with steps.window_context():
        steps.show_tab()
        for item in list(bpy.data.objects):
            bpy.data.objects.remove(item)
        target = ground()
        mask = bpy.data.images.new("Path", PIXELS, PIXELS, alpha=False)
        mask.generated_color = (*MEADOW, 1.0)
        mask.pack()
        _show(target, mask)
        scatter = bpy.context.scene.esh_scatter.add_scatter(target)
        for name, count in COUNTS.items():
            item = thing(name, OBJECTS[name])
            item.hide_set(True)
            body_class = scatter.add_class()
            body_class.name = name
            body_class.sizes[0].source_object, body_class.sizes[0].count = item, count
            _follow(body_class.add_layer("IMAGE", image=mask, image_channel="RED", use_curve=True))
        scatter.class_index = 0
        bpy.context.view_layer.objects.active = target
        target.select_set(True)
        _look_from_above(bpy.context.area.spaces.active)
        bpy.ops.ed.undo_push(message="Filled in")


def _show(target, mask):
    """The ground shows what is painted."""
    material = target.data.materials[0]
    material.use_nodes = True
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = mask
    material.node_tree.nodes.active = node


def _follow(layer):
    """All of the meadow, and nothing of the path; red is lower there."""
    node = steps.ours("densities.density_curve").curve_node(layer.curve)
    points = node.mapping.curves[0].points
    points[0].location, points[1].location = (0.0, 1.0), (1.0, 0.0)
    for place in ((0.6, 1.0), (0.75, 0.0)):
        points.new(*place).handle_type = "VECTOR"
    node.mapping.update()


def _look_from_above(space):
    region = space.region_3d
    region.view_perspective = "PERSP"
    region.view_rotation = Euler((0.86, 0.0, 0.12)).to_quaternion()
    region.view_location, region.view_distance = Vector((0.0, 0.4, 0.0)), 21.0
    space.lens = 60.0
    space.shading.type, space.shading.color_type = "SOLID", "TEXTURE"
    space.shading.show_shadows = space.shading.show_cavity = True
    space.shading.shadow_intensity = 0.3
    space.show_gizmo = space.overlay.show_text = space.overlay.show_cursor = False
    space.overlay.show_outline_selected = False
    space.overlay.show_floor = space.overlay.show_axis_x = space.overlay.show_axis_y = False


def press():
    with steps.window_context():
        bpy.ops.esh.scatter("INVOKE_DEFAULT")


def placed():
    return scene.scatter().result is not None and scene.idle() and bool(scene.scatter().report_json)


def switch_on():
    scene.scatter().live = True


def paint():
    steps.take_screenshot("film-before.png")
    with steps.window_context():
        bpy.ops.esh.layer_paint()
        bpy.context.space_data.show_region_asset_shelf = False
        settings = bpy.context.tool_settings
        brush = settings.image_paint.brush
        owner = settings.image_paint if bpy.app.version >= (5, 0, 0) else settings
        for one in (brush, owner.unified_paint_settings):
            one.size, one.color = BRUSH, PATH
        brush.strength = 1.0


class Film:
    """Paints, and takes a picture whenever the result has changed."""

    def __init__(self):
        _, area, region = steps.view()
        view = area.spaces.active.region_3d
        heights = bpy.data.objects["Ground"]
        way = []
        for x, y in WAY:
            _, place, *_ = heights.ray_cast((x, y, 10.0), (0.0, 0.0, -1.0))
            way.append(steps.on_screen(*location_3d_to_region_2d(region, view, place)))
        self.hand = steps.drag(way, STROKE_SECONDS)
        self.seen, self.pictures = scene.positions().tobytes(), 0
        bpy.app.timers.register(self.look, first_interval=0.0)

    def look(self):
        now = scene.positions().tobytes()
        if now != self.seen:
            self.seen, self.pictures = now, self.pictures + 1
            steps.take_screenshot_aside(f"film-{self.pictures}.png")
        return 0.01 if self.hand.poll() is None else None


film = None


def begin_stroke():
    global film
    film = Film()


def stroked():
    return film.hand.poll() is not None and scene.at_rest()


def look():
    answer["pictures"], answer["placed"] = film.pictures, len(scene.positions())
    steps.take_screenshot("film-after.png")


steps.run(
    [
        steps.open_sidebar,
        fill_in,
        (press, 0.5),
        (steps.within(LONGEST_RUN, placed), 0.3),
        switch_on,
        (steps.within(LONGEST_RUN, scene.at_rest), 0.3),
        (paint, 2.0),
        (begin_stroke, 2.0),
        (steps.within(LONGEST_RUN, stroked), 1.0),
        (look, 1.0),
    ]
)
