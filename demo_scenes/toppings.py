"""What lies on a pizza, modeled by code: ham, mushrooms, salami, chillies and anchovies, in many variants.

Every piece lies on the ground z = 0 and is a little sunk into it, as into molten cheese; meters. A piece that is not long
has the middle of its outline's enclosing circle at the origin. Points carry numbers 0..1 by name, which materials turn
into colors.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

__all__ = ["Piece", "anchovy", "chilli", "enclosing_circle", "ham", "mushroom", "perlin", "salami"]

_GRADIENTS = np.array(
    [(1, 1, 0), (-1, 1, 0), (1, -1, 0), (-1, -1, 0), (1, 0, 1), (-1, 0, 1), (1, 0, -1), (-1, 0, -1), (0, 1, 1),
     (0, -1, 1), (0, 1, -1), (0, -1, -1)],
    float,
)  # fmt: skip


@dataclass(frozen=True)
class Piece:
    """A mesh as arrays.

    Attributes:
        vertex: Shape ``[n, 3]`` [m].
        face: Quadrilaterals, shape ``[m, 4]``, or triangles, shape ``[m, 3]``.
        values: Numbers 0..1 at every vertex, shape ``[n]``, by name.
        material: Index of the material of every face, shape ``[m]``; None is all 0.
    """

    vertex: np.ndarray
    face: np.ndarray
    values: dict[str, np.ndarray] = field(default_factory=dict)
    material: np.ndarray | None = None


def perlin(place: np.ndarray, seed: int, octaves: int = 1) -> np.ndarray:
    """Gradient noise, about -1..1, of wavelength 1 (each further octave half of it and half as strong).

    Args:
        place: Shape ``[..., 2]`` or ``[..., 3]``.
        seed: Another seed, another noise.
        octaves: How many wavelengths are added.

    Returns:
        Shape ``[...]``.
    """
    if place.shape[-1] == 2:
        place = np.concatenate([place, np.full((*place.shape[:-1], 1), 0.37)], axis=-1)
    shuffled = np.tile(np.random.default_rng(seed).permutation(256), 3)
    total, strength = np.zeros(place.shape[:-1]), 1.0
    for octave in range(octaves):
        # One array for each axis: sums and products over a last axis of three take several times as long.
        point = [np.ascontiguousarray(place[..., axis]) * 2.0**octave + 17.3 * octave for axis in range(3)]
        cell = [np.floor(along).astype(int) for along in point]
        part = [along - whole for along, whole in zip(point, cell, strict=True)]
        weight = [along**3 * (along * (along * 6.0 - 15.0) + 10.0) for along in part]
        shares = [(1.0 - along, along) for along in weight]
        for corner in np.ndindex(2, 2, 2):
            i, j, k = ((whole & 255) + offset for whole, offset in zip(cell, corner, strict=True))
            gradient = _GRADIENTS[shuffled[shuffled[shuffled[i] + j] + k] % 12]
            share = shares[0][corner[0]] * shares[1][corner[1]] * shares[2][corner[2]]
            slope = sum(gradient[..., axis] * (part[axis] - corner[axis]) for axis in range(3))
            total = total + strength * share * slope
        strength *= 0.5
    return total


def enclosing_circle(point: np.ndarray) -> tuple[np.ndarray, float]:
    """Middle, shape ``[2]``, and radius of a circle around points ``[n, 2]``, at most 0.1 % larger than the smallest."""
    # Only the outermost points of many directions can lie on it.
    turn = np.arange(720) * 2 * np.pi / 720
    directions = np.stack([np.cos(turn), np.sin(turn)])
    point = _beyond(point, point[np.argmax(point @ directions[:, ::30], axis=0)])
    point = point[np.unique(np.argmax(point @ directions, axis=0))]
    middle = point.mean(axis=0)
    # Bădoiu and Clarkson: walk towards the farthest point in ever smaller steps.
    x, y = (np.ascontiguousarray(axis) for axis in point.T)
    at_x, at_y = middle.tolist()
    for number in range(1, 2000):
        away_x, away_y = x - at_x, y - at_y
        far = int((away_x * away_x + away_y * away_y).argmax())
        step = 1.0 / (number + 1)
        at_x += step * (float(x[far]) - at_x)
        at_y += step * (float(y[far]) - at_y)
    middle = np.array([at_x, at_y])
    return middle, float(np.sqrt(((point - middle) ** 2).sum(axis=1).max()))


def _beyond(point: np.ndarray, corner: np.ndarray) -> np.ndarray:
    """Those of points ``[n, 2]`` that are not inside of a convex polygon, whose corners ``[k, 2]`` are some of them."""
    beyond = np.zeros(len(point), bool)
    for a, b in zip(corner, np.roll(corner, -1, axis=0), strict=True):
        if (a != b).any():
            beyond |= (b[0] - a[0]) * (point[:, 1] - a[1]) - (b[1] - a[1]) * (point[:, 0] - a[0]) <= 0.0
    return point[beyond]


def _centered(piece: Piece) -> Piece:
    middle, _ = enclosing_circle(piece.vertex[:, :2])
    return replace(piece, vertex=piece.vertex - np.append(middle, 0.0))


def _slab(top: np.ndarray, thickness: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A closed sheet below ``top``, shape ``[rings, sides, 3]``, whose ring 0 is its middle and whose last ring its edge.

    Returns:
        Vertices ``[2 rings sides, 3]``, those of the top first, and faces ``[m, 4]``; ``thickness`` ``[rings, sides]``.
    """
    rings, sides = top.shape[:2]
    bottom = top - thickness[..., None] * np.array([0.0, 0.0, 1.0])
    vertex = np.concatenate([top.reshape(-1, 3), bottom.reshape(-1, 3)])
    ring, side = (index.ravel() for index in np.meshgrid(np.arange(rings - 1), np.arange(sides), indexing="ij"))
    a, b = ring * sides + side, ring * sides + (side + 1) % sides
    up = np.stack([a, a + sides, b + sides, b], axis=1)
    down = up[:, ::-1] + rings * sides
    rim = (rings - 1) * sides + np.arange(sides)
    after = (rings - 1) * sides + (np.arange(sides) + 1) % sides
    edge = np.stack([rim, rim + rings * sides, after + rings * sides, after], axis=1)
    return vertex, np.concatenate([up, down, edge])


