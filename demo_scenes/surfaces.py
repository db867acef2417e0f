"""Things on any surface, from an empty file to a picture, by one command for each scene.

    python demo_scenes/surfaces.py doughnut --output output
    python demo_scenes/surfaces.py rocks --output output
    python demo_scenes/surfaces.py boat --output output

- ``doughnut``: sprinkles of five colors, each even alone and all even together, on the icing, down its sides and into the hole;
  sugar pearls that grow fewer around another one.
- ``rocks``: moss on the north sides of rocks, overhangs too, and lichen where the sun is; the rocks are a collection.
- ``boat``: barnacles of all sizes and mussels below the water line of a boat, on hull, keel and both sides of the rudder.

Every scene checks itself: the counts are exact, and everything stands on its target, on the outside, where its density is not zero.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import bpy
import esh
import numpy as np
import surface_shapes as shapes
from mathutils import Vector
from mathutils.bvhtree import BVHTree
from scene_parts import add_camera, collection, save, set_render
from surface_materials import glossy, leafy, mottled, set_light

__all__ = ["SCENES", "build", "main", "test_final"]

SEED = 3


@dataclass(frozen=True)
class Scattered:
    """One scatter of a scene: what came of it, and on what."""

    result: esh.ScatterResult
    targets: list[bpy.types.Object]


def _sources(name: str, made: list[shapes.Shape], material: bpy.types.Material) -> bpy.types.Collection:
    """Make a hidden collection of variants."""
    holder = collection(name, bpy.context.scene.collection, hidden=True)
    for number, shape in enumerate(made):
        item = shapes.link(f"{name} {number + 1}", shape, holder)
        item.data.materials.append(material)
    return holder


def _object(name: str, shape: shapes.Shape, *materials: bpy.types.Material, smooth: bool = True) -> bpy.types.Object:
    item = shapes.link(name, shape, bpy.context.scene.collection, smooth)
    for material in materials:
        item.data.materials.append(material)
    return item


def _values(item: bpy.types.Object, name: str, values: np.ndarray, kind: str = "FLOAT", domain: str = "POINT") -> None:
    item.data.attributes.new(name, kind, domain).data.foreach_set(
        "value", values.astype(bool if kind == "BOOLEAN" else np.float32)
    )


def _normals(item: bpy.types.Object) -> tuple[np.ndarray, np.ndarray]:
    """Positions and normals of an object's vertices, in the world; it must not be scaled."""
    place, normal = np.empty((2, len(item.data.vertices), 3), np.float32)
    item.data.vertices.foreach_get("co", place.ravel())
    item.data.vertex_normals.foreach_get("vector", normal.ravel())
    matrix = np.array(item.matrix_basis)
    return place @ matrix[:3, :3].T + matrix[:3, 3], normal @ matrix[:3, :3].T


def _cut(item: bpy.types.Object, levels: int) -> None:
    """Cut the faces of an object in four so many times, for vertices enough to hold a density."""
    modifier = item.modifiers.new("Cuts", "SUBSURF")
    modifier.subdivision_type, modifier.levels = "SIMPLE", levels
    graph = bpy.context.evaluated_depsgraph_get()
    mesh = bpy.data.meshes.new_from_object(item.evaluated_get(graph))
    item.modifiers.clear()
    item.data = mesh


def _add_board_and_table() -> None:
    """Add what the doughnuts lie on."""
    board = shapes.lathe(
        np.array([(0.0, -0.016), (0.23, -0.016), (0.236, -0.011), (0.236, -0.006), (0.23, -0.001), (0.0, 0.0)]), 160
    )
    wood = mottled("Board", [(0.25, (0.72, 0.69, 0.64)), (0.75, (0.83, 0.8, 0.75))], 0.06, roughness=0.5, bump=0.0001)
    item = _object("Board", board, wood, smooth=False)
    item.location = (-0.04, 0.05, 0.0)
    table = _object(
        "Table",
        (
            np.array([(-3, -3, -0.016), (3, -3, -0.016), (3, 3, -0.016), (-3, 3, -0.016)], float),
            np.array([(0, 1, 2, 3)]),
        ),
    )
    table.data.materials.append(glossy("Table", (0.22, 0.39, 0.42), roughness=0.7, coat=0.0))


