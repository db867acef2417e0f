"""Runs inside a windowed Blender: obstacles, instances by hand, display, real objects, a second scatter, files, by mouse and keys.

What happens is done with the mouse and the keyboard only, beside the scene at the start; what came of it is read. The third argument
says which of the walks is taken.
"""

import json
import time

import bmesh
import bpy
import numpy as np
import window_hand as hand
import window_steps as steps
from window_scene import (
    LONGEST_RUN,
    ask_for,
    begin,
    fill_in,
    idle,
    instances,
    on_screen,
    open_presets,
    positions,
    scatter,
    update,
    values,
)
from window_steps import answer, take_screenshot

PRESET = "Mushroom Clusters"
# Where the fields of the panel of the last operation are, from the mouse that it is opened below, and how far apart [pixels].
LAST_ACROSS, LAST_DOWN, LINE = 209, 51, 22
# How far the menu that leads back to instances is below the upper edge of the button that was in its panel before [pixels].
BACK_DOWN = 101
# Where the checkboxes and the eyes of the list of classes are, and the buttons beside it, as shares of the sidebar's width.
CHECKBOXES, EYES, BESIDE = 0.54, 0.61, 0.825
# Where File is on the screen.
FILE_MENU = (37, 15)


def by_id(number):
    return positions()[values("id") == number][0]


def obstacles():
    """The rock in the middle becomes an obstacle."""
    answer["on_rock_before"] = on_rock()
    yield from hand.click(on_screen((0.0, 0.0, 2.0)))
    answer["clicked"] = bpy.context.view_layer.objects.active.name
    top = yield from hand.turn_panel("ESH_PT_obstacles")
    yield from hand.press("esh.obstacle_add", first=top)
    answer["obstacles"] = [one.item.name for one in scatter().obstacles if one.item]
    answer["changed"] = scatter().changes()
    yield from update()
    answer["on_rock"] = on_rock()
    take_screenshot("hand-2-obstacle.png")
    yield from hand.turn_panel("ESH_PT_obstacles", is_open=False)


def on_rock():
    return int((np.abs(positions()[:, :2]) < 2.0).all(axis=1).sum())


def instances_by_hand():
    """One is moved with G, one pinned, one removed, one deleted with X, and the run afterwards leaves them."""
    top = yield from hand.turn_panel("ESH_PT_instances")
    # In Edit Mode a mesh cannot be read.
    ids, where = values("id"), positions()
    yield from hand.press("esh.instances_edit", first=top)
    take_screenshot("hand-3-edit.png")
    answer["mode"] = scatter().result.mode
    number = {}
    corners = {"moved": (-8.0, 8.0), "pinned": (8.0, 8.0), "removed": (8.0, -8.0), "deleted": (-8.0, -8.0)}
    for what, target in corners.items():
        chosen = int(np.argmin(np.linalg.norm(where[:, :2] - target, axis=1)))
        number[what] = int(ids[chosen]), where[chosen]
    _, place = number["moved"]
    yield from hand.click(on_screen(place))
    yield from hand.keys("g", "x")
    yield from hand.write("1")
    yield from hand.keys("Return")
    yield from hand.click(on_screen(number["pinned"][1]))
    yield from hand.press("esh.instances_pin", across=0.3, first=top)
    yield from hand.click(on_screen(number["removed"][1]))
    yield from hand.press("esh.instances_remove", across=0.8, first=top)
    answer["free_places"] = len(scatter().free_places)
    yield from hand.click(on_screen(number["deleted"][1]))
    before = points_edited()
    answer["by_key"] = []
    for keys in ("x", "ctrl+z", "ctrl+shift+z", "ctrl+z", "Delete"):
        yield from hand.keys(keys)
        yield 0.5
        answer["by_key"].append(points_edited() - before)
    answer["places_by_key"] = len(scatter().free_places)
    take_screenshot("hand-4-picked.png")
    yield from hand.press("esh.instances_edit", first=top)
    answer["mode_after"] = scatter().result.mode
    answer["by_key_after"] = []
    for keys in ("ctrl+z", "ctrl+z", "ctrl+shift+z", "ctrl+shift+z"):
        yield from hand.keys(keys)
        yield 0.5
        edited = scatter().result.mode == "EDIT"
        points = points_edited() if edited else len(scatter().result.data.vertices)
        answer["by_key_after"].append((edited, points - before, len(scatter().free_places)))
    yield from update()
    moved, pinned = (by_id(number[what][0]) for what in ("moved", "pinned"))
    answer["moved_by"] = (moved - number["moved"][1]).tolist()
    answer["pinned_by"] = float(np.linalg.norm(pinned - number["pinned"][1]))
    for what in ("removed", "deleted"):
        away = np.linalg.norm(positions()[:, :2] - number[what][1][:2], axis=1)
        answer[f"nearest_to_{what}"] = float(away.min())
    take_screenshot("hand-5-stayed.png")
    yield from hand.turn_panel("ESH_PT_instances", is_open=False)


