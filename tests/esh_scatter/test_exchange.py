"""Results leave Blender as instances with their objects, and come back."""

import json
import math
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import esh  # noqa: E402
from esh import EshError, ScatterClass, ScatterSize  # noqa: E402
from esh.esh_scatter import registration  # noqa: E402
from esh.esh_scatter.operators import exchange  # noqa: E402
from esh.esh_scatter.result.display import our_modifier, set_inputs  # noqa: E402
from esh.esh_scatter.result.other_exporters import EXPORTERS  # noqa: E402
from esh.esh_scatter.sidebar.export_notes import ESH_PT_export_notes  # noqa: E402
from mathutils import Matrix  # noqa: E402

# Run by a Python of its own: another USD library than Blender's, and no crash of it takes these tests along.
READ_USD = """
import json, sys
from pxr import Usd, UsdGeom
stage = Usd.Stage.Open(sys.argv[1])
instancer = UsdGeom.PointInstancer(stage.GetDefaultPrim().GetChild("Scatter"))
time = Usd.TimeCode.Default()
boxes = []
for target in instancer.GetPrototypesRel().GetTargets():
    prim = stage.GetPrimAtPath(target)
    box = UsdGeom.BBoxCache(time, ["default"]).ComputeRelativeBound(prim, prim.GetParent()).ComputeAlignedRange()
    boxes.append([list(box.GetMin()), list(box.GetMax())])
matrices = [[list(row) for row in m] for m in instancer.ComputeInstanceTransformsAtTime(time, time)]
print(json.dumps({
    "boxes": boxes, "matrices": matrices, "index": list(instancer.GetProtoIndicesAttr().Get()),
    "class": list(UsdGeom.PrimvarsAPI(instancer).GetPrimvar("class_index").Get()),
    "up": str(UsdGeom.GetStageUpAxis(stage)), "meter": UsdGeom.GetStageMetersPerUnit(stage),
}))
"""
# The same by Blender's own library, which is what users have.
WITH_BLENDERS = "import bpy\nbpy.utils.expose_bundled_modules()\n"


@pytest.fixture
def result():
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=8, y_subdivisions=8, size=20.0)
    ground = bpy.context.object
    bpy.ops.mesh.primitive_cone_add(radius1=0.4, depth=2.0, location=(50, 0, 0), rotation=(0, 0, 0.3))
    tree = bpy.context.object
    tree.scale = (1, 1, 2)
    bpy.ops.mesh.primitive_cube_add(size=0.4, location=(50, 5, 0))
    stone = bpy.context.object
    bpy.context.view_layer.update()
    tree.name, stone.name = "Tree", "Stone"
    classes = [
        ScatterClass("tree", [ScatterSize("large", 8, tree, 0.6), ScatterSize("small", 10, tree, 0.3)]),
        ScatterClass("stone", [ScatterSize("one", 12, stone, 0.2)]),
    ]
    made = esh.scatter(ground, classes, device="cpu", max_steps=3, scale_jitter=0.2)
    bpy.context.view_layer.objects.active = made.object
    return made


def instances() -> np.ndarray:
    """Matrices of all instances of meshes as Blender shows them, in the order of their places."""
    shown = bpy.context.evaluated_depsgraph_get().object_instances
    found = [np.array(one.matrix_world) for one in shown if one.is_instance and one.object.type == "MESH"]
    return in_order(np.array(found))


def in_order(matrices: np.ndarray) -> np.ndarray:
    return matrices[np.lexsort(np.round(matrices[:, :3, 3], 4).T)]


def python(code: str, *arguments) -> dict:
    outcome = subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)], capture_output=True, text=True, timeout=120, check=False
    )
    assert outcome.returncode == 0, outcome.stderr[-2000:]
    return json.loads(outcome.stdout.splitlines()[-1])


