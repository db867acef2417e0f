"""A scatter to look at: hills, and a mixed forest of simple shapes on them."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from .preset_files import BUILT_IN, read_preset
from .presets import add_scatter_of_preset

__all__ = ["add_example", "remove_example"]

# Of the ground [m], and its faces along each side.
SIDE, FACES = 40.0, 64
# Hills: how high they are [m], and how many there are along x and y.
HILLS = ((1.6, 0.8, 0.6), (0.7, 1.7, -1.3), (0.3, 2.9, 3.4))
COLOR = (0.16, 0.15, 0.07)
PRESET = "mixed_forest.json"


def add_example(context: bpy.types.Context) -> Any:
    """Add the ground, which becomes the active object, and return the scatter on it.

    Raises:
        EshError: The preset cannot be read.
    """
    preset = read_preset(BUILT_IN / PRESET)
    ground = bpy.data.objects.new("Example Ground", _hills())
    context.collection.objects.link(ground)
    for item in context.selected_objects:
        item.select_set(False)
    ground.select_set(True)
    context.view_layer.objects.active = ground
    return add_scatter_of_preset(context.scene.esh_scatter, preset, ground).scatter


def remove_example(scatter: Any) -> None:
    """Take away the ground and the settings that :func:`add_example` has added last."""
    settings = scatter.id_data.esh_scatter
    mesh = scatter.target.data
    bpy.data.objects.remove(scatter.target)
    bpy.data.meshes.remove(mesh)
    settings.scatters.remove(len(settings.scatters) - 1)
    settings.scatter_index = max(0, len(settings.scatters) - 1)


def _hills() -> bpy.types.Mesh:
    x, y = np.meshgrid(*[np.linspace(-0.5, 0.5, FACES + 1)] * 2)
    z = sum(height * np.sin(2.0 * np.pi * (along * x + across * y) + along) for height, along, across in HILLS)
    mesh = bpy.data.meshes.new("Example Ground")
    corner = np.arange((FACES + 1) ** 2).reshape(FACES + 1, FACES + 1)
    faces = np.stack([corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]], axis=-1).reshape(-1, 4)
    mesh.from_pydata(np.stack([SIDE * x, SIDE * y, z], axis=-1).reshape(-1, 3).tolist(), [], faces.tolist())
    mesh.shade_smooth()
    material = bpy.data.materials.new("Example Ground")
    material.diffuse_color = (*COLOR, 1.0)
    mesh.materials.append(material)
    return mesh
