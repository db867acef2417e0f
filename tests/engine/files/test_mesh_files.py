"""Meshes from files, recipes that name them, and placements on them as files."""

import csv
import json
import os
import struct

import numpy as np
import pytest
import trimesh
from esh.engine.errors import EshError, InputFileError
from esh.engine.files.fixed_files import read_fixed_bodies
from esh.engine.files.image_files import read_density
from esh.engine.files.mesh_files import read_meshes
from esh.engine.files.placement_files import write_placement
from esh.engine.files.recipe import read_recipe, recipe_densities
from esh.engine.files.recipe_writer import write_recipe
from esh.engine.problem.surface import Surface
from esh.engine.solve import solve
from PIL import Image

RECIPE = """
version = 1
seed = 3
[surface]
mesh = {mesh}
[[class]]
name = "moss"
density = {density}
[[class.size]]
name = "tuft"
area = 0.001
count = 60
"""


def recipe(folder, mesh='"ball.ply"', density="1.0"):
    path = folder / "moss.toml"
    path.write_text(RECIPE.format(mesh=mesh, density=density))
    return path


@pytest.fixture
def folder(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=2)
    ball.vertex_attributes["moss"] = (ball.vertices[:, 2] > 0.0).astype(np.float32)
    ball.export(tmp_path / "ball.ply")
    for ending in ("obj", "stl", "glb", "off"):
        trimesh.creation.icosphere(subdivisions=2).export(tmp_path / f"ball.{ending}")
    Image.fromarray(np.tile(np.arange(256, dtype=np.uint8), (8, 1))).save(tmp_path / "ramp.png")
    return tmp_path


@pytest.mark.parametrize("ending", ["ply", "obj", "stl", "glb", "off"])
def test_every_format_gives_the_same_surface(folder, ending):
    surface = Surface(read_meshes(folder / f"ball.{ending}"))
    assert surface.area == pytest.approx(trimesh.creation.icosphere(subdivisions=2).area, rel=1e-5)
    assert len(surface.triangle) == 320
    assert surface.part.max() == 0


def test_files_whose_meshes_close_each_other_are_one_surface(folder):
    """One has numbers of single precision, and the other text of eight digits."""
    ball = trimesh.creation.icosphere(subdivisions=3).apply_translation((7.3, 5.1, 3.7))
    for name, own in (("up.ply", ball.triangles_center[:, 2] > 3.7), ("down.obj", ball.triangles_center[:, 2] < 3.7)):
        ball.submesh([np.flatnonzero(own)], append=True).export(folder / name)
    placement = solve(read_recipe(recipe(folder, '["up.ply", "down.obj"]')), device="cpu")
    assert placement.report.coverage_error < 0.02 and placement.report.smallest_spacing > 0.75
    assert np.abs(placement.position.mean(axis=0) - (7.3, 5.1, 3.7)).max() < 0.02


def test_scenes_keep_where_their_meshes_are(tmp_path):
    scene = trimesh.Scene()
    for x in (0.0, 3.0):
        scene.add_geometry(trimesh.creation.box(), transform=trimesh.transformations.translation_matrix([x, 0, 0]))
    scene.export(tmp_path / "two.glb")
    meshes = read_meshes(tmp_path / "two.glb")
    assert sorted(round(float(mesh.vertices[:, 0].mean())) for mesh in meshes) == [0, 3]
    assert len({mesh.name for mesh in meshes}) == 2


def test_uv_maps_of_obj_files_are_read(tmp_path):
    (tmp_path / "quad.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n"
    )
    (mesh,) = read_meshes(tmp_path / "quad.obj")
    points = Surface(mesh).sample(50)
    np.testing.assert_allclose(points.uv(), points.position[:, :2], atol=1e-9)


