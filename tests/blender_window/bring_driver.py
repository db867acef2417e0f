"""Runs inside a windowed Blender: an asset is dropped onto a class, a preset handed on, and scatters copied and appended.

What happens is done with the mouse and the keyboard only, beside files that are opened and written; what came of it is read.
"""

import json

import bpy
import numpy as np
import window_hand as hand
import window_steps as steps
from window_scene import ask_for, begin, fill_in, on_screen, open_presets, positions, scatter, update, values
from window_steps import answer, take_screenshot

PRESET = "woods.json"


def open_browser():
    """The asset browser is beside the viewport with its sidebar."""
    with steps.window_context():
        bpy.context.area.spaces.active.show_region_ui = True
    steps.open_asset_browser(0.3)


def set_stage():
    """The pebble is an asset of this file; a file without a scatter is kept aside."""
    fill_in()
    bpy.data.objects["Pebble"].asset_mark()
    bpy.ops.wm.save_as_mainfile(filepath=str(steps.FOLDER / "ground.blend"), copy=True)


def asset_dropped():
    """The pebble is dragged from the asset browser onto the field that says what a class places."""
    space = steps.asset_browser().spaces.active
    space.show_region_toolbar = False
    space.params.asset_library_reference = "LOCAL"
    space.params.display_size_discrete = "LARGE"
    top = yield from hand.turn_panel("ESH_PT_class")
    x, y = yield from hand.find("].source_object", across=0.5, first=top)
    window, region = bpy.context.window_manager.windows[0], _region(steps.asset_browser(), "WINDOW")
    start = region.x + 60, window.height - (region.y + region.height - 60)
    take_screenshot("bring-1-asset.png")
    with hand.held(start):
        for share in np.linspace(0.0, 1.0, 12):
            yield from hand.move([round(a + share * (b - a)) for a, b in zip(start, (x, y), strict=True)])
        take_screenshot("bring-2-dragged.png")
    yield 1.0
    size = scatter().active_class.active_size
    answer["dropped"] = size.source_object.name, scatter().changes(), _of("Pebble")
    with bpy.context.temp_override(window=window, area=steps.asset_browser()):
        bpy.ops.screen.area_close()
    yield 1.0
    yield from hand.turn_panel("ESH_PT_class", is_open=False, first=top - 40)
    yield from update()
    answer["placed"] = _of("Pebble"), size.count, scatter().changes()
    take_screenshot("bring-3-placed.png")


def _region(area, kind):
    return next(one for one in area.regions if one.type == kind)


def _of(name):
    """How many instances of an object are shown."""
    shown = bpy.context.evaluated_depsgraph_get().object_instances
    return sum(1 for one in shown if one.is_instance and one.object.original.name == name)


def preset_exported():
    """The settings are written as a preset."""
    bpy.ops.wm.save_as_mainfile(filepath=str(steps.FOLDER / "wood.blend"))
    yield from open_presets()
    yield 1.5
    take_screenshot("bring-4-export.png")
    yield from hand.keys("e")
    yield from hand.until(hand.file_dialog, 10.0, "the file dialog")
    yield 1.0
    yield from hand.name_file(PRESET)
    yield from hand.confirm()
    written = json.loads((steps.FOLDER / PRESET).read_text(encoding="utf-8"))
    answer["exported"] = _asked()
    answer["written"] = [[one["name"], *(size["count"] for size in one["sizes"])] for one in written["classes"]]


def preset_imported():
    """In another file, where the objects to place are selected, it asks for as many, and they are placed."""
    bpy.ops.wm.open_mainfile(filepath=str(steps.FOLDER / "ground.blend"), load_ui=False)
    yield 2.0
    answer["without"] = scatter() is None
    yield from hand.move(on_screen((0.0, 0.0, 0.0)))
    yield from hand.search("import pres")
    yield from hand.until(hand.file_dialog, 10.0, "the file dialog")
    yield 1.0
    take_screenshot("bring-5-import.png")
    yield from hand.name_file(PRESET)
    yield from hand.confirm()
    answer["imported"] = scatter().target.name, _asked(), _sources()
    yield from update()
    answer["import_placed"] = np.bincount(values("class_index")).tolist(), scatter().report["overlaps"]
    take_screenshot("bring-6-imported.png")


