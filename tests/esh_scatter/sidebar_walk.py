"""Use the sidebar in any order, as nobody would: ``python tests/esh_scatter/sidebar_walk.py --seconds 600 --seed 0``.

A walk presses the sidebar's buttons and those of Blender, sets whatever can be set, deletes, hides, undoes, opens files again and
switches Live on and off; after every step all panels are drawn. Whatever comes, a button does what it says or refuses in a sentence, a
run places exactly as many objects as asked, and nothing raises. A walk that breaks this is printed, with its last steps. A Blender
that crashes ends the process; ``--told`` says which walk that was.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import random
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from drawn_panels import draw_all
from esh.esh_scatter import operators, registration
from esh.esh_scatter.solving import live, running
from esh.esh_scatter.targets import checksums

__all__ = ["STEPS", "SidebarWalk", "main"]

# Steps of a walk, and how many of its last ones are shown.
STEPS, SHOWN = 70, 14
# Of our buttons those are left out that ask for files or assets.
FILES = ("export", "import", "preset_export", "preset_import", "presets_as_assets")
ASSETS = ("scatter_assets", "classes_from_assets", "source_from_asset", "source_from_shelf", "preset_from_asset")
LEFT_OUT = {f"esh.{name}" for name in FILES + ASSETS}
# What the settings keep for themselves; what a run takes is small.
KEPT = {
    "rna_type",
    "result",
    "live",
    "uid",
    "known_name",
    "named_after",
    "report_json",
    "ran_with",
    "device",
    "max_steps",
    "version",
}
MOST, MOST_OBJECTS, MOST_VERTICES = 25, 40, 3000
WORDS = ("", "Pine", "weights", "UVMap", "nobody knows", "Ä, ö")
WIDTHS = (160, 300, 700)
MODES = ("EDIT", "OBJECT", "SCULPT", "WEIGHT_PAINT", "TEXTURE_PAINT")


def _mesh(name: str, at: tuple[float, float, float], make: Callable[..., Any], **how: Any) -> bpy.types.Object:
    make(location=at, **how)
    item = bpy.context.object
    item.name = name
    half = range(max(1, len(item.data.vertices) // 2))
    item.vertex_groups.new(name="weights").add(half, 1.0, "REPLACE")
    return item


def _fill_in() -> None:
    """A scene with a ground, a rock, a path, things to place and a scatter of two classes."""
    add = bpy.ops.mesh
    ground = _mesh("Ground", (0, 0, 0), add.primitive_grid_add, size=20.0, x_subdivisions=10, y_subdivisions=10)
    _mesh("Rock", (0, 0, 1), add.primitive_ico_sphere_add, radius=3.0)
    trees = [_mesh(name, (40, 0, 0), add.primitive_cone_add, vertices=5, radius1=0.4) for name in ("Tree", "Bush")]
    kinds = bpy.data.collections.new("Kinds")
    bpy.context.scene.collection.children.link(kinds)
    for name in ("Reed", "Rush"):
        kinds.objects.link(_mesh(name, (45, 0, 0), add.primitive_cone_add, vertices=4, radius1=0.2))
    mask = bpy.data.images.new("Mask", 8, 8)
    mask.pixels.foreach_set(np.random.default_rng(0).random(256, np.float32))
    curve = bpy.data.curves.new("Path", "CURVE")
    curve.splines.new("POLY").points.add(1)
    for point, place in zip(curve.splines[0].points, ((-9, 0, 0, 1), (9, 3, 0, 1)), strict=True):
        point.co = place
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Path", curve))
    made = bpy.context.scene.esh_scatter.add_scatter(ground)
    for name, tree in zip(("Pine", "Beech"), trees, strict=True):
        body_class = made.add_class()
        body_class.name = name
        body_class.sizes[0].source_object, body_class.sizes[0].count = tree, 20
    made.device, made.max_steps = "CPU", 3
    bpy.ops.ed.undo_push(message="Filled in")


@contextlib.contextmanager
def _sidebar() -> Iterator[None]:
    bpy.ops.wm.read_homefile(use_empty=True)
    registration.register()
    try:
        _fill_in()
        yield
    finally:
        live.end(wait=True)
        running.session = None
        registration.unregister()


class SidebarWalk:
    """One walk.

    Args:
        seed: The same seed makes the same walk, but for what Live has come to.
        file: Where the file is saved that is opened again.

    Attributes:
        steps: What was done, in words.
    """

    def __init__(self, seed: int, file: Path) -> None:
        self._random, self._file = random.Random(seed), file
        self.steps: list[str] = []

    def run(self, count: int = STEPS) -> None:
        """Walk so many steps; raises where something breaks the promise."""
        own = [(0.22, self._set), (0.25, self._press), (0.09, self._scatter), (0.23, self._change_scene)]
        around = [
            (0.06, self._undo),
            (0.03, self._redo),
            (0.02, self._reopen),
            (0.03, self._switch_live),
            (0.07, self._wait),
        ]
        weights, kinds = zip(*own, *around, strict=True)
        said = io.StringIO()
        with _sidebar(), contextlib.redirect_stderr(said):
            for _ in range(count):
                step = self._random.choices(kinds, weights)[0]
                self.steps.append(f"{step.__name__.strip('_')} …")
                self.steps[-1] = f"{step.__name__.strip('_')} {step()}"
                draw_all(self._random.choice(WIDTHS))
                # What callbacks of Blender raise, it prints, and goes on.
                assert "Traceback" not in said.getvalue(), said.getvalue()[-3000:]

    @property
    def _active(self) -> Any:
        return bpy.context.scene.esh_scatter.active

    def _value(self, prop: Any) -> Any:
        """A value that may be set, or None where there is none."""
        choose = self._random
        if prop.type == "BOOLEAN" and not prop.is_array:
            return choose.random() < 0.5
        if prop.type == "ENUM":
            items = [item.identifier for item in prop.enum_items]
            return choose.choice(items) if items and not prop.is_enum_flag else None
        if prop.type in ("INT", "FLOAT"):
            low, high = max(prop.soft_min, prop.hard_min, -1e4), min(prop.soft_max, prop.hard_max, 1e4)
            high = min(high, MOST) if prop.identifier in ("count", "total", "most", "dots") else high
            value = choose.uniform(low, max(low, high))
            value = round(value) if prop.type == "INT" else value
            return [value] * prop.array_length if prop.is_array else value
        if prop.type == "STRING":
            return choose.choice(WORDS)
        return None

    def _set(self) -> str:
        """Set one of the settings."""
        scatter = self._active
        if scatter is None:
            return "nothing"
        groups = [scatter, *scatter.obstacles]
        for body_class in scatter.classes:
            groups += [body_class, *body_class.sizes, *body_class.layers]
        group = self._random.choice(groups)
        own = [
            p for p in group.bl_rna.properties if not (p.identifier in KEPT or p.is_readonly or p.type == "COLLECTION")
        ]
        prop = self._random.choice(own)
        kinds = {"Object": bpy.data.objects, "Collection": bpy.data.collections, "Image": bpy.data.images}
        things = kinds.get(prop.fixed_type.identifier, ()) if prop.type == "POINTER" else ()
        value = self._random.choice([None, *things]) if prop.type == "POINTER" else self._value(prop)
        if value is None and prop.type != "POINTER":
            return "nothing"
        with contextlib.suppress(TypeError):  # an object that may not be chosen
            setattr(group, prop.identifier, value)
        return f"{type(group).__name__}.{prop.identifier} = {value!r}"

    def _press(self) -> str:
        """Press one of the buttons."""
        name = self._random.choice([c.bl_idname for c in operators.CLASSES if c.bl_idname not in LEFT_OUT])
        button = getattr(bpy.ops.esh, name.partition(".")[2])
        asked = [
            p
            for p in button.get_rna_type().properties
            if p.identifier not in ("rna_type", "asked") and p.type != "STRING"
        ]
        values = {prop.identifier: self._value(prop) for prop in asked if self._random.random() < 0.5}
        values = {name: value for name, value in values.items() if value is not None}
        return (
            f"{name} {values}: {_called(lambda: button('EXEC_DEFAULT', True, **values)) if button.poll() else 'gray'}"
        )

    def _scatter(self) -> str:
        """Run the scatter that is shown, and compare what it says with what is there."""
        if not bpy.ops.esh.scatter.poll():
            return "gray"
        answer = _called(lambda: bpy.ops.esh.scatter("EXEC_DEFAULT", True))
        if answer == "{'FINISHED'}":
            scatter = self._active
            sizes = [size for c in scatter.report["classes"] for size in c["sizes"]]
            asked, placed = (sum(size[name] for size in sizes) for name in ("asked", "placed"))
            assert asked == placed == len(scatter.result.data.vertices)
            with checksums.now():
                assert not scatter.outdated, scatter.changes()
        return answer

    def _change_scene(self) -> str:
        """Do something of Blender's own."""
        change = self._random.choice(_CHANGES)
        return f"{change.__name__.strip('_')}: {_called(lambda: change(self._random))}"

    def _undo(self) -> str:
        return _called(bpy.ops.ed.undo)

    def _redo(self) -> str:
        return _called(bpy.ops.ed.redo)

    def _reopen(self) -> str:
        if bpy.context.mode != "OBJECT":
            return "not now"
        bpy.ops.wm.save_as_mainfile(filepath=str(self._file), check_existing=False)
        return _called(lambda: bpy.ops.wm.open_mainfile(filepath=str(self._file)))

    def _switch_live(self) -> str:
        if self._active is None:
            return "nothing"
        self._active.live = not self._active.live
        bpy.ops.ed.undo_push(message="Live")
        return str(self._active.live)

    def _wait(self) -> str:
        """Let Live go on for a moment."""
        until = time.monotonic() + self._random.uniform(0.0, 0.6)
        while time.monotonic() < until:
            for one in live._followed.values():
                one._looked = 0.0
            if live._tick() is None:
                return "nothing lives"
            time.sleep(0.01)
        return "done"