def test_usd_holds_what_blender_shows(result, tmp_path):
    shown = instances()
    active, selected = bpy.context.view_layer.objects.active, set(bpy.context.selected_objects)
    before = set(bpy.data.objects)
    esh.export_result(tmp_path / "wood.usdc")
    assert set(bpy.data.objects) == before
    assert (bpy.context.view_layer.objects.active, set(bpy.context.selected_objects)) == (active, selected)
    assert {path.name for path in (tmp_path / "wood_objects").iterdir()} == {"1_Tree.usdc", "2_Stone.usdc"}

    readers = [WITH_BLENDERS + READ_USD]
    if subprocess.run([sys.executable, "-c", "import pxr"], capture_output=True, check=False).returncode == 0:
        readers.append(READ_USD)
    for reader in readers:
        seen = python(reader, tmp_path / "wood.usdc")
        assert (seen["up"], seen["meter"]) == ("Z", 1.0)
        assert seen["class"] == [0] * 18 + [1] * 12
        # The cone is 2 m high and stretched by 2; the box is 0.4 m wide. Both around their origins.
        np.testing.assert_allclose(np.array(seen["boxes"])[:, :, 2], [[-2, 2], [-0.2, 0.2]], atol=1e-5)
        own = [np.array(Matrix.Rotation(0.3, 4, "Z") @ Matrix.Diagonal((1, 1, 2, 1))), np.eye(4)]
        # USD's instances do not know the objects' own rotation and scale: the references have them.
        matrices = [np.array(m).T @ own[i] for m, i in zip(seen["matrices"], seen["index"], strict=True)]
        np.testing.assert_allclose(in_order(np.array(matrices)), shown, atol=2e-3)


def test_gltf_comes_back_as_it_was(result, tmp_path):
    shown = instances()
    esh.export_result(tmp_path / "wood.glb")
    assert [path.name for path in tmp_path.iterdir()] == ["wood.glb"]
    item = result.object
    read = esh.load_placement(tmp_path / "wood.glb")
    assert read.class_name == ("tree", "stone") and read.size_name == (("large", "small"), ("one",))
    np.testing.assert_array_equal(read.class_index, [0] * 18 + [1] * 12)
    positions = np.array([vertex.co for vertex in item.data.vertices])
    np.testing.assert_allclose(read.position, positions, atol=1e-5)

    own = {"Tree": bpy.data.objects["Tree"], "Stone": bpy.data.objects["Stone"]}
    bpy.data.objects.remove(item)
    esh.import_placement(tmp_path / "wood.glb", own)
    bpy.context.view_layer.update()
    # The tree's own rotation and scale are in the transforms of the file's instances, but not twice in what is read.
    np.testing.assert_allclose(instances(), shown, atol=1e-5)


def test_a_collection_as_one_leaves_with_its_objects_in_their_places(tmp_path):
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.mesh.primitive_plane_add(size=40)
    ground = bpy.context.object
    tree = bpy.data.collections.new("Tree")
    for name, location in (("Trunk", (50.0, 50.0, 1.0)), ("Crown", (50.5, 50.0, 2.5))):
        bpy.ops.mesh.primitive_cube_add(size=0.5, location=location)
        made = bpy.context.object
        made.name = made.data.name = name
        bpy.context.collection.objects.unlink(made)
        tree.objects.link(made)
    tree.instance_offset = (50.0, 50.0, 0.0)
    trees = ScatterClass("tree", [ScatterSize("one", 20, tree, as_one=True)])
    result = esh.scatter(ground, [trees], device="cpu", max_steps=5)
    bpy.context.view_layer.update()
    shown = instances()
    before = set(bpy.data.objects)
    for name in ("wood.glb", "wood.usda"):
        esh.export_result(tmp_path / name, result.object)
    assert set(bpy.data.objects) == before
    assert esh.load_placement(tmp_path / "wood.glb").prototypes[0].name == "Tree"

    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.wm.usd_import(filepath=str(tmp_path / "wood_objects" / "1_Tree.usdc"))
    found = {item.name: np.array(item.matrix_world.translation) for item in bpy.data.objects if item.type == "MESH"}
    np.testing.assert_allclose(found["Trunk"], (0.0, 0.0, 1.0), atol=1e-5)
    np.testing.assert_allclose(found["Crown"], (0.5, 0.0, 2.5), atol=1e-5)
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=str(tmp_path / "wood.glb"))
    meshes = [item for item in bpy.data.objects if item.type == "MESH"]
    assert len(meshes) == 40
    np.testing.assert_allclose(in_order(np.array([item.matrix_world for item in meshes])), shown, atol=1e-4)


