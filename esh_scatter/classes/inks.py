"""Classes from a color image: one per ink, with its channel as density texture and a colored disc to place."""

from __future__ import annotations

import math

import bpy
import numpy as np

from ...engine.errors import ProblemError
from ...engine.problem.color_separation import MODELS, Ink, separate
from ...engine.surface.chart import Chart
from ..densities.image_pixels import image_pixels
from .flat_objects import lift_for
from .name_lists import joined_names
from .stand_ins import colored_material

__all__ = ["add_ink_classes"]

# Corners of a disc.
CORNERS = 24


def add_ink_classes(
    scatter: bpy.types.PropertyGroup, image: bpy.types.Image, model: str, dots: int, chart: Chart
) -> int:
    """Add a class for every ink that an image needs to the settings of a scatter.

    Args:
        scatter: Settings that get the classes.
        image: Colors, as stored.
        model: A name in :data:`~esh.engine.problem.color_separation.MODELS`.
        dots: How many dots a black image would take, which says how large a dot is.
        chart: The surface of the target, seen from above, over which the image is stretched.

    Returns:
        Number of classes added.

    Raises:
        ProblemError: An image without pixels, or without ink; nothing was changed.
    """
    pixels = np.clip(image_pixels(image, "`image`"), 0.0, 1.0)
    channels = separate(pixels, model)
    found = MODELS[model]
    dot_area = float(chart.area.sum()) / dots
    counts = np.array([round(_ink_area(channel, chart) / dot_area) for channel in channels])
    if not counts.any():
        raise ProblemError(
            f'`image` "{image.name}" needs no ink for half a dot of {dot_area:g} m²; make the dots smaller'
        )
    matrix = np.asarray(found.non_overlap)
    stem = image.name
    names: dict[int, str] = {}
    # Dots of several inks lie on each other: each ink in a plane of its own, the first of them off the ground.
    lift = lift_for(2.0 * math.sqrt(dot_area / math.pi), 0.0)
    for index in np.flatnonzero(counts).tolist():
        ink = found.inks[index]
        body_class = scatter.add_class()
        body_class.name = f"{stem} {ink.name}"
        names[index] = body_class.name
        body_class.color = ink.rgb
        body_class.offset = len(names) * lift
        body_class.add_layer("IMAGE", image=_channel_image(f"{image.name} {ink.name}", channels[index]))
        size = body_class.sizes[0]
        size.name = "Dot"
        size.count = int(counts[index])
        size.area_kind = "VALUE"
        size.area = dot_area
        size.shape = "DOT"
        size.source_kind = "OBJECT"
        size.source_object = _disc(f"{ink.name} dot", ink, dot_area)
    for index, name in names.items():
        body_class = next(c for c in scatter.classes if c.name == name)
        body_class.may_overlap = joined_names(names[other] for other in names if matrix[index, other] == 0.0)
    scatter.avoid_overlap = False
    return len(names)


def _ink_area(channel: np.ndarray, chart: Chart) -> float:
    """Return how much of the surface an ink covers [m²]: every point counts by the pixel that it lies in."""
    height, width = channel.shape
    x, y = chart.points.rectangle_coordinates.T
    column = np.clip((x * width).astype(int), 0, width - 1)
    row = np.clip(((1.0 - y) * height).astype(int), 0, height - 1)
    return float(channel[row, column] @ chart.area[chart.area > 0.0])


def _channel_image(name: str, channel: np.ndarray) -> bpy.types.Image:
    """Return a packed image that holds a channel as gray."""
    height, width = channel.shape
    image = bpy.data.images.new(name, width, height, alpha=False, float_buffer=True, is_data=True)
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :3] = channel[::-1, :, None]
    image.pixels.foreach_set(pixels.ravel())
    image.update()
    image.pack()
    return image


def _disc(name: str, ink: Ink, area: float) -> bpy.types.Object:
    """Return a disc of this area in the ink's color, which is in no scene: only its instances show."""
    angle = np.arange(CORNERS) * (2.0 * math.pi / CORNERS)
    # As large as the disc that the polygon stands for.
    radius = math.sqrt(area / (0.5 * CORNERS * math.sin(2.0 * math.pi / CORNERS)))
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(radius * math.cos(a), radius * math.sin(a), 0.0) for a in angle], [], [range(CORNERS)])
    mesh.materials.append(colored_material(name, ink.rgb))
    return bpy.data.objects.new(name, mesh)