@pytest.mark.parametrize("ending", ["glb", "gltf"])
@pytest.mark.parametrize("material", [False, True])
def test_maps_and_colors_of_gltf_files_are_read_with_a_material_and_without(tmp_path, ending, material):
    arrays = {
        "POSITION": np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4"),
        "TEXCOORD_0": np.array([[0, 1], [1, 1], [0, 0]], "<f4"),
        "COLOR_0": np.array([[0, 0, 0], [1, 0, 0], [0, 0.5, 0]], "<f4"),
    }
    described = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "translation": [0, 0, 5]}],
        "meshes": [{"primitives": [{"attributes": dict(zip(arrays, range(3), strict=True))}]}],
        "accessors": [
            {"bufferView": k, "componentType": 5126, "count": 3, "type": f"VEC{values.shape[1]}"}
            for k, values in enumerate(arrays.values())
        ],
        "bufferViews": [{"buffer": 0, "byteOffset": at, "byteLength": n} for at, n in ((0, 36), (36, 24), (60, 36))],
        "buffers": [{"byteLength": 96}],
    }
    if material:
        described["materials"] = [{"name": "bark"}]
        described["meshes"][0]["primitives"][0]["material"] = 0
    data = b"".join(values.tobytes() for values in arrays.values())
    if ending == "gltf":
        (tmp_path / "part.bin").write_bytes(data)
        described["buffers"][0]["uri"] = "part.bin"
    text = json.dumps(described).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sIIII", b"glTF", 2, 28 + len(text) + len(data), len(text), 0x4E4F534A)
    whole = head + text + struct.pack("<II", len(data), 0x004E4942) + data
    (tmp_path / f"part.{ending}").write_bytes(whole if ending == "glb" else text)
    (mesh,) = read_meshes(tmp_path / f"part.{ending}")
    np.testing.assert_array_equal(mesh.vertices[:, 2], 5.0)
    np.testing.assert_allclose(mesh.uv, mesh.vertices[:, :2], atol=1e-6)
    np.testing.assert_allclose(mesh.attributes["color"], arrays["COLOR_0"], atol=0.003)


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        ("none.obj", None, "does not exist"),
        ("mesh.docx", b"", r"must end in .obj, .ply, .stl, .glb, .gltf, .off; got the ending '.docx'"),
        ("empty.obj", b"", "must hold at least one triangle|cannot be read"),
        ("broken.glb", b"glTF of a kind", "cannot be read as a mesh"),
        (
            "corner.obj",
            b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n",
            "a face has a corner that is none of the file's vertices",
        ),
    ],
)
def test_what_is_no_mesh_file_is_refused_in_a_sentence(tmp_path, name, content, sentence):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(InputFileError, match=sentence):
        read_meshes(tmp_path / name)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_pipes_are_no_files_and_nobody_waits_for_them(tmp_path):
    for name in ("a.obj", "a.png", "a.csv", "a.toml"):
        os.mkfifo(tmp_path / name)
    for read, name in (
        (read_meshes, "a.obj"),
        (read_density, "a.png"),
        (read_fixed_bodies, "a.csv"),
        (read_recipe, "a.toml"),
    ):
        with pytest.raises(InputFileError, match=rf"{name} is not a regular file; "):
            read(tmp_path / name)


