"""Recipes on surfaces, for :mod:`fuzz`: meshes as they come from anywhere, whole, in pieces, and broken."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import trimesh
from fuzz_recipes import Choices, RecipeMaker

__all__ = ["SurfaceRecipeMaker"]

# What meshes begin as; about two meters wide.
SHAPES: dict[str, Callable[[], trimesh.Trimesh]] = {
    "ball": lambda: trimesh.creation.icosphere(subdivisions=2),
    "box": lambda: trimesh.creation.box((2.0, 1.0, 0.3)),
    "torus": lambda: trimesh.creation.torus(0.8, 0.3, 24, 12),
    "pipe": lambda: trimesh.creation.annulus(0.6, 0.7, 2.0, 20),
    "needle": lambda: trimesh.creation.cone(0.01, 2.0, sections=8),
    "sheet": lambda: sheet(9),
    "triangle": lambda: trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], process=False),
}


class SurfaceRecipeMaker(RecipeMaker):
    """Makes a recipe for bodies on meshes, whose files it writes."""

    def _place(self) -> dict[str, Any]:
        choose = self._choose
        meshes = [self._mesh() for _ in range(choose.pick([1, 1, 2]))]
        meshes = choose.pick([in_one_piece, in_halves, in_triangles, with_a_finer_part])(choose, meshes)
        if choose.pick(range(4)) == 0:
            meshes = choose.pick([flipped, with_crumbs, doubled, with_a_third_sheet, broken])(choose, meshes)
        scale = choose.pick([1.0, 1.0, 1.0, 1e-3, 1e4])
        away = choose.pick([0.0, 0.0, 0.0, 10.0, 1e4]) * scale
        self._endings = choose.pick([["ply"], ["ply"], ["obj"], ["ply", "obj", "stl", "glb"]])
        names = []
        for mesh in meshes:
            mesh.vertices = mesh.vertices * scale + away
            names.append(self._written(mesh))
        self._ground = max(float(sum(mesh.area for mesh in meshes)), 1e-12)
        self._size = [2.0 * scale] * 2
        self._meshes = meshes
        return {"surface": {"mesh": self._sometimes(names if len(names) > 1 else names[0], "absent.ply", [], 3)}}

    def _mesh(self) -> trimesh.Trimesh:
        choose = self._choose
        mesh = SHAPES[choose.pick(list(SHAPES))]()
        stretch = choose.pick([[1.0, 1.0, 1.0]] * 4 + [[1.0, 0.1, 1.0], [1.0, 1e-3, 1.0], [1.0, -1.0, 1.0]])
        mesh.vertices = mesh.vertices * stretch + choose.pick([0.0, 0.0, 0.5, 5.0])
        if choose.pick([False, False, True]):
            mesh.vertices += self._noise(mesh.vertices.shape) * choose.pick([1e-3, 0.05, 0.3])
        return mesh

    def _noise(self, shape: tuple[int, ...]) -> np.ndarray:
        return np.random.default_rng(int(self._choose.between(1, 1e6))).uniform(-0.5, 0.5, shape)

    def _written(self, mesh: trimesh.Trimesh) -> str:
        self._images += 1
        ending = self._choose.pick(self._endings)
        if ending == "obj":
            mesh.visual = trimesh.visual.TextureVisuals(uv=mesh.vertices[:, :2] - mesh.vertices[:, :2].min(axis=0))
        if ending == "ply":
            mesh.vertex_attributes["moss"] = (mesh.vertices[:, 0] - mesh.vertices[:, 0].min()).astype(np.float32)
            for k, axis in enumerate("xyz"):
                mesh.vertex_attributes[f"flow_{axis}"] = np.full(len(mesh.vertices), k - 0.5, np.float32)
        name = f"mesh{self._images}.{ending}"
        mesh.export(self._folder / name)
        return name

    def _few(self) -> int:
        # Every size has fields of its own on a surface, which take time to begin with.
        return self._choose.pick([1, 1, 1, 2, 2, 3])

    def _classes(self, class_count: int) -> dict[str, Any]:
        choose = self._choose
        made: dict[str, Any] = {"class": [self._class(c) for c in range(class_count)]}
        if choose.pick(range(5)) == 0:
            made["fixed"] = [{"position": [self._spot() for _ in range(choose.pick([1, 3]))]}]
        if choose.pick(range(5)) == 0:
            made["obstacle"] = [self._obstacle()]
        return made

    def _spot(self) -> list[float]:
        """A place near some vertex."""
        vertices = self._choose.pick(self._meshes).vertices
        place = vertices[int(self._choose.between(1, len(vertices))) - 1] if len(vertices) else np.zeros(3)
        return np.nan_to_num(place).tolist()

    def _obstacle(self) -> dict[str, Any]:
        choose = self._choose
        reach = choose.pick([0.02, 0.1, 0.3, 3.0]) * self._size[0]
        if choose.pick([True, False]):
            return {"ball": [*self._spot(), self._sometimes(reach, -1.0)]}
        made: dict[str, Any] = {"position": self._spot(), "margin": self._sometimes(0.1 * reach, -1.0)}
        square = [[-reach, -reach], [reach, -reach], [reach, reach], [-reach, reach]]
        return {**made, **choose.pick([{"disc": [0.0, 0.0, reach]}, {"polygon": square}])}

    def _class(self, number: int) -> dict[str, Any]:
        made = super()._class(number)
        # What is only for images and rectangles is refused; once is enough.
        for key in ("unsharp", "clustering", "clump_size", "density_correction", "invert"):
            if self._choose.pick(range(20)):
                made.pop(key, None)
        for size in made["size"]:
            if "line" in size and isinstance(size["line"]["length"], str):
                size["line"]["length"] = 0.1 * self._size[0]
                size["line"].pop("length_range")
        return made

    def _density(self) -> Any:
        image = {"image": self._image(), "mapping": "triplanar", "size": 0.5 * self._size[0]}
        by_file = {"ply": {"attribute": "moss"}, "obj": {"image": self._image()}}
        return self._choose.pick([1, 0.5, image, self._sometimes(by_file[self._endings[0]], {"attribute": "absent"})])

    def _direction(self) -> Any:
        x, y, z = self._spot()
        curve = [[x - self._size[0], y, z], [x + self._size[0], y, z]]
        some = ["density", "none", "slope", {"curve": curve}]
        return self._choose.pick([*some, {"attribute": "flow"}] if self._endings == ["ply"] else some)


def sheet(across: int) -> trimesh.Trimesh:
    """A sheet of 2 m in hills."""
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, across), np.linspace(-1.0, 1.0, across), indexing="ij")
    corner = np.stack([x, y, 0.2 * np.sin(3.0 * x) * np.cos(2.0 * y)], axis=2).reshape(-1, 3)
    one = (np.arange(across - 1)[:, None] * across + np.arange(across - 1)).ravel()
    other = one + across
    faces = [np.stack([one, other, other + 1], axis=1), np.stack([one, other + 1, one + 1], axis=1)]
    return trimesh.Trimesh(corner, np.concatenate(faces), process=False)


def in_one_piece(_: Choices, meshes: list[trimesh.Trimesh]) -> list[trimesh.Trimesh]:
    """As they are."""
    return meshes


def in_halves(choose: Choices, meshes: list[trimesh.Trimesh]) -> list[trimesh.Trimesh]:
    """The first one in two that do not quite meet."""
    lower, upper = _parted(meshes[0], 2)
    upper.vertices = upper.vertices + choose.pick([0.0, 1e-9, 1e-6, 1e-4, 1e-2])
    return [lower, upper, *meshes[1:]]


def in_triangles(choose: Choices, meshes: list[trimesh.Trimesh]) -> list[trimesh.Trimesh]:
    """Each has corners of its own, which are not quite the others'."""
    apart = choose.pick([0.0, 1e-9, 1e-6, 1e-4, 1e-2])
    made = []
    for mesh in meshes:
        corner = mesh.triangles.reshape(-1, 3)
        corner = corner + np.random.default_rng(0).uniform(-apart, apart, corner.shape)
        made.append(trimesh.Trimesh(corner, np.arange(len(corner)).reshape(-1, 3), process=False))
    return made


