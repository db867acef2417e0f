"""The scene that tests of Live begin with, and what they ask of it."""

import bpy
import numpy as np


def new_image(name="mask.png"):
    image = bpy.data.images.new(name, 64, 64)
    pixels = np.ones((64, 64, 4), np.float32)
    pixels[..., :3] = 0.5
    image.pixels.foreach_set(pixels.ravel())
    return image


def new_scatter():
    """Two classes on a square: pines by an image, beeches by a vertex group."""
    bpy.ops.mesh.primitive_grid_add(size=40, x_subdivisions=20, y_subdivisions=20)
    ground = bpy.context.object
    ground.name = "Ground"
    ground.vertex_groups.new(name="here").add(list(range(441)), 0.5, "REPLACE")
    made = bpy.context.scene.esh_scatter.add_scatter(ground)
    for name, kind in (("Pine", "IMAGE"), ("Beech", "VERTEX_GROUP")):
        bpy.ops.mesh.primitive_cone_add(radius1=0.3, depth=1.0, location=(60, 0, 0))
        bpy.context.object.name = name
        body_class = made.add_class()
        body_class.name = name
        body_class.add_layer(kind, **({"vertex_group": "here"} if kind == "VERTEX_GROUP" else {"image": new_image()}))
        body_class.sizes[0].source_object, body_class.sizes[0].count = bpy.context.object, 200
    made.device, made.max_steps = "CPU", 40
    return made


def paint(value, columns=64, name="mask.png"):
    """Give the leftmost columns of an image a value."""
    image = bpy.data.images[name]
    pixels = np.empty(64 * 64 * 4, np.float32)
    image.pixels.foreach_get(pixels)
    pixels.reshape(64, 64, 4)[:, :columns, :3] = value
    image.pixels.foreach_set(pixels)


def active():
    return bpy.context.scene.esh_scatter.active


def points(name=None):
    """Return places by the numbers of the points; of one class by its name."""
    scatter = active()
    mesh = scatter.result.data
    place = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.attributes["position"].data.foreach_get("vector", place)
    number, of_class = np.empty((2, len(mesh.vertices)), np.int32)
    mesh.attributes["id"].data.foreach_get("value", number)
    mesh.attributes["class_index"].data.foreach_get("value", of_class)
    own = slice(None) if name is None else of_class == [c.name for c in scatter.ready_classes()].index(name)
    return dict(zip(number[own].tolist(), place.reshape(-1, 3)[own], strict=True))


def moved(before, after):
    both = before.keys() & after.keys()
    return np.array([np.linalg.norm(after[n] - before[n]) for n in both])


def switch_on(scatter, follow):
    bpy.ops.esh.scatter()
    scatter.live = True
    before = points()
    follow()
    after = points()
    assert before.keys() == after.keys() and moved(before, after).max() == 0.0, "switching it on moves nothing"
    return before
