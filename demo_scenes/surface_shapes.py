"""What the surface demos are made of, modeled by code: rocks and moss, a doughnut and its sprinkles, a hull and what grows on it.

Shapes are vertices ``[n, 3]`` [m] and faces ``[m, 3 or 4]``; things that are placed stand on z = 0 and look up along z.
"""

from __future__ import annotations

import bmesh
import bpy
import numpy as np

__all__ = [
    "Shape",
    "ball",
    "barnacle",
    "box",
    "hull",
    "icing",
    "lathe",
    "lichen",
    "moss",
    "mussel",
    "pearl",
    "ring",
    "rock",
    "sprinkle",
    "waves",
]

Shape = tuple[np.ndarray, np.ndarray]

# Where the paint of a hull ends above the water [m], and share of its girth that is painted.
EDGE, PAINTED = 0.06, 0.6


def waves(place: np.ndarray, wavelength: float, seed: int, octaves: int = 4, roughness: float = 0.5) -> np.ndarray:
    """Fractal noise, about -1 to 1, of points ``[n, 3]``; its coarsest bumps are a wavelength [m] apart."""
    rng = np.random.default_rng(seed)
    total, weight = np.zeros(len(place)), 0.0
    for octave in range(octaves):
        direction = rng.normal(size=(7, 3))
        direction *= 2.0 * np.pi / wavelength * 2.0**octave / np.linalg.norm(direction, axis=1, keepdims=True)
        phase = rng.uniform(0.0, 2.0 * np.pi, 7)
        total += roughness**octave * np.sin(place @ direction.T + phase).sum(axis=1) / 3.0
        weight += roughness**octave
    return total / weight


def grid_faces(rows: int, columns: int, *, round_rows: bool = False, round_columns: bool = False) -> np.ndarray:
    """Faces of a grid of points, row after row; rows or columns may close to a ring."""
    row = np.arange(rows if round_rows else rows - 1)[:, None]
    column = np.arange(columns if round_columns else columns - 1)
    corner = [((row + i) % rows) * columns + (column + j) % columns for i, j in ((0, 0), (0, 1), (1, 1), (1, 0))]
    return np.stack(corner, axis=-1).reshape(-1, 4)


def grid(x: np.ndarray, y: np.ndarray, height: np.ndarray) -> Shape:
    """Ground of which a height is known at every place of a grid, shapes ``[rows, columns]``."""
    return np.stack([x, y, height], axis=-1).reshape(-1, 3), grid_faces(*x.shape)


def joined(shapes: list[Shape]) -> Shape:
    """Several shapes as one, of faces with as many corners."""
    first = np.concatenate([[0], np.cumsum([len(vertex) for vertex, _ in shapes])])
    return (
        np.concatenate([vertex for vertex, _ in shapes]),
        np.concatenate([face + start for (_, face), start in zip(shapes, first[:-1], strict=True)]),
    )


def lathe(profile: np.ndarray, sides: int) -> Shape:
    """A body of revolution: radius and height of its profile ``[n, 2]``, from the bottom up and outside."""
    angle = np.arange(sides) * 2.0 * np.pi / sides
    radius, height = profile[:, :1], np.repeat(profile[:, 1:], sides, axis=1)
    vertex = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=-1).reshape(-1, 3)
    return vertex, grid_faces(len(profile), sides, round_columns=True)


def ball(subdivisions: int) -> Shape:
    """A ball of radius 1, of triangles."""
    made = bmesh.new()
    bmesh.ops.create_icosphere(made, subdivisions=subdivisions, radius=1.0)
    made.verts.index_update()
    vertex = np.array([v.co[:] for v in made.verts])
    face = np.array([[v.index for v in f.verts] for f in made.faces])
    made.free()
    return vertex, face


