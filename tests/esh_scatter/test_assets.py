"""Assets are placed once each, and presets are assets that become scatters where they are dropped."""

import json
from types import SimpleNamespace

import pytest

bpy = pytest.importorskip("bpy")

import esh  # noqa: E402
from esh.esh_scatter import registration  # noqa: E402
from esh.esh_scatter.editing import assets, dropped_presets, preset_library  # noqa: E402
from esh.esh_scatter.editing.preset_files import built_in_presets  # noqa: E402
from esh.esh_scatter.sidebar import asset_shelf  # noqa: E402


def box(name, width, height):
    mesh = bpy.data.meshes.new(name)
    corners = [(x, y, z) for z in (0.0, height) for x, y in ((0, 0), (width, 0), (width, width), (0, width))]
    faces = [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    mesh.from_pydata(corners, [], faces if height else [(0, 1, 2, 3)])
    return bpy.data.objects.new(name, mesh)


@pytest.fixture
def ground(empty_file):
    item = box("Ground", 20.0, 0.0)
    bpy.context.scene.collection.objects.link(item)
    bpy.context.view_layer.objects.active = item
    return item


@pytest.fixture
def library(tmp_path):
    """A file with a tree, a collection that is a cabin, and an empty, all of them assets."""
    bpy.ops.wm.read_homefile(use_empty=True)
    tree, cabin, roof = box("Tree", 1.0, 3.0), box("Walls", 2.0, 1.0), box("Roof", 2.5, 0.5)
    tree.scale = (2.0, 2.0, 2.0)
    roof.location.z = 1.0
    hut = bpy.data.collections.new("Cabin")
    for item in (cabin, roof):
        hut.objects.link(item)
    lamp = bpy.data.objects.new("Lamp", None)
    for one in (tree, hut, lamp):
        one.asset_mark()
    path = tmp_path / "assets.blend"
    bpy.data.libraries.write(str(path), {tree, hut, lamp}, fake_user=True)
    return path


def asset(path, name, kind="OBJECT"):
    return assets.Asset(kind, name, str(path))


def test_assets_become_classes_that_are_scattered(library, ground):
    chosen = [asset(library, "Tree"), asset(library, "Cabin", "COLLECTION")]
    assert bpy.ops.esh.scatter_assets(assets=assets.text_of_assets(chosen), most=60) == {"FINISHED"}
    scatter = bpy.context.scene.esh_scatter.active
    tree, cabin = scatter.classes
    assert (tree.name, cabin.name, scatter.target) == ("Tree", "Cabin", ground)
    assert tree.sizes[0].source_object.name == "Tree" and cabin.sizes[0].source_collection.name == "Cabin"
    assert (cabin.sizes[0].source_kind, tree.align_to_normal, cabin.align_to_normal) == ("ASSET", 0.0, 1.0)
    # The tree is twice as wide as its mesh; the cabin as its roof.
    assert tree.count / cabin.count == pytest.approx(2.5 / 2.0, rel=0.1)
    assert len(scatter.result.data.vertices) == tree.count + cabin.count > 10
    items = list(bpy.context.scene.objects)
    assert sorted(item.name for item in items) == sorted(["Ground", scatter.result.name]), "only instances show"
    assert tree.sizes[0].source_object.asset_data is None, "a copy is no asset of this file"


@pytest.fixture
def listed(library, ground):
    """The file's folder is an asset library in the preferences."""
    libraries = bpy.context.preferences.filepaths.asset_libraries
    bpy.ops.preferences.asset_library_add(directory=str(library.parent))
    yield libraries[-1]
    bpy.ops.preferences.asset_library_remove(index=len(libraries) - 1)


def test_an_asset_that_is_clicked_in_the_shelf_is_placed_by_the_selected_class(library, ground, listed):
    body_class = bpy.context.scene.esh_scatter.add_scatter(ground).add_class()
    choose = bpy.ops.esh.source_from_shelf
    where = {"asset_library_type": "CUSTOM", "asset_library_identifier": listed.name}
    assert choose(**where, relative_asset_identifier="assets.blend/Object/Tree") == {"FINISHED"}
    size = body_class.active_size
    assert (size.source_kind, size.source_object.name) == ("OBJECT", "Tree")
    # In a library of all libraries a reference may lack the name of its own.
    backslashes = "assets.blend\\Collection\\Cabin"
    assert choose(asset_library_type="ALL", relative_asset_identifier=backslashes) == {"FINISHED"}
    assert (size.source_kind, size.source_collection.name) == ("ASSET", "Cabin")
    own = box("Own", 1.0, 1.0)
    own.asset_mark()
    assert choose(asset_library_type="LOCAL", relative_asset_identifier="Object/Own") == {"FINISHED"}
    assert size.source_object == own
    for wrong, says in {
        "assets.blend/Material/Bark": "must be an object or a collection",
        "assets.blend/Object/Gone": "has none of that name",
        "assets.blend/Object/Lamp": "must have geometry",
        "gone.blend/Object/Tree": "o asset library has the file",
        "": "must be an object or a collection",
    }.items():
        with pytest.raises(RuntimeError, match=says):
            choose(**where, relative_asset_identifier=wrong)
    assert size.source_object == own


def test_the_shelf_shows_objects_and_collections_where_a_class_can_place_them(ground):
    shelf = asset_shelf.ESH_AST_assets
    assert not shelf.poll(bpy.context)
    scatter = bpy.context.scene.esh_scatter.add_scatter(ground)
    assert not shelf.poll(bpy.context)
    scatter.add_class()
    assert shelf.poll(bpy.context)
    kinds = ("OBJECT", "COLLECTION", "MATERIAL", "NODETREE")
    assert [shelf.asset_poll(SimpleNamespace(id_type=kind)) for kind in kinds] == [True, True, False, False]


def test_an_asset_is_brought_in_once(library, ground):
    first = assets.bring_in(asset(library, "Tree"))
    assert assets.bring_in(asset(library, "Tree")) == first
    first.name = "Renamed"
    assert assets.bring_in(asset(library, "Tree")) == first
    assert len(bpy.data.objects) == 2


def test_where_a_library_says_so_assets_are_linked(library, ground):
    libraries = bpy.context.preferences.filepaths.asset_libraries
    told = libraries.new(name="Mine", directory=str(library.parent))
    try:
        told.import_method = "LINK"
        item = assets.bring_in(asset(library, "Tree"))
        assert item.library is not None and assets.bring_in(asset(library, "Tree")) == item
    finally:
        libraries.remove(told)


def test_assets_of_the_open_file_are_taken_as_they_are(ground):
    tree = box("Tree", 1.0, 3.0)
    tree.asset_mark()
    selected = [
        SimpleNamespace(id_type="OBJECT", name="Tree", local_id=tree, full_library_path=""),
        SimpleNamespace(id_type="MATERIAL", name="Bark", local_id=None, full_library_path="x.blend"),
        SimpleNamespace(id_type="COLLECTION", name="Cabin", local_id=None, full_library_path="/a/b.blend"),
    ]
    found = assets.selected_assets(SimpleNamespace(selected_assets=selected))
    assert found == [assets.Asset("OBJECT", "Tree", ""), assets.Asset("COLLECTION", "Cabin", "/a/b.blend")]
    assert assets.assets_from_text(assets.text_of_assets(found)) == found
    assert assets.bring_in(found[0]) == tree
    assert assets.selected_assets(SimpleNamespace()) == []


def test_assets_are_added_to_a_scatter_and_chosen_for_a_class(library, ground):
    scatter = bpy.context.scene.esh_scatter.add_scatter(ground)
    both = assets.text_of_assets([asset(library, "Tree"), asset(library, "Cabin", "COLLECTION")])
    assert bpy.ops.esh.classes_from_assets(assets=both, count=7) == {"FINISHED"}
    assert [(c.name, c.count) for c in scatter.classes] == [("Tree", 7), ("Cabin", 7)]
    scatter.class_index = 0
    cabin = assets.text_of_assets([asset(library, "Cabin", "COLLECTION")])
    assert bpy.ops.esh.source_from_asset(assets=cabin) == {"FINISHED"}
    first = scatter.classes[0]
    assert first.name == "Cabin 2" and first.sizes[0].source.name == "Cabin" and first.sizes[0].source_kind == "ASSET"
    assert scatter.obstacle(bpy.context.scene) is None


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (lambda path: [asset(path, "None")], 'must have the asset "None"'),
        (lambda path: [asset(path.with_name("no.blend"), "Tree")], "must be a file that can be read"),
        (lambda path: [asset(path, "Lamp")], "must have geometry"),
        (lambda path: [assets.Asset("OBJECT", "Gone", "")], 'no asset "Gone"'),
    ],
)
def test_what_cannot_be_placed_is_said(library, ground, given, words):
    bpy.context.scene.esh_scatter.add_scatter(ground).add_class()
    text = assets.text_of_assets(given(library))
    for name in ("scatter_assets", "classes_from_assets", "source_from_asset"):
        with pytest.raises(RuntimeError, match=words):
            getattr(bpy.ops.esh, name)(assets=text)
    assert len(bpy.context.scene.esh_scatter.scatters) == 1 and len(bpy.context.scene.esh_scatter.active.classes) == 1


