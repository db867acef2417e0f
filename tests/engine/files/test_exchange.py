"""What other programs get: every format read back by another library than wrote it, and by ourselves."""

from __future__ import annotations

import json
import math
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import esh
import numpy as np
import pytest
import trimesh
from esh import BodyClass, Domain, EshError, InputFileError, Line, Placement, Problem, Report, Size
from esh.engine.files.bodies import Bodies, Prototype, bodies_from_columns, bodies_of
from esh.engine.files.body_formats import FORMATS
from esh.engine.files.cell_text import as_cell, name_in_cell
from esh.engine.files.placement_files import WRITERS, write_bodies, write_placement
from esh.engine.files.placement_reader import READABLE

NEEDS = {".usd": "pxr", ".usdc": "pxr", ".usda": "pxr", ".parquet": "pyarrow"}


def available(ending: str) -> object:
    """A parameter that is skipped where its library is not installed."""
    reason = f"{NEEDS.get(ending)} is not installed"
    return pytest.param(ending, marks=[pytest.mark.skipif(not installed(ending), reason=reason)])


def installed(ending: str) -> bool:
    try:
        FORMATS[ending].check()
    except (EshError, KeyError):
        return ending not in FORMATS
    return True


@pytest.fixture
def placement() -> Placement:
    classes = [
        BodyClass("pine, old", [Size("large", 2.0, 3), Size('"small"', (0.5, 1.5), 4)]),
        BodyClass("Bärlauch 木", [Size("only", 0.5, 2)]),
        BodyClass("log", [Size("1/2", 0.4, 3, line=Line(2.0))]),
    ]
    problem = Problem(Domain((10.0, 4.0)), classes)
    random = np.random.default_rng(5)
    lines = np.array([False] * 9 + [True] * 3)
    return Placement(
        problem,
        random.random((12, 2)) * problem.domain.size,
        np.array([0] * 7 + [1] * 2 + [2] * 3, np.int32),
        np.array([0] * 3 + [1] * 4 + [0] * 5, np.int32),
        np.where(lines, [0.0] * 9 + [0.3, -1.2, 1.5], 0.0),
        np.where(lines, [0.0] * 9 + [1.8, 2.0, 2.2], 0.0),
        np.where(lines, [0.0] * 9 + [0.19, 0.2, 0.21], 0.0),
        Report(1, True, 0.1, "cpu", 0.0, None, 0, 0.0, ()),
    )


@pytest.mark.parametrize("ending", [available(ending) for ending in READABLE])
def test_what_is_written_reads_back(tmp_path, placement, ending):
    esh.write_placement(tmp_path / f"out{ending}", placement)
    read = esh.load_placement(tmp_path / f"out{ending}")
    expected = bodies_of(placement)
    exact = ending in (".npz", ".csv", ".ply", ".parquet", ".geojson")
    np.testing.assert_allclose(read.position, expected.position, rtol=0.0, atol=0.0 if exact else 1e-6)
    np.testing.assert_allclose(read.angle, placement.angle, atol=1e-6)
    np.testing.assert_allclose(read.area, placement.area, rtol=1e-6)
    np.testing.assert_allclose(read.length, placement.length, rtol=1e-6)
    np.testing.assert_allclose(read.width, placement.width, rtol=1e-6)
    for key in ("id", "class_index", "size_index"):
        np.testing.assert_array_equal(getattr(read, key), getattr(expected, key))
        assert getattr(read, key).dtype == getattr(expected, key).dtype
    assert read.class_name == placement.class_name
    if ending != ".npz":  # which holds no names of sizes
        assert read.size_name == (("large", '"small"'), ("only",), ("1/2",))
    if ending in FORMATS:
        np.testing.assert_array_equal(read.prototype_index, [0] * 3 + [1] * 4 + [2] * 2 + [3] * 3)
        np.testing.assert_allclose(read.scale, expected.scale, rtol=1e-6)
        names = [prototype.name for prototype in read.prototypes]
        assert names == ["pine, old/large", 'pine, old/"small"', "Bärlauch 木", "log"]


@pytest.mark.parametrize("ending", [available(ending) for ending in FORMATS])
def test_equal_bodies_give_equal_bytes_in_any_process(tmp_path, placement, ending):
    bodies = bodies_of(placement)
    for name in "ab":
        esh.write_bodies(tmp_path / f"{name}{ending}", bodies)
    assert (tmp_path / f"a{ending}").read_bytes() == (tmp_path / f"b{ending}").read_bytes()
    code = (
        "import sys, esh\n"
        "bodies = esh.load_placement(sys.argv[1])\n"
        "for name in sys.argv[2:]: esh.write_bodies(name, bodies)"
    )
    for name in "cd":  # with other hashes of texts
        command = [sys.executable, "-c", code, tmp_path / f"a{ending}", tmp_path / f"{name}{ending}"]
        subprocess.run(command, check=True, timeout=120)
    assert (tmp_path / f"c{ending}").read_bytes() == (tmp_path / f"d{ending}").read_bytes()


def test_a_prototype_has_the_footprint_of_its_size(placement):
    for prototype, size in zip(
        bodies_of(placement).prototypes, [s for c in placement.problem.classes for s in c.sizes], strict=True
    ):
        x, y = prototype.outline.T
        area = 0.5 * float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())
        expected = size.mean_area if size.line is None else 2.0 * 0.2 + math.pi * 0.1**2
        assert area == pytest.approx(expected, rel=5e-3 if size.line is None else 1e-2)
    lines = bodies_of(placement)
    reach = 2.0 + 0.2  # of the prototype; the bodies' own length and caps come from the scale
    np.testing.assert_allclose(lines.scale[9:, 0] * reach, placement.length[9:] + placement.width[9:], rtol=1e-6)


