"""Surfaces that bodies are placed on: triangles of one mesh or of several, and what they say at their points.

Nothing here knows how bodies are placed. Meshes need not be clean: triangles without an area are left out, triangles that look
the other way than their neighbors are turned round, and neither holes nor edges of many triangles matter.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ..errors import ProblemError, Reason, Refusal
from ..geometry.connected import connected
from ..geometry.connected_triangles import parts_of
from ..geometry.inward_parts import has_inward_part
from ..geometry.seams import touching_sides
from ..geometry.sides import Sides, sides_of
from ..geometry.smooth_normals import corner_normals, creased_sides, has_blunt_creases
from . import validation
from .given_values import FOREIGN_ERRORS, as_tuple, show
from .settings import settle

__all__ = ["PointsOnSurface", "Surface", "SurfaceMesh"]

# Vertices nearer than this share of the extent are one.
WELDED = 2.0**-20
# Corners that lie on sides of other triangles are no farther away than this share of the extent; looked for on so many sides at most.
SEAM = 4.0 * WELDED
MOST_OPEN_SIDES = 200_000
# A triangle's height over its longest side, below which it has no area, and no normal that means anything.
FLATTEST = 1e-7
# Points that integrals over a surface are sampled at.
SAMPLES = 1 << 16
# Triangles look to the same side where the cosine between their normals is larger.
SAME_PLANE = 1.0 - 1e-6
# Make one number of three vertices and a mesh.
HASH = np.array([1, 1_000_000_007, 998_244_353_000_003, 7_777_777_777_777_777])
EXTENT_KEY = "the surface's extent"


@dataclass(frozen=True, eq=False)
class SurfaceMesh:
    """Triangles of one mesh, with what is interpolated over them.

    Args:
        vertices: Positions [m], shape ``[v, 3]``.
        triangles: Vertex indices, shape ``[t, 3]``.
        name: How sentences name it.
        attributes: Name -> values per vertex, shape ``[v]`` or ``[v, k]``, or per triangle, shape ``[t]`` or ``[t, k]``.
        uv: Coordinates of an image, 0..1, v up: per vertex, shape ``[v, 2]``, or per corner, shape ``[t, 3, 2]``; None for none.

    Raises:
        ProblemError: No triangles, indices of vertices that are not there, coordinates that are not finite, another shape.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    name: str = "mesh"
    attributes: Mapping[str, np.ndarray] = field(default_factory=dict)
    uv: np.ndarray | None = None

    def __post_init__(self) -> None:
        where = f'of mesh "{validation.check_name(self.name, "`name` of a mesh")}"'
        vertices = _array(self.vertices, (None, 3), f"`vertices` {where}")
        triangles = _array(self.triangles, (None, 3), f"`triangles` {where}")
        if not len(triangles):
            raise ProblemError(f"`triangles` {where} must have at least one triangle; got none")
        if triangles.dtype.kind == "f" and not np.array_equal(triangles, np.round(triangles)):
            raise ProblemError(f"`triangles` {where} must be whole numbers, indices of vertices; got fractions")
        if triangles.min() < 0 or triangles.max() >= len(vertices):
            wrong = show((triangles.min() if triangles.min() < 0 else triangles.max()).item())
            raise ProblemError(f"`triangles` {where} must be indices of its {len(vertices)} vertices; got {wrong}")
        triangles = triangles.astype(np.int64)
        vertices = vertices.astype(np.float64)
        if not np.isfinite(vertices[triangles]).all():
            raise ProblemError(f"`vertices` {where} must be finite; one of them is NaN or infinite")
        attributes = {}
        if not isinstance(self.attributes, Mapping):
            raise ProblemError(f"`attributes` {where} must be arrays by their names; got {show(self.attributes)}")
        for name, values in self.attributes.items():
            values = _numbers(values, f'attribute "{name}" {where}')
            if values.ndim not in (1, 2) or len(values) not in (len(vertices), len(triangles)):
                raise ProblemError(
                    f'attribute "{name}" {where} must hold one value per vertex, {len(vertices)}, or per triangle, '
                    f"{len(triangles)}; got shape {list(values.shape)}"
                )
            attributes[name] = values
        uv = self.uv
        if uv is not None:
            uv = _numbers(uv, f"`uv` {where}").astype(np.float64)
            if uv.shape not in ((len(vertices), 2), (len(triangles), 3, 2)):
                raise ProblemError(
                    f"`uv` {where} must have shape [{len(vertices)}, 2] or [{len(triangles)}, 3, 2]; got {list(uv.shape)}"
                )
        settle(self, vertices=vertices, triangles=triangles, attributes=attributes, uv=uv)

    def attribute_at(self, name: str, triangle: np.ndarray, barycentric: np.ndarray) -> np.ndarray:
        """Values of an attribute at points of triangles, shape ``[n]`` or ``[n, k]``, float64."""
        values = np.asarray(self.attributes[name], dtype=np.float64)
        if len(values) == len(self.vertices):
            return np.einsum("nk,nk...->n...", barycentric, values[self.triangles[triangle]])
        return values[triangle]

    def uv_at(self, triangle: np.ndarray, barycentric: np.ndarray) -> np.ndarray:
        """Coordinates of an image at points of triangles, shape ``[n, 2]``."""
        assert self.uv is not None
        corner = self.uv[triangle] if self.uv.ndim == 3 else self.uv[self.triangles[triangle]]
        return np.einsum("nk,nkd->nd", barycentric, corner)