def _round_edge(share: np.ndarray, edge: float) -> np.ndarray:
    """Height 1 of a slab's top that rounds down to 0 over the outermost ``edge`` of its radius 0..1."""
    outer = np.clip((share - (1.0 - edge)) / edge, 0.0, 1.0)
    return np.sqrt(np.maximum(1.0 - outer**2, 0.0))


def _fan(outline: np.ndarray, rings: int) -> tuple[np.ndarray, np.ndarray]:
    """Points ``[rings, sides, 2]`` that fill an outline ``[sides, 2]`` seen from the origin, and their radius 0..1."""
    # Denser towards the edge, where the shape turns down; ring 0 is small, and not a point, so that no face is empty.
    share = np.linspace(0.0, 1.0, rings) ** 0.75
    share[0] = 0.002
    return share[:, None, None] * outline, np.broadcast_to(share[:, None], (rings, len(outline)))


def salami(radius: float, seed: int) -> Piece:
    """Model a slice of salami: a disc, cupped by the heat, with a darker rim (value ``rim``)."""
    rng = np.random.default_rng(seed)
    angle = np.arange(96) * 2 * np.pi / 96
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    outline = (
        radius * (1.0 + 0.035 * perlin(1.3 * circle, seed) + 0.012 * perlin(5.0 * circle, seed + 1))[:, None] * circle
    )
    point, share = _fan(outline, 26)
    thickness = 0.0020 * _round_edge(share, 0.09)
    # The edge lifts, not everywhere alike; the middle bulges a little.
    lift = 0.5 + 0.5 * perlin(0.9 * circle + rng.uniform(0, 50, 2), seed + 2) * 1.6
    height = radius * 0.085 * share**3 * np.clip(lift, 0.1, 1.2)
    height = height + 0.0005 * perlin(point / 0.006, seed + 3) * (1.0 - share**4)
    top = np.dstack([point, 0.0014 + height + thickness - 0.0020])
    vertex, face = _slab(top, thickness + 0.0004)
    rim = np.clip((share - 0.9) / 0.08, 0.0, 1.0).ravel()
    return _centered(Piece(vertex, face, {"rim": np.tile(rim, 2)}))


