"""A portrait in buttons: a photograph's inks become classes of colored buttons on linen, none over another.

    python demo_scenes/portrait.py --output output

The photograph is that of the astronaut Eileen Collins by NASA, in the public domain (``recipes/astronaut.png``).
``esh.separate`` splits it into inks; each ink is a class with buttons of its color in three sizes, as many as the photograph needs.
"""

from __future__ import annotations

from pathlib import Path

import bpy
import esh
import numpy as np
import surface_shapes as shapes
from gallery_parts import Built, add, check_counts, check_overlaps, run, variants
from PIL import Image, ImageFilter
from scene_parts import add_camera
from shader_nodes import Color, add_bump, add_node, calculate, color_ramp, mix_colors, new_material, noise
from shader_nodes import per_instance as random_of
from surface_materials import mottled, set_light

__all__ = ["build", "main", "test_final"]

SEED = 8
PHOTOGRAPH = Path(__file__).parent / "recipes" / "astronaut.png"
# Radius of the linen in its hoop, and of the three sizes of buttons [m].
HOOP = 0.30
RADII = {"small": 0.0022, "middling": 0.0030, "large": 0.0041}
SHARES = {"small": 0.4, "middling": 0.35, "large": 0.25}
# Where the four holes are, and how wide, as shares of the radius.
HOLES, HOLE = ((-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25)), 0.13
MODEL = "CMY-RGB-K"
# Colors of the buttons, in the order of the model's inks: cyan, magenta, yellow, red, green, blue, black.
BUTTONS: dict[str, Color] = {
    "C": (0.03, 0.38, 0.55),
    "M": (0.62, 0.06, 0.24),
    "Y": (0.85, 0.55, 0.08),
    "R": (0.68, 0.08, 0.03),
    "G": (0.06, 0.34, 0.13),
    "B": (0.035, 0.07, 0.32),
    "K": (0.012, 0.011, 0.014),
}
# Buttons that lie about on the table, of each color.
LOOSE = 7


def button(radius: float, seed: int) -> shapes.Shape:
    """A button with a rim and four holes that lies on the ground; ``seed`` varies its rim and how it is hollowed."""
    random = np.random.default_rng(seed)
    rim, hollow = random.uniform(0.74, 0.82), random.uniform(0.05, 0.12)
    sides = 48
    reach = np.concatenate([[1.0, 1.0, 0.985, 0.95], np.linspace(0.92, 0.0, 26)])
    angle = np.arange(sides) * 2.0 * np.pi / sides
    x, y = reach[:, None] * np.cos(angle), reach[:, None] * np.sin(angle)
    top = 0.34 * np.ones_like(reach)
    top[:4] = (0.0, 0.2, 0.28, 0.33)
    inside = np.clip((rim - reach) / 0.1, 0.0, 1.0)
    top -= (hollow + 0.05) * inside * inside * (3.0 - 2.0 * inside)
    height = np.repeat(top[:, None], sides, axis=1)
    for hole_x, hole_y in HOLES:
        height = np.where(np.hypot(x - hole_x, y - hole_y) < HOLE, 0.02, height)
    vertex = np.stack([x, y, height], axis=-1).reshape(-1, 3)
    return radius * vertex, shapes.grid_faces(len(reach), sides, round_columns=True)


def button_material(name: str, color: Color, radius: float) -> bpy.types.Material:
    """Glossy resin, of which every button is a little lighter or darker, with dark holes."""
    material, tree = new_material(name)
    shade = color_ramp(tree, random_of(tree), [(0.0, (0.72,) * 3), (0.5, (1.0,) * 3), (1.0, (1.32, 1.3, 1.26))])
    tinted = mix_colors(tree, 1.0, color, shade, "MULTIPLY")
    place = add_node(tree, "ShaderNodeTexCoord").outputs["Object"]
    nearest: object = 1.0
    for x, y in HOLES:
        away = add_node(tree, "ShaderNodeVectorMath", operation="SUBTRACT")
        tree.links.new(place, away.inputs[0])
        away.inputs[1].default_value = (radius * x, radius * y, 0.0)
        flat = add_node(tree, "ShaderNodeVectorMath", operation="MULTIPLY")
        tree.links.new(away.outputs[0], flat.inputs[0])
        flat.inputs[1].default_value = (1.0, 1.0, 0.0)
        length = add_node(tree, "ShaderNodeVectorMath", operation="LENGTH")
        tree.links.new(flat.outputs[0], length.inputs[0])
        nearest = calculate(tree, "MINIMUM", length.outputs["Value"], nearest)
    hole = calculate(tree, "LESS_THAN", nearest, 1.08 * HOLE * radius)
    surface = add_node(tree, "ShaderNodeBsdfPrincipled")
    dark = mix_colors(tree, 1.0, tinted, (0.12, 0.11, 0.10), "MULTIPLY")
    tree.links.new(mix_colors(tree, hole, tinted, dark), surface.inputs["Base Color"])
    surface.inputs["Roughness"].default_value = 0.32
    surface.inputs["Coat Weight"].default_value = 0.35
    tree.links.new(surface.outputs[0], add_node(tree, "ShaderNodeOutputMaterial").inputs["Surface"])
    return material