def _iced_doughnuts() -> list[bpy.types.Object]:
    """Add two doughnuts; returns their icings, whose upper sides are marked."""
    radius, thickness, depth = 0.042, 0.0235, 0.0028
    dough = mottled("Dough", [(0.3, (0.62, 0.33, 0.12)), (0.7, (0.78, 0.47, 0.2))], 0.03, roughness=0.75, bump=0.0006)
    iced = []
    for number, (name, color, place) in enumerate(
        (
            ("Strawberry", (0.87, 0.33, 0.42), (0.0, 0.0, 0.02)),
            ("Chocolate", (0.075, 0.026, 0.012), (-0.105, 0.115, 0.02)),
        )
    ):
        top, on_top = shapes.icing(radius, thickness, depth, SEED + 4 * number)
        item = _object(f"{name} Icing", top, glossy(name, color, roughness=0.22, under=0.002))
        _values(item, "top", on_top, "BOOLEAN", "FACE")
        bottom = _object(f"{name} Dough", shapes.ring(radius, thickness, SEED + number), dough)
        item.location = bottom.location = place
        iced.append(item)
    return iced


def doughnut(device: str) -> list[Scattered]:
    """Two doughnuts on a board."""
    scene = bpy.context.scene
    colors = {
        "pink": (0.86, 0.09, 0.24),
        "yellow": (0.95, 0.62, 0.06),
        "green": (0.16, 0.55, 0.2),
        "blue": (0.06, 0.33, 0.75),
        "white": (0.93, 0.9, 0.86),
    }
    iced = _iced_doughnuts()
    length = 0.0062
    # begin: scatter
    sprinkles = [
        esh.ScatterClass(
            name,
            [
                esh.ScatterSize(
                    "sprinkle",
                    62,
                    _sources(
                        f"{name} sprinkle", [shapes.sprinkle(length, 0.00085)], glossy(name, color, roughness=0.35)
                    ),
                    area=0.25 * np.pi * (1.03 * length) ** 2,
                    line=False,
                )
            ],
            color=color,
        )
        for name, color in colors.items()
    ]
    options = {"surface": "whole", "face_attribute": "top", "device": device, "seed": SEED}
    first = esh.scatter(iced[0], sprinkles, class_separation=0.5, max_steps=200, name="Sprinkles", **options)
    place, _ = _normals(iced[1])
    angle = np.arctan2(place[:, 1] - 0.115, place[:, 0] + 0.105)
    _values(iced[1], "sugar", 0.02 + np.clip(0.5 - 0.5 * np.cos(angle - 0.6), 0.0, 1.0) ** 2.2)
    pearls = [
        esh.ScatterClass(
            name,
            [
                esh.ScatterSize(
                    "pearl",
                    count,
                    _sources(f"{name} pearl", [shapes.pearl(0.001)], glossy(f"{name} pearl", color, coat=1.0)),
                    area=(2.6e-6, 7.5e-6),
                )
            ],
            density=esh.AttributeDensity("sugar"),
            color=color,
        )
        for name, color, count in (("gold", (0.83, 0.55, 0.14), 330), ("cream", (0.93, 0.86, 0.74), 520))
    ]
    second = esh.scatter(iced[1], pearls, class_separation=0.5, max_steps=200, name="Pearls", **options)
    # end: scatter
    _add_board_and_table()
    set_light(scene, (-0.55, 0.15, 0.7), 3.6, (0.86, 0.9, 0.97), 0.8)
    camera = add_camera(scene, "Doughnut", (0.13, -0.185, 0.16), (-0.022, 0.03, 0.013), lens=48.0, clip_end=20.0)
    camera.data.dof.use_dof, camera.data.dof.focus_distance, camera.data.dof.aperture_fstop = True, 0.225, 16.0
    scene.camera = camera
    return [Scattered(first, [iced[0]]), Scattered(second, [iced[1]])]


def _stones() -> tuple[bpy.types.Collection, list[bpy.types.Object]]:
    """Add rocks, in a collection of their own."""
    stone = mottled(
        "Stone",
        [(0.2, (0.13, 0.125, 0.12)), (0.5, (0.27, 0.26, 0.245)), (0.8, (0.42, 0.4, 0.37))],
        0.5,
        bump=0.02,
        fine=0.15,
    )
    holder = collection("Rocks", bpy.context.scene.collection)
    placed = [
        ((0.9, 0.75, 0.78), (0.0, 0.0, 0.42), 1),
        ((0.55, 0.48, 0.42), (-1.05, -0.62, 0.2), 5),
        ((0.42, 0.5, 0.36), (0.95, -0.72, 0.17), 9),
        ((0.7, 0.55, 0.5), (1.35, 0.75, 0.25), 14),
        ((0.26, 0.22, 0.2), (-0.12, -1.15, 0.1), 21),
    ]
    items = []
    for number, (size, place, seed) in enumerate(placed):
        item = shapes.link(f"Rock {number + 1}", shapes.rock(size, SEED + seed), holder)
        item.data.materials.append(stone)
        item.location = place
        items.append(item)
    return holder, items