def points_edited():
    return len(bmesh.from_edit_mesh(bpy.context.edit_object.data).verts)


def elsewhere():
    """In Edit Mode of the rock X opens Blender's menu, whose first entry deletes vertices."""
    yield from hand.click(on_screen((0.0, 0.0, 2.0)))
    answer["edited"] = bpy.context.view_layer.objects.active.name
    yield from hand.keys("Tab", "1", "a")
    yield 0.5
    before = points_edited()
    yield from hand.keys("x")
    yield 0.5
    take_screenshot("hand-7-menu.png")
    answer["rock_with_menu"] = points_edited() - before
    yield from hand.keys("v")
    yield 0.5
    answer["rock_left"] = points_edited()
    yield from hand.keys("ctrl+z", "Tab")
    yield 0.5
    answer["rock_mode"] = bpy.context.mode


def display():
    """Half of it is shown, then its bounds."""
    module = steps.ours("result.display")
    modifier = module.our_modifier(scatter().result)
    top = yield from hand.turn_panel("ESH_PT_display")
    before = instances()
    share = dict(module._inputs(modifier))["Share"]
    yield from hand.enter(share, "0.5", across=0.7, first=top)
    yield 0.5
    answer["shown"] = before, instances()
    take_screenshot("hand-10-half.png")
    yield from hand.keys("ctrl+z")
    answer["shown_again"] = instances()
    yield from hand.turn_panel("ESH_PT_display", is_open=False)


def turned_and_let_go():
    """What stays is selected, turned, and let go."""
    top = yield from hand.turn_panel("ESH_PT_instances")
    yield from hand.press("esh.instances_select_pinned", first=top)
    yield from hand.move(steps.on_screen(200, 60))
    yield from hand.keys("Tab")
    yield 0.5
    chosen = np.flatnonzero([one.select for one in scatter().result.data.vertices])
    answer["stay"] = len(chosen)
    before = headings()
    yield from hand.press("esh.instances_turn", across=0.3, first=top)
    answer["turned"] = np.flatnonzero(~np.isclose(headings(), before)).tolist() == chosen.tolist()
    yield from hand.press("esh.instances_unpin", across=0.8, first=top)
    yield from hand.press("esh.instances_select_pinned", first=top)
    answer["stay_after"] = scatter().result.mode
    take_screenshot("hand-6-let-go.png")
    yield from hand.turn_panel("ESH_PT_instances", is_open=False)


def headings():
    mesh = scatter().result.data
    found = np.empty(len(mesh.vertices), np.float32)
    mesh.attributes["heading"].data.foreach_get("value", found)
    return found


def real_ones():
    """The objects that were made of instances, by name."""
    made = [item for one in bpy.data.collections if one.name.endswith(" Objects") for item in one.objects]
    return sorted(made, key=lambda item: item.name)