def test_what_an_empty_shows_leaves_as_the_empty_stands(tmp_path):
    """Also what is shown by another empty."""
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.mesh.primitive_plane_add(size=40)
    ground = bpy.context.object

    def shown_by(name, *items):
        made = bpy.data.objects.new(name, None)
        made.instance_type, made.instance_collection = "COLLECTION", bpy.data.collections.new(name)
        made.instance_collection.instance_offset = (50.0, 50.0, 0.0)
        for item in items:
            for holder in item.users_collection:
                holder.objects.unlink(item)
            made.instance_collection.objects.link(item)
        bpy.context.scene.collection.objects.link(made)
        return made

    bpy.ops.mesh.primitive_cube_add(size=0.5, location=(50.0, 50.5, 1.0))
    stone = bpy.context.object
    stone.name = stone.data.name = "Stone"
    inner = shown_by("Inner", stone)
    inner.location, inner.scale, inner.rotation_euler = (51.0, 50.0, 0.0), (1.0, 2.0, 1.0), (0.0, 0.0, 0.5)
    outer = shown_by("Outer", inner)
    outer.location, outer.scale, outer.rotation_euler = (9.0, 9.0, 9.0), (1.5, 1.5, 1.5), (0.3, 0.0, 1.0)
    bpy.context.view_layer.update()
    outer.hide_viewport = True
    result = esh.scatter(ground, [ScatterClass("all", [ScatterSize("one", 12, outer)])], device="cpu", max_steps=5)
    bpy.context.view_layer.update()
    shown, before = instances(), set(bpy.data.objects)
    for name in ("stones.glb", "stones.usda"):
        esh.export_result(tmp_path / name, result.object)
    assert set(bpy.data.objects) == before
    outline = esh.load_placement(tmp_path / "stones.usda").prototypes[0].outline
    assert np.ptp(outline, axis=0).min() > 0.7, "the box around what it shows"
    own = np.array(outer.matrix_world.to_3x3()) @ np.array(inner.matrix_world.to_3x3())

    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.wm.usd_import(filepath=str(tmp_path / "stones_objects" / "1_Outer.usdc"))
    (found,) = [item for item in bpy.data.objects if item.type == "MESH"]
    np.testing.assert_allclose(np.array(found.matrix_world.to_3x3()), own, atol=1e-4)
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=str(tmp_path / "stones.glb"))
    meshes = [item for item in bpy.data.objects if item.type == "MESH"]
    assert len(meshes) == 12
    np.testing.assert_allclose(in_order(np.array([item.matrix_world for item in meshes])), shown, atol=1e-4)


@pytest.mark.parametrize("ending", [".ply", ".geojson", ".usda", ".glb"])
def test_a_result_that_was_moved_comes_back_where_it_stands(result, tmp_path, ending):
    set_inputs(our_modifier(result.object), {"Follow": False})
    result.object.matrix_world = Matrix.Translation((3, 4, 5)) @ Matrix.Rotation(0.5, 4, "X") @ Matrix.Scale(2, 4)
    bpy.context.view_layer.update()
    shown = instances()
    esh.export_result(tmp_path / f"wood{ending}", result.object)
    sources = {name: bpy.data.objects[name] for name in ("Tree", "Stone")}
    bpy.data.objects.remove(result.object)
    item = esh.import_placement(tmp_path / f"wood{ending}", sources, name="Again")
    bpy.context.view_layer.update()
    np.testing.assert_allclose(instances(), shown, atol=1e-4)
    assert item.name == "Again" and item["esh_scatter"]


