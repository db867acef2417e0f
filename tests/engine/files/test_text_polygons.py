"""Concave polygons of OBJ and OFF files are no fans."""

import numpy as np
import pytest
import shapely
import trimesh
from esh.engine.files.mesh_files import read_meshes
from esh.engine.files.text_polygons import obj_without_concave_polygons, off_without_concave_polygons

NOTCHED = [(0, 0), (4, 0), (4, 4), (2, 0.5), (0, 4)]
DART = [(0, 0), (2, -2), (0, 3), (-2, -2)]
# A square with a hole that is cut open: two corners come twice.
RING = [(0, 0), (4, 0), (4, 4), (0, 4), (0, 0), (1, 1), (1, 3), (3, 3), (3, 1), (1, 1)]
COMB = [
    (0, 0),
    (7, 0),
    (7, 3),
    (6, 3),
    (6, 1),
    (5, 1),
    (5, 3),
    (4, 3),
    (4, 1),
    (3, 1),
    (3, 3),
    (2, 3),
    (2, 1),
    (1, 1),
    (1, 3),
    (0, 3),
]


def obj(outline, turn=None, uv=False, backward=False):
    place = np.column_stack([outline, np.zeros(len(outline))])
    if turn is not None:
        place = place @ trimesh.transformations.rotation_matrix(1.1, turn)[:3, :3].T
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in place]
    lines += [f"vt {x / 8:.9g} {y / 8:.9g}" for x, y in outline] if uv else []
    numbers = range(1, len(outline) + 1)
    face = " ".join(f"{k - len(outline) - 1 if backward else k}" + (f"/{k}" if uv else "") for k in numbers)
    return "\n".join([*lines, f"f {face}", "f 1 2 3" if not uv else "f 1/1 2/2 3/3"])


def off(outline, kind="OFF", more=""):
    """Of a polygon, a triangle before it and one behind, with comments, empty lines and colors."""
    place = [f"{x} {y} 0{' 0.1 0.2 0.3 1' if kind == 'COFF' else ''}" for x, y in outline]
    face = f"{len(outline)} {' '.join(str(k) for k in range(len(outline)))} 0.5 0.25 0.125"
    counts = f"{len(outline)} 3 0"
    return "\n".join([f"{kind}{more}", "# made by hand", counts, "", *place, "3 0 1 2 0.5 0.5 0.5", face, "3 0 1 3"])


@pytest.mark.parametrize("kind", ["OFF", "COFF"])
@pytest.mark.parametrize("outline", [NOTCHED, DART, RING, COMB], ids=["notched", "dart", "ring", "comb"])
def test_a_concave_polygon_of_an_off_file_is_no_fan(tmp_path, outline, kind):
    path = tmp_path / "part.off"
    path.write_text(off(outline, kind))
    (mesh,) = read_meshes(path)
    faces = [shapely.Polygon(mesh.vertices[face][:, :2]) for face in mesh.triangles]
    polygon = shapely.Polygon(outline).buffer(0.0)
    assert len(faces) == len(outline), "as many as the polygon has corners, less two, and the two beside it"
    assert sum(face.area for face in faces[2:]) == pytest.approx(polygon.area)
    assert shapely.union_all(faces[2:]).symmetric_difference(polygon).area < 1e-6


@pytest.mark.parametrize(
    "text",
    ["", "OFF", "OFF\n", "OFF\n4", "OFF\nfour 1 0", "OFF 4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n",
     "OFF\n4 1 0\n0 0 0\n1 0 0\n1 x 0\n0 1 0\n4 0 1 2 9\n4 0 1", "OFF\n-4 -1 0\n0 0 0", "OFF\n9 9 9\n0 0 0"],
)  # fmt: skip
def test_what_has_no_concave_polygon_or_is_no_off_file_is_left_to_the_reader(text):
    assert off_without_concave_polygons(text) is None


@pytest.mark.parametrize("backward", [False, True])
@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize("outline", [NOTCHED, DART, RING, COMB], ids=["notched", "dart", "ring", "comb"])
def test_triangles_of_a_concave_polygon_make_up_its_area_and_nothing_else(tmp_path, outline, reverse, backward):
    outline = outline[::-1] if reverse else outline
    polygon = shapely.Polygon(outline).buffer(0.0)
    path = tmp_path / "part.obj"
    for first in range(len(outline)):
        path.write_text(obj(outline[first:] + outline[:first], backward=backward))
        (mesh,) = read_meshes(path)
        triangles = [shapely.Polygon(mesh.vertices[face][:, :2]) for face in mesh.triangles[:-1]]
        assert sum(triangle.area for triangle in triangles) == pytest.approx(polygon.area)
        assert shapely.union_all(triangles).symmetric_difference(polygon).area < 1e-6
        # They look to where the polygon does.
        corner = mesh.vertices[mesh.triangles[:-1]]
        up = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])[:, 2]
        assert (np.sign(up) * (-1 if reverse else 1) >= 0).all()


def test_a_map_of_textures_stays_with_corners_and_what_is_convex_stays_as_it_is(tmp_path):
    path = tmp_path / "part.obj"
    path.write_text(obj(NOTCHED, uv=True))
    (mesh,) = read_meshes(path)
    np.testing.assert_allclose(mesh.uv * 8.0, mesh.vertices[:, :2], atol=1e-6)
    assert shapely.union_all([shapely.Polygon(mesh.uv[face]) for face in mesh.triangles]).area == pytest.approx(
        9.0 / 64.0, abs=0.1
    )
    tilted = obj(NOTCHED, turn=(1, 2, 3))
    assert obj_without_concave_polygons(tilted).count("\nf ") == 4
    for convex in ([(0, 0), (1, 0), (1, 1), (0, 1)], [(0, 0), (1, 0), (2, 0), (2, 1), (1, 2), (0, 1)]):
        assert obj_without_concave_polygons(obj(convex, turn=(1, 0, 1))) is None


@pytest.mark.parametrize("face", ["f 1 2 3 9", "f 1 2 x 4 5", "f 0 1 2 3 4", "f 1 1 1 1", "f", "f 1 2 -9 4"])
def test_what_is_no_polygon_is_left_to_the_reader(face):
    text = "\n".join(["v 0 0 0", "v 1 0 0", "v nan 1 0", "v 0 1", "v a b c", face])
    assert obj_without_concave_polygons(text) is None
