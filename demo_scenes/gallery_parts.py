"""What the scenes of the gallery share: checks of what Blender really shows, and a command line for each of them."""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import bpy
import esh
import numpy as np
import surface_shapes as shapes
from scene_parts import collection, save, set_render

__all__ = ["Built", "add", "check_counts", "check_overlaps", "run", "seen", "variants"]


@dataclass(frozen=True)
class Built:
    """A scene that is ready to be rendered.

    Attributes:
        results: What was scattered, one scatter after the other.
        more: What the scene's own checks need to know.
    """

    results: list[esh.ScatterResult]
    more: dict[str, object] = field(default_factory=dict)


def add(
    name: str, shape: shapes.Shape, *materials: bpy.types.Material, faces: np.ndarray | None = None, smooth: bool = True
) -> bpy.types.Object:
    """Add an object of a shape to the scene; ``faces`` says which of the materials a face has."""
    item = shapes.link(name, shape, bpy.context.scene.collection, smooth)
    _set_materials(item, materials, faces)
    return item


def variants(
    name: str,
    made: list[tuple[shapes.Shape, np.ndarray | None]],
    *materials: bpy.types.Material,
    smooth: bool = True,
) -> bpy.types.Collection:
    """Make a hidden collection of shapes, each with the number of the material of its faces, or None."""
    holder = collection(name, bpy.context.scene.collection, hidden=True)
    for number, (shape, faces) in enumerate(made):
        _set_materials(shapes.link(f"{name} {number + 1}", shape, holder, smooth), materials, faces)
    return holder


def _set_materials(item: bpy.types.Object, materials: tuple[bpy.types.Material, ...], faces: np.ndarray | None) -> None:
    for material in materials:
        item.data.materials.append(material)
    if faces is not None:
        item.data.polygons.foreach_set("material_index", np.asarray(faces, np.int32))


def seen(result: esh.ScatterResult) -> np.ndarray:
    """Return where Blender instances the objects of a result, as the renderer sees them: matrices ``[n, 4, 4]``."""
    graph = bpy.context.evaluated_depsgraph_get()
    found = [
        np.array(one.matrix_world)
        for one in graph.object_instances
        if one.is_instance and one.parent.original == result.object
    ]
    return np.array(found).reshape(-1, 4, 4)


def check_counts(built: Built) -> int:
    """Every size of every class has as many as were asked for, and Blender shows all of them; returns how many.

    Raises:
        AssertionError: It is not so.
    """
    total = 0
    for result in built.results:
        placed = 0
        for entry in result.report.classes:
            for size in entry.sizes:
                assert size.asked == size.placed, f"{entry.name}: {size.asked} asked, {size.placed} placed"
                placed += size.placed
        shown = len(seen(result))
        assert shown == placed, f"{result.object.name}: {placed} placed, {shown} shown"
        total += placed
    return total


def check_overlaps(built: Built, most: float = 0.0) -> int:
    """At most this share of the bodies overlaps another; returns the pairs that do.

    Raises:
        AssertionError: It is more.
    """
    pairs = sum(result.report.overlaps for result in built.results)
    count = sum(len(result.placement.position) for result in built.results)
    assert pairs <= most * count, f"{pairs} pairs of {count} footprints overlap"
    return pairs


def run(
    name: str,
    about: str,
    build: Callable[[str, bool], Built],
    check: Callable[[Built], dict[str, float]],
    *,
    size: tuple[int, int] = (1280, 720),
    samples: int = 64,
    seed: int = 1,
    arguments: list[str] | None = None,
) -> None:
    """Build a scene, check it, render it and save it, as its command line says.

    Args:
        name: Of the picture and of the ``.blend`` file.
        about: What ``--help`` says.
        build: Makes the scene in an empty file, on a device, with few bodies where it is told so.
        check: Measures the scene, and raises an AssertionError where it is not as it should be.
        size: Of the picture, in pixels.
        samples: Per pixel.
        seed: Of the noise of the picture.
        arguments: Of the command line; None takes the program's own, in Blender those behind ``--``.
    """
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("--output", type=Path, default=Path("output"), help="folder for the picture and the .blend")
    parser.add_argument("--width", type=int, default=size[0], help="width of the picture in pixels")
    parser.add_argument("--samples", type=int, default=samples, help="Cycles samples per pixel")
    parser.add_argument("--device", default="auto", help="where things are placed: auto, cpu or cuda:0")
    parser.add_argument("--quick", action="store_true", help="few bodies and a tiny picture, to try the scene out")
    given = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else None
    options = parser.parse_args(given if arguments is None else arguments)
    if options.quick:
        options.width, options.samples = 128, 1
    options.output.mkdir(parents=True, exist_ok=True)
    start = time.perf_counter()
    bpy.ops.wm.read_homefile(use_empty=True)
    built = build(options.device, options.quick)
    for result in built.results:
        print(result.report, flush=True)
    print(f"[{time.perf_counter() - start:5.1f} s] built", flush=True)
    try:
        measured = check(built)
    except AssertionError as error:
        sys.exit(f"The {name} is not as it should be: {error}")
    scene = bpy.context.scene
    set_render(scene, options.width, math.ceil(options.width * size[1] / size[0]), options.samples, seed)
    picture = options.output / f"{name}.png"
    scene.render.filepath = str(picture.resolve())
    bpy.ops.render.render(write_still=True)
    save(options.output / f"{name}.blend")
    for key, value in measured.items():
        print(f"{key}: {value:.4g}")
    print(f"[{time.perf_counter() - start:5.1f} s] wrote {picture}; all checks passed")