@dataclass(frozen=True, eq=False)
class Surface:
    """A surface that bodies are placed on: the triangles of one mesh, or of several.

    Meshes that touch are one surface, whether they share vertices or not. Parts that do not touch do not see each other, however near
    they are, unless they are a few bodies small. What looks into opposite directions, such as the two sides of a wall, does not see
    each other either.

    Args:
        meshes: One :class:`SurfaceMesh`, or several.

    Attributes:
        position: Vertices of all meshes [m], shape ``[v, 3]``, float64.
        triangle: Indices of vertices, shape ``[t, 3]``, int64; those of a mesh follow those of the mesh before.
        source: Triangle of the meshes, counted through all of them, that each is, shape ``[t]``: those without an area are left out,
            and those that lie in the place of another of their mesh and look to the same side.
        normal: Of length 1, shape ``[t, 3]``; neighbors look to the same side.
        triangle_area: In m², shape ``[t]``.
        part: Which of the parts that share no sides each is in, see :func:`.parts_of`, shape ``[t]``.
        turned: Whether a triangle was turned round, so that its second and third corners have changed places, shape ``[t]``.
        welded: The triangles by vertices that are one where they lie in one place, shape ``[t, 3]``.
        sides: The sides of these.
        open_side: Whether no other triangle lies beyond the side opposite of each corner, shape ``[t, 3]``.

    Raises:
        ProblemError: No mesh, no triangle with an area, or an extent that is too small or too large.
    """

    meshes: SurfaceMesh | Sequence[SurfaceMesh]
    position: np.ndarray = field(init=False, repr=False)
    triangle: np.ndarray = field(init=False, repr=False)
    source: np.ndarray = field(init=False, repr=False)
    normal: np.ndarray = field(init=False, repr=False)
    triangle_area: np.ndarray = field(init=False, repr=False)
    part: np.ndarray = field(init=False, repr=False)
    turned: np.ndarray = field(init=False, repr=False)
    welded: np.ndarray = field(init=False, repr=False)
    sides: Sides = field(init=False, repr=False)
    open_side: np.ndarray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        meshes = (self.meshes,) if isinstance(self.meshes, SurfaceMesh) else self.meshes
        meshes = as_tuple(meshes, SurfaceMesh, "`meshes` of a surface")
        if not meshes:
            raise ProblemError("`meshes` of a surface must hold at least one SurfaceMesh; got none")
        first = np.concatenate([[0], np.cumsum([len(mesh.vertices) for mesh in meshes])])
        position = np.concatenate([mesh.vertices for mesh in meshes])
        triangle = np.concatenate([mesh.triangles + start for mesh, start in zip(meshes, first[:-1], strict=True)])
        used = position[triangle]
        extent = float((used.max(axis=(0, 1)) - used.min(axis=(0, 1))).max())
        if not validation.SMALLEST_LENGTH <= extent <= validation.LARGEST_LENGTH:
            raise ProblemError(
                f"{EXTENT_KEY} must lie between {validation.SMALLEST_LENGTH:g} and {validation.LARGEST_LENGTH:g} meters; "
                f"got {extent:g}",
                validation.out_of_range(extent),
            )
        cross = np.cross(used[:, 1] - used[:, 0], used[:, 2] - used[:, 0])
        length = np.linalg.norm(cross, axis=1)
        longest = np.linalg.norm(used - np.roll(used, 1, axis=1), axis=2).max(axis=1)
        kept = np.flatnonzero(length > FLATTEST * longest**2)
        if not len(kept):
            raise ProblemError(
                "the surface must have an area; all its triangles are points or lines",
                Refusal(Reason.SURFACE_WITHOUT_AREA, 0, 0),
            )
        welded = _welded(position, triangle[kept], extent)
        once = _first_of_their_place(
            welded, np.repeat(np.arange(len(meshes)), [len(m.triangles) for m in meshes])[kept]
        )
        kept, welded = kept[once], welded[once]
        triangle, normal = triangle[kept], cross[kept] / length[kept, None]
        sides = sides_of(welded)
        turned = _turned(sides, normal, _seams(welded, sides, position[triangle], SEAM * extent))
        if turned.any():
            welded = np.where(turned[:, None], welded[:, [0, 2, 1]], welded)
            sides = sides_of(welded)
        triangle = np.where(turned[:, None], triangle[:, [0, 2, 1]], triangle)
        values = {
            "meshes": meshes,
            "position": position,
            "triangle": triangle,
            "source": kept,
            "normal": np.where(turned[:, None], -normal, normal),
            "triangle_area": 0.5 * length[kept],
            "part": parts_of(welded, sides),
            "turned": turned,
            "welded": welded,
            "sides": sides,
            "open_side": (sides.count == 1)[sides.number].reshape(-1, 3),
        }
        settle(self, **values)

    @property
    def area(self) -> float:
        """Area of all triangles [m²]."""
        return float(self.triangle_area.sum())

    @cached_property
    def corner_normal(self) -> np.ndarray:
        """Where the smooth surface that the triangles stand for looks to at their corners, of length 1, shape ``[t, 3, 3]``."""
        return corner_normals(self.position[self.triangle], self.normal, self.welded)

    @cached_property
    def edge_side(self) -> np.ndarray:
        """Whether a crease or the surface's end lies at the side opposite of each corner, shape ``[t, 3]``."""
        return creased_sides(self.corner_normal, self.sides)

    @cached_property
    def has_blunt_creases(self) -> bool:
        """Whether a crease between two of its triangles bends by less than 80°."""
        return has_blunt_creases(self.normal, self.sides, self.edge_side)

    @cached_property
    def looks_inwards(self) -> bool:
        """Whether a closed part looks to its inside, as a mesh does that is inside out."""
        return has_inward_part(self.position[self.triangle], self.part, self.sides)

    @cached_property
    def repeated(self) -> int:
        """Number of triangles that lie in the place of one of another mesh, and look to the same side."""
        mesh = np.zeros(len(self.welded), np.int64)
        return 0 if len(self._first_triangles) == 2 else len(mesh) - len(_first_of_their_place(self.welded, mesh))

    @cached_property
    def low(self) -> np.ndarray:
        """Smallest coordinates [m], shape ``[3]``."""
        return self.position[self.triangle].min(axis=(0, 1))

    @cached_property
    def high(self) -> np.ndarray:
        """Largest ones."""
        return self.position[self.triangle].max(axis=(0, 1))

    @property
    def size(self) -> tuple[float, ...]:
        """Extent along x, y and z [m]."""
        return tuple((self.high - self.low).tolist())

    def points(self, triangle: np.ndarray, barycentric: np.ndarray) -> PointsOnSurface:
        """Points by their triangles, shape ``[n]``, and the weights of these triangles' corners, shape ``[n, 3]``."""
        return PointsOnSurface(self, np.asarray(triangle), np.asarray(barycentric, dtype=np.float64))

    def locate(self, mesh: np.ndarray, triangle: np.ndarray, barycentric: np.ndarray) -> PointsOnSurface:
        """Points by meshes, triangles of theirs and weights of these triangles' corners.

        It is the inverse of :meth:`PointsOnSurface.source`. The triangles must have an area.
        """
        first = self._first_triangles
        # Those of one mesh are numbered as they are there, unless some were left out.
        own = triangle if len(first) == 2 else first[mesh] + triangle
        if len(self.source) < first[-1]:
            own = np.searchsorted(self.source, own)
        return self.points(own, self._turned_round(own, barycentric))

    def wrong_triangle(self, mesh: np.ndarray, triangle: np.ndarray) -> tuple[str, int, str] | None:
        """Tell which of some triangles of meshes is none that bodies can be on; None where all are.

        Returns:
            What is wrong of it, ``"mesh"`` or ``"triangle"``; its index; and what must hold, to follow on that.
        """
        meshes = self.meshes
        assert isinstance(meshes, tuple)
        count = np.array([len(one.triangles) for one in meshes])
        no_mesh = (mesh < 0) | (mesh >= len(count))
        if no_mesh.any():
            k = int(np.argmax(no_mesh))
            return "mesh", k, f"must be below {len(count)}, the number of meshes of the surface; got {int(mesh[k])}"
        below, beyond = triangle < 0, triangle >= count[mesh]
        if below.any():
            k = int(np.argmax(below))
            return "triangle", k, f"must be a triangle of mesh {mesh[k]}, from 0 on; got {int(triangle[k])}"
        if beyond.any():
            k = int(np.argmax(beyond))
            said = f"must be below {count[mesh[k]]}, the number of triangles of mesh {mesh[k]}; got {int(triangle[k])}"
            return "triangle", k, said
        flat = np.isin(self._first_triangles[mesh] + triangle, self.source, invert=True)
        if flat.any():
            k = int(np.argmax(flat))
            return (
                "triangle",
                k,
                f"must be a triangle with an area, and none in another's place; got {int(triangle[k])} of mesh {mesh[k]}",
            )
        return None

    @property
    def _first_triangles(self) -> np.ndarray:
        """Number of the first triangle of every mesh, counted through all of them, and at the end how many there are."""
        meshes = self.meshes
        assert isinstance(meshes, tuple)
        return np.concatenate([[0], np.cumsum([len(mesh.triangles) for mesh in meshes])])

    def _turned_round(self, triangle: np.ndarray, barycentric: np.ndarray) -> np.ndarray:
        """Weights of the corners of some triangles as these are in their meshes, from what they are here; or the other way."""
        if not self.turned.any():
            return barycentric
        return np.where(self.turned[triangle][:, None], barycentric[:, [0, 2, 1]], barycentric)

    def sample(self, count: int = SAMPLES) -> PointsOnSurface:
        """Points that stand for equal areas, spread over the surface; the same ones every time."""
        return self._sample if count == SAMPLES else self._sampled(count)

    @cached_property
    def _sample(self) -> PointsOnSurface:
        return self._sampled(SAMPLES)

    def _sampled(self, count: int) -> PointsOnSurface:
        share = np.cumsum(self.triangle_area)
        along = (np.arange(count) + 0.5) / count * share[-1]
        triangle = np.minimum(np.searchsorted(share, along), len(share) - 1)
        # Fractions of the golden ratio and of its plastic kin fill a square evenly.
        u, v = np.mod(np.arange(count) * 0.7548776662466927, 1.0), np.mod(np.arange(count) * 0.5698402909980532, 1.0)
        beyond = u + v > 1.0
        u, v = np.where(beyond, 1.0 - u, u), np.where(beyond, 1.0 - v, v)
        return self.points(triangle, np.stack([1.0 - u - v, u, v], axis=1))