def _grow_on(item: bpy.types.Object) -> None:
    """Say where moss and lichen grow on a rock: the one where it looks north, the other where it does not."""
    north = np.array([-0.93, -0.05, 0.28]) / np.linalg.norm([-0.93, -0.05, 0.28])
    place, normal = _normals(item)
    facing = normal @ north
    patches = 0.5 + 0.5 * shapes.waves(place, 0.5, 40)
    moss = np.clip((facing - 0.1 + 0.55 * (patches - 0.5)) / 0.55, 0.0, 1.0) ** 1.5
    above = np.clip((place[:, 2] - 0.02) / 0.1, 0.0, 1.0)
    _values(item, "moss", moss * above)
    _values(
        item,
        "lichen",
        np.clip(0.25 - facing, 0.0, 1.0)
        * np.clip(normal[:, 2] + 0.35, 0.0, 1.0)
        * above
        * np.clip(2.2 * (0.5 + 0.5 * shapes.waves(place, 0.35, 60)) - 0.7, 0.0, 1.0),
    )


def _add_soil(device: str) -> None:
    """Add the ground between the rocks, with pebbles and grass that grows beside them."""
    side = np.linspace(-9.0, 9.0, 181)
    x, y = np.meshgrid(side, side)
    flat = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    flat[:, 2] = 0.05 * shapes.waves(flat, 2.0, 77) - 0.02
    earth = mottled(
        "Soil",
        [(0.3, (0.1, 0.075, 0.045)), (0.6, (0.19, 0.145, 0.09)), (0.8, (0.27, 0.22, 0.14))],
        0.3,
        roughness=1.0,
        bump=0.03,
    )
    soil = _object("Soil", (flat, shapes.grid_faces(181, 181)), earth)
    near = np.exp(-(((flat[:, 0] - 0.2) / 3.2) ** 2) - ((flat[:, 1] + 0.6) / 2.8) ** 2)
    patches = np.clip(0.5 + 1.6 * shapes.waves(flat, 1.1, 90), 0.0, 1.0)
    _values(soil, "pebbles", near * (0.25 + 0.75 * (1.0 - patches)))
    _values(soil, "grass", near * patches**2)
    gray = mottled("Pebble", [(0.3, (0.15, 0.135, 0.115)), (0.7, (0.33, 0.31, 0.28))], 0.2, roughness=0.9, bump=0.003)
    blade = leafy("Grass", [(0.0, (0.2, 0.24, 0.05)), (0.6, (0.33, 0.36, 0.09)), (1.0, (0.5, 0.44, 0.17))])
    pebbles = [shapes.rock((0.05, 0.042, 0.03), 60 + n, 3) for n in range(4)]
    tufts = [shapes.grass(0.16, 46, 30 + n) for n in range(4)]
    esh.scatter(
        soil,
        [
            esh.ScatterClass(
                "pebble",
                [esh.ScatterSize("pebble", 1100, _sources("Pebble", pebbles, gray), area=(0.0006, 0.009))],
                density=esh.AttributeDensity("pebbles"),
            ),
            esh.ScatterClass(
                "grass",
                [esh.ScatterSize("tuft", 1300, _sources("Grass", tufts, blade), area=0.008)],
                density=esh.AttributeDensity("grass"),
            ),
        ],
        obstacles=[bpy.data.collections["Rocks"]],
        scale_jitter=0.25,
        tilt=0.1,
        device=device,
        seed=SEED,
        name="Ground Cover",
    )