def test_usd_opens_with_units_axes_and_transforms(tmp_path, placement):
    pytest.importorskip("pxr.Usd")
    from pxr import Gf, Usd, UsdGeom

    tree = Usd.Stage.CreateNew(str(tmp_path / "tree.usda"))
    tree.SetDefaultPrim(UsdGeom.Sphere.Define(tree, "/Tree").GetPrim())
    tree.Save()
    (tmp_path / "sub").mkdir()
    esh.write_placement(tmp_path / "sub" / "out.usd", placement, assets={"pine, old": tmp_path / "tree.usda"})

    stage = Usd.Stage.Open(str(tmp_path / "sub" / "out.usd"))
    assert UsdGeom.GetStageUpAxis(stage) == "Z" and UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    instancer = UsdGeom.PointInstancer(stage.GetDefaultPrim().GetChild("Scatter"))
    targets = instancer.GetPrototypesRel().GetTargets()
    kinds = [stage.GetPrimAtPath(path).GetTypeName() for path in targets]
    assert kinds == ["Sphere", "Sphere", "Mesh", "Mesh"]
    assert [stage.GetPrimAtPath(path).GetDisplayName() for path in targets][2] == "Bärlauch 木"
    (layer,) = [layer for layer in stage.GetUsedLayers() if layer.identifier.endswith("tree.usda")]
    assert Path(layer.realPath) == (tmp_path / "tree.usda").resolve()

    # Where a body's own x axis points, by USD's own arithmetic.
    matrices = instancer.ComputeInstanceTransformsAtTime(Usd.TimeCode.Default(), Usd.TimeCode.Default())
    for matrix, position, angle in zip(matrices, placement.position, placement.angle, strict=True):
        np.testing.assert_allclose(matrix.Transform(Gf.Vec3d(0, 0, 0)), [*position, 0.0], atol=1e-5)
        along = matrix.TransformDir(Gf.Vec3d(1, 0, 0)).GetNormalized()
        np.testing.assert_allclose(along, [math.cos(angle), math.sin(angle), 0.0], atol=2e-3)
    primvars = UsdGeom.PrimvarsAPI(instancer)
    np.testing.assert_array_equal(primvars.GetPrimvar("class_index").Get(), placement.class_index)
    np.testing.assert_array_equal(primvars.GetPrimvar("size_index").Get(), placement.size_index)
    assert primvars.GetPrimvar("class_index").GetInterpolation() == "vertex"
    np.testing.assert_array_equal(instancer.GetIdsAttr().Get(), np.arange(12))
    low, high = np.array(instancer.GetExtentAttr().Get())
    assert (low < [*placement.position.min(axis=0), 0.0]).all() and (
        high > [*placement.position.max(axis=0), 0.0]
    ).all()


def test_assets_of_usd_bring_their_units_and_axes(tmp_path, placement):
    pytest.importorskip("pxr.Usd")
    from pxr import Usd, UsdGeom

    # Three meters high, as a program writes it that counts in centimeters and has y up; a meter that says nothing of itself.
    for name, meters, height in (("their.usda", 0.01, 300.0), ("plain.usda", None, 1.0)):
        tree = Usd.Stage.CreateNew(str(tmp_path / name))
        if meters:
            UsdGeom.SetStageUpAxis(tree, "Y")
            UsdGeom.SetStageMetersPerUnit(tree, meters)
        tree.SetDefaultPrim(UsdGeom.Xform.Define(tree, "/Tree").GetPrim())
        trunk = UsdGeom.Mesh.Define(tree, "/Tree/Trunk")
        top = (0.0, height, 0.0) if meters else (0.0, 0.0, height)
        trunk.CreatePointsAttr([(0, 0, 0), (height / 10.0, 0, 0), top])
        trunk.CreateFaceVertexCountsAttr([3])
        trunk.CreateFaceVertexIndicesAttr([0, 1, 2])
        trunk.CreateExtentAttr(UsdGeom.Mesh.ComputeExtent(trunk.GetPointsAttr().Get()))
        tree.Save()
    assets = {"pine, old/large": tmp_path / "their.usda", "Bärlauch 木": tmp_path / "plain.usda"}
    esh.write_placement(tmp_path / "out.usd", placement, assets=assets)

    stage = Usd.Stage.Open(str(tmp_path / "out.usd"))
    instancer = UsdGeom.PointInstancer(stage.GetPrimAtPath("/World/Scatter"))
    bounds = UsdGeom.BBoxCache(Usd.TimeCode.Default(), ["default"])
    sizes = {}
    for target in instancer.GetPrototypesRel().GetTargets():
        prim = stage.GetPrimAtPath(target)
        sizes[prim.GetDisplayName()] = list(bounds.ComputeWorldBound(prim).ComputeAlignedRange().GetSize())
    np.testing.assert_allclose(sizes["pine, old/large"], [0.3, 0.0, 3.0], atol=1e-6)
    np.testing.assert_allclose(sizes["Bärlauch 木"], [0.1, 0.0, 1.0], atol=1e-6)
    # The instancer's extent, by which viewers hide what is out of sight, holds all that stands there.
    low, high = np.array(instancer.GetExtentAttr().Get())
    measured = np.array(
        UsdGeom.PointInstancer.ComputeExtentFromPlugins(UsdGeom.Boundable(instancer), Usd.TimeCode.Default())
    )
    assert (low <= measured[0]).all() and (high >= measured[1]).all() and measured[1][2] > 3.0 - 1e-5
    # The prototypes are found again by the names that they had.
    names = [prototype.name for prototype in esh.load_placement(tmp_path / "out.usd").prototypes]
    assert names == [prototype.name for prototype in bodies_of(placement).prototypes]


