"""A summer meadow: a path winds through it, flowers stand in drifts, each kind of its own, and grass where the camera sees it.

    python demo_scenes/meadow.py --output output

The path is a curve, and an obstacle as wide as it is: nothing grows on it. Poppies and cornflowers come in clumps (``clustering``),
buttercups in patches of noise, daisies along the path. Grass grows where the camera sees it, in two sizes; flowers and grass make room
for each other.
"""

from __future__ import annotations

import math

import bpy
import esh
import materials
import numpy as np
import surface_shapes as shapes
import trees
from gallery_parts import Built, add, check_counts, run, seen, variants
from scene_parts import add_camera, collection, mesh_object
from shader_nodes import Color, add_bump, add_node, attribute, calculate, color_ramp, mix_colors, new_material, noise
from shader_nodes import per_instance as random_of

__all__ = ["build", "main", "test_final"]

SEED = 21
# The meadow [m]: half of its width, and where it begins and ends.
WIDE, NEAR, FAR = 17.0, -5.0, 32.0
PATH_WIDTH = 1.25
# The path's way through the meadow: x, y [m].
PATH = (
    (-0.6, -5.6),
    (-0.2, -2.5),
    (1.2, 1.0),
    (2.4, 5.0),
    (0.6, 9.5),
    (-3.4, 13.5),
    (-4.0, 18.0),
    (0.5, 22.5),
    (3.4, 27.0),
    (3.6, 33.0),
)
# Name -> small and large: count, height [m], ground that one takes [m²].
GRASS = {"short": (5200, 0.26, 0.030), "tall": (1500, 0.50, 0.045)}
# Name -> count, height [m], ground that one takes [m²].
FLOWERS = {
    "poppy": (420, 0.50, 0.018),
    "cornflower": (360, 0.46, 0.014),
    "buttercup": (420, 0.36, 0.012),
    "daisy": (520, 0.24, 0.010),
}
TREE = (6.9, 27.5)
STEM, PETAL, HEART = range(3)