def rocks(device: str) -> list[Scattered]:
    """Rocks in a clearing, the north to the left."""
    scene = bpy.context.scene
    holder, items = _stones()
    for item in items:
        _grow_on(item)
    green = leafy("Moss", [(0.0, (0.13, 0.22, 0.02)), (0.5, (0.25, 0.34, 0.03)), (1.0, (0.42, 0.44, 0.05))])
    crust = leafy(
        "Lichen",
        [(0.0, (0.72, 0.36, 0.05)), (0.45, (0.78, 0.5, 0.12)), (0.55, (0.55, 0.58, 0.47)), (1.0, (0.66, 0.68, 0.6))],
        through=0.0,
    )
    # begin: scatter
    asked = [
        esh.ScatterClass(
            "moss",
            [
                esh.ScatterSize(
                    "cushion",
                    900,
                    _sources("Cushion", [shapes.moss(0.034, 260, n) for n in range(3)], green),
                    area=0.0011,
                ),
                esh.ScatterSize(
                    "tuft",
                    6500,
                    _sources("Tuft", [shapes.moss(0.017, 110, 10 + n) for n in range(3)], green),
                    area=0.00022,
                ),
            ],
            density=esh.AttributeDensity("moss"),
        ),
        esh.ScatterClass(
            "lichen",
            [
                esh.ScatterSize(
                    "crust",
                    190,
                    _sources("Crust", [shapes.lichen(0.03, n) for n in range(4)], crust),
                    area=(0.0006, 0.006),
                )
            ],
            density=esh.AttributeDensity("lichen"),
        ),
    ]
    result = esh.scatter(
        holder,
        asked,
        surface="whole",
        size_emphasis=1.5,
        class_separation=0.2,
        scale_jitter=0.2,
        tilt=0.25,
        device=device,
        seed=SEED,
        name="Moss",
    )
    # end: scatter
    _add_soil(device)
    set_light(scene, (0.25, -0.75, 0.5), 5.5, (0.66, 0.78, 0.92), 1.1, (1.0, 0.86, 0.66))
    camera = add_camera(scene, "Rocks", (-1.75, -3.7, 1.25), (0.08, -0.1, 0.36), lens=50.0, clip_end=60.0)
    camera.data.dof.use_dof, camera.data.dof.focus_distance, camera.data.dof.aperture_fstop = True, 3.6, 4.0
    scene.camera = camera
    return [Scattered(result, items)]


def _add_yard() -> None:
    """Add what the boat stands on, slabs of concrete around it, and a boarded shed behind it."""
    rng = np.random.default_rng(SEED)
    wood = mottled("Timber", [(0.3, (0.19, 0.12, 0.065)), (0.7, (0.34, 0.23, 0.13))], 0.25, roughness=0.9, bump=0.004)
    for x in (-1.15, 0.55):
        block = _object("Block", shapes.box((0.3, 1.1, 0.2)), wood, smooth=False)
        block.location = (x, 0.0, 0.1)
    for x, side in ((-1.9, 1), (-1.9, -1), (1.35, 1)):
        foot, head = Vector((x, side * 1.35, 0.0)), Vector((x, side * 0.7, 0.98))
        prop = _object("Prop", shapes.box((0.09, 0.09, (head - foot).length)), wood, smooth=False)
        prop.location, prop.rotation_euler = (foot + head) / 2.0, (head - foot).to_track_quat("Z", "Y").to_euler()
    gray = [(0.3, (0.17, 0.16, 0.15)), (0.7, (0.3, 0.285, 0.26))]
    concrete = mottled("Concrete", gray, 0.8, roughness=0.9, bump=0.004, fine=0.05)
    joint = mottled("Joint", [(0.3, (0.035, 0.033, 0.03)), (0.7, (0.07, 0.065, 0.055))], 0.3)
    ground = np.array([(-40, -40, -0.02), (40, -40, -0.02), (40, 40, -0.02), (-40, 40, -0.02)], float)
    _object("Yard", (ground, np.array([(0, 1, 2, 3)])), joint)
    for x, y in itertools.product(np.arange(-9.0, 9.0, 1.5), np.arange(-4.5, 4.6, 1.5)):
        slab = _object("Slab", shapes.box((1.47, 1.47, 0.1)), concrete, smooth=False)
        slab.location = (x, y, -0.05)
        slab.rotation_euler = (*rng.uniform(-0.004, 0.004, 2), rng.uniform(-0.004, 0.004))
    hues = [(0.0, (0.045, 0.1, 0.12)), (0.5, (0.07, 0.14, 0.16)), (1.0, (0.12, 0.2, 0.21))]
    boards = [
        mottled(f"Board {number}", [(0.2, tuple(0.7 * c for c in hue)), (0.8, hue)], 0.4, bump=0.002)
        for number, (_, hue) in enumerate(hues)
    ]
    for x in np.arange(-30.0, 9.0, 0.19):
        board = _object("Board", shapes.box((0.18, 0.03, 3.2)), boards[rng.integers(3)], smooth=False)
        board.location = (x, 5.2 + rng.uniform(0.0, 0.012), 1.6)