def test_usd_of_others_becomes_meters_and_z_up(tmp_path):
    pytest.importorskip("pxr.Usd")
    from pxr import Gf, Usd, UsdGeom

    stage = Usd.Stage.CreateNew(str(tmp_path / "theirs.usda"))
    UsdGeom.SetStageUpAxis(stage, "Y")
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    parent = UsdGeom.Xform.Define(stage, "/Set")
    parent.AddTranslateOp().Set(Gf.Vec3d(100, 0, 0))
    parent.AddRotateYOp().Set(90.0)
    instancer = UsdGeom.PointInstancer.Define(stage, "/Set/Rocks")
    rock = UsdGeom.Sphere.Define(stage, "/Set/Rocks/Rock")
    instancer.CreatePrototypesRel().SetTargets([rock.GetPath()])
    instancer.CreatePositionsAttr([(0, 200, 300), (0, 0, 0)])
    instancer.CreateProtoIndicesAttr([0, 0])
    stage.Save()

    bodies = esh.load_placement(tmp_path / "theirs.usda")
    # Turned by 90 degrees about y, 300 along z are 300 along x; y up is z up.
    np.testing.assert_allclose(bodies.position, [[4.0, 0.0, 2.0], [1.0, 0.0, 0.0]], atol=1e-6)
    np.testing.assert_allclose(bodies.angle, [math.pi / 2] * 2, atol=1e-6)
    assert np.isnan(bodies.area).all() and bodies.prototypes[0].name == "Rock"


def test_a_million_points_are_written_as_usd_in_seconds(tmp_path, slowness):
    pytest.importorskip("pxr.Usd")
    random = np.random.default_rng(1)
    count = 1_000_000
    columns = dict(zip("xyz", 1000.0 * random.random((3, count)), strict=True))
    bodies = bodies_from_columns(columns | {"angle": random.random(count)}, {}, "random")
    start = time.process_time()
    esh.write_bodies(tmp_path / "many.usdc", bodies)
    # 0.7 s when written; the seconds of the processor, since tests run beside each other.
    took = time.process_time() - start
    assert took < 4.0 * slowness()
    assert (tmp_path / "many.usdc").stat().st_size > 40_000_000


def boxes(folder: Path) -> Path:
    """A .glb file of another program: two boxes, one of them textured, turned and shifted."""
    from PIL import Image

    scene = trimesh.Scene()
    scene.add_geometry(trimesh.creation.box((1.0, 2.0, 1.0)), node_name="trunk")
    crown = trimesh.creation.box((1.0, 1.0, 1.0))
    image = Image.fromarray(np.full((4, 4, 3), 200, np.uint8))
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=image)
    crown.visual = trimesh.visual.TextureVisuals(uv=np.zeros((len(crown.vertices), 2)), material=material)
    place = trimesh.transformations.rotation_matrix(0.5, (0, 1, 0)) @ np.diag([2.0, 2.0, 2.0, 1.0])
    place[:3, 3] = (0.0, 3.0, 0.5)
    scene.add_geometry(crown, node_name="crown", transform=place)
    (folder / "tree.glb").write_bytes(scene.export(file_type="glb"))
    return folder / "tree.glb"


def gltf_instances(path: Path) -> list[tuple[str, np.ndarray, dict[str, np.ndarray]]]:
    """Read a file by pygltflib: for every node its name, its instances' matrices and their numbers."""
    pygltflib = pytest.importorskip("pygltflib")
    content = pygltflib.GLTF2().load(str(path))
    blob = content.binary_blob()

    def array(index: int) -> np.ndarray:
        accessor = content.accessors[index]
        view = content.bufferViews[accessor.bufferView]
        assert accessor.componentType == pygltflib.FLOAT
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor.type]
        start = view.byteOffset + (accessor.byteOffset or 0)
        return np.frombuffer(blob, "<f4", accessor.count * width, start).reshape(accessor.count, width)

    found = []
    assert "EXT_mesh_gpu_instancing" in content.extensionsUsed
    for number in content.scenes[content.scene].nodes:
        node = content.nodes[number]
        values = {key: array(i) for key, i in node.extensions["EXT_mesh_gpu_instancing"]["attributes"].items()}
        matrices = []
        for shift, (x, y, z, w), scale in zip(
            *(values.pop(key) for key in ("TRANSLATION", "ROTATION", "SCALE")), strict=True
        ):
            matrix = trimesh.transformations.quaternion_matrix((w, x, y, z)) @ np.diag([*scale, 1.0])
            matrix[:3, 3] = shift
            matrices.append(matrix)
        assert content.meshes[node.mesh].primitives[0].attributes.POSITION is not None
        found.append((node.name, np.array(matrices), {key: value[:, 0] for key, value in values.items()}))
    return found


def test_gltf_instances_stand_where_the_bodies_are(tmp_path, placement):
    esh.write_placement(tmp_path / "out.glb", placement)
    nodes = gltf_instances(tmp_path / "out.glb")
    assert [name for name, _, _ in nodes] == ["pine, old/large", 'pine, old/"small"', "Bärlauch 木", "log"]
    ids = np.concatenate([numbers["_ID"] for _, _, numbers in nodes])
    np.testing.assert_array_equal(ids, np.arange(12))
    np.testing.assert_array_equal(np.concatenate([n["_CLASS"] for _, _, n in nodes]), placement.class_index)
    np.testing.assert_array_equal(np.concatenate([n["_SIZE"] for _, _, n in nodes]), placement.size_index)
    matrices = np.concatenate([m for _, m, _ in nodes])
    x, y = placement.position.T
    np.testing.assert_allclose(matrices[:, :3, 3], np.stack([x, 0 * x, -y], axis=1), atol=1e-5)
    along = matrices[:, :3, 0] / np.linalg.norm(matrices[:, :3, 0], axis=1, keepdims=True)
    angle = placement.angle
    np.testing.assert_allclose(along, np.stack([np.cos(angle), 0 * angle, -np.sin(angle)], axis=1), atol=1e-6)


