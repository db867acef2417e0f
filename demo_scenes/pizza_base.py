"""The pizza below its toppings, modeled by code: dough with a puffed rim, and a bed of sauce and molten cheese.

Centered on the origin, z up, meters. Points carry numbers 0..1 by name, which materials turn into colors.
"""

from __future__ import annotations

import numpy as np
from toppings import Piece, perlin

__all__ = ["BED_RADIUS", "RADIUS", "bed", "board", "dough"]

# Of the whole pizza, and of the flat part inside its rim [m].
RADIUS = 0.16
BED_RADIUS = 0.134
# Height of the dough below the sauce, and of the rim's top [m].
FLOOR = 0.008
RIM = 0.0195


def _spots(place: np.ndarray, count: int, size: tuple[float, float], area: np.ndarray, seed: int) -> np.ndarray:
    """Round bumps 0..1 at random places: ``place`` ``[n, 3]``, centers drawn from ``area`` ``[k, 3]``, radii [m]."""
    rng = np.random.default_rng(seed)
    bump = np.zeros(len(place))
    # Sorted along x, so that only a strip of the places is looked at for each.
    order = np.argsort(place[:, 0], kind="stable")
    along = place[order, 0]
    for center in area[rng.integers(len(area), size=count)]:
        radius = size[0] + (size[1] - size[0]) * rng.random() ** 2.5
        strip = order[slice(*np.searchsorted(along, [center[0] - 1.01 * radius, center[0] + 1.01 * radius]))]
        near = strip[np.abs(place[strip] - center).max(axis=1) < radius]
        distance = np.linalg.norm(place[near] - center, axis=1) / radius
        bump[near] = np.maximum(bump[near], rng.uniform(0.6, 1.0) * np.sqrt(np.clip(1.0 - distance**2, 0.0, 1.0)))
    return bump


def dough(seed: int) -> Piece:
    """Model the dough (values ``brown``, how far it is baked, and ``flour``)."""
    sides = 560
    angle = np.arange(sides) * 2 * np.pi / sides
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    # Cross-section: below, around the rim, down to the bed; r and z for a rim of width 1 and height 1.
    rim = np.linspace(-0.5 * np.pi, np.pi, 74)
    across, up = np.cos(rim), 0.5 + 0.5 * np.sin(rim)
    inner = rim > 0.5 * np.pi
    across = np.where(inner, 1.45 * across, across)
    up = np.where(inner, up**0.9, up)
    width = 0.0112 * (1.0 + 0.16 * perlin(1.6 * circle, seed) + 0.10 * perlin(4.5 * circle, seed + 1))
    height = RIM * (1.0 + 0.20 * perlin(2.1 * circle + 9.0, seed + 2) + 0.10 * perlin(6.0 * circle, seed + 3))
    outer = RADIUS - 0.0015 + 0.0025 * perlin(1.2 * circle, seed + 4)
    r = (outer - width)[None] + width[None] * across[:, None]
    z = height[None] * up[:, None]
    # Under the sauce the inner side runs out flat.
    z = np.where(inner[:, None], FLOOR + (z - FLOOR) * (up[:, None] > 0), z)
    z = np.where(inner[:, None], np.maximum(z, FLOOR - 0.002), z)
    floor_r = np.array([0.85, 0.4, 0.02])[:, None] * r[-1]
    r = np.concatenate([np.array([0.02, 0.5])[:, None] * r[:1], r, floor_r])
    z = np.concatenate([np.zeros((2, sides)), z, np.full((3, sides), FLOOR - 0.002)])
    vertex = np.dstack([r * circle[:, 0], r * circle[:, 1], z]).reshape(-1, 3)
    rows = len(r)
    row, side = (index.ravel() for index in np.meshgrid(np.arange(rows - 1), np.arange(sides), indexing="ij"))
    a, b = row * sides + side, row * sides + (side + 1) % sides
    face = np.stack([a, b, b + sides, a + sides], axis=1)
    level = vertex[:, 2] / RIM
    center = np.dstack([(outer - width)[None] * circle[:, 0], (outer - width)[None] * circle[:, 1], 0.5 * height[None]])
    out = vertex - np.broadcast_to(center, (rows, sides, 3)).reshape(-1, 3)
    out /= np.linalg.norm(out, axis=1, keepdims=True) + 1e-9
    upper = np.flatnonzero((level > 0.35) & (np.hypot(vertex[:, 0], vertex[:, 1]) > BED_RADIUS))
    blister = _spots(vertex, 90, (0.003, 0.011), vertex[upper], seed + 5)
    rough = perlin(vertex / 0.012, seed + 6, 3)
    on_rim = np.clip((level - 0.12) / 0.3, 0, 1) * (np.hypot(vertex[:, 0], vertex[:, 1]) > 0.92 * BED_RADIUS)
    vertex = vertex + (on_rim * (0.0026 * blister + 0.0010 * rough))[:, None] * out
    # Baked most at the top, on the blisters, and more on one side of the oven than on the other.
    oven = perlin(vertex / 0.07, seed + 7, 2)
    brown = 0.19 + 0.46 * np.clip(level - 0.25, 0, 1) + 0.42 * blister**2 * on_rim + 0.34 * oven + 0.14 * rough
    char = np.clip(perlin(vertex / 0.016, seed + 8, 2) - 0.28, 0, 1) * 1.9 * on_rim * np.clip(oven + 0.7, 0, 1)
    flour = np.clip(perlin(vertex / 0.02, seed + 9, 3) + 0.25 - 0.5 * np.clip(level, 0, 1), 0, 1)
    return Piece(vertex, face, {"brown": np.clip(brown + char, 0, 1), "flour": flour})


