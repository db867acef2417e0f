"""Four pizzas, each from one density texture per ingredient to rendered pictures, by one command.

    python demo_scenes/pizza.py --output output

1. The pizza without toppings: dough, sauce and cheese (``pizza_base.py``).
2. Ingredients by code (``toppings.py``): ham, mushrooms and salami of three sizes, chillies and anchovies, which are long,
   of two; four shape variants of each size.
3. One density texture per ingredient and pizza (``pizza_textures.py``), black near the crust.
4. One call of ``esh.scatter`` for each pizza places all of its ingredients at once, without overlap.
5. Every pizza from above with the densities asked for in its corner, ``pizza-plans.png``; all of them on the table,
   ``pizza.png``; ``pizza.blend``; the reports; the scene's own checks.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import bpy
import esh
import numpy as np
import pizza_base as base
import pizza_materials as materials
import toppings
from PIL import Image, ImageDraw, ImageFilter, ImageFont
from pizza_textures import MENU, PIXELS, Pizza, draw
from scene_parts import add_camera, collection, mesh_object, save, save_textures, set_render

__all__ = ["build", "main", "test_final"]

SEED = 5
VARIANTS = 4
# Ingredient -> size -> radius of a piece, or length of a long one [m].
SIZES = {
    "ham": {"large": 0.0235, "medium": 0.0190, "small": 0.0145},
    "mushroom": {"large": 0.0175, "medium": 0.0145, "small": 0.0115},
    "salami": {"large": 0.0185, "medium": 0.0145, "small": 0.0105},
    "chilli": {"large": 0.0560, "small": 0.0420},
    "anchovy": {"large": 0.0560, "small": 0.0430},
}
MODELS = {
    "ham": toppings.ham,
    "mushroom": toppings.mushroom,
    "salami": toppings.salami,
    "chilli": toppings.chilli,
    "anchovy": toppings.anchovy,
}
LONG = ("chilli", "anchovy")
# In the pictures of the densities.
COLORS = {
    "ham": (0.93, 0.52, 0.55),
    "mushroom": (0.58, 0.47, 0.30),
    "salami": (0.62, 0.07, 0.10),
    "chilli": (0.95, 0.55, 0.05),
    "anchovy": (0.16, 0.35, 0.62),
}
# Half the side of the square that a bed covers, and what two pieces keep between them [m].
HALF = base.BED_RADIUS + 0.006
GAP = 0.0008
# Between the middles of two pizzas [m].
APART = 0.40
BOARD = 0.02
EXPOSURE = -0.4


@dataclass(frozen=True)
class Serving:
    """One pizza of the scene: what was asked for, and what came out."""

    pizza: Pizza
    place: tuple[float, float]
    densities: dict[str, np.ndarray]
    result: esh.ScatterResult


@dataclass(frozen=True)
class Ingredient:
    """One size of an ingredient: its variants, the area that they take, and the body if they are long."""

    source: bpy.types.Collection
    area: float
    reach: float
    axis: float | None = None
    width: float | None = None


def piece_object(name: str, piece: toppings.Piece, surfaces: list[bpy.types.Material]) -> bpy.types.Object:
    """Make an object of a modeled piece with its values as attributes of the points."""
    item = mesh_object(name, piece.vertex, piece.face, smooth=True)
    for material in surfaces:
        item.data.materials.append(material)
    if piece.material is not None:
        item.data.polygons.foreach_set("material_index", piece.material.astype(np.int32))
    for key, value in piece.values.items():
        item.data.attributes.new(key, "FLOAT", "POINT").data.foreach_set("value", value.astype(np.float32))
    return item


def capsule_around(point: np.ndarray) -> tuple[float, float]:
    """Axis and width of the smallest capsule along x that holds points ``[n, 2]`` [m]; the origin is its middle."""
    x, y = np.abs(point).T
    best = (math.inf, 0.0, 0.0)
    for half in np.max(y) * np.linspace(1.0, 1.6, 25):
        axis = 2.0 * max(float((x - np.sqrt(half**2 - y**2)).max()), 0.1 * half)
        best = min(best, (2.0 * half * axis + math.pi * half**2, axis, 2.0 * half))
    return best[1:]


def model_ingredients(scene: bpy.types.Scene) -> dict[tuple[str, str], Ingredient]:
    """Model every size of every ingredient in :data:`VARIANTS` shapes, one collection for each size.

    The footprint that a size asks for holds all of each variant: the circle around it, or a capsule around a long one.
    """
    surfaces = {kind: [getattr(materials, kind)()] for kind in SIZES}
    surfaces["chilli"].append(materials.calyx())
    library = collection("Ingredients", scene.collection)
    library.hide_render = True
    made = {}
    for kind, sizes in SIZES.items():
        for number, (size, length) in enumerate(sizes.items()):
            members = collection(f"{kind} {size}", library)
            pieces = [MODELS[kind](length, 100 * number + variant) for variant in range(VARIANTS)]
            items = []
            for variant, piece in enumerate(pieces):
                item = piece_object(f"{kind} {size} {variant + 1}", piece, surfaces[kind])
                members.objects.link(item)
                items.append(item)
            bpy.context.view_layer.update()
            if kind not in LONG:
                reach = max(toppings.enclosing_circle(piece.vertex[:, :2])[1] for piece in pieces)
                made[kind, size] = Ingredient(members, math.pi * (reach + 0.5 * GAP) ** 2, reach)
                continue
            shapes = []
            for item, piece in zip(items, pieces, strict=True):
                outline = esh.measure_footprint(item, key=item.name)
                c, s = math.cos(outline.angle), math.sin(outline.angle)
                shapes.append(capsule_around((piece.vertex[:, :2] - outline.center) @ [[c, -s], [s, c]]))
            axis, width = (max(values) for values in zip(*shapes, strict=True))
            width += GAP
            area = axis * width + 0.25 * math.pi * width**2
            made[kind, size] = Ingredient(members, area, 0.5 * (axis + width), axis, width)
    return made


def densities(pizza: Pizza, ingredients: dict[tuple[str, str], Ingredient]) -> dict[str, np.ndarray]:
    """Draw the textures of a pizza, black wherever a piece of the ingredient would reach the crust."""
    drawn = {}
    for kind, topping in pizza.toppings.items():
        reach = max(ingredients[kind, size].reach for size in SIZES[kind])
        room = (base.BED_RADIUS - reach) / base.BED_RADIUS
        image = draw(topping.density, HALF, base.BED_RADIUS)
        inside = draw(np.hypot, HALF, base.BED_RADIUS) < room - 2.0 * HALF / PIXELS / base.BED_RADIUS
        drawn[kind] = np.where(inside, image / image[inside].max(), 0.0)
    return drawn


def serve(
    number: int,
    place: tuple[float, float],
    scene: bpy.types.Scene,
    ingredients: dict[tuple[str, str], Ingredient],
    surfaces: dict[str, bpy.types.Material],
    output: Path,
    max_steps: int,
) -> Serving:
    """Bake one pizza of the menu: its base, its textures as files, its ingredients scattered."""
    pizza = MENU[number]
    parts = {
        "Board": piece_object(f"Board {number + 1}", base.board(0.178, BOARD, number), [surfaces["board"]]),
        "Crust": piece_object(f"Crust {number + 1}", base.dough(10 * number + SEED), [surfaces["dough"]]),
        "Bed": piece_object(f"Bed {number + 1}", base.bed(10 * number + SEED), [surfaces["bed"]]),
    }
    parts["Board"].rotation_euler[2] = 0.4 + 0.9 * number
    for item in parts.values():
        item.location = (*place, 0.0)
        scene.collection.objects.link(item)
    # What was just linked is in the view layer only from now on.
    bpy.context.view_layer.update()
    wanted = densities(pizza, ingredients)
    images = save_textures({f"pizza-{number + 1}-{kind}": image for kind, image in wanted.items()}, output)
    # begin: scatter
    classes = []
    for kind, topping in pizza.toppings.items():
        direction = topping.direction
        if callable(direction):
            direction = draw(direction, HALF, base.BED_RADIUS)
        sizes = []
        for size, count in zip(SIZES[kind], topping.counts, strict=True):
            own = ingredients[kind, size]
            # Stiff: pieces are turned along the direction, but never drawn out.
            line = own.axis and esh.Line(own.axis, direction, width=own.width, stretch_weights=(0.0, 0.1))
            sizes.append(esh.ScatterSize(size, count, own.source, area=own.area, line=line or False))
        density = esh.ImageDensity(images[f"pizza-{number + 1}-{kind}"])
        classes.append(esh.ScatterClass(kind, sizes, density=density, color=COLORS[kind]))
    result = esh.scatter(
        parts["Bed"],
        classes,
        seed=SEED + number,
        max_steps=max_steps,
        align_to_normal=0.08,
        name=f"Toppings {number + 1}",
    )
    # end: scatter
    return Serving(pizza, place, wanted, result)


def add_garnish(scene: bpy.types.Scene) -> None:
    """Leave some ingredients on the table in front, by hand: name, x, y [m], turn [rad]."""
    for name, x, y, turn in (
        ("chilli large 2", -0.450, -0.185, 0.4),
        ("chilli large 3", -0.435, -0.170, 1.2),
        ("chilli small 1", -0.428, -0.213, -0.3),
        ("mushroom large 1", -0.105, -0.428, 0.5),
        ("mushroom large 3", -0.140, -0.446, 2.1),
    ):
        item = bpy.data.objects.new("Garnish", bpy.data.objects[name].data)
        item.location, item.rotation_euler[2] = (x, y, 0.001 - BOARD), turn
        scene.collection.objects.link(item)


def build(output: Path, max_steps: int = 200) -> list[Serving]:
    """Build the whole scene in an empty file.

    Args:
        output: Existing folder for the density textures.
        max_steps: Of the sampler.
    """
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    scene.unit_settings.system = "METRIC"
    ingredients = model_ingredients(scene)
    surfaces = {
        "dough": materials.dough(),
        "bed": materials.bed(),
        "board": materials.wood("Board", (0.19, 0.085, 0.032), (0.46, 0.26, 0.115)),
    }
    table = mesh_object(
        "Table",
        np.array([(-3, -3, -BOARD), (3, -3, -BOARD), (3, 3, -BOARD), (-3, 3, -BOARD)]),
        np.array([(0, 1, 2, 3)]),
    )
    table.data.materials.append(materials.wood("Table", (0.016, 0.008, 0.005), (0.085, 0.046, 0.026), plank=0.145))
    scene.collection.objects.link(table)
    servings = []
    for number in range(len(MENU)):
        place = ((number % 2 - 0.5) * APART, (0.5 - number // 2) * APART)
        servings.append(serve(number, place, scene, ingredients, surfaces, output, max_steps))
    for layer in scene.view_layers[0].layer_collection.children:
        if layer.name == "Ingredients":
            layer.exclude = True
    add_garnish(scene)
    materials.set_light(scene)
    return servings


def render_plans(servings: list[Serving], side: int, output: Path) -> None:
    """Render every pizza from above, ``side`` pixels wide, and join them with their densities to ``pizza-plans.png``."""
    scene = bpy.context.scene
    scene.render.resolution_x = scene.render.resolution_y = side
    pictures = []
    for number, serving in enumerate(servings):
        x, y = serving.place
        lens = 90.0
        height = 0.385 * lens / 36.0
        scene.camera = add_camera(scene, f"Above {number + 1}", (x, y, height), (x, y, 0.0), lens=lens)
        path = output / f"pizza-{number + 1}.png"
        scene.render.filepath = str(path.resolve())
        bpy.ops.render.render(write_still=True)
        picture = Image.open(path).convert("RGB")
        add_inset(picture, serving)
        picture.save(path)
        pictures.append(picture)
    sheet_of(pictures).save(output / "pizza-plans.png")


def density_picture(wanted: dict[str, np.ndarray], charges: dict[str, float], side: int) -> Image.Image:
    """Draw densities as a disc of dots in the ingredients' colors on white.

    Dots, and no mixture: two mixed colors look like a third ingredient.

    Args:
        wanted: Densities by ingredient.
        charges: Area of all pieces of each ingredient [m²]: what the densities, which have no scale, add up to.
        side: Width of the disc [pixels].
    """
    cells = 56
    at = ((np.arange(cells) + 0.5) / cells * PIXELS).astype(int)
    share = np.stack([charges[kind] * image[np.ix_(at, at)] / image.sum() for kind, image in wanted.items()])
    upper = np.cumsum(share, axis=0) / share.sum(axis=0).max()
    row, column = np.indices((cells, cells))
    # Thresholds of a low-discrepancy lattice: neighbors differ much.
    threshold = (0.7548776662 * column + 0.5698402910 * row) % 1.0
    color = np.array([*(COLORS[kind] for kind in wanted), (1.0, 1.0, 1.0)])
    picture = Image.fromarray(np.round(255 * color[(threshold >= upper).sum(axis=0)]).astype(np.uint8))
    picture = picture.resize((4 * side, 4 * side), Image.Resampling.NEAREST)
    disc = Image.new("L", picture.size)
    ImageDraw.Draw(disc).ellipse((0, 0, 4 * side - 1, 4 * side - 1), fill=255)
    picture.putalpha(disc)
    return picture.resize((side, side), Image.Resampling.LANCZOS)


def add_inset(picture: Image.Image, serving: Serving) -> None:
    """Put the densities into the lower right corner of a pizza's picture."""
    side = round(0.205 * picture.width)
    rim = max(side // 40, 1)
    inset = Image.new("RGBA", (side + 2 * rim, side + 2 * rim))
    ring = Image.new("L", (4 * inset.width, 4 * inset.height))
    ImageDraw.Draw(ring).ellipse((0, 0, ring.width - 1, ring.height - 1), fill=255)
    inset.paste((255, 255, 255, 255), (0, 0), ring.resize(inset.size, Image.Resampling.LANCZOS))
    charges = {c.name: sum(s.area * s.placed for s in c.sizes) for c in serving.result.report.classes}
    disc = density_picture(serving.densities, charges, side)
    inset.paste(disc, (rim, rim), disc)
    corner = picture.width - inset.width - round(0.015 * picture.width)
    shadow = Image.new("L", picture.size)
    shadow.paste(inset.getchannel("A").point(lambda a: a * 0.55), (corner, corner + rim))
    shadow = shadow.filter(ImageFilter.GaussianBlur(2.5 * rim))
    picture.paste((0, 0, 0), (0, 0), shadow)
    picture.paste(inset, (corner, corner), inset)


def sheet_of(pictures: list[Image.Image]) -> Image.Image:
    """Join four pictures, with a line below that says which color is which ingredient."""
    side = pictures[0].width
    gap, strip = max(side // 90, 2), max(round(0.07 * side), 12)
    sheet = Image.new("RGB", (2 * side + 3 * gap, 2 * side + 3 * gap + strip), (250, 248, 244))
    for number, picture in enumerate(pictures):
        sheet.paste(picture, (gap + number % 2 * (side + gap), gap + number // 2 * (side + gap)))
    pen = ImageDraw.Draw(sheet)
    font = ImageFont.load_default(size=0.48 * strip)
    x, y = 3 * gap, sheet.height - strip // 2 - gap // 2
    for kind, color in COLORS.items():
        r = 0.22 * strip
        pen.ellipse((x, y - r, x + 2 * r, y + r), fill=tuple(round(255 * c) for c in color))
        x += 3.2 * r
        pen.text((x, y), kind, font=font, fill=(50, 42, 36), anchor="lm")
        x += pen.textlength(kind, font=font) + 0.9 * strip
    return sheet


def render_table(width: int, output: Path) -> None:
    """Render the pizzas at an angle, the nearest in focus."""
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = width, round(width * 10 / 16)
    # Along the table's diagonal: one pizza in front, two beside it, one behind.
    near = np.array([-0.5 * APART, -0.5 * APART, 0.0])
    camera = add_camera(scene, "Table", (-0.62, -0.62, 0.42), (-0.15, -0.15, 0.0), lens=45.0)
    camera.data.dof.use_dof = True
    camera.data.dof.focus_distance = float(np.linalg.norm(np.array(camera.location) - near))
    camera.data.dof.aperture_fstop = 6.3
    scene.camera = camera
    scene.render.filepath = str((output / "pizza.png").resolve())
    bpy.ops.render.render(write_still=True)


def placed_pieces(result: bpy.types.Object) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Read what Blender really instances: of every piece its object's name, vertices ``[n, 3]`` [m] and faces."""
    meshes: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    found = []
    for instance in bpy.context.evaluated_depsgraph_get().object_instances:
        if not instance.is_instance or instance.parent.original != result:
            continue
        name = instance.object.original.name
        if name not in meshes:
            mesh = bpy.data.objects[name].data
            vertex = np.empty(3 * len(mesh.vertices), np.float32)
            mesh.vertices.foreach_get("co", vertex)
            face = np.empty(len(mesh.loops), np.int32)
            mesh.loops.foreach_get("vertex_index", face)
            meshes[name] = vertex.reshape(-1, 3).astype(float), face.reshape(len(mesh.polygons), -1)
        vertex, face = meshes[name]
        matrix = np.array(instance.matrix_world)
        found.append((name, vertex @ matrix[:3, :3].T + matrix[:3, 3], face))
    return found


def overlapping(pieces: list[tuple[str, np.ndarray, np.ndarray]], step: float = 0.0003) -> list[tuple[str, str]]:
    """Find the pairs whose faces, seen from above, share a cell of a grid of ``step`` [m]."""
    low = np.min([vertex[:, :2].min(axis=0) for _, vertex, _ in pieces], axis=0) - step
    high = np.max([vertex[:, :2].max(axis=0) for _, vertex, _ in pieces], axis=0) + step
    columns, rows = np.ceil((high - low) / step).astype(int) + 1
    owner = np.full((rows, columns), -1)
    pairs = set()
    for index, (_, vertex, face) in enumerate(pieces):
        at = (vertex[:, :2] - low) / step
        first = np.floor(at.min(axis=0)).astype(int)
        size = np.ceil(at.max(axis=0)).astype(int) - first + 1
        mask = Image.new("1", tuple(int(n) for n in size))
        pen = ImageDraw.Draw(mask)
        for corner in (at - first)[face].reshape(len(face), -1):
            pen.polygon(corner.tolist(), fill=1)
        window = owner[first[1] : first[1] + size[1], first[0] : first[0] + size[0]]
        own = np.asarray(mask)
        pairs |= {(int(other), index) for other in np.unique(window[own]) if other >= 0}
        window[own] = index
    return [(pieces[i][0], pieces[j][0]) for i, j in sorted(pairs)]


def test_final(servings: list[Serving], blend: Path) -> dict[str, float]:
    """Check the finished pizzas; the scene is read back from ``blend``, so nothing counts that was not saved.

    Returns:
        What was measured, by name.

    Raises:
        AssertionError: Something is not as it should be; the message says what.
    """
    names = [serving.result.object.name for serving in servings]
    reports = [serving.result.report for serving in servings]
    bpy.ops.wm.open_mainfile(filepath=str(blend.resolve()))
    widest, total = 0.0, 0
    for serving, name, report in zip(servings, names, reports, strict=True):
        title = serving.pizza.name
        pieces = placed_pieces(bpy.data.objects[name])
        _check_counts(serving.pizza, report, [piece[0] for piece in pieces])
        assert report.overlaps == 0, f"{title}: {report.overlaps} pairs of footprints overlap"
        pairs = overlapping(pieces)
        assert not pairs, f"{title}: {len(pairs)} pairs of pieces overlap, first {' and '.join(pairs[0])}"
        for kind, vertex, _ in pieces:
            reach = float(np.hypot(*(vertex[:, :2] - serving.place).T).max())
            assert reach < base.BED_RADIUS, f"{title}: {kind} reaches {reach:.4f} m from the middle, onto the crust"
            widest = max(widest, reach)
        total += len(pieces)
    return {"pieces": total, "farthest_from_middle": widest, "crust_begins_at": base.BED_RADIUS}


def _check_counts(pizza: Pizza, report: object, found: list[str]) -> None:
    """As many of every size as the menu says, in the report and in the scene."""
    for entry in report.classes:
        for size, asked in zip(entry.sizes, pizza.toppings[entry.name].counts, strict=True):
            there = sum(name.startswith(f"{entry.name} {size.name} ") for name in found)
            assert size.asked == size.placed == there == asked, (
                f"{pizza.name}: {asked} pieces of {entry.name} {size.name} asked, {size.placed} placed, {there} in the scene"
            )


def main(arguments: list[str] | None = None) -> None:
    """Run the scene from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=Path("output"), help="folder for the pictures and the .blend")
    parser.add_argument("--width", type=int, default=1200, help="width of the picture at an angle in pixels (16:10)")
    parser.add_argument("--side", type=int, default=600, help="width of each picture from above in pixels")
    parser.add_argument("--samples", type=int, default=16, help="Cycles samples per pixel")
    parser.add_argument("--quick", action="store_true", help="tiny pictures of few samples, to try the scene out")
    options = parser.parse_args(arguments)
    if options.quick:
        options.width, options.side, options.samples = 192, 120, 2
    options.output.mkdir(parents=True, exist_ok=True)
    start = time.perf_counter()

    def tell(text: str) -> None:
        print(f"[{time.perf_counter() - start:5.1f} s] {text}", flush=True)

    servings = build(options.output)
    for serving in servings:
        print(f"{serving.pizza.name}:\n{serving.result.report}\n", flush=True)
    tell("built")
    scene = bpy.context.scene
    set_render(scene, options.width, options.width, options.samples, SEED)
    # Food wants its reds and yellows as they are: no film curve.
    scene.view_settings.view_transform, scene.view_settings.look = "Standard", "None"
    scene.view_settings.exposure = EXPOSURE
    render_plans(servings, options.side, options.output)
    tell("rendered pizza-plans.png")
    render_table(options.width, options.output)
    tell("rendered pizza.png")
    blend = options.output / "pizza.blend"
    save(blend)
    tell(f"wrote {blend}")
    try:
        measured = test_final(servings, blend)
    except AssertionError as error:
        sys.exit(f"The pizzas are not as they should be: {error}")
    for key, value in measured.items():
        print(f"{key}: {value:.4g}")
    tell("all checks passed")


if __name__ == "__main__":
    main(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else None)