def test_without_assets_the_buttons_say_what_to_select(ground):
    bpy.context.scene.esh_scatter.add_scatter(ground).add_class()
    for name in ("scatter_assets", "classes_from_assets", "source_from_asset", "preset_from_asset"):
        with pytest.raises(RuntimeError, match="Select "):
            getattr(bpy.ops.esh, name)()
    with pytest.raises(esh.ProblemError, match="must be a list of kind, name and file"):
        assets.assets_from_text("[1]")


@pytest.fixture
def presets(ground, tmp_path):
    return preset_library.write_library(tmp_path)


def test_the_library_has_every_preset_with_its_picture(ground, tmp_path):
    kept = bpy.data.node_groups.new("Meadow", "GeometryNodeTree")
    file = preset_library.write_library(tmp_path)
    assert kept.name == "Meadow" and list(bpy.data.node_groups) == [kept], "the open file is as it was"
    assert file.stat().st_size < 2_000_000
    bpy.ops.wm.read_homefile(use_empty=True)
    with bpy.data.libraries.load(str(file), assets_only=True) as (offered, wanted):
        wanted.node_groups = list(offered.node_groups)
    assert sorted(group.name for group in wanted.node_groups) == sorted(built_in_presets().values())
    catalogs = (tmp_path / "blender_assets.cats.txt").read_text(encoding="utf-8")
    for group in wanted.node_groups:
        told = group.asset_data
        assert told.description and f"{told.catalog_id}:Scatter Presets:" in catalogs
        assert group.is_modifier and tuple(group.preview.image_size) != (0, 0)
        assert json.loads(group[assets.PRESET])["name"] == group.name