@dataclass(frozen=True, eq=False)
class PointsOnSurface:
    """Points of a surface.

    Attributes:
        surface: The surface.
        triangle: Triangle that each lies on, shape ``[n]``.
        barycentric: Weights of its corners, shape ``[n, 3]``, float64.
    """

    surface: Surface
    triangle: np.ndarray
    barycentric: np.ndarray

    @property
    def position(self) -> np.ndarray:
        """Where they are [m], shape ``[n, 3]``, float64."""
        corner = self.surface.position[self.surface.triangle[self.triangle]]
        return np.einsum("nk,nkd->nd", self.barycentric, corner)

    @property
    def normal(self) -> np.ndarray:
        """Of their triangles, of length 1, shape ``[n, 3]``, float64."""
        return self.surface.normal[self.triangle]

    @property
    def smooth_normal(self) -> np.ndarray:
        """Where the smooth surface looks to that the triangles stand for, of length 1, shape ``[n, 3]``, float64."""
        between = np.einsum("nk,nkd->nd", self.barycentric, self.surface.corner_normal[self.triangle])
        return between / np.linalg.norm(between, axis=1, keepdims=True)

    def attribute(self, name: str, key: str = "`attribute`") -> np.ndarray:
        """Values of an attribute of the meshes, shape ``[n]`` or ``[n, k]``; a mesh that lacks it counts as 0."""
        meshes = self.surface.meshes
        assert isinstance(meshes, tuple)
        names = sorted({own for mesh in meshes for own in mesh.attributes})
        if name not in names:
            listed = ", ".join(f'"{own}"' for own in names) or "none"
            raise ProblemError(
                f'{key} must name an attribute of the surface\'s meshes, which have {listed}; got "{name}"'
            )
        return self._of_meshes(
            lambda mesh, triangle, weights: (
                mesh.attribute_at(name, triangle, weights) if name in mesh.attributes else None
            )
        )

    def uv(self, key: str = "`uv`") -> np.ndarray:
        """Coordinates in the meshes' UV maps, shape ``[n, 2]``."""
        meshes = self.surface.meshes
        assert isinstance(meshes, tuple)
        for mesh in meshes:
            if mesh.uv is None:
                raise ProblemError(f'{key} needs a UV map, and mesh "{mesh.name}" has none')
        return self._of_meshes(lambda mesh, triangle, weights: mesh.uv_at(triangle, weights))

    def source(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Mesh, triangle of that mesh, and weights of its corners in its own order, for every point."""
        surface = self.surface
        first, weights = surface._first_triangles, surface._turned_round(self.triangle, self.barycentric)
        triangle = self.triangle if len(surface.source) == first[-1] else surface.source[self.triangle]
        if len(first) == 2:
            return np.zeros(len(triangle), np.int64), triangle, weights
        mesh = np.searchsorted(first, triangle, side="right") - 1
        return mesh, triangle - first[mesh], weights

    def _of_meshes(self, read: Callable[[SurfaceMesh, np.ndarray, np.ndarray], np.ndarray | None]) -> np.ndarray:
        """What ``read`` returns of every mesh for its triangles and weights, put together; it may return None of some."""
        meshes = self.surface.meshes
        assert isinstance(meshes, tuple)
        number, triangle, barycentric = self.source()
        result: np.ndarray | None = None
        for k, mesh in enumerate(meshes):
            own = np.flatnonzero(number == k)
            values = read(mesh, triangle[own], barycentric[own])
            if values is None:
                continue
            if result is None:
                result = np.zeros((len(number), *values.shape[1:]))
            result[own] = values
        assert result is not None
        return result


def _numbers(value: object, key: str) -> np.ndarray:
    """Return an array of numbers; raise ProblemError for anything else."""
    try:
        array = np.asarray(value)
    except FOREIGN_ERRORS:
        array = np.empty(0, dtype=object)
    if array.dtype.kind not in "biuf":
        raise ProblemError(f"{key} must be an array of numbers; got {show(value)}")
    return array


def _array(value: object, shape: tuple[int | None, ...], key: str) -> np.ndarray:
    try:
        array = np.asarray(value)
    except FOREIGN_ERRORS:
        array = np.empty(0, dtype=object)
    fits = array.ndim == len(shape) and all(n is None or n == m for n, m in zip(shape, array.shape, strict=False))
    if not array.size and array.dtype.kind in "iuf":
        return np.zeros((0, 3), array.dtype)
    if not fits or array.dtype.kind not in "iuf":
        shown = ", ".join("n" if n is None else str(n) for n in shape)
        got = f"shape {list(array.shape)}" if array.dtype.kind in "iuf" else show(value)
        raise ProblemError(f"{key} must be an array of numbers of shape [{shown}]; got {got}")
    return array


def _welded(position: np.ndarray, triangle: np.ndarray, extent: float) -> np.ndarray:
    """Triangles of vertices that are one where they lie in one place."""
    used, index = np.unique(triangle, return_inverse=True)
    place = position[used]
    cell = np.round((place - place.min(axis=0)) / (WELDED * extent)).astype(np.int64)
    key = (cell[:, 0] << 42) | (cell[:, 1] << 21) | cell[:, 2]
    return np.unique(key, return_inverse=True)[1].ravel()[index].reshape(-1, 3)


def _first_of_their_place(welded: np.ndarray, mesh: np.ndarray) -> np.ndarray:
    """Which triangles come first of those of a mesh that lie in one place and look to one side, indices in rising order."""
    first = welded.argmin(axis=1)[:, None]
    corner = np.column_stack([np.take_along_axis(welded, (first + np.arange(3)) % 3, axis=1), mesh])
    # Numbers that go round at 64 bits: those that differ are of different places.
    _, number, count = np.unique((corner * HASH).sum(axis=1), return_inverse=True, return_counts=True)
    alike = np.flatnonzero(count[number.ravel()] > 1)
    if not len(alike):
        return np.arange(len(welded))
    again = np.ones(len(alike), bool)
    again[np.unique(corner[alike], axis=0, return_index=True)[1]] = False
    return np.delete(np.arange(len(welded)), alike[again])


def _seams(
    welded: np.ndarray, sides: Sides, corner: np.ndarray, near: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What :func:`.touching_sides` finds, where there may be any and not so many that it takes long."""
    count = int((sides.count == 1).sum())
    if not 0 < count <= MOST_OPEN_SIDES:
        return np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0, bool)
    place = np.zeros((int(welded.max()) + 1, 3))
    place[welded] = corner
    return touching_sides(sides, place, near)


