"""Presets make a scatter in one click, hold nothing but plain values, and come back from their files."""

import json

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import esh  # noqa: E402
from esh.esh_scatter.editing.preset_files import BUILT_IN, built_in_presets, read_preset, write_preset  # noqa: E402
from esh.esh_scatter.editing.presets import preset_of  # noqa: E402

NAMES = sorted(path.stem for path in BUILT_IN.glob("*.json"))


def new_object(name, width):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(0, 0, 0), (width, 0, 0), (width, width, 0), (0, width, 0)], [], [(0, 1, 2, 3)])
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


@pytest.fixture
def ground(empty_file):
    item = new_object("Ground", 40.0)
    bpy.context.view_layer.objects.active = item
    return item


def test_there_are_a_dozen_and_their_names_tell_their_files():
    assert len(NAMES) >= 12
    for path, name in built_in_presets().items():
        preset = read_preset(path)
        assert preset["name"] == name and preset["about"]


@pytest.mark.parametrize("name", NAMES)
def test_every_preset_scatters_at_once_and_fits_on_its_ground(ground, name):
    image = bpy.data.images.new("picture", 32, 32)
    image.generated_type = "COLOR_GRID"
    assert bpy.ops.esh.preset_apply(filepath=str(BUILT_IN / f"{name}.json")) == {"FINISHED"}
    scatter = bpy.context.scene.esh_scatter.active
    assert scatter.obstacle(bpy.context.scene) is None and not scatter.left_out()
    for body_class in scatter.classes:
        # Few of them, which says the same.
        body_class.sizes[0].count = min(body_class.sizes[0].count, 40)
    scatter.device, scatter.max_steps = "CPU", 3
    positional, named = scatter.arguments(bpy.context.scene)
    assert len(esh.ScatterJob(*positional, **named).problem.classes) == len(scatter.classes)
    cover = sum(one.get("cover", 0.0) for one in read_preset(BUILT_IN / f"{name}.json")["classes"])
    assert cover < 0.75 or not scatter.avoid_overlap


@pytest.mark.parametrize("width", [0.3, 40.0, 2000.0])
def test_a_preset_is_as_large_as_its_ground(ground, width):
    target = new_object("Other", width)
    bpy.context.view_layer.objects.active = target
    bpy.ops.esh.preset_apply(filepath=str(BUILT_IN / "pizza.json"))
    scatter = bpy.context.scene.esh_scatter.active
    salami = scatter.classes["Salami"].sizes[0]
    assert scatter.first_target == target and salami.count == 14
    bounds = salami.source_object.bound_box
    diameter = max(corner[0] for corner in bounds) - min(corner[0] for corner in bounds)
    # 14 discs on 24 % of the ground.
    assert diameter == pytest.approx(width * (4 * 0.24 / 14 / 3.1416) ** 0.5, rel=0.03)
    assert all(salami.source_object not in list(scene.objects) for scene in bpy.data.scenes), "only its instances show"


def test_selected_objects_take_the_places_of_the_classes(ground, capfd):
    tree, bush = new_object("A tree", 2.0), new_object("B bush", 0.02)
    for item in (tree, bush, ground):
        item.select_set(True)
    bpy.context.view_layer.objects.active = ground
    bpy.context.view_layer.update()
    bpy.ops.esh.preset_apply(filepath=str(BUILT_IN / "mixed_forest.json"))
    first, second, third = bpy.context.scene.esh_scatter.active.classes
    assert (first.sizes[0].source_object, second.sizes[0].source_object) == (tree, bush)
    assert first.sizes[0].count == 64, "16 % of 1,600 m², 4 m² each"
    assert second.sizes[0].count == 20_000, "not without end"
    said = capfd.readouterr().out
    assert f"Held at 20,000: {second.name} (" in said and first.name not in said.partition("Held")[2]
    assert third.sizes[0].source_object.name.startswith("Bush")