def ham(radius: float, seed: int) -> Piece:
    """Model a torn slice of cooked ham, thin and rumpled, pushed together into folds (values ``edge`` and ``fold``).

    Args:
        radius: Of the circle around it [m].
        seed: Another seed, another slice.
    """
    rng = np.random.default_rng(seed)
    angle = np.arange(160) * 2 * np.pi / 160
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    # Between a circle and a square, torn.
    square = (np.abs(circle) ** 2.7).sum(axis=1) ** (-1.0 / 2.7)
    outline = circle * square[:, None] * [1.0, rng.uniform(0.78, 0.95)]
    torn = (
        0.13 * perlin(1.1 * circle, seed)
        + 0.07 * perlin(3.0 * circle, seed + 1)
        + 0.035 * perlin(9.0 * circle, seed + 2)
    )
    outline = outline * (1.0 + torn)[:, None]
    point, share = _fan(outline, 56)
    turn = rng.uniform(0, np.pi)
    height = np.zeros(share.shape)
    shift = np.zeros(point.shape)
    fold = np.zeros(share.shape)
    # Folds cross the slice side by side, each with a course, a steepness and an end of its own.
    for number, middle in enumerate(rng.uniform(-0.12, 0.12) + np.array([-0.52, 0.0, 0.5])):
        course = turn + rng.normal(0.0, 0.35)
        normal, along = np.array([np.cos(course), np.sin(course)]), np.array([-np.sin(course), np.cos(course)])
        across = (
            point @ normal - middle - 0.20 * perlin(np.stack([1.2 * point @ along, 0 * share], -1), seed + 10 + number)
        )
        steep = rng.uniform(0.10, 0.19)
        high = rng.uniform(0.10, 0.22) * np.clip(0.6 + rng.uniform(-0.7, 0.7) * (point @ along), 0.0, 1.0)
        ridge = np.exp(-((across / steep) ** 2))
        # It leans over to one side.
        height += high * ridge
        shift -= (0.45 * high * np.tanh(across / steep) - 0.5 * high * ridge)[..., None] * normal
        fold = np.maximum(fold, ridge * high / 0.22)
    height += 0.07 * np.maximum(perlin(1.6 * point, seed + 4, 2) + 0.1, 0.0) * (0.3 + share**2)
    point = point + shift
    _, reach = enclosing_circle(point[-1])
    scale = radius / reach
    thickness = 0.0012 * _round_edge(share, 0.03)
    top = np.dstack([point * scale, height * scale + 0.0006 + thickness])
    vertex, face = _slab(top, thickness + 0.0003)
    values = {"edge": np.tile(np.clip((share - 0.82) / 0.18, 0, 1).ravel(), 2), "fold": np.tile(fold.ravel(), 2)}
    return _centered(Piece(vertex, face, values))


# Right half of a champignon's outline, from the top of the cap to the middle of the stem's end; width of the cap 2.
_CHAMPIGNON = np.array(
    [(0.0, 0.78), (0.30, 0.75), (0.58, 0.62), (0.82, 0.38), (0.97, 0.08), (1.0, -0.12), (0.93, -0.26), (0.80, -0.27),
     (0.66, -0.16), (0.48, -0.08), (0.33, -0.10), (0.27, -0.24), (0.25, -0.46), (0.28, -0.68), (0.30, -0.80),
     (0.22, -0.87), (0.0, -0.89)]
)  # fmt: skip


def _smooth_closed(corner: np.ndarray, count: int) -> np.ndarray:
    """A closed smooth curve near ``corner``, shape ``[k, 2]``, as ``count`` points at equal distances."""
    k = len(corner)
    t = np.arange(40 * k) / 40
    i, u = np.floor(t).astype(int), (t % 1.0)[:, None]
    a, b, c, d = (corner[(i + offset) % k] for offset in (-1, 0, 1, 2))
    # Catmull-Rom.
    curve = 0.5 * (2 * b + (c - a) * u + (2 * a - 5 * b + 4 * c - d) * u**2 + (3 * b - a - 3 * c + d) * u**3)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(np.vstack([curve, curve[:1]]), axis=0), axis=1))])
    at = np.linspace(0.0, length[-1], count, endpoint=False)
    closed = np.vstack([curve, curve[:1]])
    return np.stack([np.interp(at, length, closed[:, axis]) for axis in range(2)], axis=1)