def linen_material() -> bpy.types.Material:
    """Linen: threads along x and y that differ in thickness."""
    material, tree = new_material("Linen")
    place = add_node(tree, "ShaderNodeNewGeometry").outputs["Position"]
    threads = []
    for direction in "XY":
        wave = add_node(tree, "ShaderNodeTexWave", wave_type="BANDS", bands_direction=direction)
        wave.inputs["Scale"].default_value = 160.0
        wave.inputs["Distortion"].default_value = 1.6
        wave.inputs["Detail"].default_value = 2.0
        tree.links.new(place, wave.inputs["Vector"])
        threads.append(wave.outputs["Fac"])
    weave = calculate(tree, "MAXIMUM", *threads)
    cloud = noise(tree, 0.02, 5.0)
    color = color_ramp(
        tree, calculate(tree, "MULTIPLY", weave, cloud), [(0.1, (0.66, 0.61, 0.52)), (0.6, (0.86, 0.82, 0.74))]
    )
    surface = add_node(tree, "ShaderNodeBsdfPrincipled")
    tree.links.new(color, surface.inputs["Base Color"])
    surface.inputs["Roughness"].default_value = 0.95
    add_bump(tree, surface, weave, 0.0005, 0.6)
    tree.links.new(surface.outputs[0], add_node(tree, "ShaderNodeOutputMaterial").inputs["Surface"])
    return material


def wood_material(name: str, dark: Color, light: Color, width: float) -> bpy.types.Material:
    """Planed wood with its grain along x."""
    material, tree = new_material(name)
    place = add_node(tree, "ShaderNodeVectorMath", operation="MULTIPLY")
    tree.links.new(add_node(tree, "ShaderNodeTexCoord").outputs["Object"], place.inputs[0])
    place.inputs[1].default_value = (0.06, 1.0, 1.0)
    grain = noise(tree, width, 8.0, place.outputs[0])
    surface = add_node(tree, "ShaderNodeBsdfPrincipled")
    tree.links.new(color_ramp(tree, grain, [(0.3, dark), (0.7, light)]), surface.inputs["Base Color"])
    surface.inputs["Roughness"].default_value = 0.5
    add_bump(tree, surface, grain, 0.0008, 0.4)
    tree.links.new(surface.outputs[0], add_node(tree, "ShaderNodeOutputMaterial").inputs["Surface"])
    return material


def _disc(radius: float, height: float) -> shapes.Shape:
    vertex, face = shapes.lathe(np.array([(radius, 0.0), (0.5 * radius, 0.0), (0.0, 0.0)]), 128)
    return vertex + (0.0, 0.0, height), face


