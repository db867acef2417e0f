"""Every button can be undone and redone: settings, objects and points are then what they were; so they are in files."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh.esh_scatter import operators  # noqa: E402
from esh.esh_scatter.editing import assets, preset_library  # noqa: E402
from esh.esh_scatter.editing.preset_files import built_in_presets  # noqa: E402
from esh.esh_scatter.targets import mesh_attributes  # noqa: E402

pytestmark = pytest.mark.usefixtures("empty_file")

# Buttons, and with what they are pressed.
BUTTONS = {
    "scatter_add": {},
    "scatter_choose": {"index": 0},
    "scatter_remove": {},
    "seed_roll": {},
    "class_add": {},
    "class_remove": {},
    "class_lift": {},
    "class_raise": {},
    "class_duplicate": {},
    "class_copy": {},
    "classes_sort": {},
    "class_overlap": {"other": "Beech"},
    "class_move": {"direction": "DOWN"},
    "classes_from_image": {"image": "Inks", "dots": 100},
    "classes_from_selection": {},
    "classes_from_collection": {"collection": "Kinds"},
    "size_add": {},
    "size_move": {"direction": "UP"},
    "size_remove": {},
    "variants_list": {},
    "layer_add": {"kind": "SLOPE"},
    "layer_move": {"direction": "UP"},
    "layer_remove": {},
    "layer_paint": {"kind": "VERTEX_GROUP"},
    "obstacle_add": {},
    "obstacle_remove": {},
    "scatter": {},
    "scatter_all": {},
    "scatter_selection": {"most": 20},
    "example": {},
    "preset_apply": {},
    "preset_import": {},
    "scatter_of_copy": {},
    "counts_to_fit": {},
    "select_overlapping": {},
    "instances_pin": {},
    "instances_unpin": {},
    "instances_turn": {"angle": 0.5},
    "instances_remove": {},
    "instances_refill": {},
    "instances_make_real": {},
    "instances_from_real": {},
    # Which assets: those of a file, see `asked_of_assets`.
    "scatter_assets": {"most": 20},
    "classes_from_assets": {"count": 7},
    "source_from_asset": {},
    "source_from_shelf": {"asset_library_type": "LOCAL", "relative_asset_identifier": "Object/Stone"},
    "preset_from_asset": {},
}
# What needs a window or a file, and what changes nothing of the file.
ELSEWHERE = {
    *("instances_edit", "instances_select_pinned", "frame_overlap"),
    *("preset_export", "presets_as_assets"),
    *("stop", "keep"),
}


def values_of(group):
    """All that a group of properties holds, as plain data; what it points to by its name."""
    found = {}
    for prop in group.bl_rna.properties:
        if prop.identifier in ("rna_type", "ran_with"):
            continue
        value = getattr(group, prop.identifier)
        if prop.type == "COLLECTION":
            value = [values_of(one) for one in value]
        elif isinstance(value, bpy.types.PropertyGroup):
            value = values_of(value)
        elif prop.type == "POINTER":
            value = getattr(value, "name", None)
        elif getattr(prop, "is_array", False):
            value = list(value)
        found[prop.identifier] = value
    return found


def state():
    """All of the file that the buttons can change."""
    scene = bpy.context.scene
    points = {}
    for item in scene.objects:
        if item.type == "MESH":
            # What Edit Mode has selected since, Blender does not take back with a step from outside of it.
            known = [
                a
                for a in item.data.attributes
                if a.domain == "POINT" and mesh_attributes.can_be_read(a) and not a.name.startswith(".select")
            ]
            values = {a.name: mesh_attributes.read_attribute(item.data, a.name).tobytes() for a in known}
            points[item.name] = (values, [m.name for m in item.modifiers], item.hide_get(), item.mode)
    return {"settings": values_of(scene.esh_scatter), "objects": points}


def new_object(name, size, at=(0.0, 0.0, 0.0)):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(0, 0, 0), (size, 0, 0), (size, size, 0), (0, size, 0)], [], [(0, 1, 2, 3)])
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    item.location = at
    return item


def active():
    return bpy.context.scene.esh_scatter.active


@pytest.fixture(scope="module")
def scene_file(tmp_path_factory):
    """Where the scene is kept, which is made once."""
    return tmp_path_factory.mktemp("undo") / "scene.blend"


@pytest.fixture
def scene(scene_file):
    """Something for every button."""
    if not scene_file.exists():
        make_scene()
        bpy.ops.wm.save_as_mainfile(filepath=str(scene_file))
    bpy.ops.wm.open_mainfile(filepath=str(scene_file))
    bpy.ops.ed.undo_push(message="made")


def make_scene():
    new_object("Ground", 20.0), new_object("Tree", 0.5, (40.0, 0.0, 0.0)), new_object("Stone", 0.5, (45.0, 0.0, 0.0))
    kinds = bpy.data.collections.new("Kinds")
    bpy.context.scene.collection.children.link(kinds)
    for name in ("Reed", "Rush"):
        item = new_object(name, 0.3, (40.0, 0.0, 0.0))
        bpy.context.scene.collection.objects.unlink(item)
        kinds.objects.link(item)
    inks = bpy.data.images.new("Inks", 8, 8)
    inks.generated_color, inks.use_fake_user = (0.8, 0.2, 0.1, 1.0), True
    made = bpy.context.scene.esh_scatter.add_scatter(bpy.data.objects["Ground"])
    for name in ("Pine", "Beech"):
        body_class = made.add_class()
        body_class.name, body_class.sizes[0].source_object = name, bpy.data.objects["Tree"]
        body_class.sizes[0].count = 30
    reeds = made.classes[0].add_size()
    reeds.source_kind, reeds.source_collection, reeds.count = "COLLECTION", bpy.data.collections["Kinds"], 20
    made.classes[0].add_layer("NOISE")
    made.classes[0].add_layer("ALTITUDE")
    made.class_index, made.device, made.max_steps = 0, "CPU", 3
    made.obstacles.add().item = bpy.data.objects["Stone"]
    bpy.ops.esh.scatter()
    for item in bpy.context.scene.objects:
        item.select_set(item.name in ("Ground", "Stone"))
    bpy.context.view_layer.objects.active = bpy.data.objects["Ground"]


def make_library(path):
    """A file with an object and a collection that are assets; nothing of them stays here."""
    fir, hut = new_object("Fir", 0.5), bpy.data.collections.new("Hut")
    bpy.context.scene.collection.objects.unlink(fir)
    wall = new_object("Wall", 0.5)
    bpy.context.scene.collection.objects.unlink(wall)
    hut.objects.link(wall)
    for one in (fir, hut):
        one.asset_mark()
    bpy.data.libraries.write(str(path), {fir, hut}, fake_user=True)
    bpy.data.batch_remove([fir, wall, hut, fir.data, wall.data])


def asked_of_assets(name, folder):
    """The assets that a button takes, as it is told of them."""
    if name == "preset_from_asset":
        return assets.text_of_assets([assets.Asset("NODETREE", "Pebbles", str(preset_library.write_library(folder)))])
    path = folder / "assets.blend"
    make_library(path)
    hut = assets.Asset("COLLECTION", "Hut", str(path))
    return assets.text_of_assets(
        [hut] if name == "source_from_asset" else [assets.Asset("OBJECT", "Fir", str(path)), hut]
    )


def make_ready(name):
    """What an artist would have done before the button is pressed."""
    scatter = active()
    if name.startswith("instances_"):
        mesh = scatter.result.data
        mesh.vertices.foreach_set("select", np.arange(len(mesh.vertices)) % 5 == 0)
    if name == "instances_unpin":
        bpy.ops.esh.instances_pin()
    elif name == "instances_refill":
        bpy.ops.esh.instances_remove()
    elif name == "instances_from_real":
        bpy.ops.esh.instances_make_real()
    elif name in ("counts_to_fit", "select_overlapping"):
        scatter.classes[1].sizes[0].count = 3000
        bpy.ops.esh.scatter()
    elif name in ("scatter", "scatter_all"):
        scatter.seed += 1
    elif name == "class_copy":
        scatter.classes[0].tilt = 0.25
    elif name == "class_raise":
        tree = bpy.data.objects["Tree"].data
        tree.vertices[0].co.z, tree.vertices[2].co.z = -1.0, 1.0
        tree.update()
        bpy.context.view_layer.update()
    elif name == "scatter_of_copy":
        bpy.ops.object.select_all(action="DESELECT")
        scatter.result.select_set(True)
        bpy.context.view_layer.objects.active = scatter.result
        bpy.ops.object.duplicate()
    elif name == "obstacle_add":
        # What is placed cannot be an obstacle, and an entry with nothing chosen yet is added where nothing is selected.
        bpy.ops.object.select_all(action="DESELECT")
    elif name == "variants_list":
        scatter.classes[0].sizes[1].variants.clear()
    elif name == "source_from_shelf":
        bpy.data.objects["Stone"].asset_mark()


@pytest.mark.parametrize("name", BUTTONS)
def test_a_button_is_undone_and_redone(scene, name, tmp_path):
    make_ready(name)
    asked = BUTTONS[name]
    if name.endswith(("_assets", "_asset")):
        asked = {**asked, "assets": asked_of_assets(name, tmp_path)}
    bpy.ops.ed.undo_push(message="ready")
    before = state()
    if name in ("preset_apply", "preset_import"):
        asked = {"filepath": next(iter(built_in_presets()))}
    elif name == "class_copy":
        asked = {"classes": {str(active().classes[1].uid)}}
    assert getattr(bpy.ops.esh, name)(**asked) == {"FINISHED"}
    after = state()
    assert after != before or name in ("scatter_choose", "select_overlapping"), "it has changed something"
    bpy.ops.ed.undo_push(message="pressed")
    bpy.ops.ed.undo()
    assert state() == before
    bpy.ops.ed.redo()
    assert state() == after


IN_EDIT_MODE = (
    "seed_roll",
    "class_add",
    "class_remove",
    "class_move",
    "size_add",
    "layer_add",
    "layer_remove",
    "obstacle_remove",
)


@pytest.mark.parametrize("name", IN_EDIT_MODE)
@pytest.mark.parametrize("edited", ["Ground", "Ground Scatter"])
def test_a_button_is_undone_and_redone_in_edit_mode(scene, name, edited):
    """Blender's steps of Edit Mode hold what is edited alone."""

    def settings():
        assert bpy.data.objects[edited].mode == "EDIT"
        return values_of(bpy.context.scene.esh_scatter)

    bpy.context.view_layer.objects.active = bpy.data.objects[edited]
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.ed.undo_push(message="edited")
    known = [settings()]
    for button in (name, "class_add"):
        assert getattr(bpy.ops.esh, button)(**BUTTONS[button]) == {"FINISHED"}
        bpy.ops.ed.undo_push(message="pressed")
        known.append(settings())
    assert known[0] != known[1] != known[2]
    for step, there in (("undo", 1), ("undo", 0), ("redo", 1), ("redo", 2)):
        getattr(bpy.ops.ed, step)()
        assert settings() == known[there]


def test_saved_read_and_run_again_the_points_have_the_same_bytes(scene, tmp_path):
    def points():
        mesh = active().result.data
        known = [a for a in mesh.attributes if a.domain == "POINT" and mesh_attributes.can_be_read(a)]
        return {a.name: mesh_attributes.read_attribute(mesh, a.name).tobytes() for a in known}

    before, path = points(), str(tmp_path / "scene.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert points() == before and not active().outdated
    bpy.ops.esh.scatter()
    assert points() == before and not active().outdated


def test_every_button_is_tried_or_known_to_need_something_else():
    there = {cls.bl_idname.partition(".")[2] for cls in operators.CLASSES}
    assert there == BUTTONS.keys() | ELSEWHERE
    changing = {cls for cls in operators.CLASSES if cls.bl_idname.partition(".")[2] in BUTTONS}
    assert all("UNDO" in cls.bl_options for cls in changing)
