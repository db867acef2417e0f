"""Blender's own Scatter on Surface (Essentials, since 5.0) beside esh.scatter: the same classes on the same ground.

    python benchmarks/scatter_on_surface.py --picture docs/scatter-on-surface.png

Prints a Markdown table, and draws what every way has placed, seen from above: discs of the objects' footprints, red where they
overlap. Needs pip's bpy, 5.0 or later, and Pillow. As an artist would, every class has a modifier of its own in Blender, with the
diameter of its objects as minimum distance.
"""

from __future__ import annotations

import argparse
import math
import time
from pathlib import Path
from typing import Any, NamedTuple

import bpy
import esh
import numpy as np
from esh.engine.problem.domain import Domain
from esh.engine.quality.coverage import coverage_error
from PIL import Image, ImageDraw

SIDE = 40.0
UNIFORM = np.ones((1, 1), dtype=np.float32)
ASSETS = ("datafiles", "assets", "nodes", "geometry_nodes_essentials.blend")
NAME = "Scatter on Surface"
# The pictures: pixels along a side, drawn so many times as large, and the gap between two.
PIXELS, FINER, GAP = 400, 3, 10
GROUND, OVERLAPPING = (238, 236, 228), (214, 40, 32)


class Thing(NamedTuple):
    """A class: its name, the radius of its objects [m], how many are asked for, and its color in the picture."""

    name: str
    radius: float
    count: int
    color: tuple[int, int, int]


THINGS = (
    Thing("tree", 1.2, 100, (58, 118, 74)),
    Thing("bush", 0.6, 300, (150, 170, 70)),
    Thing("stone", 0.3, 600, (120, 122, 132)),
)


class Placed(NamedTuple):
    """What one way has placed: title, places of every class [m] within 0..SIDE, shape ``[n, 2]`` each, and seconds."""

    title: str
    places: list[np.ndarray]
    seconds: float


def essentials() -> bpy.types.NodeTree:
    """Append Blender's node group."""
    path = Path(bpy.utils.resource_path("LOCAL")).joinpath(*ASSETS)
    if not path.exists():
        path = Path(bpy.utils.system_resource("DATAFILES")).joinpath(*ASSETS[1:])
    with bpy.data.libraries.load(str(path)) as (there, wanted):
        if NAME not in there.node_groups:
            raise SystemExit(f"{path} has no {NAME}: it needs Blender 5.0 or later, this is {bpy.app.version_string}")
        wanted.node_groups = [NAME]
    return wanted.node_groups[0]