@pytest.mark.parametrize("ending", [".ply", ".usda", ".glb"])
def test_what_follows_its_target_leaves_where_it_is_shown(result, tmp_path, ending):
    """The file had the places of the run, under a target that was moved since."""
    ground = next(
        item
        for item in bpy.data.objects
        if item.type == "MESH" and item.name not in ("Tree", "Stone", result.object.name)
    )
    ground.matrix_world = Matrix.Translation((3, 4, 5)) @ Matrix.Rotation(0.6, 4, (1.0, 2.0, 0.5)) @ ground.matrix_world
    result.object.location = (1.0, 0.0, -2.0)
    bpy.context.view_layer.update()
    shown = instances()
    esh.export_result(tmp_path / f"wood{ending}", result.object)
    sources = {name: bpy.data.objects[name] for name in ("Tree", "Stone")}
    bpy.data.objects.remove(result.object)
    esh.import_placement(tmp_path / f"wood{ending}", sources, name="Again")
    bpy.context.view_layer.update()
    np.testing.assert_allclose(instances(), shown, atol=1e-4)


def test_a_placement_without_objects_is_shown_by_prisms(tmp_path):
    bpy.ops.wm.read_homefile(use_empty=True)
    problem = esh.Problem(
        esh.Domain((4.0, 3.0)),
        [
            esh.BodyClass("dot", [esh.Size("one", 0.05, 6)]),
            esh.BodyClass("dash", [esh.Size("one", 0.02, 5, line=esh.Line(0.4, direction=0.7))]),
        ],
    )
    placement = esh.solve(problem, device="cpu", max_steps=5)
    esh.write_placement(tmp_path / "plan.npz", placement)
    esh.write_placement(tmp_path / "plan.ply", placement)
    for name in ("plan.npz", "plan.ply"):
        bpy.ops.wm.read_homefile(use_empty=True)
        esh.import_placement(tmp_path / name)
        bpy.context.view_layer.update()
        seen = instances()
        np.testing.assert_allclose(
            seen[:, :2, 3], placement.position[np.lexsort(np.round(placement.position, 4).T)], atol=1e-5
        )
        turned = sorted(math.atan2(m[1, 0], m[0, 0]) % math.pi for m in seen)
        np.testing.assert_allclose(turned, sorted(placement.angle % math.pi), atol=1e-5)


def test_the_menu_exports_and_imports(result, tmp_path):
    registration.register()
    try:
        assert bpy.ops.esh.export(filepath=str(tmp_path / "wood.ply")) == {"FINISHED"}
        assert bpy.ops.esh.export.get_rna_type().properties["format"].enum_items.keys() == [
            *(".usdc", ".glb", ".ply", ".geojson")
        ]
        before = set(bpy.data.objects)
        assert getattr(bpy.ops.esh, "import")(filepath=str(tmp_path / "wood.ply")) == {"FINISHED"}
        (made,) = [item for item in set(bpy.data.objects) - before if item.get("esh_scatter")]
        assert len(made.data.vertices) == 30
        with pytest.raises(RuntimeError, match=r"absent\.ply cannot be read: no such file"):
            getattr(bpy.ops.esh, "import")(filepath=str(tmp_path / "absent.ply"))
        bpy.context.view_layer.objects.active = bpy.data.objects["Tree"]
        assert not bpy.ops.esh.export.poll()
    finally:
        registration.unregister()


@pytest.mark.parametrize(
    ("name", "chosen", "changed", "expected"),
    [
        ("wood.glb", ".usdc", False, ("wood.glb", ".glb")),
        ("wood.usda", ".ply", False, ("wood.usda", ".usdc")),
        ("wood.usda", ".usdc", False, ("wood.usda", ".usdc")),
        ("wood.parquet", ".usdc", False, ("wood.parquet", ".usdc")),
        ("wood.glb", ".ply", True, ("wood.ply", ".ply")),
        ("wood", ".ply", False, ("wood.ply", ".ply")),
    ],
)
def test_the_ending_and_the_format_of_an_export_follow_each_other(name, chosen, changed, expected):
    """Whichever was changed last."""
    asked = SimpleNamespace(filepath=name, format=chosen, filename_ext=".usdc" if changed else chosen)
    exchange.ESH_OT_export.check(asked, None)
    assert (asked.filepath, asked.format) == expected
    assert not exchange.ESH_OT_export.check(asked, None), "nothing is left to change"