def test_the_mesh_that_stands_in_is_closed_and_looks_outwards(tmp_path, placement):

    esh.write_placement(tmp_path / "out.glb", placement)
    meshes = list(trimesh.load_scene(tmp_path / "out.glb").geometry.values())
    assert len(meshes) == 4
    for mesh, area in zip(meshes, [2.0, 1.0, 0.5, 2.0 * 0.2 + math.pi * 0.1**2], strict=True):
        solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=True)
        solid.merge_vertices(merge_norm=True, merge_tex=True)
        assert solid.is_watertight and solid.volume == pytest.approx(area * solid.extents[1], rel=1e-2)


def test_an_asset_of_several_meshes_is_taken_in_and_keeps_their_places(tmp_path, placement):

    asset = boxes(tmp_path)
    esh.write_placement(tmp_path / "out.glb", placement, assets={"Bärlauch 木": asset, "pine, old/large": asset})
    nodes = gltf_instances(tmp_path / "out.glb")
    assert [name for name, _, _ in nodes].count("Bärlauch 木") == 2
    theirs = {name: place for name, place in node_places(asset)}
    ours = [matrices for name, matrices, _ in nodes if name == "Bärlauch 木"]
    bodies = bodies_of(placement)
    for matrices, place in zip(ours, theirs.values(), strict=True):
        for matrix, (x, y, z), scale in zip(matrices, bodies.position[7:9], bodies.scale[7:9], strict=True):
            body = np.diag([*scale, 1.0])
            body[:3, 3] = (x, z, -y)
            np.testing.assert_allclose(matrix, body @ place, atol=1e-5)
    scene = trimesh.load_scene(tmp_path / "out.glb")
    textured = [m for m in scene.geometry.values() if getattr(m.visual, "material", None) is not None]
    assert any(getattr(m.visual.material, "baseColorTexture", None) is not None for m in textured)
    # Reading sees every body once, whatever it is made of.
    read = esh.load_placement(tmp_path / "out.glb")
    np.testing.assert_array_equal(read.id, np.arange(12))


def node_places(path: Path) -> list[tuple[str, np.ndarray]]:

    scene = trimesh.load_scene(path)
    order = {"trunk": 0, "crown": 1}
    places = [(name, scene.graph.get(name)[0]) for name in scene.graph.nodes_geometry]
    return sorted(places, key=lambda entry: order[entry[0]])


def test_long_bodies_do_not_stretch_meshes_that_are_turned(tmp_path, placement):
    with pytest.raises(EshError, match="must not turn its meshes"):
        esh.write_placement(tmp_path / "out.glb", placement, assets={"log": boxes(tmp_path)})
    assert not (tmp_path / "out.glb").exists()


def test_ply_is_read_by_trimesh(tmp_path, placement):

    esh.write_placement(tmp_path / "out.ply", placement)
    (cloud,) = trimesh.load_scene(tmp_path / "out.ply").geometry.values()
    np.testing.assert_array_equal(cloud.vertices[:, :2], placement.position)
    data = cloud.metadata["_ply_raw"]["vertex"]["data"]
    np.testing.assert_array_equal(np.asarray(data["class_index"]).ravel(), placement.class_index)


def test_parquet_is_read_by_pyarrow(tmp_path, placement):
    parquet = pytest.importorskip("pyarrow.parquet")
    esh.write_placement(tmp_path / "out.parquet", placement)
    table = parquet.read_table(tmp_path / "out.parquet")
    np.testing.assert_array_equal(table["x"].to_numpy(), placement.position[:, 0])
    np.testing.assert_array_equal(table["area"].to_numpy(), placement.area)
    names = [placement.class_name[c] for c in placement.class_index]
    assert table["class_name"].to_pylist() == names
    assert table["size_name"].to_pylist()[-1] == "1/2"
    assert parquet.ParquetFile(tmp_path / "out.parquet").metadata.row_group(0).column(1).compression == "ZSTD"


def test_geojson_is_points_with_properties(tmp_path, placement):
    esh.write_placement(tmp_path / "out.geojson", placement)
    content = json.loads((tmp_path / "out.geojson").read_text("utf-8"))
    assert content["type"] == "FeatureCollection" and len(content["features"]) == 12
    for feature, position, angle in zip(content["features"], placement.position, placement.angle, strict=True):
        assert feature["geometry"] == {"type": "Point", "coordinates": position.tolist()}
        assert feature["properties"]["angle"] == pytest.approx(angle, abs=1e-6)
    assert content["features"][-1]["properties"]["class_name"] == "log"


@pytest.mark.parametrize("ending", [available(ending) for ending in FORMATS])
def test_bodies_that_lean_read_back(tmp_path, placement, ending):
    random = np.random.default_rng(3)
    rotation = random.normal(size=(12, 4))
    rotation /= np.linalg.norm(rotation, axis=1, keepdims=True)
    rotation *= np.where(rotation[:, :1] < 0.0, -1.0, 1.0)
    position = random.normal(size=(12, 3))
    leaning = replace(
        bodies_of(placement), rotation=rotation.astype(np.float32), position=position, id=np.arange(12) * 1000 + 7
    )
    esh.write_bodies(tmp_path / f"out{ending}", leaning)
    read = esh.load_placement(tmp_path / f"out{ending}")
    np.testing.assert_allclose(read.position, position, atol=1e-6)
    signs = np.where(read.rotation[:, :1] < 0.0, -1.0, 1.0)
    np.testing.assert_allclose(signs * read.rotation, rotation, atol=1e-6)
    np.testing.assert_array_equal(read.id, leaning.id)