def mushroom(radius: float, seed: int) -> Piece:
    """Model a slice of a champignon seen from the side: cap, gills and stem (values ``skin``, ``gills``, ``stem``).

    Args:
        radius: Of the circle around it [m].
        seed: Another seed, another slice.
    """
    rng = np.random.default_rng(seed)
    half = _CHAMPIGNON * [rng.uniform(0.92, 1.08), 1.0]
    half[:11, 1] *= rng.uniform(0.9, 1.15)
    half[11:, 0] *= rng.uniform(0.85, 1.2)
    half[12:, 1] -= rng.uniform(-0.06, 0.14)
    corner = np.concatenate([half, half[-2:0:-1] * [-1.0, 1.0]])
    corner = corner + rng.normal(0.0, 0.012, corner.shape)
    # The stem leans.
    corner[:, 0] += np.minimum(corner[:, 1], 0.0) * rng.uniform(-0.22, 0.22)
    outline = _smooth_closed(corner[::-1], 160)
    point, share = _fan(outline - [0.0, 0.06], 30)
    point = point + [0.0, 0.06]
    x, y = point[..., 0], point[..., 1]
    _, reach = enclosing_circle(point[-1])
    scale = radius / reach
    # Gills: a dark band above the cap's lower edge, on both sides of the stem.
    side = np.abs(x - np.minimum(y, 0.0) * 0.1)
    ceiling = 0.07 + 0.05 * np.clip(side - 0.35, 0, 1) - 0.34 * np.clip(side - 0.55, 0, 1) ** 1.5
    gills = np.clip((side - 0.30) / 0.05, 0, 1) * np.clip((ceiling - y) / 0.05, 0, 1) * (y > -0.33)
    skin = np.clip((share - 0.93) / 0.05, 0.0, 1.0) * (y > -0.1)
    stem = np.clip((-0.2 - y) / 0.1, 0, 1) * (side < 0.42)
    thickness = 0.0024 * _round_edge(share, 0.10) - 0.0004 * gills
    bend = 0.0012 * (perlin(0.7 * point + rng.uniform(0, 9, 2), seed + 7) + 0.5 * (x / 1.0) ** 2)
    top = np.dstack([point * scale, 0.0024 + bend + thickness - 0.0024])
    vertex, face = _slab(top, np.maximum(thickness, 0.0) + 0.0006)
    values = {"skin": skin, "gills": gills, "stem": stem, "edge": np.clip((share - 0.75) / 0.25, 0, 1)}
    return _centered(Piece(vertex, face, {name: np.tile(value.ravel(), 2) for name, value in values.items()}))