def _add_table(scene: bpy.types.Scene) -> tuple[bpy.types.Object, bpy.types.Collection]:
    """Add the table, the hoop with its screw, and two spools of thread; return the table and what stands on it."""
    walnut = wood_material("Walnut", (0.035, 0.019, 0.011), (0.115, 0.062, 0.034), 0.035)
    beech = wood_material("Beech", (0.50, 0.31, 0.16), (0.68, 0.47, 0.28), 0.006)
    brass = glossy_metal("Brass", (0.80, 0.56, 0.22))
    side = np.linspace(-1.0, 1.0, 41)
    x, y = np.meshgrid(1.1 * side, 0.8 * side)
    table = add("Table", shapes.grid(x, y, 0.0 * x - 0.012), walnut)
    holder = bpy.data.collections.new("On the Table")
    scene.collection.children.link(holder)
    profile = [
        (1.0, -0.012),
        (1.036, -0.012),
        (1.04, -0.008),
        (1.04, 0.006),
        (1.034, 0.011),
        (1.006, 0.011),
        (1.0, 0.007),
    ]
    ring, faces = shapes.lathe(np.array(profile) * (HOOP, 1.0), 160)
    parts = [("Hoop", (ring, faces), beech)]
    knob, knob_faces = shapes.lathe(
        np.array([(0.0, -0.05), (0.0035, -0.05), (0.0035, -0.022), (0.011, -0.022), (0.011, 0.0), (0.0, 0.0)]), 32
    )
    turned = np.stack([knob[:, 2] + 0.02, 1.055 * HOOP + knob[:, 0], knob[:, 1]], axis=1)
    parts.append(("Screw", (turned, knob_faces), brass))
    for name, place, color in (
        ("Red", (0.40, 0.165), (0.50, 0.035, 0.03)),
        ("Blue", (0.435, 0.06), (0.03, 0.12, 0.33)),
        ("Cream", (-0.41, -0.17), (0.74, 0.62, 0.42)),
    ):
        foot = [(0.0, 0.0), (0.026, 0.0), (0.027, 0.003), (0.026, 0.006), (0.019, 0.009)]
        head = [
            (0.019, 0.063),
            (0.026, 0.066),
            (0.027, 0.069),
            (0.026, 0.072),
            (0.006, 0.072),
            (0.006, 0.06),
            (0.0, 0.06),
        ]
        up = foot + head
        turns = np.linspace(0.0095, 0.0625, 160)
        yarn = np.stack([0.0235 + 0.0007 * np.sin(np.arange(160) * 0.8 * np.pi), turns], axis=1)
        for what, outline, material in (
            ("Spool", up, beech),
            ("Thread", yarn, mottled(f"{name} Thread", [(0.3, color), (0.7, tuple(1.25 * c for c in color))], 0.004)),
        ):
            vertex, faces = shapes.lathe(np.array(outline), 96)
            parts.append((f"{name} {what}", (vertex + (*place, -0.012), faces), material))
    for name, shape, material in parts:
        item = shapes.link(name, shape, holder, True)
        item.data.materials.append(material)
    return table, holder


def glossy_metal(name: str, color: Color) -> bpy.types.Material:
    """A polished metal."""
    material, tree = new_material(name)
    surface = add_node(tree, "ShaderNodeBsdfPrincipled")
    surface.inputs["Base Color"].default_value = (*color, 1.0)
    surface.inputs["Metallic"].default_value = 1.0
    surface.inputs["Roughness"].default_value = 0.28
    tree.links.new(surface.outputs[0], add_node(tree, "ShaderNodeOutputMaterial").inputs["Surface"])
    return material


def photograph() -> np.ndarray:
    """The astronaut's head, red, green and blue 0..1, with stronger edges and colors, as cloth and buttons weaken them."""
    with Image.open(PHOTOGRAPH) as image:
        sharp = image.convert("RGB").crop((14, 4, 134, 124)).filter(ImageFilter.UnsharpMask(5, 110, 0))
    pixels = np.asarray(sharp, float) / 255.0
    gray = pixels.mean(axis=2, keepdims=True)
    return np.clip(1.25 * (gray - 0.05) + 2.0 * (pixels - gray), 0.0, 1.0)