def with_a_finer_part(choose: Choices, meshes: list[trimesh.Trimesh]) -> list[trimesh.Trimesh]:
    """Half of it has corners within sides of the other half."""
    lower, upper = _parted(meshes[0], choose.pick([0, 1, 2]))
    for _ in range(choose.pick([1, 2, 3])):
        upper = upper.subdivide()
    parts = [lower, upper]
    return [*(parts if choose.pick([True, False]) else [trimesh.util.concatenate(parts)]), *meshes[1:]]


def flipped(_: Choices, meshes: list[trimesh.Trimesh]) -> list[trimesh.Trimesh]:
    """Every third triangle looks the other way."""
    for mesh in meshes:
        faces = np.array(mesh.faces)
        faces[::3] = faces[::3, ::-1]
        mesh.faces = faces
    return meshes


def with_crumbs(choose: Choices, meshes: list[trimesh.Trimesh]) -> list[trimesh.Trimesh]:
    """Beside many small ones, in one file."""
    rng = np.random.default_rng(int(choose.between(1, 1e6)))
    crumbs = [trimesh.creation.box((0.02,) * 3).apply_translation(rng.uniform(-2.0, 2.0, 3)) for _ in range(60)]
    return [*meshes, trimesh.util.concatenate(crumbs)]


def doubled(_: Choices, meshes: list[trimesh.Trimesh]) -> list[trimesh.Trimesh]:
    """Twice in one place."""
    return [meshes[0], *(mesh.copy() for mesh in meshes)]