def real_objects():
    """Made real, one of them moved, and back."""
    top = yield from hand.turn_panel("ESH_PT_instances")
    x, edge = yield from hand.upper_edge("esh.instances_edit", first=top)
    yield from hand.press("esh.instances_make_real", first=top)
    yield from hand.until(real_ones, 20.0, "the real objects")
    take_screenshot("hand-11-real.png")
    made = real_ones()
    answer["real"] = [item.name for item in made]
    place = made[0].matrix_world.translation.copy()
    yield from hand.click(on_screen(place))
    # To draw hundreds of objects for the first time may take a while.
    yield from hand.until(lambda: bpy.context.view_layer.objects.active == made[0], 10.0, "picking an object")
    answer["picked"] = bpy.context.view_layer.objects.active.name
    yield from hand.keys("g", "x")
    yield from hand.write("0.5")
    yield from hand.keys("Return")
    # A menu has no command of its own: it is below the two lines that say what is the case, as is said above the panel since then.
    yield from hand.click((x, edge + BACK_DOWN))
    take_screenshot("hand-11-back-menu.png")
    yield from hand.keys("k")
    yield 1.0
    answer["back"] = instances()
    answer["at_moved"] = float(np.linalg.norm(positions() - np.array([place.x + 0.5, place.y, place.z]), axis=1).min())
    take_screenshot("hand-12-back.png")
    yield from hand.turn_panel("ESH_PT_instances", is_open=False)


def ends():
    """A run that is stopped changes nothing; a result that is deleted is missed; a scatter's new name is its result's."""
    before = positions()
    yield from hand.press("esh.scatter(")
    yield from hand.until(lambda: not idle(), 5.0, "the start of the run")
    pressed = time.perf_counter()
    yield from hand.keys("Escape")
    yield from hand.until(idle, 5.0, "the end of the run")
    answer["stopping"] = time.perf_counter() - pressed
    answer["stopped"] = bool((positions() == before).all())
    yield from hand.enter("].name", "Wood", across=0.4)
    answer["renamed"] = scatter().name, scatter().result.name
    yield from hand.click(on_screen(positions()[0]))
    answer["to_delete"] = bpy.context.view_layer.objects.active.name
    yield from hand.keys("x", "Return")
    yield 1.0
    answer["deleted"] = scatter().result_in(bpy.context.scene) is None
    take_screenshot("hand-16-deleted.png")
    yield from hand.keys("ctrl+z")
    yield 1.0
    answer["undone"] = scatter().result_in(bpy.context.scene) is not None
    take_screenshot("hand-17-undone.png")


def another_scatter():
    """A second scatter between the first one's objects: the ground is clicked where the result may be what is picked."""
    first, taken = scatter().result, positions()
    yield from hand.click(on_screen((-12.0, 0.0, 0.0)))
    yield from hand.click(on_screen(free_place(taken)), "shift")
    answer["selected"] = sorted(item.name for item in bpy.context.selected_objects)
    # The menu beside the scatter's name is in one line with the button that adds a scatter.
    _, y = yield from hand.find("esh.scatter_add", across=0.76)
    _, _, region = hand.sidebar()
    yield from hand.click((region.x + 20, y))
    yield 0.5
    take_screenshot("hand-20-menu.png")
    yield from hand.keys("s")
    yield from hand.until(
        lambda: scatter().result not in (None, first) and idle(), LONGEST_RUN, "the run of the second scatter"
    )
    yield 1.0
    answer["second"] = scatter().target.name, [one.name for one in scatter().classes]
    here = positions()[:, :2]
    answer["nearest_of_other"] = float(min(np.linalg.norm(taken[:, :2] - one, axis=1).min() for one in here))
    answer["second_overlaps"] = scatter().report["overlaps"]
    take_screenshot("hand-21-second.png")


def free_place(taken):
    """The place of the ground that is farthest from everything on it."""
    x, y = np.meshgrid(np.linspace(-8.0, 8.0, 60), np.linspace(-8.0, 8.0, 60))
    places = np.stack([x.ravel(), y.ravel()], axis=-1)
    places = places[np.abs(places).max(axis=1) > 3.0]
    nearest = np.linalg.norm(places[:, None] - taken[None, :, :2], axis=-1).min(axis=1)
    return (*places[np.argmax(nearest)], 0.0)