def _concentric(n: int) -> tuple[np.ndarray, np.ndarray]:
    """A unit disc of n × n points, evenly dense (Shirley and Chiu's concentric map), and its faces."""
    side = np.linspace(-1.0, 1.0, n)
    a, b = np.meshgrid(side, side)
    wide = np.abs(a) > np.abs(b)
    r = np.where(wide, a, b)
    with np.errstate(divide="ignore", invalid="ignore"):
        turn = np.where(wide, 0.25 * np.pi * b / a, 0.5 * np.pi - 0.25 * np.pi * a / b)
    turn = np.where(r == 0, 0.0, turn)
    vertex = np.stack([r * np.cos(turn), r * np.sin(turn)], axis=-1).reshape(-1, 2)
    row, column = (index.ravel() for index in np.meshgrid(np.arange(n - 1), np.arange(n - 1), indexing="ij"))
    first = row * n + column
    return vertex, np.stack([first, first + 1, first + n + 1, first + n], axis=1)


def bed(seed: int, points: int = 330) -> Piece:
    """Model sauce and cheese as one surface (values ``cheese``, how thick it lies, and ``toast``, how brown it is)."""
    disc, face = _concentric(points)
    flat = disc * (BED_RADIUS + 0.006)
    r = np.hypot(*flat.T)
    at = np.column_stack([flat, np.zeros(len(flat))])
    wander = np.stack([perlin(flat / 0.03 + 5.0, seed), perlin(flat / 0.03 + 31.0, seed + 1)], axis=-1)
    melted = flat + 0.008 * wander
    # Cheese in pools that have run into one another, thin between them, with an uneven shore before the rim.
    pool = perlin(melted / 0.036, seed + 2) + 0.45 * perlin(melted / 0.016, seed + 3)
    shore = BED_RADIUS - 0.003 + 0.010 * perlin(flat / 0.022, seed + 4, 2)
    reach = np.clip((shore - r) / 0.007, -1.0, 1.0)
    cover = np.clip(0.55 + 1.25 * pool, 0.0, 1.0) * np.clip(0.5 + 0.5 * reach, 0.0, 1.0)
    cheese = cover * cover * (3.0 - 2.0 * cover)
    blister = _spots(at, 330, (0.002, 0.0085), at[r < BED_RADIUS - 0.006], seed + 5) * np.clip(2.0 * cheese - 0.6, 0, 1)
    ripple = perlin(melted / 0.011, seed + 6, 3)
    height = FLOOR + 0.0006 + 0.0013 * cheese + 0.0008 * blister + 0.0004 * ripple * (0.4 + cheese)
    height = height + 0.0003 * perlin(flat / 0.0035, seed + 7, 2) * (1.0 - cheese)
    # It runs up to the rim and dips under it.
    height = height + 0.0030 * np.clip((r - BED_RADIUS + 0.012) / 0.016, 0, 1) ** 2
    toast = blister**1.5 * np.clip(0.55 + 1.1 * perlin(flat / 0.05, seed + 8, 2), 0.0, 1.0)
    # Leopard spots: where the cheese lies thick it is scorched between the blisters too.
    toast = toast + np.clip(perlin(melted / 0.017, seed + 9, 3) - 0.16, 0.0, 1.0) * 1.15 * cheese
    vertex = np.column_stack([flat, height])
    return Piece(vertex, face, {"cheese": cheese, "toast": np.clip(toast, 0, 1)})


def board(radius: float, thickness: float, seed: int) -> Piece:
    """Model a round wooden board with rounded edges, its top at z = 0."""
    sides, corner = 200, 0.006
    angle = np.arange(sides) * 2 * np.pi / sides
    turn = np.linspace(0.5 * np.pi, -0.5 * np.pi, 16)
    r = np.concatenate([[0.001, 0.5 * radius], radius - corner + corner * np.cos(turn), [0.5 * radius, 0.001]])
    z = np.concatenate(
        [[0.0, 0.0], np.where(turn >= 0, -corner, corner - thickness) + corner * np.sin(turn), [-thickness] * 2]
    )
    vertex = np.stack([r[:, None] * np.cos(angle), r[:, None] * np.sin(angle), np.repeat(z[:, None], sides, 1)], -1)
    row, side = (index.ravel() for index in np.meshgrid(np.arange(len(r) - 1), np.arange(sides), indexing="ij"))
    a, b = row * sides + side, row * sides + (side + 1) % sides
    vertex = vertex.reshape(-1, 3)
    vertex[:, :2] *= (1.0 + 0.003 * perlin(vertex / 0.1, seed))[:, None]
    return Piece(vertex, np.stack([a, a + sides, b + sides, b], axis=1))