def test_what_is_scattered_there_already_takes_no_place_although_it_is_still_selected(ground):
    tree, stone = new_object("A tree", 2.0), new_object("B stone", 1.0)
    for item in (tree, ground):
        item.select_set(True)
    bpy.context.view_layer.objects.active = ground
    bpy.context.view_layer.update()
    bpy.ops.esh.scatter_selection(most=20)
    stone.select_set(True)
    bpy.ops.esh.preset_apply(filepath=str(BUILT_IN / "pebbles.json"))
    first, second, _ = bpy.context.scene.esh_scatter.active.classes
    assert first.sizes[0].source_object == stone
    assert second.sizes[0].source_object.name.startswith("Pebble")


def test_a_preset_asks_for_what_fits_between_what_stands_there(ground):
    tree = new_object("Tree", 1.2)
    for item in (tree, ground):
        item.select_set(True)
    bpy.context.view_layer.objects.active = ground
    bpy.context.view_layer.update()
    bpy.ops.esh.scatter_selection(cover=0.35)
    bpy.ops.esh.preset_apply(filepath=str(BUILT_IN / "pebbles.json"))
    scatter = bpy.context.scene.esh_scatter.active
    scatter.device = "CPU"
    large, pebble, gravel = scatter.classes
    widths = [one.sizes[0].source_object.dimensions.x for one in scatter.classes]
    assert widths[0] > widths[1] > widths[2] and widths[0] < 1.5, "stones are as large as the gaps"
    assert large.count < 0.7 * 60 and pebble.count > 0.5 * 340 and gravel.count > 0.75 * 1500, (
        "between trees there is room for gravel, not for boulders"
    )
    bpy.ops.esh.scatter()
    assert scatter.report["overlaps"] == scatter.report["in_obstacles"] == 0


def test_a_scatter_that_is_exported_comes_back(ground, tmp_path):
    scatter = bpy.context.scene.esh_scatter.add_scatter(ground)
    scatter.name, scatter.class_separation, scatter.device = "Rocks", 0.25, "CPU"
    one = scatter.add_class()
    one.name, one.tilt, one.count_kind, one.distance, one.color = "Rock", 0.5, "DISTANCE", 3.5, (0.1, 0.2, 0.3)
    second = one.add_size()
    second.count, second.area_kind, second.area = 9, "VALUE", 0.25
    layer = one.add_layer("NOISE", noise_scale=3.0, invert=True, use_curve=True)
    layer.curve.nodes[0].mapping.curves[0].points[1].location = (1.0, 0.5)
    other = scatter.add_class()
    other.name, other.may_overlap = "Moss", "Rock"
    other.add_layer("CLASS", class_name="Rock", blend="SUBTRACT")
    path = tmp_path / "rocks.json"
    assert bpy.ops.esh.preset_export(filepath=str(path)) == {"FINISHED"}
    assert bpy.ops.esh.preset_import(filepath=str(path)) == {"FINISHED"}
    scatters = bpy.context.scene.esh_scatter.scatters
    made = scatters[1]
    assert (made.name, made.class_separation, made.device) == ("Rocks 2", 0.25, "AUTO")
    rock, moss = made.classes
    assert (rock.tilt, rock.count_kind, rock.distance) == (0.5, "DISTANCE", 3.5)
    assert tuple(rock.color) == pytest.approx((0.1, 0.2, 0.3), abs=1e-4)
    assert [(s.area_kind, s.count) for s in rock.sizes] == [("MESH", 100), ("VALUE", 9)]
    layer = rock.layers[0]
    assert (layer.kind, layer.noise_scale, layer.invert) == ("NOISE", 3.0, True)
    assert layer.curve_record()[1][:2] == pytest.approx([1.0, 0.5])
    assert moss.overlaps_with(rock) and moss.layers[0].other_class == rock and moss.layers[0].blend == "SUBTRACT"
    assert preset_of(made) | {"name": "Rocks"} == preset_of(scatters[0]) | {"classes": preset_of(made)["classes"]}