def overlaps():
    """Too many overlap: they are selected, and the worst is framed."""
    yield from ask_for("640")
    yield from update()
    answer["overlaps"] = scatter().report["overlaps"]
    take_screenshot("hand-22-overlaps.png")
    yield from hand.press("esh.select_overlapping", across=0.3)
    answer["selecting"] = scatter().result.mode
    yield from hand.press("esh.frame_overlap", across=0.8)
    answer["cursor"] = list(bpy.context.scene.cursor.location)
    take_screenshot("hand-23-framed.png")
    yield from hand.move(steps.on_screen(200, 60))
    yield from hand.keys("Tab", "Home")
    yield 0.5
    answer["selected_points"] = int(sum(one.select for one in scatter().result.data.vertices))


def scaled_to_fit():
    """Far too many are asked for: it is said before a run, and the button below it asks for as many as fit."""
    yield from ask_for("9000")
    # It is worked out in a moment.
    yield 3.0
    take_screenshot("hand-25-too-many.png")
    yield from hand.press("esh.counts_to_fit")
    yield 3.0
    answer["scaled_to"] = [one.count for one in scatter().classes]
    take_screenshot("hand-26-scaled.png")
    yield from hand.move(on_screen((0.0, 0.0, 0.0)))
    yield from hand.keys("ctrl+z")
    yield 1.0
    answer["scaling_undone"] = [one.count for one in scatter().classes]
    yield from hand.keys("ctrl+shift+z")
    yield 1.0
    answer["scaling_redone"] = [one.count for one in scatter().classes]
    yield from update()
    answer["scaled"] = len(positions()), scatter().report["overlaps"], scatter().report["covered"]
    take_screenshot("hand-27-fitted.png")


def undone_while_it_runs():
    """Ctrl+Z during a run takes back what has just begun, and nothing before it."""
    before, changes = positions(), scatter().changes()
    yield from hand.press("esh.scatter(")
    yield from hand.until(lambda: not idle(), 5.0, "the start of the run")
    yield from hand.keys("ctrl+z")
    yield from hand.until(idle, 5.0, "the end of the run")
    yield 1.0
    answer["undone_run"] = bool((positions() == before).all()) and scatter().changes() == changes
    take_screenshot("hand-24-undone.png")


def by_keyboard():
    """F3 finds what the buttons do by their names, and F9 changes what was done last: more or fewer, another seed."""
    yield from hand.move(on_screen((0.0, 0.0, 0.0)))
    yield from hand.search("scatter sel")
    yield from hand.until(lambda: scatter() and scatter().report_json and idle(), LONGEST_RUN, "the first run")
    yield 1.0
    answer["found"] = [one.count for one in scatter().classes]
    yield from _change_last("hand-40-last.png", 2, "60")
    yield from hand.until(lambda: len(positions()) < 70, LONGEST_RUN, "the run with fewer")
    answer["fewer"] = len(bpy.context.scene.esh_scatter.scatters), len(positions())
    yield from hand.keys("Escape")
    report = scatter().report_json
    yield from hand.move(on_screen((0.0, 0.0, 0.0)))
    yield from hand.search("update sca")
    yield from hand.until(lambda: idle() and scatter().report_json != report, LONGEST_RUN, "the next run")
    yield 1.0
    yield from _change_last("hand-41-update.png", 1, "2")
    yield from hand.until(lambda: len(positions()) > 100, LONGEST_RUN, "the run with twice as many")
    answer["more"] = len(positions()), [one.count for one in scatter().classes], scatter().changes()
    take_screenshot("hand-42-more.png")
    yield from hand.keys("Escape")
    yield from hand.move(on_screen((0.0, 0.0, 0.0)))
    before = len(bpy.context.scene.objects)
    yield from hand.search("make real")
    yield 1.0
    answer["real"] = len(bpy.context.scene.objects) - before
    take_screenshot("hand-43-real.png")


def _change_last(picture, line, text):
    """Write a number into a line of the panel of the last operation, which F9 opens below the mouse."""
    x, y = on_screen((0.0, 0.0, 0.0))
    yield from hand.function_key(9)
    yield 0.5
    take_screenshot(picture)
    yield from hand.click((x + LAST_ACROSS, y + LAST_DOWN + (line - 1) * LINE), times=2)
    yield from hand.replace(text)
    yield 0.5