@pytest.mark.parametrize("ending", [available(ending) for ending in READABLE])
def test_what_is_no_such_file_is_said_in_one_sentence(tmp_path, ending):
    path = tmp_path / f"out{ending}"
    with pytest.raises(InputFileError, match="cannot be read: no such file"):
        esh.load_placement(path)
    for content in (b"", b"\x00\xff nothing of the kind", b"{}", b"[1, 2]\n"):
        path.write_bytes(content)
        with pytest.raises(InputFileError) as caught:
            esh.load_placement(path)
        assert str(path) in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("ending", [available(ending) for ending in READABLE])
def test_a_file_that_was_cut_off_is_not_taken_for_a_whole_one(tmp_path, placement, ending):
    path = tmp_path / f"out{ending}"
    esh.write_placement(path, placement)
    content = path.read_bytes()
    path.write_bytes(content[: len(content) * 2 // 3 - 1])
    try:
        read = esh.load_placement(path)
    except InputFileError:
        return
    assert ending == ".csv" and len(read.position) < 12  # a table of text may end anywhere


def test_tables_of_others_need_only_places(tmp_path):
    (tmp_path / "a.csv").write_text("\ufeffid, y,x,angle,species\n7,1,2,0.5,oak\n9,3,4,0,ash\n", encoding="utf-8")
    bodies = esh.load_placement(tmp_path / "a.csv")
    np.testing.assert_array_equal(bodies.position, [[2, 1, 0], [4, 3, 0]])
    np.testing.assert_array_equal(bodies.id, [7, 9])
    np.testing.assert_allclose(bodies.angle, [0.5, 0.0], atol=1e-6)
    assert bodies.class_name == ("class 1",) and bodies.size_name == (("class 1 1",),)
    (tmp_path / "a.csv").write_text("x,z\n1,2\n")
    with pytest.raises(InputFileError, match=r"a\.csv must have a column `y`; its columns are .x, z"):
        esh.load_placement(tmp_path / "a.csv")
    (tmp_path / "a.csv").write_text("x,y\n1,two\n")
    with pytest.raises(InputFileError, match="must hold numbers in its column `y`; line 2 has"):
        esh.load_placement(tmp_path / "a.csv")
    (tmp_path / "a.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
        "1 2 3\n4 5 6\n"
    )
    np.testing.assert_array_equal(esh.load_placement(tmp_path / "a.ply").position, [[1, 2, 3], [4, 5, 6]])
    (tmp_path / "a.geojson").write_text(
        '{"type": "FeatureCollection", "features": [{"type": "Feature", "properties": null,'
        ' "geometry": {"type": "Point", "coordinates": [3, 4]}}]}'
    )
    np.testing.assert_array_equal(esh.load_placement(tmp_path / "a.geojson").position, [[3, 4, 0]])


@pytest.mark.parametrize(("ending", "library", "extra"), [(".usdc", "pxr", "usd"), (".parquet", "pyarrow", "parquet")])
def test_a_library_that_is_missing_is_named_with_the_command(tmp_path, placement, monkeypatch, ending, library, extra):
    for name in [name for name in sys.modules if name.partition(".")[0] == library]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, library, None)
    (tmp_path / f"a{ending}").write_bytes(b"something")
    for act in (
        lambda: esh.write_placement(tmp_path / f"b{ending}", placement),
        lambda: esh.load_placement(tmp_path / f"a{ending}"),
        lambda: WRITERS[ending].check(),
    ):
        with pytest.raises(EshError, match=rf"needs the library {library}, .*: pip install 'esh-scatter\[{extra}\]'"):
            act()
    assert not (tmp_path / f"b{ending}").exists()


@pytest.mark.skipif(not installed(".usd"), reason="pxr is not installed")
def test_an_asset_must_be_of_the_format(tmp_path, placement):
    (tmp_path / "log.glb").write_bytes(b"")
    with pytest.raises(EshError, match=r'the asset of "log" for a USD file must end in \.usd or .*; got .*log\.glb'):
        esh.write_placement(tmp_path / "a.usd", placement, assets={"log": tmp_path / "log.glb"})
    assert [path.name for path in tmp_path.iterdir()] == ["log.glb"]


def test_a_library_that_is_there_but_broken_says_why(tmp_path, placement, monkeypatch):
    for name in [name for name in sys.modules if name.partition(".")[0] == "pyarrow"]:
        monkeypatch.delitem(sys.modules, name)
    (tmp_path / "pyarrow.py").write_text('raise ImportError("pyarrow requires NumPy 3")')
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(EshError, match=r"needs the library pyarrow, which cannot be used: pyarrow requires NumPy 3"):
        esh.write_placement(tmp_path / "a.parquet", placement)


def test_an_asset_must_be_for_something(tmp_path, placement):
    with pytest.raises(EshError, match=r"an asset must be for a class or a size .*; got 'birch'"):
        esh.write_placement(tmp_path / "a.glb", placement, assets={"birch": "birch.glb"})
    with pytest.raises(InputFileError, match=r"absent\.glb does not exist"):
        esh.write_placement(tmp_path / "a.glb", placement, assets={"log": tmp_path / "absent.glb"})
    assert not list(tmp_path.iterdir())


def test_an_asset_of_usd_must_have_a_default_prim(tmp_path, placement):
    pytest.importorskip("pxr.Usd")
    glb = boxes(tmp_path)
    (tmp_path / "a.usda").write_text('#usda 1.0\ndef Sphere "a" {}\n')
    with pytest.raises(EshError, match=r"a\.usda must be a USD file that has a default prim; it has none"):
        esh.write_placement(tmp_path / "b.usd", placement, assets={"log": [glb, tmp_path / "a.usda"]})


@pytest.mark.parametrize("ending", [available(ending) for ending in READABLE])
def test_fixed_bodies_come_from_every_format(tmp_path, placement, ending):
    kept = np.array([True] * 3 + [False] * 8 + [True])
    marked = replace(placement, id=np.arange(12) * 10 + 5, fixed=kept)
    esh.write_placement(tmp_path / f"there{ending}", marked)
    read = esh.load_placement(tmp_path / f"there{ending}")
    np.testing.assert_array_equal(read.fixed, kept)
    np.testing.assert_array_equal(read.id, marked.id)
    assert read.size_name == (("large", '"small"'), ("only",), ("1/2",))

    again = Problem(
        Domain((10.0, 4.0)),
        placement.problem.classes[:2] + (BodyClass("log", [Size("1/2", 0.4, 3, line=Line(2.0))]),),
        fixed=[esh.read_fixed_bodies(tmp_path / f"there{ending}")],
    )
    assert len(again.fixed.id) == 12
    order = np.argsort(again.fixed.id)
    np.testing.assert_array_equal(again.fixed.id[order], marked.id)
    np.testing.assert_allclose(again.fixed.position[order], placement.position, atol=1e-6)
    np.testing.assert_array_equal(again.fixed.class_index[order], placement.class_index)
    np.testing.assert_array_equal(again.fixed.size_index[order], placement.size_index)


@pytest.mark.parametrize("ending", [".npz", ".csv"])
def test_a_table_without_prototypes_has_one_for_every_size(tmp_path, placement, ending):
    """Everything in it was a disc of the mean area of all classes."""
    esh.write_placement(tmp_path / f"a{ending}", placement)
    read, expected = esh.load_placement(tmp_path / f"a{ending}"), bodies_of(placement)
    np.testing.assert_array_equal(read.prototype_index, expected.prototype_index)
    # Areas that are drawn have not quite the mean that was asked for.
    exact = expected.prototype_index != 1
    np.testing.assert_allclose(read.scale[exact], expected.scale[exact], rtol=1e-6)
    for one, other in zip(read.prototypes, expected.prototypes, strict=True):
        if ending == ".csv":  # the other knows no names of sizes
            assert one.name == other.name
        np.testing.assert_allclose(one.outline, other.outline, rtol=0.2, atol=1e-9)
    of_range = read.prototype_index == 1
    radius = read.scale[of_range, 0] * read.prototypes[1].height / 2.0
    np.testing.assert_allclose(math.pi * radius**2, placement.area[of_range], rtol=1e-6)


@pytest.fixture(scope="module")
def outlined() -> Placement:
    """Planks, triangles and coins of one size, scaled; logs whose outlines lie askew of their axes; and stones without outlines."""
    outlines = [
        esh.Footprint.rectangle(1.2, 0.2),
        esh.Footprint.polygon([[0.0, 0.0], [0.9, 0.0], [0.0, 0.6]], rounding=0.05),
        esh.Footprint.disc(0.3),
    ]
    mixed = esh.Size("mixed", None, 60, footprint=esh.Footprints(outlines, scale_jitter=0.4))
    askew = esh.Footprint.polygon([[-0.8, -0.1], [0.7, -0.2], [0.8, 0.1]])
    log = esh.Size("log", 0.2, 10, line=Line(1.0, direction=0.4), footprint=esh.Footprints([askew], turn=math.pi))
    classes = [BodyClass("wood", [mixed, log]), BodyClass("stone", [Size("one", (0.1, 0.3), 20)])]
    return esh.solve(Problem(Domain((10.0, 8.0)), classes, seed=2, avoid_overlap=True), device="cpu", max_steps=20)


@pytest.mark.parametrize("ending", [available(ending) for ending in FORMATS])
def test_prisms_stand_on_the_outlines_that_bodies_have(tmp_path, outlined, ending):
    """They were discs of the same area, and planks lay through each other in other programs."""
    shapely = pytest.importorskip("shapely")
    from shapely import affinity

    esh.write_placement(tmp_path / f"a{ending}", outlined)
    read = esh.load_placement(tmp_path / f"a{ending}")
    prototypes = bodies_of(outlined).prototypes
    names = ["wood/mixed/0", "wood/mixed/1", "wood/mixed/2", "wood/log", "stone"]
    assert [prototype.name for prototype in prototypes] == [prototype.name for prototype in read.prototypes] == names
    for body in range(len(read.id)):
        size = outlined.problem.classes[read.class_index[body]].sizes[read.size_index[body]]
        lying = shapely.Polygon(prototypes[read.prototype_index[body]].outline)
        assert lying.is_valid and lying.exterior.is_ccw
        lying = affinity.scale(lying, *read.scale[body, :2].tolist(), origin=(0.0, 0.0))
        lying = affinity.rotate(lying, read.angle[body], origin=(0.0, 0.0), use_radians=True)
        if size.footprint is None:
            expected = shapely.Point(0.0, 0.0).buffer(math.sqrt(outlined.area[body] / math.pi))
        else:
            outline = size.footprint.outlines[outlined.variant[body]].outline(64) * outlined.scale[body]
            expected = affinity.rotate(
                shapely.Polygon(outline), outlined.angle[body], origin=(0.0, 0.0), use_radians=True
            )
        assert lying.symmetric_difference(expected).area < 0.03 * expected.area


@pytest.mark.parametrize("ending", [available(ending) for ending in READABLE])
def test_fixed_bodies_keep_their_outlines_in_every_format(tmp_path, outlined, ending):
    marked = replace(outlined, id=np.arange(len(outlined.id)), fixed=np.ones(len(outlined.id), bool))
    esh.write_placement(tmp_path / f"there{ending}", marked)
    fixed = esh.read_fixed_bodies(tmp_path / f"there{ending}")
    given = outlined.problem
    classes = [*given.classes, BodyClass("moss", [Size("one", 0.01, 5)])]
    again = esh.solve(
        Problem(given.domain, classes, fixed=fixed, include_fixed=True, seed=9), device="cpu", max_steps=2
    )
    order = np.flatnonzero(again.fixed)[np.argsort(again.id[again.fixed])]
    np.testing.assert_array_equal(again.variant[order], outlined.variant)
    np.testing.assert_allclose(again.scale[order], outlined.scale, rtol=1e-6)
    np.testing.assert_allclose(again.area[order], outlined.area, rtol=1e-6)


def test_every_outline_may_have_an_asset_of_its_own(tmp_path, outlined):
    for name in ("plank", "any", "log"):
        (tmp_path / f"{name}.glb").write_bytes(b"")
    files = {"wood/mixed/0": tmp_path / "plank.glb", "wood": tmp_path / "any.glb", "wood/log": tmp_path / "log.glb"}
    assets = [[path.stem for path in prototype.assets] for prototype in bodies_of(outlined, files).prototypes]
    assert assets == [["plank"], ["any"], ["any"], ["log"], []]
    with pytest.raises(EshError, match="an asset must be for a class or a size"):
        bodies_of(outlined, {"wood/mixed/3": tmp_path / "any.glb"})


def test_fixed_bodies_of_others_get_the_class_that_is_said(tmp_path):
    (tmp_path / "rocks.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
        "1 2 3\n4 3 6\n"
    )
    fixed = esh.read_fixed_bodies(tmp_path / "rocks.ply", body_class="rock", size="one")
    classes = [BodyClass("pine", [Size("one", 0.1, 3)]), BodyClass("rock", [Size("one", 0.2, 1)])]
    problem = Problem(Domain((10.0, 4.0)), classes, fixed=[fixed])
    np.testing.assert_array_equal(problem.fixed.position, [[1, 2], [4, 3]])
    np.testing.assert_array_equal(problem.fixed.class_index, [1, 1])


def test_names_that_are_quoted_for_spreadsheets_come_back_as_they_were(tmp_path):
    names = ("=pine", "'beech", "'+oak", 'ash;=HYPERLINK("a.b")')
    classes = [BodyClass(name, [Size(f"{name} size", 0.1, 2)]) for name in names]
    placement = esh.solve(Problem(Domain((4.0, 4.0)), classes), device="cpu", max_steps=2)
    esh.write_placement(tmp_path / "a.csv", placement)
    written = (tmp_path / "a.csv").read_text()
    assert "'=pine" in written and ";'=HYPERLINK" in written and ";=" not in written
    assert esh.load_placement(tmp_path / "a.csv").class_name == names
    fixed = esh.read_fixed_bodies(tmp_path / "a.csv")
    again = Problem(Domain((4.0, 4.0)), classes, fixed=[fixed])
    np.testing.assert_array_equal(np.sort(again.fixed.class_index), [0, 0, 1, 1, 2, 2, 3, 3])


@pytest.mark.parametrize("separator", [";", "\t", "\n"])
@pytest.mark.parametrize("start", ["=", "+", "-", "@", "\uff1d"])
@pytest.mark.parametrize("before", ["", " ", '"', "'", " '\""])
def test_no_part_of_a_name_is_a_formula_where_something_else_than_a_comma_separates(separator, start, before):
    name = f"oak{separator}{before}{start}1+1{separator}=2"
    cell = as_cell(name)
    assert not any(part.lstrip(' "').startswith(("=", start)) for part in cell.split(separator))
    assert name_in_cell(cell) == name
    # A dash in a name is none, nor is what a comma separates: that is quoted.
    assert as_cell("sea-buckthorn; old, =1") == "sea-buckthorn; old, =1"


def test_a_table_of_text_keeps_large_ids_and_tells_the_line_of_a_mistake(tmp_path):
    path = tmp_path / "a.csv"
    large = 2**53 + 1
    path.write_text(f"x,y,id,angle\n1,2,{large},\n\n3,4,7,0.5\n", encoding="utf-8")
    bodies = esh.load_placement(path)
    assert bodies.id.tolist() == [large, 7]
    np.testing.assert_allclose(bodies.angle, [0.0, 0.5], atol=1e-7)
    path.write_text("x,y\n1,2\n\n3,four\n", encoding="utf-8")
    for read in (esh.load_placement, esh.read_fixed_bodies):
        with pytest.raises(InputFileError, match='must hold numbers in its column `y`; line 4 has "four"'):
            read(path)


@pytest.mark.parametrize("what", ["class", "size"])
def test_an_empty_cell_does_not_choose_the_first_class_or_size(tmp_path, what):
    path = tmp_path / "a.csv"
    path.write_text(f"x,y,{what}_index\n1,2,1\n3,4,\n", encoding="utf-8")
    for read in (esh.load_placement, esh.read_fixed_bodies):
        with pytest.raises(InputFileError, match=f'whole numbers in its column `{what}_index`; line 3 has ""'):
            read(path)
    path.write_text(f"x,y,{what}_index,{what}_name\n1,2,1,b\n3,4,,a\n", encoding="utf-8")
    labels = esh.read_fixed_bodies(path)
    assert list(labels.body_class if what == "class" else labels.size) == ["b", "a"]


@pytest.mark.parametrize("ending", [available(ending) for ending in READABLE])
def test_bodies_of_a_surface_stand_on_it(ending, tmp_path):
    ball = trimesh.creation.icosphere(2)
    line = esh.Line(length=0.2, direction="slope")
    classes = [
        esh.BodyClass("dot", [esh.Size("s", 0.01, 40)]),
        esh.BodyClass("line", [esh.Size("s", 0.01, 20, line=line)]),
    ]
    surface = esh.Surface([esh.SurfaceMesh(ball.vertices, ball.faces)])
    placement = esh.solve(esh.Problem(surface, classes), device="cpu", max_steps=3)
    path = tmp_path / f"a{ending}"
    write_placement(path, placement)
    bodies = bodies_of(placement)
    w, x, y, z = bodies.rotation.astype(float).T
    # Columns of the rotation: the body's own x axis and its z axis.
    np.testing.assert_allclose(
        np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)], axis=1),
        placement.tangent,
        atol=1e-6,
    )
    np.testing.assert_allclose(
        np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=1),
        placement.normal,
        atol=1e-6,
    )
    back = esh.load_placement(path)
    np.testing.assert_allclose(back.position, placement.position, atol=1e-6)
    np.testing.assert_allclose(np.abs((back.rotation * bodies.rotation).sum(axis=1)), 1.0, atol=1e-5)


