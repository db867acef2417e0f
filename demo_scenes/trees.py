"""Trees modeled by code: spruce-like pines and autumn beeches, some shape variants of each.

Every tree stands on the origin, z up, meters. Its trunk goes ``ROOT_DEPTH`` into the ground, so that it leaves no gap
on the downhill side. A face carries ``tint``, a number 0..1 that its material turns into a shade of its color, and
a material index: 0 bark, 1 foliage.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

__all__ = ["ROOT_DEPTH", "TreeMesh", "beech", "boulder", "grass_tuft", "pine"]

ROOT_DEPTH = 1.2
GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))


@dataclass(frozen=True)
class TreeMesh:
    """A mesh as arrays.

    Attributes:
        vertex: Shape ``[n, 3]`` [m].
        face: Triangles, shape ``[m, 3]``.
        tint: Shade of every face, 0..1, shape ``[m]``.
        material: 0 bark, 1 foliage, shape ``[m]``.
        trunk_radius: Radius of the trunk at the ground [m].
    """

    vertex: np.ndarray
    face: np.ndarray
    tint: np.ndarray
    material: np.ndarray
    trunk_radius: float = 0.0


class _Builder:
    """Collects pieces of a mesh."""

    def __init__(self) -> None:
        self.vertex: list[np.ndarray] = []
        self.face: list[np.ndarray] = []
        self.tint: list[np.ndarray] = []
        self.material: list[np.ndarray] = []
        self.count = 0

    def add(self, vertex: np.ndarray, face: np.ndarray, tint: np.ndarray | float, material: int) -> None:
        self.vertex.append(vertex)
        self.face.append(face + self.count)
        self.tint.append(np.broadcast_to(np.asarray(tint, float), (len(face),)))
        self.material.append(np.full(len(face), material))
        self.count += len(vertex)

    def tube(self, path: np.ndarray, radius: np.ndarray, sides: int, tint: float) -> None:
        """A tapering tube along ``path``, shape ``[k, 3]``, with ``radius``, shape ``[k]``."""
        turn = np.arange(sides) * 2 * np.pi / sides
        along = np.gradient(path, axis=0)
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        aside = np.cross(along, np.where(np.abs(along[:, 2:]) > 0.9, [[1.0, 0.0, 0.0]], [[0.0, 0.0, 1.0]]))
        aside /= np.linalg.norm(aside, axis=1, keepdims=True)
        other = np.cross(along, aside)
        ring = aside[:, None] * np.cos(turn)[:, None] + other[:, None] * np.sin(turn)[:, None]
        vertex = (path[:, None] + radius[:, None, None] * ring).reshape(-1, 3)
        k, s = np.meshgrid(np.arange(len(path) - 1), np.arange(sides), indexing="ij")
        a, b = (k * sides + s).ravel(), (k * sides + (s + 1) % sides).ravel()
        face = np.concatenate([np.stack([a, b, b + sides], 1), np.stack([a, b + sides, a + sides], 1)])
        self.add(vertex, face, tint, 0)

    def done(self, trunk_radius: float = 0.0) -> TreeMesh:
        return TreeMesh(
            np.concatenate(self.vertex),
            np.concatenate(self.face),
            np.concatenate(self.tint),
            np.concatenate(self.material),
            trunk_radius,
        )


def pine(height: float, crown_radius: float, whorls: int, seed: int) -> TreeMesh:
    """Model a conifer.

    Args:
        height: From the ground to the tip [m].
        crown_radius: Reach of the lowest branches [m].
        whorls: Number of levels of branches.
        seed: Another seed, another tree.
    """
    rng = np.random.default_rng(seed)
    build = _Builder()
    trunk_radius = 0.016 * height + 0.05
    lean = rng.normal(0.0, 0.008 * height, 2)
    level = np.array([-ROOT_DEPTH, 0.0, 0.06 * height, 0.5 * height, 0.95 * height])
    path = np.column_stack([*(lean[:, None] * np.maximum(level / height, 0.0) ** 2), level])
    build.tube(path, trunk_radius * np.array([1.5, 1.25, 0.95, 0.55, 0.08]), 7, 0.4)
    first = rng.uniform(0.11, 0.15)
    for whorl in range(whorls):
        t = whorl / (whorls - 1)
        base = height * (first + (0.975 - first) * t**0.86)
        # A spire that bulges a little, frayed from level to level.
        reach = crown_radius * (0.9 * (1.0 - t) ** 0.85 + 0.14 * (1.0 - t) ** 0.25 + 0.03) * rng.uniform(0.82, 1.08)
        branches = 6 + round(6 * (1.0 - t))
        start = whorl * GOLDEN_ANGLE
        center = np.append(lean * (base / height) ** 2, base)
        for branch in range(branches):
            angle = start + 2 * np.pi * (branch + rng.uniform(-0.25, 0.25)) / branches
            _pine_branch(build, center, angle, reach * rng.uniform(0.72, 1.05), t, rng)
    top = np.append(lean * 0.97, 0.965 * height)
    spire = np.array([[0.09, 0.0, -0.6], [-0.05, 0.08, -0.6], [-0.05, -0.08, -0.6], [0.0, 0.0, 0.02 * height]])
    build.add(top + spire, np.array([[0, 1, 3], [1, 2, 3], [2, 0, 3]]), 0.75, 1)
    return _fit(build.done(trunk_radius), height, crown_radius)


def _fit(tree: TreeMesh, height: float, crown_radius: float) -> TreeMesh:
    """Stretch ``tree`` so that it is as high and as wide as asked: the footprint is what the sampler keeps free."""
    vertex = tree.vertex.copy()
    wide = crown_radius / np.percentile(np.hypot(vertex[:, 0], vertex[:, 1]), 99.5)
    vertex[:, :2] *= wide
    vertex[:, 2] *= np.where(vertex[:, 2] > 0.0, height / vertex[:, 2].max(), 1.0)
    return replace(tree, vertex=vertex, trunk_radius=wide * tree.trunk_radius)


def _pine_branch(
    build: _Builder, center: np.ndarray, angle: float, reach: float, t: float, rng: np.random.Generator
) -> None:
    """A drooping fan with a ridge along its middle and a ragged outline."""
    out = np.array([np.cos(angle), np.sin(angle), 0.0])
    side = np.array([-out[1], out[0], 0.0])
    up = np.array([0.0, 0.0, 1.0])
    droop = reach * (0.36 - 0.68 * t) + 0.1 * reach * rng.uniform(-1, 1)
    width = reach * rng.uniform(0.26, 0.38)
    along = np.array([0.0, 0.34, 0.6, 0.82, 1.0])
    spread = np.array([0.25, 0.95, 0.72, 0.55, 0.0]) * rng.uniform(0.8, 1.2, 5)
    lift = np.array([0.16, 0.12, 0.04, -0.02, 0.0]) * reach
    middle = center + reach * along[:, None] * out + (lift - droop * along**1.25)[:, None] * up
    # Between two tufts the outline draws back: that is what makes it a branch and not a leaf.
    tuft = middle - 0.1 * reach * out - 0.11 * reach * up
    left = tuft + (spread * width)[:, None] * side
    right = tuft - (spread * width)[:, None] * side
    notch = 0.5 * (middle[:-1] + middle[1:]) - 0.03 * reach * up
    notch_left, notch_right = (notch + sign * 0.35 * (spread[:-1] * width)[:, None] * side for sign in (1, -1))
    vertex = np.concatenate([middle, left, right, notch_left, notch_right])
    face = []
    for i in range(4):
        m, lft, rgt, nl, nr = i, 5 + i, 10 + i, 15 + i, 19 + i
        face += [(m, m + 1, nl), (m, nl, lft), (m + 1, m, nr), (m, rgt, nr)]
        if i < 3:
            face += [(m + 1, lft + 1, nl), (m + 1, nr, rgt + 1)]
    face_index = np.array(face)
    far = np.linalg.norm((vertex[face_index].mean(1) - center)[:, :2], axis=1) / reach
    tint = np.clip(0.15 + 0.6 * far + rng.normal(0.0, 0.08) + rng.normal(0.0, 0.06, len(face)), 0.0, 1.0)
    build.add(vertex, face_index, tint, 1)


def beech(height: float, crown_radius: float, blobs: int, leaves: int, seed: int) -> TreeMesh:
    """Model a broad-leaved tree: a crown of leaf sprays on rounded boughs.

    Args:
        height: From the ground to the top of the crown [m].
        crown_radius: Reach of the crown [m].
        blobs: Number of boughs that the crown is made of.
        leaves: Number of leaf sprays.
        seed: Another seed, another tree.
    """
    rng = np.random.default_rng(seed)
    build = _Builder()
    trunk_radius = 0.018 * height + 0.06
    fork = 0.24 * height
    bend = rng.normal(0.0, 0.012 * height, 2)
    level = np.array([-ROOT_DEPTH, 0.0, 0.05 * height, fork, 0.72 * height])
    path = np.column_stack([*(bend[:, None] * np.maximum(level / height, 0.0)), level])
    build.tube(path, trunk_radius * np.array([1.6, 1.35, 1.0, 0.8, 0.2]), 8, 0.55)
    center, radius = [np.array([*bend, 0.66 * height])], [0.6 * crown_radius]
    for blob in range(blobs - 1):
        t = (blob + 0.5) / (blobs - 1)
        angle = blob * GOLDEN_ANGLE + rng.uniform(-0.4, 0.4)
        # An egg: boughs reach farthest a third of the way up, and close in towards the top.
        level_of = 0.33 + 0.53 * t + rng.uniform(-0.03, 0.03)
        reach = crown_radius * (0.52 + 0.35 * t - 0.72 * t * t) * rng.uniform(0.85, 1.15)
        center.append(np.array([reach * np.cos(angle), reach * np.sin(angle), level_of * height]))
        radius.append(crown_radius * (0.46 - 0.12 * t) * rng.uniform(0.8, 1.15))
    middle, size = np.array(center), np.array(radius)
    for c in middle[1:]:
        knee = np.array([0.35 * c[0], 0.35 * c[1], 0.5 * (fork + c[2])])
        start = np.array([0.0, 0.0, min(fork, 0.8 * c[2])])
        build.tube(np.stack([start, knee, c]), trunk_radius * np.array([0.5, 0.32, 0.1]), 5, 0.5)
    flat = np.array([1.0, 1.0, 0.9])
    for c, r in zip(middle, size, strict=True):
        vertex, face = _sphere(1)
        vertex = c + 0.72 * r * flat * vertex * rng.uniform(0.82, 1.08, (len(vertex), 1))
        build.add(vertex, face, 0.08 + rng.uniform(0.0, 0.08), 1)
    which = rng.choice(len(size), leaves, p=size**2 / (size**2).sum())
    z = 1.0 - 2.0 * rng.random(leaves) ** 1.15
    around = rng.random(leaves) * 2 * np.pi
    ring = np.sqrt(1.0 - z * z)
    normal = np.stack([ring * np.cos(around), ring * np.sin(around), z], 1)
    place = middle[which] + size[which, None] * rng.uniform(0.74, 1.1, (leaves, 1)) * flat * normal
    # Sprays inside another bough are never seen.
    inside = np.linalg.norm((place[:, None] - middle) / flat, axis=2) / size
    inside[np.arange(leaves), which] = 2.0
    seen = inside.min(1) > 0.78
    place, normal, which = place[seen], normal[seen], which[seen]
    _leaf_sprays(build, place, normal, crown_radius, height, which, rng)
    return _fit(build.done(trunk_radius), height, crown_radius)


def _leaf_sprays(
    build: _Builder,
    place: np.ndarray,
    normal: np.ndarray,
    crown_radius: float,
    height: float,
    which: np.ndarray,
    rng: np.random.Generator,
) -> None:
    """Small bent diamonds that lie roughly on the crown's surface, tilted at random."""
    n = len(place)
    facing = normal + rng.normal(0.0, 0.5, (n, 3))
    facing /= np.linalg.norm(facing, axis=1, keepdims=True)
    along = np.cross(facing, rng.normal(size=(n, 3)))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(facing, along)
    half = (0.022 * crown_radius + 0.095) * rng.uniform(0.7, 1.35, (n, 1))
    bend = 0.35 * half * facing
    corner = np.stack([place - half * along, place + 0.62 * half * across + bend,
                       place + half * along, place - 0.62 * half * across + bend], 1)  # fmt: skip
    first = 4 * np.arange(n)[:, None]
    face = np.concatenate([first + [0, 1, 2], first + [0, 2, 3]])
    bough = rng.normal(0.0, 0.09, which.max() + 1)[which]
    tint = 0.34 + 0.34 * (place[:, 2] / height) + 0.1 * normal[:, 2] + bough + rng.normal(0.0, 0.1, n)
    build.add(corner.reshape(-1, 3), face, np.clip(np.tile(tint, 2), 0.0, 1.0), 1)