def test_mistakes_are_one_sentence(result, tmp_path):
    with pytest.raises(EshError, match=r'`result` must be an object that a scatter made; "Tree" is not one'):
        esh.export_result(tmp_path / "a.ply", bpy.data.objects["Tree"])
    with pytest.raises(EshError, match=r"a\.txt must end in \.usd, .*; got the ending '\.txt'"):
        esh.export_result(tmp_path / "a.txt", result.object)
    with pytest.raises(EshError, match=r'`sources\["tree"\]` must be an object; got 3'):
        esh.export_result(tmp_path / "a.ply", result.object)
        esh.import_placement(tmp_path / "a.ply", {"tree": 3})
    set_inputs(our_modifier(result.object), {"Follow": False})
    result.object.scale = (1.0, 2.0, 1.0)
    bpy.context.view_layer.update()
    with pytest.raises(EshError, match="must have the same scale along all axes"):
        esh.export_result(tmp_path / "b.ply", result.object)
    result.object.modifiers.clear()
    result.object.modifiers.new("Empty", "NODES")
    with pytest.raises(EshError, match="must have the modifier that shows its objects; it was removed: scatter again"):
        esh.export_result(tmp_path / "b.ply", result.object)
    assert [path.name for path in Path(tmp_path).iterdir()] == ["a.ply"]


@pytest.mark.parametrize("path", [None, 3, b"x.ply"])
def test_a_path_that_is_none_is_a_sentence(path):
    for read_or_write in (esh.export_result, esh.import_placement):
        with pytest.raises(esh.EshError, match="`path` must be the path of a file"):
            read_or_write(path)


@pytest.fixture
def enabled():
    """The add-on, registered and among those that Blender has enabled."""
    registration.register()
    entry = bpy.context.preferences.addons.new()
    entry.module = "esh"
    yield
    bpy.context.preferences.addons.remove(entry)
    registration.unregister()


@pytest.mark.parametrize(
    ("keeps", "hidden", "said"), [(False, False, True), (True, False, False), (False, True, False)]
)
def test_the_exporter_of_gltf_says_that_it_leaves_scatters_out(result, enabled, tmp_path, capfd, keeps, hidden, said):
    """It exported the ground and the objects, and no word."""
    result.object.hide_set(hidden)
    capfd.readouterr()
    bpy.ops.export_scene.gltf(filepath=str(tmp_path / "plain.glb"), export_gn_mesh=keeps)
    warned = "glTF leaves scatters out. Switch on Geometry Nodes Instances" in "".join(capfd.readouterr())
    assert warned is said
    nodes = json.loads(glb_json(tmp_path / "plain.glb"))["nodes"]
    assert (len(nodes) > 20) is keeps


def glb_json(path: Path) -> bytes:
    """The text of a binary glTF file."""
    content = path.read_bytes()
    return content[20 : 20 + int.from_bytes(content[12:16], "little")]


@pytest.mark.parametrize("name", ["EXPORT_SCENE_OT_gltf", "WM_OT_usd_export", "EXPORT_SCENE_OT_fbx"])
@pytest.mark.parametrize("hidden", [False, True])
def test_dialogs_of_exporters_that_lose_scatters_show_a_note_where_there_are_some(result, name, hidden):
    result.object.hide_set(hidden)
    exporter = EXPORTERS[name]
    settings = SimpleNamespace(**{exporter.selected: False, **({exporter.switch: False} if exporter.switch else {})})
    shown = SimpleNamespace(
        space_data=SimpleNamespace(active_operator=SimpleNamespace(bl_idname=name, properties=settings)),
        view_layer=bpy.context.view_layer,
    )
    assert ESH_PT_export_notes.poll(shown) is not hidden
    assert exporter.loses(settings)
    if exporter.switch:
        assert not exporter.loses(SimpleNamespace(**{exporter.switch: True}))
    # What is exported alone is no result.
    setattr(settings, exporter.selected, True)
    result.object.select_set(False)
    assert not ESH_PT_export_notes.poll(shown)


def test_the_switches_of_exporters_are_there():
    """Their names are Blender's."""
    for name, exporter in EXPORTERS.items():
        group, _, operator = name.lower().partition("_ot_")
        known = getattr(getattr(bpy.ops, group), operator).get_rna_type().properties.keys()
        assert {exporter.selected, exporter.switch} - {""} <= set(known)