def box(size: tuple[float, float, float]) -> Shape:
    """A box around the origin."""
    corner = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * size
    return corner, np.array([(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])


def rock(size: tuple[float, float, float], seed: int, subdivisions: int = 6) -> Shape:
    """A rock: a ball that planes have been broken off, weathered."""
    rng = np.random.default_rng(seed)
    vertex, face = ball(subdivisions)
    for _ in range(16):
        normal = rng.normal(size=3)
        normal /= np.linalg.norm(normal)
        beyond = np.maximum(vertex @ normal - rng.uniform(0.62, 0.9), 0.0)
        vertex = vertex - 0.94 * beyond[:, None] * normal
    outward = vertex / np.linalg.norm(vertex, axis=1, keepdims=True)
    rough = 0.045 * waves(vertex, 0.9, seed + 1) + 0.014 * waves(vertex, 0.16, seed + 2)
    return (vertex + rough[:, None] * outward) * size, face


def moss(radius: float, leaves: int, seed: int) -> Shape:
    """A cushion of moss: narrow leaves that spread from its middle."""
    rng = np.random.default_rng(seed)
    number = np.arange(leaves) + 0.5
    up = 1.0 - 0.93 * number / leaves
    angle = np.pi * (1.0 + 5.0**0.5) * number + rng.normal(0.0, 0.25, leaves)
    flat = np.sqrt(1.0 - up**2)
    way = np.stack([flat * np.cos(angle), flat * np.sin(angle), 0.8 * up], axis=1)
    side = np.cross(way, rng.normal(size=(leaves, 3)))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    length = radius * rng.uniform(0.75, 1.15, (leaves, 1))
    width = 0.11 * radius
    droop = np.array([0.0, 0.0, -0.22 * radius]) * flat[:, None]
    root, tip = 0.25 * way * length, way * length + droop
    middle = 0.65 * way * length
    vertex = np.stack([root, middle - width * side, tip, middle + width * side], axis=1).reshape(-1, 3)
    return vertex, np.arange(4 * leaves).reshape(-1, 4)


def lichen(radius: float, seed: int) -> Shape:
    """A crust of lichen: many flat scales side by side, smaller and sparser towards a ragged rim."""
    rng = np.random.default_rng(seed)
    count, sides, rings = 150, 9, 3
    number = np.arange(count) + 0.5
    angle = np.pi * (1.0 + 5.0**0.5) * number + rng.normal(0.0, 0.1, count)
    share = np.sqrt(number / count)
    lobes = 0.8 + sum(rng.uniform(0.04, 0.1) * np.sin(k * angle + rng.uniform(0.0, 6.3)) for k in (2, 3, 5, 8))
    kept = rng.random(count) > 0.45 * share**3
    middle = (radius * share * lobes)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    width = radius * (0.105 - 0.045 * share) * rng.uniform(0.75, 1.2, count)
    scales = []
    for place, size, turn in zip(middle[kept], width[kept], angle[kept], strict=True):
        around = turn + np.arange(sides) * 2.0 * np.pi / sides
        ragged = rng.uniform(0.75, 1.15, sides)
        ring_share = np.array([1.0, 0.9, 0.0])[:, None]
        flat = place + (size * ring_share * ragged)[..., None] * np.stack([np.cos(around), np.sin(around)], axis=1)
        height = np.repeat(np.array([-0.3, 0.12, 0.22])[:, None] * size, sides, axis=1)
        scales.append(
            (
                np.concatenate([flat, height[..., None]], axis=2).reshape(-1, 3),
                grid_faces(rings, sides, round_columns=True),
            )
        )
    return joined(scales)


def grass(height: float, blades: int, seed: int) -> Shape:
    """A tuft of grass: narrow blades that bend outwards."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0.0, 2.0 * np.pi, blades)
    way = np.stack([np.cos(angle), np.sin(angle), np.zeros(blades)], axis=1)
    side = np.stack([-np.sin(angle), np.cos(angle), np.zeros(blades)], axis=1)
    root = way * rng.uniform(0.0, 0.14 * height, (blades, 1))
    long, lean = height * rng.uniform(0.5, 1.1, (blades, 1)), rng.uniform(0.15, 0.75, (blades, 1))
    rows = []
    for share in (0.0, 0.4, 0.75, 1.0):
        place = (
            root + way * long * lean * share**2 + np.array([0.0, 0.0, 1.0]) * long * share * (1.0 - 0.3 * lean * share)
        )
        half = 0.018 * height * (1.0 - share**2) * side
        rows += [place - half, place + half]
    vertex = np.stack(rows, axis=1).reshape(-1, 3)
    first = 8 * np.arange(blades)[:, None]
    quads = np.array([(2 * k, 2 * k + 1, 2 * k + 3, 2 * k + 2) for k in range(3)])
    return vertex, (first[:, None] + quads).reshape(-1, 4)


def ring(radius: float, thickness: float, seed: int) -> Shape:
    """A doughnut, puffed and a little uneven."""
    around, about = _angles(300, 90)
    vertex = _on_ring(around, about, radius, thickness)
    outward = _on_ring(around, about, radius, thickness + 1.0) - vertex
    bump = 0.03 * thickness * waves(vertex, 1.6 * radius, seed) + 0.006 * thickness * waves(vertex, 0.1 * radius, seed)
    return vertex + bump[:, None] * outward, grid_faces(300, 90, round_rows=True, round_columns=True)[:, ::-1]


def icing(radius: float, thickness: float, depth: float, seed: int) -> tuple[Shape, np.ndarray]:
    """Icing on a doughnut that has run down its sides; and for every face whether it lies on top, and not on the rim."""
    rng = np.random.default_rng(seed)
    rows, columns = 420, 72
    turn = np.arange(rows) * 2.0 * np.pi / rows

    def run(low: float, high: float) -> np.ndarray:
        wave = sum(np.sin(k * turn + rng.uniform(0.0, 6.3)) / k**0.5 for k in (5, 8, 11, 14))
        return low + (high - low) * (0.5 + 0.5 * np.tanh(1.1 * wave))

    outer, inner = run(-0.42, 0.3), np.pi - run(-0.1, 0.42)
    share = np.linspace(0.0, 1.0, columns)
    about = (outer[:, None] + (inner - outer)[:, None] * share).ravel()
    around = np.repeat(turn, columns)
    edge = np.abs(2.0 * np.tile(share, rows) - 1.0)
    thick = depth * np.sqrt(np.maximum(1.0 - edge**9, 0.0)) - np.where(edge > 0.999, 0.7 * depth, 0.0)
    vertex = _on_ring(around, about, radius, thickness + thick)
    face = grid_faces(rows, columns, round_rows=True)[:, ::-1]
    return (vertex, face), edge[face].max(axis=1) < 0.86


def _angles(rows: int, columns: int) -> tuple[np.ndarray, np.ndarray]:
    around = np.repeat(np.arange(rows) * 2.0 * np.pi / rows, columns)
    return around, np.tile(np.arange(columns) * 2.0 * np.pi / columns, rows)


def _on_ring(around: np.ndarray, about: np.ndarray, radius: float, thickness: np.ndarray | float) -> np.ndarray:
    reach = radius + thickness * np.cos(about)
    return np.stack([reach * np.cos(around), reach * np.sin(around), 0.86 * thickness * np.sin(about)], axis=1)


def sprinkle(length: float, radius: float) -> Shape:
    """A sprinkle that lies along x, sunk in a little."""
    bend = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 12)
    along = np.where(bend < 0, -1.0, 1.0) * (0.5 * length - radius) + radius * np.sin(bend)
    profile = np.stack([radius * np.cos(bend), along], axis=1)
    vertex, face = lathe(profile, 18)
    return vertex[:, [2, 0, 1]] + (0.0, 0.0, 0.55 * radius), face


def pearl(radius: float) -> Shape:
    """A pearl of sugar."""
    vertex, face = ball(3)
    return radius * (vertex + (0.0, 0.0, 0.6)), face


def hull(length: float, beam: float, draft: float, board: float) -> tuple[Shape, np.ndarray]:
    """The hull of a boat, bow towards x, water line at z = 0; and for every face whether it is below the water.

    Args:
        length: From end to end [m].
        beam: Width.
        draft: Depth below the water.
        board: Height above it.
    """
    rows, columns = 220, 201
    along = np.linspace(-1.0, 1.0, rows)[:, None]
    girth = np.linspace(-1.0, 1.0, columns)
    fore = np.maximum((along + 0.2) / 1.2, 0.0)
    aft = np.minimum(along + 0.2, 0.0)
    width = 0.5 * beam * np.maximum(1.0 - fore**2.3, 0.0) ** 0.75 * (1.0 - 0.2 * aft**2)
    width = np.maximum(width, 0.012)
    keel = -draft * (1.0 - 0.75 * np.maximum(along, 0.0) ** 3 - 0.45 * np.maximum(-along, 0.0) ** 2)
    rail = board * (1.0 + 0.55 * np.maximum(along, 0.0) ** 2 + 0.12 * along**2)
    # A row of points runs along the edge of the paint.
    share = np.abs(girth)
    below = np.minimum(share / PAINTED, 1.0)
    height = keel + (EDGE - keel) * below + (rail - EDGE) * np.maximum(share - PAINTED, 0.0) / (1.0 - PAINTED)
    up = (height - keel) / (rail - keel)
    flare = np.sin(0.5 * np.pi * up ** (0.8 / 1.35)) ** 0.9
    across = np.sign(girth) * width * flare
    stem = 0.5 * length * along + 0.1 * length * np.maximum(along, 0.0) ** 4 * up
    vertex = np.stack([np.broadcast_to(stem, across.shape), across, height], axis=-1).reshape(-1, 3)
    # Faces look outward, which is down at the keel.
    face = grid_faces(rows, columns)
    return (vertex, face), vertex[face][..., 2].mean(axis=1) < EDGE


def barnacle(radius: float, seed: int) -> Shape:
    """A barnacle: six plates around an opening."""
    rng = np.random.default_rng(seed)
    sides = 48
    angle = np.arange(sides) * 2.0 * np.pi / sides
    plates = np.abs(np.sin(3.0 * angle + rng.uniform(0.0, 3.0)))
    ribs = 0.03 * np.sin(24.0 * angle)
    profile = [
        (1.02, -0.12, 1.0),
        (0.97, 0.05, 1.0),
        (0.78, 0.42, 0.9),
        (0.55, 0.72, 0.7),
        (0.42, 0.8, 0.5),
        (0.34, 0.72, 0.3),
        (0.2, 0.3, 0.1),
        (0.0, 0.24, 0.0),
    ]
    lean = rng.normal(0.0, 0.07, 2)
    rows = []
    for reach, height, amount in profile:
        r = radius * reach * (1.0 + amount * (ribs - 0.13 * (1.0 - plates) ** 3))
        top = radius * (height + 0.09 * (height > 0.6) * plates)
        x, y = r * np.cos(angle) + lean[0] * top, r * np.sin(angle) + lean[1] * top
        rows.append(np.stack([x, y, np.broadcast_to(top, x.shape)], axis=1))
    return np.concatenate(rows), grid_faces(len(profile), sides, round_columns=True)


def mussel(length: float, seed: int) -> Shape:
    """A mussel that stands on its tip, leaning."""
    rng = np.random.default_rng(seed)
    vertex, face = ball(4)
    taper = 0.55 + 0.45 * np.sin(0.5 * np.pi * np.clip(0.5 + 0.5 * vertex[:, 2], 0.0, 1.0))
    shell = vertex * (0.27, 0.17, 0.5) * np.stack([taper, taper, np.ones_like(taper)], axis=1)
    shell[:, 0] += 0.12 * vertex[:, 2] ** 2
    lean = rng.uniform(0.5, 0.9)
    c, s = np.cos(lean), np.sin(lean)
    turned = np.stack([c * shell[:, 0] + s * shell[:, 2], shell[:, 1], c * shell[:, 2] - s * shell[:, 0]], axis=1)
    return length * (turned + (0.0, 0.0, 0.3)), face


def link(name: str, shape: Shape, holder: bpy.types.Collection, smooth: bool = True) -> bpy.types.Object:
    """Make an object of a shape, in a collection."""
    from scene_parts import mesh_object

    item = mesh_object(name, *shape, smooth=smooth)
    holder.objects.link(item)
    return item