def test_a_recipe_places_on_a_mesh_by_an_attribute(folder, tmp_path):
    problem = read_recipe(recipe(folder, density='{ attribute = "moss" }'))
    placement = solve(problem, device="cpu", max_steps=10)
    assert len(placement.position) == 60
    assert placement.position[:, 2].min() > -0.3
    again = solve(read_recipe(recipe(folder, density='{ attribute = "moss" }')), device="cpu", max_steps=10)
    np.testing.assert_array_equal(placement.position, again.position)
    write_placement(tmp_path / "out.npz", placement)
    with np.load(tmp_path / "out.npz") as stored:
        np.testing.assert_array_equal(stored["position"], placement.position)
        for name in ("normal", "tangent", "mesh", "triangle", "barycentric"):
            np.testing.assert_array_equal(stored[name], getattr(placement, name))
    write_placement(tmp_path / "out.csv", placement)
    with (tmp_path / "out.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["class_name"] for row in rows] == ["moss"] * 60
    np.testing.assert_array_equal([[float(row[axis]) for axis in "xyz"] for row in rows], placement.position)
    found = [[float(row[f"normal_{axis}"]) for axis in "xyz"] for row in rows]
    np.testing.assert_array_equal(found, placement.normal)
    np.testing.assert_array_equal([int(row["triangle"]) for row in rows], placement.triangle)
    found = [[float(row[f"weight_{corner}"]) for corner in range(3)] for row in rows]
    np.testing.assert_array_equal(found, placement.barycentric)


def test_a_recipe_lays_an_image_along_the_axes(folder):
    density = '{ image = "ramp.png", mapping = "triplanar", size = 2.0 }'
    problem = read_recipe(recipe(folder, '["ball.obj", "ball.stl"]', density))
    assert len(problem.domain.meshes) == 2
    named = {path.name for path in recipe_densities(recipe(folder, '["ball.obj", "ball.stl"]', density))}
    assert named == {"ball.obj", "ball.stl", "ramp.png"}


def half_white(folder):
    """An image that is white where the first coordinate is above one half."""
    Image.fromarray(np.tile(np.repeat(np.uint8([0, 255]), 128), (8, 1))).save(folder / "half.png")


@pytest.mark.parametrize("axes", [(0, 1), (1, 0)], ids=["along x", "along y"])
def test_bodies_of_a_recipe_stand_where_the_image_lies_by_the_uv_map(folder, axes):
    half_white(folder)
    x, y = np.meshgrid(np.linspace(0.0, 3.0, 7), np.linspace(0.0, 3.0, 7))
    vertices = np.stack([x.ravel(), y.ravel(), 0.1 * x.ravel() ** 2], axis=1)
    corner = (np.arange(6)[:, None] * 7 + np.arange(6)).reshape(-1, 1)
    faces = np.concatenate([corner + [0, 1, 8], corner + [0, 8, 7]])
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    mesh.visual = trimesh.visual.TextureVisuals(uv=vertices[:, list(axes)] / 3.0, image=Image.new("RGB", (4, 4)))
    mesh.export(folder / "sheet.glb")
    recipe(folder, '"sheet.glb"', '{ image = "half.png" }')
    placement = solve(read_recipe(folder / "moss.toml"), device="cpu", max_steps=20)
    assert len(placement.position) == 60
    surface = placement.problem.domain
    # As trimesh reads the file, whichever way up it takes it to be.
    along = (surface.meshes[0].uv[surface.triangle[placement.triangle], 0] * placement.barycentric).sum(axis=1)
    assert along.min() > 0.495
    assert np.ptp(placement.position[:, axes[0]]) > 1.2


def test_bodies_of_a_recipe_stand_where_the_image_lies_along_the_axes(folder):
    half_white(folder)
    trimesh.creation.box((2.0, 2.0, 2.0)).export(folder / "box.ply")
    recipe(folder, '"box.ply"', '{ image = "half.png", mapping = "triplanar", size = 1.0 }')
    placement = solve(read_recipe(folder / "moss.toml"), device="cpu", max_steps=20)
    assert len(placement.position) == 60
    for axis in range(3):
        of_face = np.abs(placement.normal[:, axis]) > 0.99
        assert of_face.sum() >= 15
        # The image lies along the first of the other two axes, a meter wide: its right half is white.
        across = placement.position[of_face, 1 if axis == 0 else 0]
        assert np.abs((across - 0.25) % 1.0 - 0.5).max() < 0.33


@pytest.mark.parametrize(
    ("mesh", "density", "sentence"),
    [
        ('"rock.obj"', "1.0", "`surface.mesh` cannot be used: .*rock.obj does not exist"),
        ("3", "1.0", "`surface.mesh` must be the name of a mesh file, or a list of such; got 3"),
        ("[]", "1.0", "must be the name of a mesh file, or a list of such"),
        (
            '"ball.ply"',
            '"ramp.png"',
            r'must say how the image lies on the surface: . image = "ramp.png" .; got "ramp.png"',
        ),
        ('"ball.ply"', '{ image = "ramp.png" }', "needs a UV map"),
        (
            '"ball.ply"',
            '{ image = "ramp.png", mapping = "round" }',
            '`class.1..density.mapping` .* must be "uv" or "triplanar"',
        ),
        ('"ball.ply"', '{ image = "ramp.png", size = 2.0 }', 'is only for a `mapping` of "triplanar"'),
        (
            '"ball.ply"',
            '{ attribute = "moss", invert = true }',
            "`class.1..density.invert` .* cannot be combined with `attribute`: it is about an image",
        ),
        ('"ball.ply"', '{ attribute = "mos" }', 'which have .*"moss".*; got "mos"'),
        ('"ball.ply"', "{ atribute = 3 }", "did you mean `attribute`|is not a known key"),
    ],
)
def test_mistakes_in_recipes_of_surfaces_are_named(folder, mesh, density, sentence):
    with pytest.raises(EshError, match=sentence):
        read_recipe(recipe(folder, mesh, density))


def test_a_surface_and_a_domain_exclude_each_other_and_surfaces_are_not_written(folder):
    path = recipe(folder)
    problem = read_recipe(path)
    with pytest.raises(EshError, match="must be a rectangle for this; it is a surface"):
        write_recipe(folder / "out.toml", problem)
    path.write_text(path.read_text().replace("[surface]", "[domain]\nsize = [1.0, 1.0]\n[surface]"))
    with pytest.raises(InputFileError, match=r"`domain` cannot be combined with \[surface\]"):
        read_recipe(path)


@pytest.mark.parametrize("encoding", ["binary", "ascii"])
def test_properties_of_ply_files_are_read_as_numbers_and_as_text(tmp_path, encoding):
    ball = trimesh.creation.icosphere(subdivisions=2)
    ball.vertex_attributes["moss"] = ball.vertices[:, 2].astype(np.float32)
    (tmp_path / "ball.ply").write_bytes(trimesh.exchange.ply.export_ply(ball, encoding=encoding))
    (mesh,) = read_meshes(tmp_path / "ball.ply")
    np.testing.assert_allclose(mesh.attributes["moss"], mesh.vertices[:, 2], atol=1e-6)


def test_lines_of_a_recipe_lie_along_vectors_of_its_mesh(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=2)
    for axis, values in zip("xyz", np.cross([0, 0, 1], ball.vertices).T, strict=True):
        ball.vertex_attributes[f"flow_{axis}"] = values.astype(np.float32)
    ball.export(tmp_path / "ball.ply")
    path = recipe(tmp_path)
    plain = path.read_text()
    path.write_text(f'{plain}[class.size.line]\nlength = 0.2\ndirection = {{ attribute = "flow" }}\n')
    placement = solve(read_recipe(path), device="cpu", max_steps=30)
    round_z = np.abs((placement.tangent * np.cross([0, 0, 1], placement.position)).sum(axis=1))
    assert np.median(round_z / np.linalg.norm(placement.position[:, :2], axis=1)) > 0.98
    for wrong, sentence in (
        ('{ atribute = "flow" }', "did you mean `attribute`"),
        ('{ attribute = "flow_x" }', "must name an attribute of three numbers"),
        ('{ attribute = "flow" }\ndirection_kind = "angle"', "is only for a `direction` that is an image"),
        ("{ }", "`attribute` or `curve` must be given|or `curve` must be given"),
        ('{ attribute = "flow", curve = "a.csv" }', "cannot be combined with `curve`"),
        ('{ attribute = "moss" }', '`line.direction` of class "moss" must name an attribute of the surface'),
        ('{ curve = "a.csv" }', "cannot be used: .*a.csv"),
        ("{ curve = [[0, 0, 0]] }", r"`class\[1\]\.size\[1\]\.line\.direction\.curve` .* must be two or more points"),
        ("{ curve = [[0, 0, 0], [nan, 0, 0]] }", r"direction\.curve` .* must be finite everywhere"),
    ):
        path.write_text(f"{plain}[class.size.line]\nlength = 0.2\ndirection = {wrong}\n")
        with pytest.raises(EshError, match=sentence):
            solve(read_recipe(path), device="cpu", max_steps=1)
    path.write_text(f'{plain}[class.size.line]\nlength = 0.2\ndirection = {{ attribute = "flow" }}\n')
    path.write_text(path.read_text().replace('[surface]\nmesh = "ball.ply"', "[domain]\nsize = [1.0, 1.0]"))
    with pytest.raises(EshError, match="direction"):
        read_recipe(path)


@pytest.mark.parametrize("inline", [False, True])
def test_lines_of_a_recipe_lie_along_the_nearest_curve(tmp_path, inline):
    """One ring about the poles of a ball, and a short piece far below it, which is the nearest nowhere above the middle."""
    trimesh.creation.icosphere(subdivisions=2).export(tmp_path / "ball.ply")
    turn = np.linspace(0.0, 2.0 * np.pi, 60)
    ring = np.stack([2.0 * np.cos(turn), 2.0 * np.sin(turn), 0.0 * turn], axis=1)
    below = np.array([[0.0, 0.0, -3.0], [0.0, 1.0, -3.0]])
    with (tmp_path / "curves.csv").open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["x", "y", "z", "curve"])
        rows.writerows([*point, number] for number, curve in enumerate([ring, below]) for point in curve.tolist())
    curve = json.dumps([ring.tolist(), below.tolist()]) if inline else '"curves.csv"'
    path = recipe(tmp_path, '"ball.ply"', "1.0")
    path.write_text(f"{path.read_text()}[class.size.line]\nlength = 0.2\ndirection = {{ curve = {curve} }}\n")
    assert (tmp_path / "curves.csv" in recipe_densities(path)) != inline
    placement = solve(read_recipe(path), device="cpu", max_steps=30)
    above = placement.position[:, 2] > -0.3
    round_z = np.abs((placement.tangent * np.cross([0, 0, 1], placement.position)).sum(axis=1))
    share = round_z / np.linalg.norm(placement.position[:, :2], axis=1)
    assert above.sum() > 10 and np.median(share[above]) > 0.98