def painted_without_live():
    """What is painted is scattered by the button, without leaving the paint mode."""
    yield from hand.move(on_screen((0.0, 0.0, 0.0)))
    yield from hand.search("paint dens")
    yield 2.0
    answer["painting"] = bpy.context.mode
    before, report = positions(), scatter().report_json
    (x, y), (right, _) = on_screen((-8.0, 6.0, 0.0)), on_screen((8.0, 6.0, 0.0))
    stroke = steps.drag([(x + k * (right - x) // 30, y) for k in range(31)], 2.0)
    yield from hand.until(lambda: stroke.poll() is not None, 20.0, "the stroke")
    yield 1.0
    take_screenshot("hand-44-painted.png")
    yield from hand.press("esh.scatter(")
    yield from hand.until(lambda: idle() and scatter().report_json != report, LONGEST_RUN, "the run")
    yield 1.0
    own = values("class_index") == 0
    answer["off_stroke"] = int((np.abs(positions()[own][:, 1] - 6.0) > 3.0).sum()), int(own.sum())
    answer["painting_after"] = bpy.context.mode, len(before) == len(positions())
    take_screenshot("hand-45-updated.png")


def a_preset_on_top():
    """A preset is chosen from the menu with its pictures, by its first letters, and finds room between what is there."""
    yield from hand.move(steps.on_screen(200, 200))
    yield from hand.keys("alt+a")
    yield from hand.move(on_screen((0.0, 0.0, 0.0)))
    yield from open_presets()
    # Its pictures are read only now.
    yield 1.5
    take_screenshot("hand-30-presets.png")
    yield from hand.keys("space")
    yield from hand.write(PRESET[:8])
    take_screenshot("hand-31-search.png")
    yield from hand.keys("Return")
    yield 1.0
    answer["preset"] = scatter().name, scatter().target.name
    yield from update()
    answer["placed"] = len(positions())
    answer["of_preset"] = instances() - len(positions()), scatter().report["overlaps"]
    take_screenshot("hand-32-preset.png")


def exported():
    """Written with the File menu's entry: the ending that is typed is the format, and what is there is said."""
    # A dialog begins in the file's folder, with its name.
    bpy.ops.wm.save_as_mainfile(filepath=str(steps.FOLDER / "wood.blend"))
    # A file dialog over one area that fills the window would leave that area's place to itself.
    yield from hand.move(on_screen((0.0, 0.0, 0.0)))
    yield from hand.keys("ctrl+space")
    yield 1.0
    yield from _choose_export()
    take_screenshot("hand-33-export.png")
    answer["offered"] = bpy.context.window_manager.windows[0].screen.areas[0].spaces.active.params.filename
    yield from hand.name_file("forest.glb")
    take_screenshot("hand-34-named.png")
    yield from hand.confirm()
    answer["exported"] = (steps.FOLDER / "forest.glb").stat().st_size
    take_screenshot("hand-35-exported.png")
    yield from _choose_export()
    yield from hand.name_file("forest.usdc")
    yield from hand.confirm()
    answer["usd"] = bpy.app.build_options.usd, (steps.FOLDER / "forest.usdc").exists()
    take_screenshot("hand-36-usd.png")
    # Blender's own exporter says that it leaves the scatter out, and keeps it where that is switched on.
    with steps.window_context():
        bpy.ops.export_scene.gltf("INVOKE_DEFAULT")
    yield from hand.until(hand.file_dialog, 10.0, "the file dialog")
    yield 1.0
    take_screenshot("hand-37-note.png")
    yield from hand.name_file("plain.glb")
    yield from hand.confirm()
    content = (steps.FOLDER / "plain.glb").read_bytes()
    answer["nodes"] = len(json.loads(content[20 : 20 + int.from_bytes(content[12:16], "little")])["nodes"])


def _choose_export():
    """The last entry of File, Export."""
    yield from hand.click(FILE_MENU)
    yield from hand.keys("e")
    yield 0.5
    take_screenshot("hand-33-menu.png")
    yield from hand.keys("Up", "Return")
    yield from hand.until(hand.file_dialog, 10.0, "the file dialog")
    yield 1.0


def classes():
    """In the list of the classes one is left out, one hidden, one renamed; one is duplicated and asked for by its distance."""
    top = yield from hand.turn_panel("ESH_PT_classes")
    before = instances()
    yield from hand.press("classes[1].mute", across=CHECKBOXES, first=top)
    answer["muted"] = scatter().classes[1].mute, scatter().changes()
    yield from hand.press("classes[0].show_viewport", across=EYES, first=top)
    answer["hidden"] = before, instances(), scatter().changes()
    take_screenshot("hand-50-muted.png")
    yield from hand.keys("ctrl+z")
    yield 0.5
    answer["shown_again"] = instances()
    yield from hand.enter("class_index", "Fir", across=0.2, first=top)
    _, y = yield from hand.find("esh.class_add", across=BESIDE, first=top)
    _, _, region = hand.sidebar()
    # The menu is below the buttons that add and remove a class.
    yield from hand.click((round(region.x + BESIDE * region.width), y + 2 * LINE - 2))
    take_screenshot("hand-51-menu.png")
    yield from hand.keys("d")
    yield 0.5
    answer["classes"] = [one.name for one in scatter().classes]
    yield from hand.turn_panel("ESH_PT_classes", is_open=False)
    top = yield from hand.turn_panel("ESH_PT_class")
    yield from hand.press("count_kind", first=top)
    take_screenshot("hand-52-how-many.png")
    yield from hand.keys("d")
    yield from hand.enter("].distance", "1.5", first=top)
    yield 0.5
    copied = scatter().active_class
    answer["distance"] = copied.count_kind, round(copied.distance, 3)
    yield from update()
    answer["without"] = np.bincount(values("class_index")).tolist()
    take_screenshot("hand-53-updated.png")


def densities():
    """The density of a class gets layers, shown on the ground; one is weakened, turned round, moved and removed."""
    _, shown = yield from hand.press("esh_scatter_show_density")
    window, _, region = hand.sidebar()
    top, layers = shown - (window.height - region.y - region.height), scatter().active_class.layers
    for number, key in enumerate(("n", "s")):
        yield from _add_layer(top, key, f"hand-5{4 + number}-add.png")
    answer["layers"] = [one.kind for one in layers]
    take_screenshot("hand-56-layers.png")
    yield from hand.enter("layers[1].strength", "0.5", first=top)
    yield from hand.press("layers[1].invert", first=top)
    yield 1.0
    answer["layer"] = round(layers[1].strength, 3), layers[1].invert
    take_screenshot("hand-57-shown.png")
    yield from hand.press("layers[0].use", across=0.115, first=top)
    answer["off"] = [one.use for one in layers]
    yield from hand.press("esh.layer_remove", across=BESIDE, first=top)
    answer["left"] = [one.kind for one in layers]
    yield from hand.move(on_screen((0.0, 0.0, 0.0)))
    yield from hand.keys("ctrl+z", "ctrl+z")
    yield 0.5
    layers = scatter().active_class.layers
    answer["back"] = [(one.kind, one.use) for one in layers]
    yield from hand.press("esh_scatter_show_density", first=top)
    yield from update()
    answer["followed"] = scatter().changes(), len(positions()) > 100
    take_screenshot("hand-58-updated.png")


def _add_layer(top, key, picture):
    """Open the menu that adds a layer: a button across the panel while there is none, then one beside the list."""
    if len(scatter().active_class.layers):
        _, y = yield from hand.find("esh.layer_remove", across=BESIDE, first=top)
        _, _, region = hand.sidebar()
        yield from hand.click((round(region.x + BESIDE * region.width), y - LINE))
    else:
        # It is below the line that says that there is none.
        x, y = hand.on_panel(top, 2.0)
        yield from hand.click((x - 100, y))
    take_screenshot(picture)
    yield from hand.keys(key)
    yield 0.5


WALKS = {
    "one scatter": (begin, obstacles, instances_by_hand, turned_and_let_go, elsewhere, display, real_objects, ends),
    "another scatter": (begin, another_scatter, overlaps, undone_while_it_runs, scaled_to_fit),
    "handing on": (begin, a_preset_on_top, exported),
    "by keyboard": (by_keyboard,),
    "painting": (begin, painted_without_live),
    "classes": (begin, classes, densities),
}
hand.take(WALKS[steps.ARGUMENTS[0]], fill_in)