GOOD = {"format": "esh-scatter-preset", "version": 1, "classes": [{"name": "A"}]}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"format": "other"}, "must be a preset of ESH Scatter"),
        ({"version": 9}, "must be of version 1; got 9"),
        ({"classes": []}, "must be a list of 1 to 256"),
        ({"code": "print()"}, 'must have no key "code"'),
        ({"classes": [{"name": "A", "count": 0}]}, "Count of class 1"),
        ({"classes": [{"name": "A", "color": [1, 2]}]}, "must be 3 numbers"),
        ({"classes": [{"name": "A", "stand_in": {"shape": "import os"}}]}, "one of ball, box, cone"),
        ({"classes": [{"name": "A", "settings": {"tilt": None}}]}, "must be a number, text, true or false"),
        ({"classes": [{"name": "A", "settings": {"uid": 5}}]}, '"uid" is not'),
        ({"classes": [{"name": "A", "settings": {"__class__": "x"}}]}, '"__class__" is not'),
        ({"classes": [{"name": "A", "settings": {"count_kind": "MANY"}}]}, "must have a value that fits"),
        ({"classes": [{"name": "A", "layers": [{"kind": "MAGIC"}]}]}, "must have a value that fits"),
        ({"classes": [{"name": "A", "layers": [{"kind": "NOISE", "curve": [[1.0]]}]}]}, "must be points (x, y)"),
        ({"settings": {"target": "Cube"}}, '"target" is not'),
    ],
)
def test_what_is_no_preset_is_said_and_changes_nothing(ground, tmp_path, changes, words):
    path = tmp_path / "bad.json"
    path.write_text(json.dumps(GOOD | changes), encoding="utf-8")
    with pytest.raises(RuntimeError) as caught:
        bpy.ops.esh.preset_import(filepath=str(path))
    assert words in str(caught.value), str(caught.value)
    assert not bpy.context.scene.esh_scatter.scatters


def test_files_that_cannot_be_read_or_written_are_named(tmp_path):
    said = "must be a preset of ESH Scatter: a file that Export Preset has written"
    for name, content, words in (
        ("none.json", None, "must be a file that can be read"),
        ("text.json", b"no", f"{said}$"),
        ("picture.json", bytes([255, 216, 255]), f"{said}$"),
        ("torn.json", b'{"format": "esh-scatter-preset",\n "classes"', rf"{said} \(.*line 2"),
    ):
        if content is not None:
            (tmp_path / name).write_bytes(content)
        with pytest.raises(esh.InputFileError, match=words):
            read_preset(tmp_path / name)
    with pytest.raises(esh.InputFileError, match="must be a file that can be written"):
        write_preset(tmp_path / "no" / "folder.json", {"classes": []})


def test_the_example_is_a_forest_on_hills(ground):
    ground.select_set(True)
    assert bpy.ops.esh.example() == {"FINISHED"}
    scatter = bpy.context.scene.esh_scatter.active
    hills = scatter.first_target
    assert hills != ground and hills == bpy.context.view_layer.objects.active and not ground.select_get()
    assert np.ptp([vertex.co.z for vertex in hills.data.vertices]) > 2.0
    assert scatter.report["overlaps"] == 0 and len(scatter.result.data.vertices) == sum(
        c.count for c in scatter.classes
    )
    assert len({c.sizes[0].source_object for c in scatter.classes}) == 3 and not scatter.outdated


def test_an_example_that_is_stopped_leaves_nothing(ground, monkeypatch):
    before = [len(bpy.data.objects), len(bpy.data.meshes)]

    def fail(*_arguments, **_named):
        raise esh.EshError("it was stopped")

    monkeypatch.setattr("esh.esh_scatter.api.scatter", fail)
    with pytest.raises(RuntimeError, match="It was stopped"):
        bpy.ops.esh.example()
    assert not bpy.context.scene.esh_scatter.scatters and "Example Ground" not in bpy.data.objects
    # The shapes that stood for objects are in no scene, and go when the file is saved.
    assert all(item.users_scene == () for item in bpy.data.objects if item != ground)
    assert len(bpy.data.objects) == before[0] + 3