@pytest.mark.parametrize(
    ("lines", "sentence"),
    [
        ("0,0,0,1\n\n1,,1,1\n", "must have a finite number in every line of its column `y`; line 4 has none"),
        ("0,0,0,1\n1,inf,1,1\n", "must have a finite number in every line of its column `y`; line 3 has none"),
        ("0,0,0,1\n1,1,1,\n", "must have a finite number in every line of its column `curve`; line 3 has none"),
        ("0,0,0,1\n1,1,1,2\n", r"must be two or more points \[x, y, z\] of a curve"),
        ("", "must be curves of some length"),
    ],
)
def test_mistakes_in_the_table_of_a_curve_are_told_with_its_file_and_line(tmp_path, lines, sentence):
    trimesh.creation.icosphere(subdivisions=2).export(tmp_path / "ball.ply")
    (tmp_path / "stem.csv").write_text(f"x,y,z,curve\n{lines}")
    path = recipe(tmp_path, '"ball.ply"', "1.0")
    path.write_text(f'{path.read_text()}[class.size.line]\nlength = 0.2\ndirection = {{ curve = "stem.csv" }}\n')
    with pytest.raises(InputFileError, match=rf"direction\.curve` \(.*\) cannot be used: .*stem\.csv {sentence}"):
        read_recipe(path)