def build(device: str = "auto", quick: bool = False) -> Built:
    """Build the portrait in an empty file."""
    scene = bpy.context.scene
    linen = add("Linen", _disc(HOOP, 0.0), linen_material(), smooth=False)
    table, things = _add_table(scene)
    grow = 4.0 if quick else 1.0
    paints = {ink: button_material(f"Button {ink}", color, 1.0) for ink, color in BUTTONS.items()}
    # Modeled 1 m large, and made as large as their footprints ask for.
    library = {
        ink: variants(f"Button {ink}", [(button(1.0, k), None) for k in range(3)], paint)
        for ink, paint in paints.items()
    }
    camera = add_camera(scene, "Camera", (0.0, -0.50, 1.06), (0.005, -0.016, 0.0), lens=46.0, clip_end=20.0)
    camera.data.dof.use_dof, camera.data.dof.focus_distance, camera.data.dof.aperture_fstop = True, 1.05, 11.0
    scene.camera = camera
    bpy.context.view_layer.update()
    image = photograph()
    steps = 30 if quick else 80

    # begin: scatter
    channels = esh.separate(image, MODEL)
    classes = [
        esh.ScatterClass(
            ink,
            [
                esh.ScatterSize(
                    size, source=library[ink], area=(0.9 * area, 1.1 * area), share=SHARES[size], line=False
                )
                for size, area in ((size, np.pi * (grow * radius) ** 2) for size, radius in RADII.items())
            ],
            density=channel,
            count="cover",
            gap=0.0002,
            color=BUTTONS[ink],
        )
        for ink, channel in zip(BUTTONS, channels, strict=True)
        if channel.mean() > 0.01
    ]
    portrait = esh.scatter(
        linen,
        classes,
        class_separation=0.5,
        size_emphasis=2.0,
        seed=SEED,
        device=device,
        max_steps=steps,
        name="Portrait",
    )
    where_seen = esh.CameraDensity(camera, margin=0.0)
    about = [
        esh.ScatterClass(
            f"loose {ink}", [esh.ScatterSize("any", LOOSE, library[ink], area=(4e-5, 2.4e-4), line=False)], where_seen
        )
        for ink in (list(BUTTONS)[:2] if quick else BUTTONS)
    ]
    loose = esh.scatter(
        table,
        about,
        obstacles=[esh.ScatterObstacle([linen, things], margin=0.006)],
        tilt=0.08,
        seed=SEED,
        device=device,
        max_steps=steps,
        name="Loose Buttons",
    )
    # end: scatter
    set_light(scene, (-0.8, 0.45, 0.75), 4.6, (0.82, 0.86, 0.95), 0.75, (1.0, 0.92, 0.8))
    # Few large buttons may jam where the photograph is black.
    return Built([portrait, loose], {"photograph": image, "may overlap": 0.01 if quick else 0.0})


def test_final(built: Built) -> dict[str, float]:
    """Check the portrait: exact counts, no button over another, all of them in the hoop, and one recognizes the photograph.

    Raises:
        AssertionError: Something is not as it should be; the message says what.
    """
    portrait, loose = built.results
    total = check_counts(built)
    overlaps = check_overlaps(built, built.more["may overlap"])
    place, scale = portrait.instances.position, portrait.instances.scale
    edge = np.hypot(place[:, 0], place[:, 1])
    assert edge.max() < HOOP, f"a button lies {edge.max() - HOOP:.4f} m outside of the hoop"
    away = np.hypot(*loose.instances.position[:, :2].T) - 1.04 * HOOP
    assert away.min() > 0.0, f"a loose button lies {-away.min():.4f} m in the hoop"
    # What is printed in cells of the picture, and what the photograph asks for there.
    wanted = 1.0 - built.more["photograph"].mean(axis=2)
    names = [c.name for c in portrait.placement.problem.classes]
    ink = np.array([1.0 if name == "K" else 2.0 / 3.0 if name in "RGB" else 1.0 / 3.0 for name in names])
    cells = max(min(int(np.sqrt(len(place) / 12.0)), 24), 4)
    weight = ink[portrait.placement.class_index] * np.pi * scale**2
    column, row = (
        ((place[:, 0] / HOOP + 1.0) * 0.5 * cells).astype(int),
        ((1.0 - place[:, 1] / HOOP) * 0.5 * cells).astype(int),
    )
    printed = np.zeros((cells, cells))
    np.add.at(printed, (row.clip(0, cells - 1), column.clip(0, cells - 1)), weight)
    edges = np.linspace(0.0, len(wanted), cells + 1)
    at = np.searchsorted(edges, np.arange(len(wanted)) + 0.5, side="right") - 1
    asked = np.zeros((cells, cells))
    np.add.at(asked, (at[:, None], at), wanted)
    asked /= np.bincount(at)[:, None] * np.bincount(at)
    middle = (np.arange(cells) + 0.5) / cells * 2.0 - 1.0
    inside = np.hypot(middle, middle[:, None]) < 1.0 - 1.5 / cells
    likeness = float(np.corrcoef(printed[inside], asked[inside])[0, 1])
    assert likeness > 0.7, f"nobody recognizes the photograph: correlation {likeness:.2f}"
    return {"placed": total, "overlaps": overlaps, "likeness": likeness}


def main(arguments: list[str] | None = None) -> None:
    """Run the scene from the command line."""
    run("portrait", __doc__.splitlines()[0], build, test_final, size=(1400, 1050), seed=SEED, arguments=arguments)


if __name__ == "__main__":
    main()