def _called(work: Callable[[], Any]) -> str:
    """Return what an operator answers, or the sentence that it refuses with."""
    try:
        return str(work())
    except RuntimeError as error:
        if "Traceback" in str(error):
            raise
        return f"refused: {str(error)[:90]}"


def _select(choose: random.Random) -> None:
    items = [item for item in bpy.context.view_layer.objects if bpy.context.mode == "OBJECT"]
    for item in items:
        item.select_set(False)
    for item in choose.sample(items, min(len(items), 3)):
        item.select_set(True)
        bpy.context.view_layer.objects.active = item


def _any_object(choose: random.Random) -> bpy.types.Object | None:
    return choose.choice([*bpy.context.scene.objects]) if bpy.context.scene.objects else None


def _delete(_choose: random.Random) -> None:
    bpy.ops.object.delete()


def _duplicate(choose: random.Random) -> None:
    if len(bpy.context.scene.objects) < MOST_OBJECTS:
        bpy.ops.object.duplicate("EXEC_DEFAULT", True, linked=choose.random() < 0.5)


def _rename(choose: random.Random) -> None:
    if item := _any_object(choose):
        item.name = choose.choice(("Tree", "Ground", "Path", "X"))
        bpy.ops.ed.undo_push(message="Rename")


def _move(choose: random.Random) -> None:
    if item := _any_object(choose):
        item.location.x += choose.uniform(-3.0, 3.0)
        item.scale *= choose.choice((0.5, 0.0, 1.0, 1.3, -1.0))
        bpy.ops.ed.undo_push(message="Move")