@pytest.mark.parametrize("ending", [".npz", ".csv"])
def test_bodies_of_a_surface_can_be_fixed_on_it_again(ending, tmp_path):
    ball = trimesh.creation.icosphere(2)
    surface = esh.Surface([esh.SurfaceMesh(ball.vertices, ball.faces)])
    classes = [BodyClass("dot", [Size("s", 0.01, 40)])]
    placement = esh.solve(Problem(surface, classes), device="cpu", max_steps=3)
    write_placement(tmp_path / f"a{ending}", placement)
    again = Problem(surface, classes, fixed=esh.read_fixed_bodies(tmp_path / f"a{ending}"))
    np.testing.assert_allclose(again.fixed.position, placement.position, atol=1e-6)
    (tmp_path / "heights.csv").write_text("x,y,z\n1,2,3\n", encoding="utf-8")
    assert esh.read_fixed_bodies(tmp_path / "heights.csv").position.tolist() == [[1.0, 2.0]]


def some_bodies(position, **more):
    """Bodies of one class at these places, turned anyhow."""
    n = len(position)
    random = np.random.default_rng(3)
    turned = random.normal(size=(n, 4))
    one = Prototype("a", np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), 1.0)
    given = {
        "position": np.asarray(position, np.float64),
        "rotation": (turned / np.linalg.norm(turned, axis=1, keepdims=True)).astype(np.float32),
        "scale": random.uniform(0.5, 2.0, (n, 3)).astype(np.float32),
        "prototype_index": np.zeros(n, np.int32),
        "prototypes": (one,),
        "id": np.arange(n),
        "class_index": np.zeros(n, np.int32),
        "size_index": np.zeros(n, np.int32),
        "class_name": ("木",),
        "size_name": (("größe 1",),),
        "length": np.zeros(n),
        "width": np.zeros(n),
        "area": np.full(n, 0.1),
        "fixed": np.zeros(n, bool),
        "variant": np.zeros(n, np.int32),
        "factor": np.ones(n),
    }
    return Bodies(**given | more)