def _asked():
    return [[one.name, one.count] for one in scatter().classes]


def _sources():
    return [one.active_size.source_object.name for one in scatter().classes]


def opened_again():
    """The file is opened again, as it was saved: what it placed is there, and a run places the same."""
    before = positions().tobytes()
    bpy.ops.wm.open_mainfile(filepath=str(steps.FOLDER / "wood.blend"), load_ui=False)
    yield 2.0
    there = positions().tobytes()
    yield from update()
    answer["opened"] = before == there, positions().tobytes() == there, scatter().changes()


def scatter_copied():
    """What was placed is copied with Shift+D and made a scatter of its own; both keep working."""
    first, there = scatter().result.name, positions()
    yield from hand.click(on_screen(_in_middle(there)))
    yield from hand.move(on_screen((0.0, 0.0, 0.0)))
    yield from hand.keys("shift+d", "Return")
    yield 0.5
    copied = bpy.context.view_layer.objects.active.name
    take_screenshot("bring-7-copy.png")
    yield from hand.press("esh.scatter_of_copy")
    yield 0.5
    answer["copied"] = first, copied, scatter().result.name, len(bpy.context.scene.esh_scatter.scatters)
    yield from ask_for("20")
    yield from update()
    answer["copy_updated"] = len(positions()), len(there), scatter().report["overlaps"], scatter().changes()
    kept = bpy.context.scene.esh_scatter.scatters[0]
    answer["first_kept"] = _places(kept.result).tobytes() == there.tobytes(), kept.changes()
    apart = np.linalg.norm(positions()[:, None] - there[None], axis=-1)
    answer["nearest_of_first"] = float(apart.min())
    take_screenshot("bring-8-copies.png")


def _places(item):
    """Where a result's points are."""
    place = np.empty(3 * len(item.data.vertices), np.float32)
    item.data.attributes["position"].data.foreach_get("vector", place)
    return place.reshape(-1, 3)


def _in_middle(places):
    """One of some places that the rock does not hide."""
    return places[np.argmin(np.linalg.norm(places[:, :2] - (-4.0, 0.0), axis=1))]


def scene_copied():
    """The whole scene is copied: what it shows is its own, and a run changes nothing in the other."""
    first, before, place = bpy.context.scene, scatter().result, positions().tobytes()
    bpy.ops.scene.new(type="FULL_COPY")
    yield 1.0
    second = bpy.context.window.scene
    answer["scenes"] = first != second, scatter().changes()
    yield from ask_for("30")
    yield from update()
    answer["scene_copied"] = (
        scatter().result.data != before.data,
        _places(before).tobytes() == place,
        scatter().result.name in second.objects,
        len(positions()) == sum(one.count for one in scatter().classes),
    )
    take_screenshot("bring-9-scene.png")


def appended():
    """What another file has placed is appended, and made a scatter of this file; it is placed anew."""
    name = "Ground Scatter"
    bpy.ops.wm.open_mainfile(filepath=str(steps.FOLDER / "ground.blend"), load_ui=False)
    yield 2.0
    with steps.window_context():
        # What the dialog of File > Append calls.
        bpy.ops.wm.append(directory=str(steps.FOLDER / "wood.blend" / "Object"), filename=name)
    yield 1.0
    yield from hand.click(on_screen(_in_middle(_places(bpy.data.objects[name]))))
    answer["picked"] = bpy.context.view_layer.objects.active.name, name
    take_screenshot("bring-10-appended.png")
    yield from hand.press("esh.scatter_of_copy")
    yield 0.5
    asked = sum(one.count for one in scatter().classes)
    answer["appended"] = scatter().target.name, asked, len(positions()), scatter().obstacle(bpy.context.scene)
    yield from ask_for("25")
    yield from update()
    answer["appended_updated"] = len(positions()), sum(one.count for one in scatter().classes), scatter().changes()
    answer["appended_classes"] = np.bincount(values("class_index")).tolist()
    take_screenshot("bring-11-updated.png")


WALKS = (
    begin,
    asset_dropped,
    preset_exported,
    opened_again,
    scatter_copied,
    scene_copied,
    preset_imported,
    appended,
)
hand.take(WALKS, set_stage, opening=open_browser)