def _boat_parts() -> list[bpy.types.Object]:
    """Add hull, keel and rudder, and say where barnacles and mussels grow on them."""
    length, beam, draft, board = 5.6, 1.9, 0.62, 0.62
    (vertex, face), below = shapes.hull(length, beam, draft, board)
    paint = mottled(
        "Antifouling",
        [(0.3, (0.3, 0.035, 0.022)), (0.7, (0.42, 0.065, 0.035))],
        0.5,
        roughness=0.65,
        bump=0.002,
        fine=0.05,
    )
    white = glossy("Topsides", (0.8, 0.79, 0.74), roughness=0.3)
    body = _object("Hull", (vertex, face), paint, white)
    body.data.polygons.foreach_set("material_index", (~below).astype(np.int32))
    fin = shapes.box((2.5, 0.09, 0.4))
    keel = _object("Keel", fin, paint, smooth=False)
    keel.location = (-0.35, 0.0, -draft - 0.1)
    blade = _object("Rudder", shapes.box((0.42, 0.05, 0.95)), paint, smooth=False)
    blade.location = (-0.5 * length - 0.16, 0.0, -0.35)
    targets = [body, keel, blade]
    # The keel stands on the blocks of the yard.
    lift = draft + 0.5
    for item in targets:
        item.location.z += lift
    for item in (keel, blade):
        _cut(item, 5)
    graph = bpy.context.evaluated_depsgraph_get()
    hull = BVHTree.FromObject(body, graph)
    for item in targets:
        place, _ = _normals(item)
        depth = lift - place[:, 2]
        if item != body:
            # Nothing grows where the hull is.
            nearest = [hull.find_nearest(Vector(at) - body.location)[:2] for at in place.tolist()]
            outside = [
                (Vector(at) - body.location - on).dot(out) > 0.0
                for at, (on, out) in zip(place.tolist(), nearest, strict=True)
            ]
            _values(item, "growth", np.where(outside, 0.8 * np.clip(depth / 0.12 - 0.1, 0.0, 1.0), 0.0))
            continue
        colony = np.clip(0.75 * shapes.waves(place, 1.1, 5) + 0.45, 0.0, 1.0)
        _values(item, "growth", np.clip(depth / 0.12 - 0.1, 0.0, 1.0) * (0.25 + colony))
        _values(
            item, "band", np.clip(1.0 - np.abs(depth - 0.16) / 0.13, 0.0, 1.0) * np.clip(2.5 * colony - 0.7, 0.0, 1.0)
        )
    return targets


def boat(device: str) -> list[Scattered]:
    """A boat out of the water, seen from where its bow is and from below."""
    scene = bpy.context.scene
    targets = _boat_parts()
    lime = leafy("Lime", [(0.0, (0.46, 0.42, 0.36)), (0.6, (0.66, 0.62, 0.54)), (1.0, (0.8, 0.76, 0.68))], through=0.0)
    shell = glossy("Shell", (0.012, 0.016, 0.035), roughness=0.3)
    # begin: scatter
    asked = [
        esh.ScatterClass(
            "barnacle",
            [
                esh.ScatterSize(
                    "any",
                    1300,
                    _sources("Barnacle", [shapes.barnacle(0.02, n) for n in range(5)], lime),
                    area=(0.0002, 0.0024),
                    distribution="linear",
                )
            ],
            density=esh.AttributeDensity("growth"),
        ),
        esh.ScatterClass(
            "mussel",
            [
                esh.ScatterSize(
                    "any",
                    90,
                    _sources("Mussel", [shapes.mussel(0.06, n) for n in range(4)], shell),
                    area=0.0016,
                    line=False,
                )
            ],
            density=esh.AttributeDensity("band"),
        ),
    ]
    result = esh.scatter(
        targets,
        asked,
        surface="whole",
        face_material="Antifouling",
        size_emphasis=1.5,
        class_separation=0.3,
        scale_jitter=0.1,
        device=device,
        seed=SEED,
        name="Growth",
    )
    # end: scatter
    _add_yard()
    set_light(scene, (0.55, -0.8, 0.34), 4.6, (0.6, 0.74, 0.92), 0.9, (1.0, 0.85, 0.66))
    camera = add_camera(scene, "Boat", (4.25, -3.55, 0.62), (0.32, 0.0, 0.86), lens=36.0, clip_end=200.0)
    scene.camera = camera
    return [Scattered(result, targets)]