@pytest.mark.parametrize("ending", [available(ending) for ending in FORMATS])
def test_coordinates_of_the_world_are_kept(tmp_path, ending):
    """As 32-bit floats they were off by a quarter of a meter."""
    place = np.random.default_rng(2).uniform(-500.0, 500.0, (40, 3)) + [450_000.0, -5_300_000.0, 1_234.5]
    bodies = some_bodies(place)
    write_bodies(tmp_path / f"far{ending}", bodies)
    back = esh.load_placement(tmp_path / f"far{ending}")
    assert np.abs(back.position - place).max() < 1e-4
    assert np.abs(np.abs((back.rotation * bodies.rotation).sum(axis=1)) - 1.0).max() < 1e-6
    assert np.allclose(back.scale, bodies.scale, rtol=1e-6)


@pytest.mark.parametrize("ending", [available(ending) for ending in FORMATS])
@pytest.mark.parametrize("count", [0, 1])
def test_nobody_and_a_single_one_read_back(tmp_path, ending, count):
    bodies = some_bodies(np.full((count, 3), -7.25))
    write_bodies(tmp_path / f"few{ending}", bodies)
    back = esh.load_placement(tmp_path / f"few{ending}")
    assert back.position.tolist() == bodies.position.tolist() and back.id.tolist() == bodies.id.tolist()
    assert back.class_name == ("木",) and back.size_name == (("größe 1",),)


