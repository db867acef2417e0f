"""Runs inside a windowed Blender: 10,000 objects, Live, and a stroke with the mouse that is followed while it is painted.

The argument says what is painted: ``image``, ``colors`` or ``weights``.
"""

import time

import bpy
import numpy as np
import window_steps as steps
from bpy_extras.view3d_utils import location_3d_to_region_2d
from window_steps import answer

PAINTED = steps.ARGUMENTS[0]
COUNT, SIZE = 10_000, 80.0
PIXELS = 1024
# Where the stroke begins and ends, on the ground [m].
FROM, TO = (-0.325 * SIZE, -0.3 * SIZE), (-0.225 * SIZE, 0.2 * SIZE)
BRUSH = 45
# It is followed in as many parts as there is time for.
STROKE_SECONDS = 5.0
LONGEST_RUN = 180.0


def active():
    return bpy.context.scene.esh_scatter.active


def fill_in():
    with steps.window_context():
        steps.show_tab()
        steps.remove_objects()
        # The weights of many vertices are read whole during the stroke, too.
        cuts = {"image": 50, "colors": 150, "weights": 250}[PAINTED]
        bpy.ops.mesh.primitive_grid_add(size=SIZE, x_subdivisions=cuts, y_subdivisions=cuts)
        ground = bpy.context.object
        ground.name = "Ground"
        scatter = bpy.context.scene.esh_scatter.add_scatter(ground)
        mask = bpy.data.images.new("Mask", PIXELS, PIXELS, alpha=False, is_data=True)
        mask.generated_color = (1.0, 1.0, 1.0, 1.0)
        mask.pack()
        ground.data.color_attributes.new("Colors", "BYTE_COLOR", "POINT")
        ground.data.attributes["Colors"].data.foreach_set("color", np.ones(4 * len(ground.data.vertices)))
        ground.vertex_groups.new(name="Weights").add(range(len(ground.data.vertices)), 1.0, "REPLACE")
        layer = {
            "image": {"kind": "IMAGE", "image": mask},
            "colors": {"kind": "ATTRIBUTE", "attribute": "Colors"},
            "weights": {"kind": "VERTEX_GROUP", "vertex_group": "Weights"},
        }[PAINTED]
        for name, radius, height, share, color in (
            ("Bush", 0.42, 0.9, 0.3, (0.05, 0.38, 0.08, 1.0)),
            ("Grass", 0.22, 0.5, 0.7, (0.72, 0.50, 0.05, 1.0)),
        ):
            bpy.ops.mesh.primitive_cone_add(vertices=6, radius1=radius, depth=height, location=(80.0, 0.0, 0.0))
            item = bpy.context.object
            item.name = name
            material = bpy.data.materials.new(name)
            material.diffuse_color = color
            item.data.materials.append(material)
            item.hide_set(True)
            body_class = scatter.add_class()
            body_class.name = name
            body_class.add_layer(**layer)
            body_class.sizes[0].source_object, body_class.sizes[0].count = item, round(share * COUNT)
        scatter.class_index = 0
        _material(ground, mask)
        bpy.ops.view3d.view_axis(type="TOP")
        bpy.ops.view3d.view_selected()
        space = bpy.context.area.spaces.active
        space.region_3d.view_perspective, space.region_3d.view_distance = "ORTHO", 1.15 * SIZE
        space.shading.type, space.shading.color_type = "SOLID", "MATERIAL"
        space.overlay.show_floor = False
        bpy.ops.ed.undo_push(message="Filled in")


def _material(ground, mask):
    """The ground shows what is painted."""
    material = bpy.data.materials.new("Ground")
    material.use_nodes = True
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = mask
    material.node_tree.nodes.active = node
    ground.data.materials.append(material)


def press():
    with steps.window_context():
        bpy.context.view_layer.objects.active = bpy.data.objects["Ground"]
        answer["pressed"] = sorted(bpy.ops.esh.scatter("INVOKE_DEFAULT"))


def placed():
    return active().result is not None and bool(active().report_json)


def switch_on():
    answer["seconds"] = active().report["seconds"]
    active().live = True


def live_of(scatter):
    """What follows a scatter; None while nothing does."""
    return steps.ours("solving.live")._followed.get((bpy.context.scene.session_uid, scatter.uid))


def at_rest():
    live = live_of(active())
    return live is not None and not live.busy and not active().outdated


def paint():
    steps.take_screenshot("live-before.png")
    with steps.window_context():
        answer["paint"] = sorted(bpy.ops.esh.layer_paint())
        modes = {"image": "image_paint", "colors": "vertex_paint", "weights": "weight_paint"}
        paint = getattr(bpy.context.tool_settings, modes[PAINTED])
        brush = paint.brush
        brush.color, brush.strength = (0.0, 0.0, 0.0), 1.0
        unified = paint.unified_paint_settings if bpy.app.version >= (5, 0, 0) else None
        for owner in (brush, unified or bpy.context.tool_settings.unified_paint_settings):
            owner.size, owner.weight = BRUSH, 0.0
            if PAINTED == "weights":
                # By itself its edge is soft.
                brush.curve_distance_falloff_preset = "CONSTANT"
            if hasattr(owner, "color"):
                owner.color = (0.0, 0.0, 0.0)
    answer["mode"] = bpy.context.mode


