"""Meshes of PLY files, whatever the numbers of corners of their faces."""

import struct

import numpy as np
import pytest
from esh.engine.errors import InputFileError
from esh.engine.files.mesh_files import read_meshes
from esh.engine.problem.surface import Surface

# A square, a U whose triangles are no fan, a triangle beside them, and an edge that is no face.
CORNERS = [
    (0, 4),
    (1, 4),
    (1, 5),
    (0, 5),
    (0, 0),
    (3, 0),
    (3, 3),
    (2, 3),
    (2, 1),
    (1, 1),
    (1, 3),
    (0, 3),
    (9, 0),
    (9, 2),
]
FACES = [(0, 1, 2, 3), (4, 5, 6, 7, 8, 9, 10, 11), (11, 12, 13), (0, 5)]
AREA = 1.0 + 7.0 + 9.0
FORMATS = ("ascii", "binary_little_endian", "binary_big_endian")
HEAD = """ply\r
format {} 1.0
comment property of nobody
obj_info none
element camera 1
property list uchar double view
element vertex 14
property double x
property float y
property float z
property uchar red
property uchar green
property uchar blue
property ushort moss
element face {}
property uchar flags
property list {} int {}
property list uchar float texcoord
end_header
"""


def ply(kind, faces=FACES, number="uchar", name="vertex_indices"):
    """A file with a property of each kind; textures lie as the corners do, a tenth as large."""
    rows = [("B", 2), ("dd", 0.5, -1e30)]
    rows += [("dffBBBH", x, y, 0.0, 255 * (y > 2), 0, 51, k) for k, (x, y) in enumerate(CORNERS)]
    code = {"uchar": "B", "int": "i", "ushort": "H"}[number]
    for face in faces:
        uv = [value / 10 for k in face for value in CORNERS[k % 14]]
        row = [7, len(face), *face, len(uv), *uv]
        rows.append((f"B{code}{len(face)}iB{len(uv)}f", *row))
    head = HEAD.format(kind, len(faces), number, name).encode()
    if kind == "ascii":
        return head + "\n".join(" ".join(map(repr, row[1:])) for row in rows).encode()
    order = "<" if "little" in kind else ">"
    return head + b"".join(struct.pack(order + row[0], *row[1:]) for row in rows)


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize(("number", "name"), [("uchar", "vertex_indices"), ("int", "vertex_index")])
def test_polygons_of_all_kinds_are_read(tmp_path, kind, number, name):
    (tmp_path / "part.ply").write_bytes(ply(kind, number=number, name=name))
    (mesh,) = read_meshes(tmp_path / "part.ply")
    assert Surface(mesh).area == pytest.approx(AREA)
    # In their order.
    np.testing.assert_array_equal(mesh.triangles[:, 0] > 3, [False] * 2 + [True] * 7)
    np.testing.assert_array_equal(mesh.triangles[-1], [11, 12, 13])
    np.testing.assert_allclose(mesh.uv, mesh.vertices[mesh.triangles][:, :, :2] / 10, atol=1e-6)
    np.testing.assert_array_equal(mesh.attributes["moss"], np.arange(14))
    np.testing.assert_array_equal(mesh.attributes["color"][[0, 4]], [[1.0, 0.0, 0.2], [0.0, 0.0, 0.2]])


@pytest.mark.parametrize("kind", FORMATS)
def test_faces_of_as_many_corners_and_coordinates_of_vertices_are_read(tmp_path, kind):
    text = ply(kind, FACES[1:2]).replace(b"uchar red", b"uchar   s").replace(b"uchar green", b"uchar t")
    (tmp_path / "part.ply").write_bytes(text.replace(b"texcoord", b"unknown"))
    (mesh,) = read_meshes(tmp_path / "part.ply")
    assert Surface(mesh).area == pytest.approx(7.0)
    np.testing.assert_array_equal(mesh.uv[:, 0], [255 * (y > 2) for _, y in CORNERS])


@pytest.mark.parametrize("kind", FORMATS)
def test_what_is_cut_off_or_broken_is_said(tmp_path, kind):
    path, whole = tmp_path / "part.ply", ply(kind)
    start = whole.index(b"end_header") + 11
    for content in [whole[:k] for k in (2, 40, start, start + 3, start + 30, -30, -300)] + [
        whole.replace(b"element vertex 14", b"element vertex 999999999999999"),
        whole.replace(b"property float y", b"property quad y"),
        whole.replace(b"element face 4", b"element face four"),
        whole.replace(kind.encode(), b"ebcdic", 1),
        ply(kind, [(0, 1, 99)]),
        ply(kind, [(0, 1, 2, -5)]),
    ]:
        path.write_bytes(content)
        with pytest.raises(InputFileError, match=r"part.ply(: | cannot be read as a mesh: )\S"):
            read_meshes(path)
    for content in (
        ply(kind, []),
        ply(kind, [(0, 1)]),
        ply(kind, name="other"),
        whole.replace(b"double x", b"double q"),
    ):
        path.write_bytes(content)
        with pytest.raises(InputFileError, match="must hold at least one triangle"):
            read_meshes(path)