@pytest.mark.parametrize("ending", [available(ending) for ending in FORMATS])
def test_large_ids_come_back_as_they_are_or_are_refused(tmp_path, ending):
    bodies = some_bodies(np.zeros((3, 3)), id=np.array([7, 2**53 + 1, 2**62 + 1]))
    if ending in (".glb", ".ply"):
        with pytest.raises(EshError, match=f"ids in a {ending} file must be .* write .usdc or .parquet instead"):
            write_bodies(tmp_path / f"ids{ending}", bodies)
        return
    write_bodies(tmp_path / f"ids{ending}", bodies)
    assert sorted(esh.load_placement(tmp_path / f"ids{ending}").id.tolist()) == sorted(bodies.id.tolist())


def test_ways_to_stand_that_are_none_are_refused(tmp_path):
    names = ["x", "y", *(f"{name}_{axis}" for name in ("normal", "tangent") for axis in "xyz")]
    path = tmp_path / "a.csv"

    def read(normal, tangent):
        path.write_text(",".join(names) + "\n" + ",".join(map(str, (1.0, 2.0, *normal, *tangent))) + "\n")
        return esh.load_placement(path)

    # Neither of length 1 nor at right angles: x goes to y, and z stays.
    np.testing.assert_allclose(read((0, 0, 3), (0, 2, 1)).rotation, [[0.5**0.5, 0.0, 0.0, 0.5**0.5]], atol=1e-6)
    for normal, tangent, words in (
        ((0, 0, 0), (0, 2, 1), "normals must not be 0"),
        ((0, 0, 1), (0, 0, 2), "tangents, beside normals, must not be 0"),
    ):
        with pytest.raises(InputFileError, match=words):
            read(normal, tangent)
