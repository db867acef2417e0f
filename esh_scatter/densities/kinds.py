"""What the density of a class can be in Blender: every kind of it."""

from __future__ import annotations

from .density_source import Density
from .density_stack import ClassDensity, DensityLayer, DensityStack
from .ground_densities import AltitudeDensity, FacingDensity, NoiseDensity, SlopeDensity
from .image_density import ImageDensity
from .mesh_densities import AttributeDensity, VertexGroupDensity
from .scene_densities import CameraDensity, DistanceDensity, InsideDensity

__all__ = [
    "AltitudeDensity",
    "AttributeDensity",
    "CameraDensity",
    "ClassDensity",
    "Density",
    "DensityLayer",
    "DensityStack",
    "DistanceDensity",
    "FacingDensity",
    "ImageDensity",
    "InsideDensity",
    "NoiseDensity",
    "SlopeDensity",
    "VertexGroupDensity",
]