def _hide(choose: random.Random) -> None:
    if item := _any_object(choose):
        item.hide_viewport ^= choose.random() < 0.5
        item.hide_set(choose.random() < 0.5)
        bpy.ops.ed.undo_push(message="Hide")


def _parent(choose: random.Random) -> None:
    one, other = _any_object(choose), _any_object(choose)
    if one is not None and one != other:
        one.parent = other
        bpy.ops.ed.undo_push(message="Parent")


def _change_mode(choose: random.Random) -> None:
    with contextlib.suppress(TypeError):  # what is active has no such mode
        bpy.ops.object.mode_set(mode=choose.choice(MODES))


def _cut_finer(_choose: random.Random) -> None:
    # There once Blender is.
    import bmesh

    item = bpy.context.view_layer.objects.active
    if item is None or item.type != "MESH" or item.mode != "OBJECT" or len(item.data.vertices) > MOST_VERTICES:
        return
    made = bmesh.new()
    made.from_mesh(item.data)
    bmesh.ops.subdivide_edges(made, edges=made.edges[:], cuts=1)
    made.to_mesh(item.data)
    made.free()
    bpy.ops.ed.undo_push(message="Subdivide")


def _modify(choose: random.Random) -> None:
    item = bpy.context.view_layer.objects.active
    if item is not None and item.type == "MESH":
        item.modifiers.clear()
        item.modifiers.new("Any", choose.choice(("SUBSURF", "DISPLACE", "ARRAY", "SOLIDIFY", "DECIMATE")))
        bpy.ops.ed.undo_push(message="Modify")


