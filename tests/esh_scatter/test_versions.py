"""Files that older versions saved come up to date when they are opened."""

import json
from pathlib import Path

import pytest

bpy = pytest.importorskip("bpy")

from esh.esh_scatter import registration, versions  # noqa: E402
from esh.esh_scatter.result import words  # noqa: E402

# Made in Blender 4.5 by the last version without a number: two scatters, of which the second was changed after its run.
OLD = Path(__file__).parent / "files" / "settings_of_version_0.blend"
# The same, saved by version 1 with other values of how objects stand.
OLD_1 = OLD.with_name("settings_of_version_1.blend")
# Of two scatters with a density of each kind, saved by version 2; the second one's image was no longer inverted after its run.
OLD_2 = OLD.with_name("settings_of_version_2.blend")


pytestmark = pytest.mark.usefixtures("empty_file")


def check(settings):
    first, second = settings.scatters
    assert settings.version == versions.VERSION
    assert (first.seed, first.device, first.class_separation, first.target.name) == (11, "CPU", 0.25, "Ground")
    pine, beech = first.classes
    assert (pine.name, pine.use_unsharp, pine.unsharp_radius, pine.may_overlap) == ("Pine", True, 9.0, "Beech")
    assert beech.sizes[0].count == 77 and beech.sizes[0].source.name == "Tree"
    # What was added since has its default.
    assert beech.sizes[0].distribution == "LINEAR"
    assert not first.outdated, "nothing was changed since its run"
    assert second.outdated
    first.classes[0].sizes[0].count += 1
    assert first.outdated


def test_an_old_file_is_brought_up_to_date_when_it_is_opened():
    bpy.ops.wm.open_mainfile(filepath=str(OLD))
    check(bpy.context.scene.esh_scatter)


def test_standing_and_numbers_of_classes_come_from_the_scatter_of_version_1():
    bpy.ops.wm.open_mainfile(filepath=str(OLD_1))
    check(bpy.context.scene.esh_scatter)
    first, second = bpy.context.scene.esh_scatter.scatters
    for body_class in first.classes:
        assert (body_class.align_to_normal, body_class.random_turn, body_class.scale_jitter) == (0.25, 1.0, 0.125)
        assert (body_class.tilt, body_class.offset) == (0.0, 0.0)
    assert second.classes[0].align_to_normal == 1.0
    assert len({body_class.uid for body_class in first.classes} - {0}) == 2
    assert second.changes() == ["settings"]


def test_what_was_one_density_in_version_2_is_one_layer():
    bpy.ops.wm.open_mainfile(filepath=str(OLD_2))
    first, second = bpy.context.scene.esh_scatter.scatters
    even, image, group, attribute = first.classes
    assert [len(c.layers) for c in first.classes] == [0, 1, 1, 1]
    layer = image.layers[0]
    assert (layer.kind, layer.image.name, layer.image_mapping, layer.uv_map) == ("IMAGE", "mask", "UV", "Map")
    assert layer.invert and not second.classes[1].layers[0].invert
    assert (group.layers[0].kind, group.layers[0].vertex_group) == ("VERTEX_GROUP", "wet")
    assert (attribute.layers[0].kind, attribute.layers[0].attribute) == ("ATTRIBUTE", "grass")
    assert not first.outdated, "nothing was changed since its run"
    assert second.changes() == ["settings"]
    densities = [type(c.as_argument().density).__name__ for c in first.classes]
    assert densities == ["float", "ImageDensity", "VertexGroupDensity", "AttributeDensity"]
    even.add_layer("NOISE")
    assert first.changes() == ["density of Even"]


def test_notes_of_version_3_are_about_what_their_words_say():
    bpy.ops.wm.open_mainfile(filepath=str(OLD_2))
    settings = bpy.context.scene.esh_scatter
    first = settings.scatters[0]
    said = ["12 pairs of footprints still overlap, the deepest by 0.1 m", "the footprints cover 90% of it", "another"]
    told = {name: value for name, value in first.report.items() if name != words.NOTE_KINDS}
    first.report_json = json.dumps({**told, "notes": said, "overlaps": 12})
    settings.version = 3
    versions.bring_up_to_date()
    assert words.notes(first.report, foreseen=True) == ["Another"] and len(words.notes(first.report)) == 2
    assert not first.outdated


def test_a_result_of_an_older_version_is_out_of_date_when_its_objects_are_to_stand_otherwise():
    bpy.ops.wm.open_mainfile(filepath=str(OLD_1))
    first = bpy.context.scene.esh_scatter.scatters[0]
    first.classes[0].tilt = 0.1
    assert first.outdated and first.changes() == ["settings"]


def test_an_old_file_that_is_open_is_brought_up_to_date_when_the_extension_is_enabled():
    registration.unregister()
    bpy.ops.wm.open_mainfile(filepath=str(OLD))
    registration.register()
    check(bpy.context.scene.esh_scatter)


@pytest.mark.skipif(not hasattr(bpy.app.handlers, "blend_import_post"), reason="this Blender does not say so")
def test_an_old_scene_that_is_appended_is_brought_up_to_date():
    with bpy.data.libraries.load(str(OLD)) as (_, wanted):
        wanted.scenes = ["Scene"]
    check(wanted.scenes[0].esh_scatter)


def test_an_old_scene_that_is_linked_is_left_as_it_is():
    with bpy.data.libraries.load(str(OLD), link=True) as (_, wanted):
        wanted.scenes = ["Scene"]
    versions.bring_up_to_date()
    assert wanted.scenes[0].esh_scatter.version == 0 and len(wanted.scenes[0].esh_scatter.scatters) == 2


def test_every_version_is_passed_once_and_in_order(monkeypatch):
    settings = bpy.context.scene.esh_scatter
    passed = []
    steps = tuple(lambda _, number=number: passed.append(number) for number in range(4))
    monkeypatch.setattr(versions, "MIGRATIONS", steps)
    monkeypatch.setattr(versions, "VERSION", 4)
    settings.version = 2
    versions.bring_up_to_date()
    versions.bring_up_to_date()
    assert passed == [2, 3] and settings.version == 4


def test_settings_of_a_later_version_are_left_as_they_are(tmp_path):
    bpy.context.scene.esh_scatter.version = versions.VERSION + 3
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "later.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "later.blend"))
    assert bpy.context.scene.esh_scatter.version == versions.VERSION + 3


def test_new_scenes_are_of_this_version_once_they_hold_something(tmp_path):
    scene = bpy.data.scenes.new("Second")
    scene.esh_scatter.add_scatter(None)
    assert scene.esh_scatter.version == versions.VERSION
    assert len(versions.MIGRATIONS) == versions.VERSION