def test_fixed_bodies_of_a_recipe_say_which_side_of_a_thin_wall_they_are_on(tmp_path):
    """The two sides of a sheet lie in one place: the nearest triangle alone would not tell them apart."""
    corner = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
    front = np.array([[0, 1, 2], [0, 2, 3]])
    sheet = trimesh.Trimesh(corner, np.concatenate([front, front[:, ::-1]]), process=False)
    sheet.export(tmp_path / "sheet.ply")
    path = recipe(tmp_path, '"sheet.ply"', "1.0")
    plain = path.read_text()
    for triangle, weights in ((1, "[0.4, 0.3, 0.3]"), (3, "[0.3, 0.3, 0.4]")):
        path.write_text(
            f"{plain}\n[[fixed]]\nposition = [[0.3, 0.6, 0.0]]\nmesh = 0\ntriangle = {triangle}\nbarycentric = [{weights}]\n"
        )
        placement = solve(read_recipe(path), device="cpu", max_steps=2)
        assert placement.triangle[placement.fixed].tolist() == [triangle]
        assert np.sign(placement.normal[placement.fixed][:, 2]).tolist() == [1.0 if triangle == 1 else -1.0]
    path.write_text(path.read_text().replace("[0.3, 0.3, 0.4]", "[0.3, 0.4, 0.3]"))
    with pytest.raises(
        InputFileError, match=r"`fixed\.position` must be where .*, \[0\.4, 0\.7, 0\.0\]; got \[0\.3, 0\.6, 0"
    ):
        read_recipe(path)
    path.write_text(f"{plain}\n[[fixed]]\nposition = [[0.3, 0.6, 0.0]]\ntriangle = 9\n")
    with pytest.raises(EshError, match="triangle"):
        read_recipe(path)
    path.write_text(path.read_text().replace('[surface]\nmesh = "sheet.ply"', "[domain]\nsize = [1.0, 1.0]"))
    path.write_text(path.read_text().replace("[[0.3, 0.6, 0.0]]", "[[0.3, 0.6]]"))
    with pytest.raises(EshError, match=r"`fixed\.triangle` is only for surfaces"):
        read_recipe(path)