def path_points(count: int = 210) -> np.ndarray:
    """Points along the middle of the path, shape ``[count, 2]`` [m]: a smooth way through :data:`PATH`."""
    given = np.array(PATH)
    step = np.arange(len(given) - 3)[:, None, None]
    share = np.linspace(0.0, 1.0, count // len(step))[:, None]
    a, b, c, d = (given[step[:, 0, 0] + k][:, None] for k in range(4))
    # Catmull and Rom's spline, which goes through all points; the first and the last only bend it.
    way = 0.5 * (
        2.0 * b
        + (c - a) * share
        + (2.0 * a - 5.0 * b + 4.0 * c - d) * share**2
        + (3.0 * b - a - 3.0 * c + d) * share**3
    )
    return way.reshape(-1, 2)


def distance_to_path(place: np.ndarray) -> np.ndarray:
    """How far points ``[n, 2]`` are from the middle of the path [m], shape ``[n]``."""
    way = path_points()
    start, along = way[:-1], np.diff(way, axis=0)
    length = np.maximum((along**2).sum(axis=1), 1e-12)
    nearest = np.full(len(place), np.inf)
    for first in range(0, len(place), 4096):
        to = place[first : first + 4096, None] - start
        share = np.clip((to * along).sum(axis=2) / length, 0.0, 1.0)
        nearest[first : first + 4096] = np.hypot(*np.moveaxis(to - share[..., None] * along, 2, 0)).min(axis=1)
    return nearest


def ground_height(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Height of the ground [m]: a slope that rises to a crest."""
    place = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    rise = np.clip((y - 1.0) / 30.0, 0.0, 1.2)
    swell = (0.32 * shapes.waves(place, 13.0, 3, 2) + 0.05 * shapes.waves(place, 2.5, 4, 2)).reshape(x.shape)
    return 3.4 * rise**1.35 + swell + 0.012 * x


def _leaf(
    root: np.ndarray, way: np.ndarray, side: np.ndarray, length: np.ndarray, half: np.ndarray, bow: np.ndarray
) -> shapes.Shape:
    """Blades of grass: from their roots ``[n, 3]`` up, and over in a bow towards ``way``, of three quads each."""
    rows = []
    for share, width in ((0.0, 1.0), (0.4, 0.95), (0.75, 0.62), (1.0, 0.06)):
        middle = root + length * share * (np.array([0.0, 0.0, 1.0]) * (1.0 - 0.35 * bow * share) + way * bow * share)
        rows += [middle - half * width * side, middle + half * width * side]
    vertex = np.stack(rows, axis=1)
    count = len(root)
    face = np.array([(0, 1, 3, 2), (2, 3, 5, 4), (4, 5, 7, 6)])
    return vertex.reshape(-1, 3), (8 * np.arange(count)[:, None, None] + face).reshape(-1, 4)


def tuft(height: float, blades: int, seed: int) -> tuple[shapes.Shape, np.ndarray]:
    """A tuft of grass that stands on the ground; all of its faces are stems."""
    random = np.random.default_rng(seed)
    angle = random.uniform(0.0, 2.0 * np.pi, (blades, 1))
    way = np.concatenate([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    side = np.concatenate([-way[:, 1:2], way[:, :1], np.zeros_like(angle)], axis=1)
    root = 0.34 * height * np.sqrt(random.random((blades, 1))) * way[random.permutation(blades)] - (0.0, 0.0, 0.02)
    length = height * random.uniform(0.55, 1.1, (blades, 1))
    half = random.uniform(0.0022, 0.0042, (blades, 1))
    shape = _leaf(root, way, side, length, half, random.uniform(0.12, 0.75, (blades, 1)))
    return shape, np.full(len(shape[1]), STEM)


def _petals(middle: np.ndarray, reach: float, count: int, width: float, lift: float, turn: float) -> shapes.Shape:
    """Petals about a point: quads from a narrow foot to a wide end, bent upwards by ``lift`` and back a little."""
    angle = turn + np.arange(count) * 2.0 * np.pi / count
    out = np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=1)
    side = np.stack([-out[:, 1], out[:, 0], np.zeros(count)], axis=1)
    rows = []
    for share, wide, up in ((0.08, 0.2, 0.0), (0.5, 0.9, 0.75), (0.85, 1.0, 1.0), (1.0, 0.55, 0.92)):
        place = middle + reach * (share * math.cos(0.6 * lift) * out + np.array([0.0, 0.0, up * math.sin(lift)]))
        rows += [place - 0.5 * reach * width * wide * side, place + 0.5 * reach * width * wide * side]
    vertex = np.stack(rows, axis=1)
    face = np.array([(0, 1, 3, 2), (2, 3, 5, 4), (4, 5, 7, 6)])
    return vertex.reshape(-1, 3), (8 * np.arange(count)[:, None, None] + face).reshape(-1, 4)


def _heart(middle: np.ndarray, radius: float, flat: float) -> shapes.Shape:
    vertex, face = shapes.lathe(np.array([(0.0, -0.5), (0.8, -0.3), (1.0, 0.1), (0.7, 0.7), (0.0, 1.0)]), 8)
    return vertex * (radius, radius, radius * flat) + middle, face


def flower(kind: str, height: float, seed: int) -> tuple[shapes.Shape, np.ndarray]:
    """A plant of some flowers on bent stems, with leaves at its foot; and what each face is: stem, petal or heart."""
    random = np.random.default_rng(seed)
    pieces: list[tuple[shapes.Shape, int]] = []
    stems = {"poppy": 3, "cornflower": 3, "buttercup": 5, "daisy": 4}[kind]
    for _ in range(stems):
        angle, tall = random.uniform(0.0, 2.0 * np.pi), height * random.uniform(0.72, 1.08)
        lean = 0.28 * tall * random.random() ** 0.5
        share = np.linspace(0.0, 1.0, 6)[:, None]
        out = np.array([[math.cos(angle), math.sin(angle), 0.0]])
        path = share * (0.0, 0.0, tall) + lean * share**1.7 * out - (0.0, 0.0, 0.02)
        turn = np.arange(4) * np.pi / 2.0
        ring = 0.0021 * np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=1)
        pieces.append((((path[:, None] + ring).reshape(-1, 3), shapes.grid_faces(6, 4, round_columns=True)), STEM))
        top, at = path[-1], random.uniform(0.0, 6.3)
        if kind == "poppy":
            reach = random.uniform(0.046, 0.060)
            pieces.append((_petals(top, reach, 4, 1.5, random.uniform(0.5, 0.95), at), PETAL))
            pieces.append(
                (_petals(top + (0, 0, 0.003), 0.92 * reach, 4, 1.4, random.uniform(0.6, 1.0), at + 0.8), PETAL)
            )
            pieces.append((_heart(top + (0.0, 0.0, 0.008), 0.009, 1.2), HEART))
        elif kind == "cornflower":
            for petals, reach, lift in ((9, 0.036, 0.35), (8, 0.028, 0.75), (6, 0.018, 1.1)):
                pieces.append((_petals(top, reach, petals, 0.5, lift, at + petals), PETAL))
            pieces.append((_heart(top - (0.0, 0.0, 0.008), 0.008, 1.4), HEART))
        elif kind == "buttercup":
            pieces.append((_petals(top, random.uniform(0.024, 0.030), 5, 1.25, random.uniform(0.4, 0.7), at), PETAL))
            pieces.append((_heart(top + (0.0, 0.0, 0.002), 0.006, 0.9), HEART))
        else:
            pieces.append((_petals(top, random.uniform(0.030, 0.036), 15, 0.36, random.uniform(0.0, 0.25), at), PETAL))
            pieces.append((_heart(top, 0.0105, 0.7), HEART))
    leaves, _ = tuft(0.45 * height, 12, seed + 7)
    pieces.append((leaves, STEM))
    shape = shapes.joined([piece for piece, _ in pieces])
    return shape, np.concatenate([np.full(len(piece[1]), part) for piece, part in pieces])


def thin(
    name: str, stops: list[tuple[float, Color]], through: float, *, tall: float = 0.0, roughness: float = 0.6
) -> bpy.types.Material:
    """What light shines through: blades and petals. Each instance has its own of some colors; ``tall`` darkens the foot [m]."""
    material, tree = new_material(name)
    color = color_ramp(tree, random_of(tree), stops)
    patch = color_ramp(tree, noise(tree, 6.0, 2.0), [(0.3, (0.80, 0.86, 0.8)), (0.7, (1.16, 1.1, 1.0))])
    color = mix_colors(tree, 1.0, color, patch, "MULTIPLY")
    if tall:
        split = add_node(tree, "ShaderNodeSeparateXYZ")
        tree.links.new(add_node(tree, "ShaderNodeTexCoord").outputs["Object"], split.inputs[0])
        up = calculate(tree, "DIVIDE", split.outputs[2], tall)
        color = mix_colors(
            tree, 1.0, color, color_ramp(tree, up, [(0.0, (0.35, 0.42, 0.35)), (1.0, (1.35, 1.25, 1.05))]), "MULTIPLY"
        )
    surface = add_node(tree, "ShaderNodeBsdfPrincipled")
    tree.links.new(color, surface.inputs["Base Color"])
    surface.inputs["Roughness"].default_value = roughness
    surface.inputs["Specular IOR Level"].default_value = 0.2
    glow = add_node(tree, "ShaderNodeBsdfTranslucent")
    tree.links.new(color, glow.inputs["Color"])
    mix = add_node(tree, "ShaderNodeMixShader")
    mix.inputs[0].default_value = through
    tree.links.new(surface.outputs[0], mix.inputs[1])
    tree.links.new(glow.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], add_node(tree, "ShaderNodeOutputMaterial").inputs["Surface"])
    return material


def ground_material() -> bpy.types.Material:
    """Earth and old grass; on the path trodden sand and pebbles."""
    material, tree = new_material("Ground")
    earth = color_ramp(tree, noise(tree, 0.5, 6.0), [(0.3, (0.055, 0.075, 0.02)), (0.7, (0.13, 0.15, 0.045))])
    grit = noise(tree, 0.035, 5.0)
    sand = color_ramp(tree, grit, [(0.3, (0.13, 0.095, 0.06)), (0.5, (0.25, 0.19, 0.125)), (0.7, (0.38, 0.31, 0.22))])
    worn = calculate(
        tree, "ADD", attribute(tree, "path"), calculate(tree, "MULTIPLY_ADD", noise(tree, 0.4, 5.0), 0.5, -0.25)
    )
    share = color_ramp(tree, worn, [(0.42, (0.0,) * 3), (0.58, (1.0,) * 3)])
    surface = add_node(tree, "ShaderNodeBsdfPrincipled")
    tree.links.new(mix_colors(tree, share, earth, sand), surface.inputs["Base Color"])
    surface.inputs["Roughness"].default_value = 0.95
    add_bump(tree, surface, grit, 0.02, 0.8)
    tree.links.new(surface.outputs[0], add_node(tree, "ShaderNodeOutputMaterial").inputs["Surface"])
    return material


def _add_ground(step: float) -> bpy.types.Object:
    x, y = np.meshgrid(np.arange(-WIDE, WIDE + step, step), np.arange(NEAR, FAR + step, step))
    away = distance_to_path(np.stack([x.ravel(), y.ravel()], axis=1)).reshape(x.shape)
    height = ground_height(x, y) - 0.06 * np.clip(1.0 - away / (0.5 * PATH_WIDTH), 0.0, 1.0) ** 0.5
    shape = shapes.grid(x, y, height)
    ground = add("Meadow", shape, ground_material())
    worn = ground.data.attributes.new("path", "FLOAT", "POINT")
    worn.data.foreach_set("value", np.clip(1.5 - 2.0 * away / PATH_WIDTH, 0.0, 1.0).ravel().astype(np.float32))
    return ground


def _add_path() -> bpy.types.Object:
    """The path as a curve, along the middle of what is trodden."""
    way = path_points()
    data = bpy.data.curves.new("Path", "CURVE")
    data.dimensions = "3D"
    line = data.splines.new("POLY")
    line.points.add(len(way) - 1)
    height = ground_height(way[:, 0], way[:, 1])
    line.points.foreach_set("co", np.column_stack([way, height, np.ones(len(way))]).ravel().astype(np.float32))
    item = bpy.data.objects.new("Path", data)
    item.hide_render = True
    bpy.context.scene.collection.objects.link(item)
    return item


def _tree(name: str, made: trees.TreeMesh, *surfaces: bpy.types.Material) -> bpy.types.Object:
    item = mesh_object(name, made.vertex, made.face)
    for material in surfaces:
        item.data.materials.append(material)
    item.data.polygons.foreach_set("material_index", made.material.astype(np.int32))
    item.data.attributes.new("tint", "FLOAT", "FACE").data.foreach_set("value", made.tint.astype(np.float32))
    return item


def _add_far_hills(quick: bool) -> tuple[bpy.types.Object, list[bpy.types.Object]]:
    """Add hills behind the crest; return the wooded one and kinds of trees for it."""
    hills = []
    for number, (away, tall, color) in enumerate(
        ((70.0, 9.0, (0.075, 0.105, 0.03)), (190.0, 34.0, (0.07, 0.10, 0.05)))
    ):
        x, y = np.meshgrid(np.linspace(-3.2 * away, 3.2 * away, 97), np.linspace(0.55 * away, 1.9 * away, 41))
        place = np.stack([x, y, 0.0 * x], axis=-1).reshape(-1, 3)
        ridge = np.exp(-(((y - 1.25 * away) / (0.36 * away)) ** 2))
        height = tall * ridge * (0.75 + 0.35 * shapes.waves(place, 1.5 * away, 30 + number, 3).reshape(x.shape)) - 2.0
        grass = materials.foliage(f"Far Hill {number + 1}", [(0.0, color), (1.0, color)], 0.8, 0.0)
        hills.append(
            add(
                f"Far Hill {number + 1}",
                shapes.grid(x, y, height),
                grass,
            )
        )
    bark = materials.bark("Bark", (0.06, 0.045, 0.035), (0.16, 0.13, 0.10))
    leaves = materials.foliage(
        "Leaves", [(0.0, (0.07, 0.13, 0.025)), (0.5, (0.12, 0.19, 0.035)), (1.0, (0.20, 0.24, 0.05))], 0.4, 0.35
    )
    holder = collection("Trees", bpy.context.scene.collection, hidden=True)
    kinds = []
    for number in range(3):
        kinds.append(
            _tree(
                f"Tree {number + 1}",
                trees.beech(7.5 + number, 3.2, 9, 300 if quick else 1800, 40 + number),
                bark,
                leaves,
            )
        )
        holder.objects.link(kinds[-1])
    lone = _tree("Lone Tree", trees.beech(8.6, 4.3, 14, 500 if quick else 9000, 77), bark, leaves)
    lone.location = (*TREE, float(ground_height(np.array(TREE[0]), np.array(TREE[1]))))
    bpy.context.scene.collection.objects.link(lone)
    return hills[0], kinds


def _plants(quick: bool) -> tuple[dict[str, bpy.types.Collection], dict[str, bpy.types.Collection]]:
    """Make variants of all grass and flowers, by what they are called."""
    blade = thin(
        "Grass",
        [
            (0.0, (0.075, 0.15, 0.022)),
            (0.5, (0.13, 0.21, 0.032)),
            (0.85, (0.22, 0.26, 0.05)),
            (1.0, (0.36, 0.32, 0.11)),
        ],
        0.45,
        tall=0.4,
    )
    stem = thin("Stems", [(0.0, (0.07, 0.13, 0.03)), (1.0, (0.12, 0.19, 0.05))], 0.35)
    petals = {
        "poppy": (thin("Poppy", [(0.0, (0.72, 0.025, 0.012)), (1.0, (0.85, 0.09, 0.02))], 0.5), (0.012, 0.010, 0.012)),
        "cornflower": (
            thin("Cornflower", [(0.0, (0.07, 0.09, 0.58)), (1.0, (0.16, 0.20, 0.78))], 0.3),
            (0.05, 0.03, 0.12),
        ),
        "buttercup": (
            thin("Buttercup", [(0.0, (0.90, 0.56, 0.01)), (1.0, (0.95, 0.70, 0.03))], 0.3, roughness=0.3),
            (0.55, 0.40, 0.03),
        ),
        "daisy": (thin("Daisy", [(0.0, (0.80, 0.79, 0.76)), (1.0, (0.90, 0.86, 0.86))], 0.3), (0.80, 0.46, 0.02)),
    }
    grass = {
        name: variants(f"Grass {name}", [(tuft(height, 24 if quick else 64, 10 * k)) for k in range(5)], blade)
        for name, (_, height, _) in GRASS.items()
    }
    flowers = {
        kind: variants(
            kind.title(),
            [flower(kind, height, 30 * k) for k in range(4)],
            stem,
            petals[kind][0],
            thin(f"{kind} heart", [(0.0, petals[kind][1]), (1.0, petals[kind][1])], 0.0),
        )
        for kind, (_, height, _) in FLOWERS.items()
    }
    return grass, flowers


def _woods(hill: bpy.types.Object, share: float, device: str, quick: bool) -> esh.ScatterResult:
    """Scatter trees on a hill that is far away."""
    woods = esh.scatter(
        hill,
        [
            esh.ScatterClass(
                "tree",
                [esh.ScatterSize("any", round(share * 420), bpy.data.collections["Trees"], area=26.0, line=False)],
                density=esh.NoiseDensity(scale=55.0, cover=0.5, seed=6),
            )
        ],
        align_to_normal=0.0,
        scale_jitter=0.25,
        seed=SEED,
        device=device,
        max_steps=20 if quick else 60,
        name="Woods",
    )
    return woods


def build(device: str = "auto", quick: bool = False) -> Built:
    """Build the meadow in an empty file."""
    scene = bpy.context.scene
    ground, path = _add_ground(0.5 if quick else 0.14), _add_path()
    hill, _ = _add_far_hills(quick)
    grass, flowers = _plants(quick)
    eye = (-0.35, -5.6, float(ground_height(np.array(-0.35), np.array(-5.6))) + 1.28)
    scene.camera = add_camera(scene, "Camera", eye, (0.55, 12.0, 1.75), lens=30.0, clip_end=1000.0)
    bpy.context.view_layer.update()
    # The fewer, the farther apart: clumps are to be seen all the same.
    share, clump = (0.2, 4.0) if quick else (1.0, 1.6)

    # begin: scatter
    seen_by_camera = esh.CameraDensity(scene.camera, margin=0.06, distance=9.0, falloff=32.0)
    where = {
        "poppy": esh.NoiseDensity(scale=7.0, cover=0.5, seed=4),
        "cornflower": esh.NoiseDensity(scale=6.0, cover=0.45, seed=9),
        "buttercup": esh.NoiseDensity(scale=5.0, cover=0.4, seed=2),
        "daisy": esh.DistanceDensity(path, near=0.9, far=2.8),
    }
    classes = [
        esh.ScatterClass(
            "grass",
            [
                esh.ScatterSize(name, round(share * n), grass[name], area=area, line=False)
                for name, (n, _, area) in GRASS.items()
            ],
            density=seen_by_camera,
        )
    ]
    classes += [
        esh.ScatterClass(
            kind,
            [esh.ScatterSize("plant", round(share * n), flowers[kind], area=area, line=False)],
            density=esh.DensityStack([esh.DensityLayer(seen_by_camera), esh.DensityLayer(where[kind])]),
            clustering=0.9,
            clump_size=clump,
        )
        for kind, (n, _, area) in FLOWERS.items()
    ]
    result = esh.scatter(
        ground,
        classes,
        obstacles=[esh.ScatterObstacle(path, width=PATH_WIDTH, margin=0.02)],
        class_separation=0.3,
        align_to_normal=0.3,
        tilt=0.15,
        scale_jitter=0.3,
        seed=SEED,
        device=device,
        max_steps=20 if quick else 60,
        name="Meadow Plants",
    )
    # end: scatter
    woods = _woods(hill, share, device, quick)
    materials.set_sky(scene, math.radians(33.0), math.radians(-98.0))
    scene.view_settings.exposure = 0.75
    return Built([result, woods], {"clump": clump})


def test_final(built: Built) -> dict[str, float]:
    """Check the meadow: exact counts, nothing on the path, everything on the ground, flowers in clumps and grass evenly.

    Raises:
        AssertionError: Something is not as it should be; the message says what.
    """
    total = check_counts(built)
    result = built.results[0]
    place = seen(result)[:, :3, 3]
    away = distance_to_path(place[:, :2])
    assert away.min() > 0.5 * PATH_WIDTH, f"something grows {0.5 * PATH_WIDTH - away.min():.2f} m within the path"
    above = place[:, 2] - ground_height(place[:, 0], place[:, 1])
    assert np.abs(above).max() < 0.12, f"a plant is {np.abs(above).max():.2f} m off the ground"
    measured = {"placed": total, "closest to the path": away.min(), "overlaps": result.report.overlaps}
    position, index = result.instances.position[:, :2], result.placement.class_index
    names = [c.name for c in result.placement.problem.classes]
    grass = position[index == names.index("grass")]
    near = 0.45 * built.more["clump"]
    for kind in FLOWERS:
        own = position[index == names.index(kind)]
        measured[f"{kind}, clumps"] = clumped = (
            _neighbors(own, own, near) / len(own) / (_neighbors(own, grass, near) / len(grass))
        )
        assert clumped > 1.5, f"{kind} has {clumped:.2f} times the neighbors that it would have if it grew like grass"
    return measured


def _neighbors(place: np.ndarray, others: np.ndarray, within: float) -> float:
    """How many of other points ``[m, 2]`` points ``[n, 2]`` have within a distance [m] on average, themselves left out."""
    away = np.hypot(*np.moveaxis(place[:, None] - others, 2, 0))
    return float(((away > 0.0) & (away < within)).sum() / len(place))


def main(arguments: list[str] | None = None) -> None:
    """Run the scene from the command line."""
    run("meadow", __doc__.splitlines()[0], build, test_final, seed=SEED, arguments=arguments)


if __name__ == "__main__":
    main()