def positions():
    mesh = active().result.data
    place, number = np.empty(3 * len(mesh.vertices), np.float32), np.empty(len(mesh.vertices), np.int32)
    mesh.attributes["position"].data.foreach_get("vector", place)
    mesh.attributes["id"].data.foreach_get("value", number)
    return dict(zip(number.tolist(), place.reshape(-1, 3), strict=True))


class Watch:
    """What is seen during the stroke: when pixels changed, and when the result did; and how long the window stood still."""

    def __init__(self):
        self.before = positions()
        self.mask = self._pixels()
        self.sum = self._sum()
        self.painted, self.followed, self.ticks = [], [], []
        _, _, region = steps.view()
        rv3d = steps.view()[1].spaces.active.region_3d
        ends = np.array([location_3d_to_region_2d(region, rv3d, (*end, 0.0)) for end in (FROM, TO)])
        way = [steps.on_screen(*(ends[0] + share * (ends[1] - ends[0]))) for share in np.linspace(0.0, 1.0, 60)]
        self.mouse = steps.drag(way, STROKE_SECONDS)
        bpy.app.timers.register(self.look, first_interval=0.0)

    @staticmethod
    def _pixels():
        if PAINTED == "weights":
            found = bpy.data.objects["Ground"].data.vertices
            return np.array([found[number].groups[0].weight for number in range(0, len(found), 20)])
        if PAINTED == "colors":
            found = bpy.data.objects["Ground"].data.attributes["Colors"].data
            colors = np.empty(4 * len(found), np.float32)
            found.foreach_get("color", colors)
            return colors
        pixels = np.empty(4 * PIXELS * PIXELS, np.float32)
        bpy.data.images["Mask"].pixels.foreach_get(pixels)
        return pixels.reshape(PIXELS, PIXELS, 4)[::16, ::16, 0].copy()

    @staticmethod
    def _sum():
        mesh = active().result.data
        place = np.empty(3 * len(mesh.vertices), np.float32)
        mesh.attributes["position"].data.foreach_get("vector", place)
        return hash(place.tobytes())

    def look(self):
        now = time.perf_counter()
        self.ticks.append(now)
        pixels, total = self._pixels(), self._sum()
        if (pixels != self.mask).any():
            self.mask = pixels
            self.painted.append(now)
        if total != self.sum:
            self.sum = total
            self.followed.append(now)
        return None if answer.get("stroked") else 0.01


def on_stroke(place):
    """How many of some places lie well within the stroke."""
    way = np.subtract(TO, FROM)
    share = np.clip((place[:, :2] - FROM) @ way / (way @ way), 0.0, 1.0)
    return int((np.linalg.norm(place[:, :2] - FROM - share[:, None] * way, axis=1) < 1.2).sum())


watch = None


def begin_stroke():
    global watch
    watch = Watch()


def stroked():
    # A busy Blender hears later that the mouse was let go.
    paints = any(
        "paint" in one.bl_idname for window in bpy.context.window_manager.windows for one in window.modal_operators
    )
    if watch.mouse.poll() is None or paints or not at_rest():
        return False
    answer["stroked"] = True
    ended = watch.painted[-1] if watch.painted else 0.0
    answer["painted"] = len(watch.painted)
    answer["followed"] = len(watch.followed)
    answer["followed_during"] = sum(1 for at in watch.followed if at <= ended)
    if watch.painted and watch.followed:
        start = watch.painted[0]
        answer["first_after"] = next((at - start for at in watch.followed if at >= start), None)
        answer["last_after"] = watch.followed[-1] - ended
        waits = [min((f - p for f in watch.followed if f > p), default=None) for p in watch.painted]
        answer["waits"] = [wait for wait in waits if wait is not None]
    # From reading what was painted to having written what came of it.
    answer["update"] = live_of(active()).seconds
    answer["longest_tick"] = float(np.diff(watch.ticks).max())
    answer["usual_tick"] = float(np.median(np.diff(watch.ticks)))
    before, after = watch.before, positions()
    both = sorted(before.keys() & after.keys())
    away = np.array([np.linalg.norm(after[n] - before[n]) for n in both])
    there = np.array([before[n] for n in both])
    far = there[:, 0] > 10.0
    answer["far"] = {
        "count": int(far.sum()),
        "median": float(np.median(away[far])),
        "still": float((away[far] < 0.3).mean()),
    }
    there = np.array(list(after.values()))
    answer["on_stroke"] = on_stroke(there)
    answer["on_stroke_before"] = on_stroke(np.array(list(before.values())))
    answer["placed"] = len(after)
    return True


def look():
    answer["live"] = active().live
    steps.take_screenshot("live-after.png")


steps.run(
    [
        steps.open_sidebar,
        fill_in,
        press,
        (steps.within(LONGEST_RUN, placed), 0.3),
        switch_on,
        (steps.within(LONGEST_RUN, at_rest), 0.3),
        (paint, 1.0),
        (begin_stroke, 1.0),
        (steps.within(LONGEST_RUN, stroked), 0.3),
        look,
    ]
)