def _sphere(subdivisions: int) -> tuple[np.ndarray, np.ndarray]:
    """A unit sphere from an icosahedron, vertices and triangles."""
    golden = (1.0 + np.sqrt(5.0)) / 2.0
    vertex = np.array([(-1, golden, 0), (1, golden, 0), (-1, -golden, 0), (1, -golden, 0), (0, -1, golden), (0, 1, golden),
                       (0, -1, -golden), (0, 1, -golden), (golden, 0, -1), (golden, 0, 1), (-golden, 0, -1),
                       (-golden, 0, 1)])  # fmt: skip
    face = np.array([(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2),
                     (10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5), (2, 4, 11),
                     (6, 2, 10), (8, 6, 7), (9, 8, 1)])  # fmt: skip
    for _ in range(subdivisions):
        edge = np.sort(np.concatenate([face[:, [0, 1]], face[:, [1, 2]], face[:, [2, 0]]]), axis=1)
        unique, index = np.unique(edge, axis=0, return_inverse=True)
        ab, bc, ca = index.reshape(3, -1) + len(vertex)
        vertex = np.concatenate([vertex, vertex[unique].mean(1)])
        a, b, c = face.T
        face = np.concatenate([np.stack(t, 1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    return vertex / np.linalg.norm(vertex, axis=1, keepdims=True), face


def boulder(radius: float, seed: int) -> TreeMesh:
    """Model a rock, half sunk into the ground: a sphere cut by random planes."""
    rng = np.random.default_rng(seed)
    vertex, face = _sphere(3)
    for _ in range(14):
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        over = np.maximum(vertex @ direction - rng.uniform(0.6, 0.9), 0.0)
        vertex = vertex - 0.9 * over[:, None] * direction
    vertex = vertex * radius * np.array([1.0, rng.uniform(0.7, 1.0), rng.uniform(0.55, 0.75)])
    build = _Builder()
    build.add(vertex + [0.0, 0.0, 0.12 * radius], face, 0.5 + rng.normal(0.0, 0.05, len(face)), 0)
    return build.done()


def grass_tuft(height: float, blades: int, seed: int) -> TreeMesh:
    """Model a tuft of bent blades."""
    rng = np.random.default_rng(seed)
    angle = rng.random(blades) * 2 * np.pi
    out = np.stack([np.cos(angle), np.sin(angle), np.zeros(blades)], 1)
    side = np.stack([-out[:, 1], out[:, 0], np.zeros(blades)], 1)
    tall = height * rng.uniform(0.5, 1.0, (blades, 1))
    root = out * rng.uniform(0.0, 0.3, (blades, 1)) * height - [0.0, 0.0, 0.1]
    half = 0.022 * height * rng.uniform(0.8, 1.4, (blades, 1))
    lean = rng.uniform(0.1, 0.6, (blades, 1))
    up = np.array([0.0, 0.0, 1.0])
    knee = root + 0.6 * tall * up + 0.3 * lean * tall * out
    tip = root + tall * up + lean * tall * out
    vertex = np.stack(
        [root - half * side, root + half * side, knee - 0.7 * half * side, knee + 0.7 * half * side, tip], 1
    )
    first = 5 * np.arange(blades)[:, None]
    face = np.concatenate([first + [0, 1, 3], first + [0, 3, 2], first + [2, 3, 4]])
    build = _Builder()
    build.add(vertex.reshape(-1, 3), face, np.clip(np.tile(rng.normal(0.5, 0.2, blades), 3), 0, 1), 1)
    return build.done()