def _take_away(choose: random.Random) -> None:
    """An image, the vertex groups of the active mesh, or a collection goes."""
    item = bpy.context.view_layer.objects.active
    if item is not None and item.type == "MESH":
        item.vertex_groups.clear()
    for kind in (bpy.data.images, bpy.data.collections):
        if len(kind) and choose.random() < 0.3:
            kind.remove(choose.choice([*kind]))
    bpy.data.images.new("New", 8, 8)
    bpy.ops.ed.undo_push(message="Remove")


def _add_scene(choose: random.Random) -> None:
    if len(bpy.data.scenes) < 4 and bpy.context.mode == "OBJECT":
        bpy.ops.scene.new(type=choose.choice(("NEW", "EMPTY", "LINK_COPY", "FULL_COPY")))


def _change_scene_shown(choose: random.Random) -> None:
    # Blender crashes where what is edited is in no scene that is shown, and that is undone.
    if bpy.context.window is not None and bpy.context.mode == "OBJECT":
        bpy.context.window.scene = choose.choice([*bpy.data.scenes])


def _apply(_choose: random.Random) -> None:
    bpy.ops.object.transform_apply()


def _join(_choose: random.Random) -> None:
    bpy.ops.object.join()


_CHANGES = (
    *(_select, _select, _select, _delete, _duplicate, _rename, _move, _hide, _parent, _change_mode, _change_mode),
    *(_cut_finer, _modify, _take_away, _add_scene, _change_scene_shown, _apply, _join),
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Walk for a while; return 1 if a walk broke the promise."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=600.0, help="how long (default: 600)")
    parser.add_argument(
        "--seed", type=int, default=0, help="the first walk (default: 0); the next ones are one more each"
    )
    parser.add_argument("--steps", type=int, default=STEPS, help=f"of each walk (default: {STEPS})")
    parser.add_argument("--only", action="store_true", help="this walk alone")
    parser.add_argument("--told", type=Path, help="file that says which walk is under way")
    options = parser.parse_args(arguments)
    until, seed, broken = time.monotonic() + options.seconds, options.seed, 0
    with tempfile.TemporaryDirectory(prefix="esh-walk-") as folder:
        while time.monotonic() < until:
            if options.told:
                options.told.write_text(f"{seed}\n", encoding="utf-8")
            walk = SidebarWalk(seed, Path(folder) / "walk.blend")
            try:
                walk.run(options.steps)
            except Exception:  # all that comes is told
                broken += 1
                print(f"walk {seed}, step {len(walk.steps)}:", *walk.steps[-SHOWN:], traceback.format_exc(), sep="\n")
            seed += 1
            if options.only:
                break
    print(f"{seed - options.seed} walks, {broken} broken")
    return 1 if broken else 0


if __name__ == "__main__":
    status = main()
    sys.stdout.flush()
    # Blender as a module may crash where Python ends it.
    os._exit(status)