def _tube(path: np.ndarray, radius: np.ndarray, sides: int, flat: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """A closed tube along ``path`` ``[k, 3]`` with ``radius`` ``[k]``, ``flat`` times as high as wide."""
    turn = np.arange(sides) * 2 * np.pi / sides
    along = np.gradient(path, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    aside = np.cross([0.0, 0.0, 1.0], along)
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    other = np.cross(along, aside)
    ring = aside[:, None] * np.cos(turn)[:, None] + flat * other[:, None] * np.sin(turn)[:, None]
    vertex = (path[:, None] + radius[:, None, None] * ring).reshape(-1, 3)
    k, s = (index.ravel() for index in np.meshgrid(np.arange(len(path) - 1), np.arange(sides), indexing="ij"))
    a, b = k * sides + s, k * sides + (s + 1) % sides
    return vertex, np.stack([a, b, b + sides, a + sides], axis=1)


def chilli(length: float, seed: int) -> Piece:
    """Model a curved, tapering chilli (material 0) with its green calyx and stem (material 1).

    Args:
        length: From the stem's end to the tip, about [m].
        seed: Another seed, another chilli.
    """
    rng = np.random.default_rng(seed)
    bend = rng.choice([-1, 1]) * rng.uniform(0.35, 0.7)
    wide = 0.075 * length * rng.uniform(0.9, 1.15)

    def place(t: np.ndarray, height: np.ndarray) -> np.ndarray:
        # An arc of a circle, tightening towards the tip.
        turn = bend * (t - 0.5) + 0.25 * bend * (t - 0.5) ** 2
        step = np.stack([np.cos(turn), np.sin(turn)], axis=1) * np.gradient(t)[:, None] * length
        return np.column_stack([np.cumsum(step, axis=0), height])

    t = np.linspace(0.0, 1.0, 110)
    pod = (t - 0.24) / 0.76
    inside = np.clip(pod, 0.0, 1.0)
    body = (
        wide
        * np.sqrt(np.clip(inside / 0.06, 0, 1))
        * (1.0 - inside**1.7) ** 0.8
        * (1.0 + 0.10 * np.sin(9 * inside + seed))
    )
    body = body * (1.0 + 0.07 * perlin(np.stack([inside * 7, 0 * t], -1), seed)) + 0.0003
    path = place(t, 0.55 * wide + 0.25 * wide * (0.5 - t))
    first = int(np.argmax(pod > 0.0))
    vertex, face = _tube(path[first:], body[first:], 20, 0.9)
    # Stem: thin, thickening into a calyx that grips the shoulder of the pod.
    stem_radius = np.interp(
        t, [0.0, 0.03, 0.15, 0.20, 0.235, 0.265, 0.29], np.array([0.34, 0.30, 0.24, 0.34, 0.8, 1.02, 0.9]) * wide
    )
    last = int(np.argmax(t > 0.285))
    rise = path.copy()
    rise[:, 2] += wide * 0.9 * np.clip((0.2 - t) / 0.2, 0, 1) ** 1.5
    stem_vertex, stem_face = _tube(rise[:last], stem_radius[:last], 20, 0.9)
    material = np.concatenate([np.zeros(len(face), int), np.ones(len(stem_face), int)])
    count = len(vertex)
    vertex, face = np.concatenate([vertex, stem_vertex]), np.concatenate([face, stem_face + count])
    values = {"along": np.concatenate([np.repeat(inside[first:], 20), np.repeat(t[:last], 20)])}
    return _centered(Piece(vertex, face, values, material))


def anchovy(length: float, seed: int) -> Piece:
    """Model an anchovy fillet: slim, flat, wavy, blunt in front (values ``across`` and ``along``, 0..1)."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 1.0, 110)
    wide = 0.108 * length * rng.uniform(0.92, 1.08)
    blunt = np.sqrt(np.clip(1.0 - (1.0 - np.clip(t / 0.12, 0, 1)) ** 2, 0.0, 1.0))
    outline = wide * blunt * (1.0 - 0.80 * t**1.9) * np.clip((1.0 - t) / 0.05, 0.12, 1.0) ** 0.5 + 0.0002
    outline = outline * (1.0 + 0.12 * perlin(np.stack([t * 5, 0 * t], -1), seed))
    sway = 0.05 * length * np.sin(2.0 * np.pi * t * rng.uniform(0.6, 1.0) + rng.uniform(0, 6))
    path = np.column_stack([(t - 0.5) * length, sway, 0.0015 + 0.0007 * np.sin(3 * np.pi * t + rng.uniform(0, 6))])
    sides = 40
    vertex, face = _tube(path, outline, sides, 0.22)
    turn = np.tile(np.arange(sides) * 2 * np.pi / sides, len(t))
    across, upper = np.cos(turn), np.sin(turn) > 0
    # The line along its middle, and flakes of flesh that run aslant from it.
    furrow = np.exp(-((across / 0.13) ** 2)) * upper
    slant = np.repeat(t, sides) * length / 0.0034 - 0.9 * np.abs(across)
    flake = np.abs((slant + 0.3 * perlin(np.stack([slant * 0.4, across * 2], -1), seed + 2)) % 1.0 - 0.5)
    local = np.repeat(outline, sides) * upper
    vertex[:, 2] += local * (-0.10 * furrow + 0.13 * flake * (1.0 - across**2))
    return _centered(Piece(vertex, face, {"across": 0.5 + 0.5 * across, "along": np.repeat(t, sides)}))
