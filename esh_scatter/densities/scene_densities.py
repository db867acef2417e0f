"""Densities that follow what else is in the scene: near objects, inside outlines, in a camera's view."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

import bpy
import numpy as np

from ...engine.errors import ProblemError
from ...engine.problem.given_values import show
from ...engine.problem.settings import Choice, described, setting
from ..targets.depsgraph import evaluated_depsgraph
from ..targets.target import check_exists, world_matrix
from .density_source import DensityReader, DensitySource, Known
from .ground_densities import within
from .shapes import Shapes, check_shapes, read_shapes

__all__ = ["CameraDensity", "DistanceDensity", "InsideDensity"]

Source: TypeAlias = bpy.types.Object | bpy.types.Collection | Sequence[bpy.types.Object | bpy.types.Collection] | Shapes


@dataclass(frozen=True, eq=False)
class StoredCamera:
    """A camera as it was when it was read: what any thread may look at.

    Attributes:
        name: Of its object.
        matrix: From its space, in which it looks along -z, to the world, shape ``[4, 4]``.
        projection: From its space to the picture, which is from -1 to 1, shape ``[4, 4]``.
    """

    name: str
    matrix: np.ndarray
    projection: np.ndarray


@described
@dataclass(frozen=True)
class DistanceDensity(DensitySource):
    """How near objects are: 1 near them, 0 far from them. It is measured as seen from above; on a whole surface, in space.

    Meshes reach as far as their faces, curves and edges as far as they go, and what has no geometry is where its origin is. Of the
    result of another scatter, its points are read.
    """

    source: Source = field(
        metadata=setting("What it is near to", more="An object, a collection, or a list of them", check=check_shapes)
    )
    near: float = field(
        default=0.0, metadata=setting("Up to this distance the density is white", unit="m", low=0.0, soft_high=100.0)
    )
    far: float = field(
        default=5.0, metadata=setting("From this distance on it is black", unit="m", low=0.0, soft_high=100.0)
    )
    falloff: str = field(
        default="smooth",
        metadata=setting(
            "How the density falls from near to far",
            choices=(
                Choice("smooth", "Smooth", "slowly at both ends", "SMOOTH"),
                Choice("linear", "Linear", "evenly", "LINEAR"),
                Choice("sharp", "Sharp", "fast at first", "SHARP"),
            ),
        ),
    )

    @property
    def label(self) -> str:
        """``distance to "Path"``."""
        return f"distance to {_names(self.source)}"

    def read(self, key: str, known: Known) -> DistanceDensity:
        """Return it with the shapes of the objects."""
        return replace(self, source=read_shapes(self.source, key, known))

    def content(self, reader: DensityReader) -> Hashable | None:
        """Return the shapes, in short."""
        assert isinstance(self.source, Shapes)
        from_above = reader.points.view.from_above
        shapes = self.source.checksum if from_above else self.source.checksum_in_space
        return "distance", from_above, shapes, self.near, self.far, self.falloff

    def values(self, reader: DensityReader, _key: str) -> np.ndarray:
        """Return 1 near the objects."""
        # Warp is not imported before something is computed.
        from ...engine.surface.near_shapes import NearShapes

        assert isinstance(self.source, Shapes)
        shapes = NearShapes(self.source.triangle if reader.points.view.from_above else self.source.solid)
        reach = max(self.near, self.far)
        # A little farther, so that what lies at the far end is told from what lies beyond it.
        distance = shapes.distance(reader.points.position, 1.001 * reach + 1e-6)
        value = within(distance, 0.0, self.near, max(self.far - self.near, 0.0))
        if self.falloff == "smooth":
            return value * value * (3.0 - 2.0 * value)
        return value * value if self.falloff == "sharp" else value


@described
@dataclass(frozen=True)
class InsideDensity(DensitySource):
    """Inside of outlines seen from above: 1 inside of curves, and of meshes' faces; 0 outside.

    A curve that is open is closed by a straight piece.
    """

    source: Source = field(
        metadata=setting(
            "The outline",
            more="A curve, a mesh, a collection, or a list of them: inside of any of them counts",
            check=check_shapes,
        )
    )
    falloff: float = field(
        default=0.0,
        metadata=setting("How far outside the curves the density fades out", unit="m", low=0.0, soft_high=100.0),
    )

    @property
    def label(self) -> str:
        """``inside of "Border"``."""
        return f"inside of {_names(self.source)}"

    def read(self, key: str, known: Known) -> InsideDensity:
        """Return it with the shapes of the outlines."""
        return replace(self, source=read_shapes(self.source, key, known))

    def content(self, _reader: DensityReader) -> Hashable | None:
        """Return the shapes, in short."""
        assert isinstance(self.source, Shapes)
        return "inside", self.source.checksum, self.falloff

    def values(self, reader: DensityReader, _key: str) -> np.ndarray:
        """Return 1 inside."""
        from ...engine.surface.near_shapes import NearShapes
        from ...engine.surface.shapes_from_above import inside_outlines

        assert isinstance(self.source, Shapes)
        position = reader.points.position
        inside = np.zeros(len(position), bool)
        # One after the other: what lies inside two objects is not outside.
        for outline in self.source.outlines:
            inside |= inside_outlines(outline, position)
        distance = NearShapes(self.source.triangle).distance(position, 1.001 * self.falloff)
        return np.where(inside, np.float32(1.0), within(distance, 0.0, 0.0, self.falloff))


def _camera(value: Any, key: str) -> Any:
    if isinstance(value, StoredCamera):
        return value
    if not isinstance(value, bpy.types.Object):
        raise ProblemError(f"{key} must be a camera, or None; got {show(value)}")
    check_exists(value, key)
    if value.type != "CAMERA":
        raise ProblemError(f'{key} must be a camera, or None; "{value.name}" is of type {value.type}')
    return value


@described
@dataclass(frozen=True)
class CameraDensity(DensitySource):
    """What a camera sees at the current frame: 1 in its view, 0 outside. What hides behind something counts as seen."""

    camera: bpy.types.Object | StoredCamera | None = field(
        default=None, metadata=setting("The camera", more="None: the scene's", check=_camera)
    )
    margin: float = field(
        default=0.1,
        metadata=setting(
            "How far outside of the view the density fades out; 1 is the width of the picture",
            unit="share",
            low=0.0,
            high=10.0,
            soft_high=1.0,
        ),
    )
    distance: float = field(
        default=0.0,
        metadata=setting(
            "Distance from the camera at which the density begins to fade out. 0 means no limit",
            unit="m",
            low=0.0,
            soft_high=1000.0,
        ),
    )
    falloff: float = field(
        default=10.0,
        metadata=setting("Distance over which it then fades out", unit="m", low=0.0, soft_high=1000.0),
    )

    @property
    def label(self) -> str:
        """``view of "Camera"``."""
        return f'view of "{self.camera.name}"' if self.camera else "view of the camera"

    def read(self, key: str, _known: Known) -> CameraDensity:
        """Return it with where the camera stands, and what it sees."""
        if isinstance(self.camera, StoredCamera):
            return self
        context = bpy.context
        camera = context.scene.camera if self.camera is None else self.camera
        if camera is None:
            raise ProblemError(f'{key} needs a camera, and scene "{context.scene.name}" has none')
        check_exists(camera, key)
        render = context.scene.render
        projection = camera.calc_matrix_camera(
            evaluated_depsgraph(context),
            x=render.resolution_x,
            y=render.resolution_y,
            scale_x=render.pixel_aspect_x,
            scale_y=render.pixel_aspect_y,
        )
        matrix = world_matrix(camera, context)
        # A camera's scale does not change what it sees.
        matrix[:3, :3] /= np.linalg.norm(matrix[:3, :3], axis=0)
        return replace(self, camera=StoredCamera(camera.name, matrix, np.array(projection)))

    def content(self, _reader: DensityReader) -> Hashable | None:
        """Return what the camera sees, in short."""
        camera = self.camera
        assert isinstance(camera, StoredCamera)
        limits = self.margin, self.distance, self.falloff
        return "camera", camera.matrix.tobytes(), camera.projection.tobytes(), limits

    def values(self, reader: DensityReader, _key: str) -> np.ndarray:
        """Return 1 in the camera's view."""
        camera = self.camera
        assert isinstance(camera, StoredCamera)
        local = (reader.points.position - camera.matrix[:3, 3]) @ np.linalg.inv(camera.matrix[:3, :3]).T
        clip = np.column_stack([local, np.ones(len(local))]) @ camera.projection.T
        in_front = (clip[:, 3] > 1e-9) & (local[:, 2] < 0.0)
        weight = np.where(in_front, clip[:, 3], np.inf)
        beside = 0.5 * (np.abs(clip[:, :2]).max(axis=1) / weight - 1.0)
        seen = within(beside, -np.inf, 0.0, self.margin)
        seen[~in_front] = 0.0
        if self.distance > 0.0:
            seen *= within(np.linalg.norm(local, axis=1), 0.0, self.distance, self.falloff)
        return seen


def _names(source: Any) -> str:
    items = source if isinstance(source, tuple) else (source,)
    names = source.names if isinstance(source, Shapes) else [item.name for item in items]
    return ", ".join(f'"{name}"' for name in names)