def new_ground() -> bpy.types.Object:
    """A flat square around the origin."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=40, y_subdivisions=40, size=SIDE)
    return bpy.context.object


def new_disc(thing: Thing) -> bpy.types.Object:
    """What is placed: a disc as large as the footprint."""
    bpy.ops.mesh.primitive_circle_add(vertices=64, radius=thing.radius, fill_type="NGON", location=(100.0, 0.0, 0.0))
    return bpy.context.object


def scattered_by_blender(method: str) -> Placed:
    """Have Blender place all classes, a modifier each; ``method`` is "Amount" or "Density"."""
    bpy.ops.wm.read_homefile(use_empty=True)
    original = essentials()
    grounds = []
    for thing in THINGS:
        group = original.copy()
        item = new_disc(thing)
        values: dict[str, Any] = {
            "Density Method": method,
            "Distribution Method": "Poisson Disk",
            "Amount": thing.count,
            "Density": thing.count / SIDE**2,
            "Minimum Distance": 2.0 * thing.radius,
            "Keep Surface": False,
            "Seed": len(grounds) + 1,
            "Object": item,
        }
        # A modifier begins with the defaults of its group, in every version.
        for socket in group.interface.items_tree:
            if socket.item_type == "SOCKET" and socket.in_out == "INPUT" and socket.name in values:
                socket.default_value = values[socket.name]
        grounds.append(new_ground())
        grounds[-1].modifiers.new(thing.name, "NODES").node_group = group
    start = time.perf_counter()
    graph = bpy.context.evaluated_depsgraph_get()
    found: list[list[tuple[float, float]]] = [[] for _ in THINGS]
    for one in graph.object_instances:
        if one.is_instance:
            place = one.matrix_world.translation
            found[grounds.index(one.parent.original)].append((place.x, place.y))
    seconds = time.perf_counter() - start
    return Placed(f"Blender, {method}", [np.array(one).reshape(-1, 2) + SIDE / 2.0 for one in found], seconds)


def scattered_by_esh() -> Placed:
    """Have esh.scatter place all classes at once."""
    bpy.ops.wm.read_homefile(use_empty=True)
    ground = new_ground()
    classes = [
        esh.ScatterClass(
            thing.name,
            [esh.ScatterSize("one", thing.count, new_disc(thing), area=math.pi * thing.radius**2, line=False)],
        )
        for thing in THINGS
    ]
    # What is compiled is compiled before.
    esh.scatter(ground, classes, max_steps=2)
    start = time.perf_counter()
    result = esh.scatter(ground, classes, seed=1)
    seconds = time.perf_counter() - start
    placement = result.placement
    return Placed("ESH Scatter", [placement.position[placement.class_index == k] for k in range(len(THINGS))], seconds)


def overlapping(places: list[np.ndarray]) -> tuple[np.ndarray, int, int]:
    """Return which discs overlap another, class after class, and how many pairs do: of one class, and of two."""
    place = np.concatenate(places)
    kind = np.repeat(np.arange(len(places)), [len(one) for one in places])
    radius = np.array([thing.radius for thing in THINGS])[kind]
    distance = np.hypot(*np.moveaxis(place[:, None] - place, 2, 0))
    # What touches does not overlap.
    pair = np.triu(distance < (radius[:, None] + radius) * (1.0 - 1e-4), 1)
    same = kind[:, None] == kind
    return (pair | pair.T).any(axis=1), int((pair & same).sum()), int((pair & ~same).sum())


def closest(place: np.ndarray) -> float:
    """Return the distance of the closest two [m]."""
    distance = np.hypot(*np.moveaxis(place[:, None] - place, 2, 0))
    np.fill_diagonal(distance, np.inf)
    return float(distance.min())


def row(placed: Placed) -> str:
    """Return the line of the table for one way."""
    counts = ", ".join(f"{len(one):,} of {thing.count:,}" for thing, one in zip(THINGS, placed.places, strict=True))
    nearest = ", ".join(
        f"{closest(one):.2f} of {2.0 * thing.radius:.1f}" for thing, one in zip(THINGS, placed.places, strict=True)
    )
    _, same, other = overlapping(placed.places)
    domain = Domain((SIDE, SIDE))
    errors = ", ".join(f"{coverage_error(one, np.ones(len(one)), UNIFORM, domain):.2f}" for one in placed.places)
    return f"| {placed.title} | {counts} | {nearest} | {same:,} | {other:,} | {errors} | {placed.seconds:.2f} s |"


def drawn(placed: Placed) -> Image.Image:
    """Draw the discs of one way, seen from above."""
    scale = FINER * PIXELS / SIDE
    picture = Image.new("RGB", (FINER * PIXELS, FINER * PIXELS), GROUND)
    draw = ImageDraw.Draw(picture)
    overlaps = iter(overlapping(placed.places)[0].tolist())
    for thing, places in zip(THINGS, placed.places, strict=True):
        for x, y in places.tolist():
            box = [scale * (x - thing.radius), scale * (SIDE - y - thing.radius)]
            box += [scale * (x + thing.radius), scale * (SIDE - y + thing.radius)]
            outline = OVERLAPPING if next(overlaps) else tuple(int(0.7 * c) for c in thing.color)
            draw.ellipse(box, fill=thing.color, outline=outline, width=FINER * (2 if outline == OVERLAPPING else 1))
    return picture.resize((PIXELS, PIXELS), Image.Resampling.LANCZOS)


def main() -> None:
    """Print the table, and draw the picture where it is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--picture", type=Path, help="where to draw the three ways beside each other")
    options = parser.parse_args()
    ways = [scattered_by_blender("Amount"), scattered_by_blender("Density"), scattered_by_esh()]
    names = ", ".join(thing.name + ("es" if thing.name.endswith("sh") else "s") for thing in THINGS)
    print(
        f"| way | placed: {names} | closest two of a class, of their diameter [m] | overlapping pairs of one class | of two "
        "classes | coverage error | time |"
    )
    print("|---|---|---|---|---|---|---|")
    for way in ways:
        print(row(way), flush=True)
    if options.picture:
        whole = Image.new("RGB", (len(ways) * (PIXELS + GAP) - GAP, PIXELS), "white")
        for number, way in enumerate(ways):
            whole.paste(drawn(way), (number * (PIXELS + GAP), 0))
        whole.quantize(128, dither=Image.Dither.NONE).save(options.picture, optimize=True)


if __name__ == "__main__":
    main()