def _turned(sides: Sides, normal: np.ndarray, seams: tuple[np.ndarray, np.ndarray, np.ndarray]) -> np.ndarray:
    """Which triangles look the other way than most of the sheet that they are in, shape ``[t]``.

    Sheets go on at ``seams``: a side, another one, and whether both run the same way.
    """
    count = len(sides.number) // 3
    side, beside = sides.pairs()
    # Neighbors run along the side between them in opposite directions, or one of them is to be turned round.
    ahead = sides.start < sides.end
    against = ahead[side] == ahead[beside]
    # Unless one lies on the other, as at the border of a sheet that is there twice.
    lies_on = against & (np.einsum("nd,nd->n", normal[side // 3], normal[beside // 3]) > SAME_PLANE)
    side, beside, against = side[~lies_on], beside[~lies_on], np.concatenate([against[~lies_on], seams[2]])
    one, other = side // 3, beside // 3
    one, other = np.concatenate([one, seams[0] // 3]), np.concatenate([other, seams[1] // 3])
    turned = np.zeros(count, bool)
    if not against.any():
        return turned
    sheet = connected(count, one, other)
    # Only sheets with a contradiction are gone through, from triangle to triangle.
    wrong = np.zeros(int(sheet.max()) + 1, bool)
    wrong[sheet[one[against]]] = True
    edge = np.flatnonzero(wrong[sheet[one]])
    a = np.concatenate([one[edge], other[edge]])
    b = np.concatenate([other[edge], one[edge]])
    flips = np.concatenate([against[edge], against[edge]])
    order = np.argsort(a, kind="stable")
    a, b, flips = a[order], b[order], flips[order]
    first = np.searchsorted(a, np.arange(count + 1))
    seen = ~wrong[sheet]
    starts = np.flatnonzero(~seen)
    _, leaders = np.unique(sheet[starts], return_index=True)
    front = starts[leaders]
    seen[front] = True
    while len(front):
        lengths = first[front + 1] - first[front]
        at = np.repeat(first[front] - np.concatenate([[0], np.cumsum(lengths)[:-1]]), lengths) + np.arange(
            lengths.sum()
        )
        state = np.repeat(turned[front], lengths) ^ flips[at]
        fresh = ~seen[b[at]]
        found, which = np.unique(b[at][fresh], return_index=True)
        turned[found] = state[fresh][which]
        seen[found] = True
        front = found
    # The side that most triangles of the sheet look to is the right one.
    votes = np.bincount(sheet, weights=np.where(turned, -1.0, 1.0), minlength=len(wrong))
    return turned ^ (votes < 0.0)[sheet]
