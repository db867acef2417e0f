"""Simple shapes that stand in for objects that nobody has chosen yet; they are in no scene, and only their instances show."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import bpy
import numpy as np

__all__ = ["colored_material", "stand_in"]

# Sides of what is round.
SIDES = 16
# Shapes as profiles that are turned about z: radius (1 is the whole) and height (0 to 1).
_PROFILES: dict[str, list[tuple[float, float]]] = {
    "cone": [(0.15, 0.0), (0.15, 0.15), (1.0, 0.15), (0.62, 0.5), (0.72, 0.5), (0.0, 1.0)],
    "disc": [(1.0, 0.0), (1.0, 1.0), (0.0, 1.0)],
    "dome": [(1.0, 0.0), (0.92, 0.4), (0.7, 0.72), (0.38, 0.93), (0.0, 1.0)],
    "ball": [(0.0, 0.0), (0.38, 0.04), (0.71, 0.15), (0.92, 0.31), (1.0, 0.5), (0.92, 0.69), (0.71, 0.85), (0.38, 0.96), (0.0, 1.0)],
    "person": [(0.55, 0.0), (1.0, 0.55), (0.9, 0.8), (0.3, 0.83), (0.42, 0.9), (0.3, 0.98), (0.0, 1.0)],
}  # fmt: skip


def stand_in(
    name: str, shape: str, proportions: Sequence[float], area: float, color: Sequence[float]
) -> bpy.types.Object:
    """Return an object of a simple shape.

    Args:
        name: Of the object.
        shape: One of :data:`~esh.esh_scatter.editing.preset_files.SHAPES`.
        proportions: Length, width and height, as they are to each other.
        area: Ground that it takes [m²].
        color: Of its material.
    """
    length, width, height = (float(one) for one in proportions)
    round_one = shape in _PROFILES
    covered = length * width * (0.5 * SIDES * math.sin(2.0 * math.pi / SIDES) / 4.0 if round_one else 1.0)
    factor = math.sqrt(area / covered)
    vertices, faces = _turned(_PROFILES[shape]) if round_one else _box()
    # From 1 by 1 by 1, on the ground.
    position = np.array(vertices) * np.array([length, width, height]) * factor
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(position.tolist(), [], faces)
    mesh.materials.append(colored_material(name, color, 0.8))
    if shape in ("ball", "dome"):
        mesh.shade_smooth()
    return bpy.data.objects.new(name, mesh)


def _turned(profile: list[tuple[float, float]]) -> tuple[list[tuple[float, float, float]], list[list[int]]]:
    angle = [2.0 * math.pi * k / SIDES for k in range(SIDES)]
    vertices: list[tuple[float, float, float]] = []
    rings: list[list[int]] = []
    for radius, height in profile:
        spread = angle if radius > 0.0 else angle[:1]
        rings.append(list(range(len(vertices), len(vertices) + len(spread))))
        vertices += [(0.5 * radius * math.cos(a), 0.5 * radius * math.sin(a), height) for a in spread]
    faces: list[list[int]] = []
    for low, high in pairwise(rings):
        for k in range(SIDES):
            corner = [low[k % len(low)], low[(k + 1) % len(low)], high[(k + 1) % len(high)], high[k % len(high)]]
            faces.append(list(dict.fromkeys(corner)))
    if len(rings[0]) > 1:
        faces.append(rings[0][::-1])
    return vertices, faces


def _box() -> tuple[list[tuple[float, float, float]], list[list[int]]]:
    vertices = [(x, y, z) for z in (0.0, 1.0) for x, y in ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))]
    return vertices, [[3, 2, 1, 0], [4, 5, 6, 7], *([k, (k + 1) % 4, 4 + (k + 1) % 4, 4 + k] for k in range(4))]


def colored_material(name: str, color: Sequence[float], roughness: float | None = None) -> bpy.types.Material:
    """Return a new material of a color, also as the viewport shows it; of Blender's roughness, unless another one is given."""
    material = bpy.data.materials.new(name)
    material.diffuse_color = (*color, 1.0)
    if material.node_tree is None:
        # From Blender 5.0 on, every material has nodes.
        material.use_nodes = True
    shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    shader.inputs["Base Color"].default_value = (*color, 1.0)
    if roughness is not None:
        shader.inputs["Roughness"].default_value = roughness
    return material