def drop(presets, name, ground):
    """Have Blender do what it does when a node group is dragged onto a mesh."""
    bpy.ops.wm.append(directory=f"{presets}/NodeTree/", filename=name)
    ground.modifiers.new(name, "NODES").node_group = bpy.data.node_groups[name]


def test_a_preset_that_is_dropped_on_a_mesh_becomes_a_scatter(presets, ground):
    drop(presets, "Meadow", ground)
    assert bpy.app.timers.is_registered(dropped_presets._take)
    assert dropped_presets.take_dropped(bpy.context) == ["Meadow"]
    scatter = bpy.context.scene.esh_scatter.active
    assert (scatter.name, scatter.target, len(scatter.classes)) == ("Meadow", ground, 3)
    assert not ground.modifiers and "Meadow" not in bpy.data.node_groups
    assert scatter.obstacle(bpy.context.scene) is None
    assert dropped_presets.take_dropped(bpy.context) == []


def test_other_node_groups_that_come_in_are_left_alone(ground, tmp_path):
    path = tmp_path / "other.blend"
    group = bpy.data.node_groups.new("Other", "GeometryNodeTree")
    bpy.data.libraries.write(str(path), {group}, fake_user=True)
    bpy.data.node_groups.remove(group)
    drop(path, "Other", ground)
    assert not bpy.app.timers.is_registered(dropped_presets._take)
    assert dropped_presets.take_dropped(bpy.context) == [] and len(ground.modifiers) == 1


def test_a_selected_preset_is_applied_from_the_menu(presets, ground):
    one = assets.text_of_assets([assets.Asset("NODETREE", "Pebbles", str(presets))])
    assert bpy.ops.esh.preset_from_asset(assets=one) == {"FINISHED"}
    assert bpy.context.scene.esh_scatter.active.name == "Pebbles" and not bpy.data.node_groups.get("Pebbles")


def test_in_the_asset_browser_the_entry_needs_a_selected_preset(ground):
    area = bpy.context.window_manager.windows[0].screen.areas[0]
    kind, area.ui_type = area.ui_type, "ASSETS"
    try:
        with bpy.context.temp_override(window=bpy.context.window_manager.windows[0], area=area):
            assert not bpy.ops.esh.preset_from_asset.poll()
        assert bpy.ops.esh.preset_from_asset.poll(), "elsewhere it is told which"
    finally:
        area.ui_type = kind


def test_a_dropped_preset_that_is_none_changes_nothing_but_says_so(ground):
    group = bpy.data.node_groups.new("Bad", "GeometryNodeTree")
    group[assets.PRESET] = '{"format": "other"}'
    ground.modifiers.new("Bad", "NODES").node_group = group
    with pytest.raises(esh.InputFileError, match="must be a preset of ESH Scatter"):
        dropped_presets.take_dropped(bpy.context)
    assert not bpy.context.scene.esh_scatter.scatters and not ground.modifiers


def test_the_button_adds_the_library_to_the_preferences_once(ground, tmp_path, monkeypatch):
    monkeypatch.setattr(preset_library, "library_folder", lambda: tmp_path)
    libraries = bpy.context.preferences.filepaths.asset_libraries
    before = len(libraries)
    try:
        for _ in range(2):
            assert bpy.ops.esh.presets_as_assets() == {"FINISHED"}
            assert len(libraries) == before + 1 and (tmp_path / "presets.blend").exists()
        assert libraries[-1].name == preset_library.LIBRARY and libraries[-1].import_method == "APPEND"
    finally:
        while len(libraries) > before:
            libraries.remove(libraries[-1])


def test_the_library_lies_with_what_the_user_keeps(ground):
    folder = preset_library.library_folder()
    assert folder.is_dir() and folder.name == "presets"


def test_nothing_is_left_of_the_handlers():
    bpy.ops.wm.read_homefile(use_empty=True)
    before = len(bpy.app.handlers.blend_import_post)
    registration.register()
    registration.unregister()
    assert len(bpy.app.handlers.blend_import_post) == before