SCENES: dict[str, Callable[[str], list[Scattered]]] = {"doughnut": doughnut, "rocks": rocks, "boat": boat}


def build(name: str, device: str = "auto") -> list[Scattered]:
    """Build a scene in an empty file."""
    bpy.ops.wm.read_homefile(use_empty=True)
    return SCENES[name](device)


def test_final(scattered: list[Scattered]) -> dict[str, float]:
    """Check a finished scene.

    Returns:
        What was measured, by name.

    Raises:
        AssertionError: Something is not as it should be; the message says what.
    """
    total, farthest, overlaps = 0, 0.0, 0
    graph = bpy.context.evaluated_depsgraph_get()
    for one in scattered:
        report, item = one.result.report, one.result.object
        for entry in report.classes:
            for size in entry.sizes:
                assert size.asked == size.placed, f"{entry.name}: {size.asked} asked, {size.placed} placed"
        shown = sum(i.is_instance and i.parent.original == item for i in graph.object_instances)
        assert shown == sum(size.placed for entry in report.classes for size in entry.sizes), (
            f"{item.name} shows {shown}"
        )
        total += shown
        overlaps += report.overlaps
        position, normal = one.result.placement.position, one.result.placement.normal
        count = len(position)
        nearest, outward = np.full(count, np.inf), np.zeros(count)
        for target in one.targets:
            inverse = target.matrix_world.inverted()
            evaluated = target.evaluated_get(graph)
            for k in range(count):
                found, place, facing, _ = evaluated.closest_point_on_mesh(inverse @ Vector(position[k].tolist()))
                away = (target.matrix_world @ place - Vector(position[k].tolist())).length
                if found and away < nearest[k]:
                    nearest[k] = away
                    outward[k] = np.dot(target.matrix_world.to_3x3() @ facing, normal[k])
        size = float(np.ptp(position, axis=0).max())
        assert nearest.max() < 1e-4 * size, f"{item.name}: something is {nearest.max():.3g} m off its target"
        # On a sharp edge the nearest face may be the other one, at a right angle.
        inside = outward < -0.1
        assert np.mean(inside) < 0.01, f"{item.name}: {np.mean(inside):.1%} stand inside"
        farthest = max(farthest, float(nearest.max()))
        assert report.overlaps <= 0.01 * count, f"{item.name}: {report.overlaps} pairs of footprints overlap"
    return {"placed": total, "overlaps": overlaps, "farthest_from_target": farthest}


def main(arguments: list[str] | None = None) -> None:
    """Run a scene from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", choices=SCENES)
    parser.add_argument("--output", type=Path, default=Path("output"), help="folder for the picture and the .blend")
    parser.add_argument("--width", type=int, default=1200, help="width of the picture in pixels (3:2)")
    parser.add_argument("--samples", type=int, default=48, help="Cycles samples per pixel")
    parser.add_argument("--device", default="auto", help="where things are placed: auto, cpu or cuda:0")
    parser.add_argument("--quick", action="store_true", help="a tiny picture of few samples, to try the scene out")
    options = parser.parse_args(arguments)
    if options.quick:
        options.width, options.samples = 192, 2
    options.output.mkdir(parents=True, exist_ok=True)
    start = time.perf_counter()
    scattered = build(options.scene, options.device)
    for one in scattered:
        print(one.result.report, flush=True)
    print(f"[{time.perf_counter() - start:5.1f} s] built", flush=True)
    try:
        measured = test_final(scattered)
    except AssertionError as error:
        sys.exit(f"The {options.scene} is not as it should be: {error}")
    scene = bpy.context.scene
    set_render(scene, options.width, options.width * 2 // 3, options.samples, SEED)
    picture = options.output / f"{options.scene}.png"
    scene.render.filepath = str(picture.resolve())
    bpy.ops.render.render(write_still=True)
    save(options.output / f"{options.scene}.blend")
    for key, value in measured.items():
        print(f"{key}: {value:.4g}")
    print(f"[{time.perf_counter() - start:5.1f} s] wrote {picture}; all checks passed")


if __name__ == "__main__":
    main(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else None)