def with_a_third_sheet(choose: Choices, meshes: list[trimesh.Trimesh]) -> list[trimesh.Trimesh]:
    """A triangle stands on a side of two others, another one in the middle of some."""
    first = meshes[0]
    a, b, c = first.vertices[first.faces[int(choose.between(1, len(first.faces))) - 1]]
    fin = trimesh.Trimesh([a, b, a + [0.3, 0.2, 0.7]], [[0, 1, 2]], process=False)
    through = trimesh.Trimesh([(a + b + c) / 3.0, a + 0.5, b - 0.5], [[0, 1, 2]], process=False)
    return [*meshes, fin, through]


def broken(choose: Choices, meshes: list[trimesh.Trimesh]) -> list[trimesh.Trimesh]:
    """With what no mesh should have."""
    mesh = meshes[0]
    vertices, faces = np.array(mesh.vertices, float), np.array(mesh.faces)
    what = choose.pick(["not a number", "without end", "no area", "twice", "no faces"])
    if what in ("not a number", "without end"):
        vertices[0, 1] = np.nan if what == "not a number" else np.inf
    elif what == "no area":
        faces[: len(faces) // 2, 2] = faces[: len(faces) // 2, 1]
    elif what == "twice":
        faces = np.concatenate([faces, faces, faces[:, ::-1]])
    else:
        faces = faces[:0]
    return [trimesh.Trimesh(vertices, faces, process=False), *meshes[1:]]


def _parted(mesh: trimesh.Trimesh, axis: int) -> list[trimesh.Trimesh]:
    """A mesh in two, by where triangles lie along an axis; one that has only one, twice."""
    place = mesh.triangles_center[:, axis]
    is_low = place <= np.median(place)
    if is_low.all():
        return [mesh, mesh.copy()]
    return [mesh.submesh([np.flatnonzero(own)], append=True) for own in (is_low, ~is_low)]
