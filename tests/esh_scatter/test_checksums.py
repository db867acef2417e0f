"""What makes a result out of date, and what does not."""

import json
import time

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")
bmesh = pytest.importorskip("bmesh")

from esh.esh_scatter.targets import checksums  # noqa: E402

pytestmark = pytest.mark.usefixtures("empty_file")


def image(name):
    made = bpy.data.images.new(name, 16, 8)
    pixels = np.linspace(0.1, 1.0, 16 * 8 * 4, dtype=np.float32)
    # A file keeps no alpha of an image that was made without.
    pixels[3::4] = 1.0
    made.pixels.foreach_set(pixels)
    return made


@pytest.fixture
def scatter():
    bpy.ops.mesh.primitive_grid_add(size=20, x_subdivisions=8, y_subdivisions=8)
    ground = bpy.context.object
    ground.name = "Ground"
    group = ground.vertex_groups.new(name="here")
    group.add(list(range(len(ground.data.vertices))), 0.5, "REPLACE")
    ground.data.attributes.new("wet", "FLOAT", "POINT").data.foreach_set("value", np.ones(len(ground.data.vertices)))
    ground.data.attributes.new("Paint", "BYTE_COLOR", "CORNER").data.foreach_set(
        "color", np.ones(4 * len(ground.data.loops))
    )
    made = bpy.context.scene.esh_scatter.add_scatter(ground)
    trees = bpy.data.collections.new("Trees")
    for number in range(6):
        bpy.ops.mesh.primitive_cube_add(size=0.3, location=(30, number, 0))
        bpy.context.object.name = f"Tree {number}"
        if number > 3:
            trees.objects.link(bpy.context.object)
        body_class = made.add_class()
        body_class.name = ["Mask", "Laid out", "Weights", "Wet", "Painted", "Collected"][number]
        size = body_class.sizes[0]
        # So many begin once; fewer try several starts.
        size.source_object, size.source_collection, size.count = bpy.context.object, trees, 60
        size.source_kind = "COLLECTION" if number == 5 else "OBJECT"
    mask, laid_out, weights, wet, painted, _ = made.classes
    mask.add_layer("IMAGE", image=image("mask.png"))
    laid_out.add_layer("IMAGE", image=image("layout.png"), image_mapping="UV")
    weights.add_layer("VERTEX_GROUP", vertex_group="here")
    wet.add_layer("ATTRIBUTE", attribute="wet")
    painted.add_layer("ATTRIBUTE", attribute="Paint")
    made.device, made.max_steps = "CPU", 2
    bpy.ops.esh.scatter()
    assert made.report and not made.outdated
    return made


def active():
    return bpy.context.scene.esh_scatter.active


def paint(name, index):
    bpy.data.images[name].pixels[index] = 0.77


def sculpt():
    ground = active().target
    ground.data.vertices[40].co.z += 0.01
    ground.data.update()


def add_modifier():
    active().target.modifiers.new("Wave", "SIMPLE_DEFORM")
    bpy.context.view_layer.update()


def set_value(attribute, field, index, value):
    setattr(active().target.data.attributes[attribute].data[index], field, value)


def lay_out():
    active().target.data.uv_layers[0].uv[3].vector = (0.2, 0.7)


def edit_source():
    bpy.data.objects["Tree 1"].data.vertices[0].co.x -= 0.1


def scale_source():
    bpy.data.objects["Tree 1"].scale.z = 1.5
    bpy.context.view_layer.update()


def join_collection():
    bpy.data.collections["Trees"].objects.link(bpy.data.objects["Tree 0"])


def edit_member():
    bpy.data.objects["Tree 4"].data.vertices[0].co.x -= 0.1


def replace_source():
    other = bpy.data.objects["Tree 2"].copy()
    bpy.context.scene.collection.objects.link(other)
    # One that covers the same ground would take the other's place at once.
    other.scale.x *= 2.0
    bpy.context.view_layer.update()
    active().classes["Weights"].sizes[0].source_object = other


CHANGES = [
    (lambda: paint("mask.png", 0), ["mask.png painted"]),
    (lambda: paint("mask.png", 4 * 16 * 8 - 2), ["mask.png painted"]),
    (lambda: paint("layout.png", 77), ["layout.png painted"]),
    (lambda: bpy.data.images["mask.png"].scale(8, 8), ["mask.png painted"]),
    (sculpt, ["shape or place of the target"]),
    (add_modifier, ["shape or place of the target"]),
    (lambda: active().target.vertex_groups["here"].add([9], 0.6, "REPLACE"), ["here painted"]),
    (lambda: set_value("wet", "value", 5, 0.5), ["wet painted"]),
    (lambda: set_value("Paint", "color", 7, (1, 0, 0, 1)), ["Paint painted"]),
    (lay_out, ["UV map edited"]),
    (edit_source, ["Tree 1 edited"]),
    (scale_source, ["Tree 1 edited"]),
    (join_collection, ["Trees edited"]),
    (edit_member, ["Tree 4 edited", "Trees edited"]),
    (replace_source, ["object of Weights"]),
]


@pytest.mark.parametrize(("change", "said"), CHANGES)
def test_what_a_result_was_made_of_makes_it_out_of_date(scatter, change, said):
    change()
    assert active().outdated
    assert sorted(active().changes()) == sorted(said)


def test_two_pixels_of_a_row_that_change_places_are_seen(scatter):
    mask = bpy.data.images["mask.png"]
    pixels = np.array(mask.pixels, np.float32).reshape(8, 16, 4)
    mask.pixels.foreach_set(pixels.ravel())
    before = checksums.of_image(mask)
    pixels[3, [5, 11]] = pixels[3, [11, 5]]
    mask.pixels.foreach_set(pixels.ravel())
    assert checksums.of_image(mask) != before


def test_an_image_that_is_replaced_by_an_equal_one_changes_nothing(scatter):
    scatter.classes["Mask"].layers[0].image = image("other.png")
    assert not scatter.outdated
    paint("other.png", 9)
    assert scatter.changes() == ["image of Mask"]


def test_what_nothing_follows_changes_nothing(scatter):
    other = image("unused.png")
    weights = scatter.classes["Weights"]
    weights.layers[0].image = other
    paint("unused.png", 5)
    weights.sizes[0].source_collection = None
    scatter.target.vertex_groups.new(name="another").add([1, 2], 1.0, "REPLACE")
    bpy.data.objects["Tree 0"].location.x += 3
    bpy.context.view_layer.update()
    assert not scatter.outdated


@pytest.fixture
def subdivided(scatter):
    """Rough ground of which nothing but the shape counts."""
    ground = scatter.target
    for number, vertex in enumerate(ground.data.vertices):
        vertex.co.z = np.sin(1.7 * number)
    # Subdivision gives attributes other values, too.
    for name in ("Laid out", "Wet", "Painted"):
        scatter.classes[name].mute = True
    ground.modifiers.new("Subdivision", "SUBSURF")
    scatter.ran_with = scatter.fingerprint()
    assert scatter.changes() == []
    return scatter


def crease(ground):
    ground.data.attributes.new("crease_edge", "FLOAT", "EDGE").data[9].value = 1.0


def simplify(_ground):
    render = bpy.context.scene.render
    render.use_simplify, render.simplify_subdivision = True, 0


def follow_a_driver(ground):
    ground.modifiers[0].driver_add("levels").driver.expression = "3"


def assert_change_is_told(scatter, change):
    """What changes the shape of its target is said to have done so."""
    ground = scatter.target
    before = checksums.of_shape(ground)
    change(ground)
    ground.data.update()
    bpy.context.view_layer.update()
    assert checksums.of_shape(ground) != before, "it is another shape"
    assert scatter.changes() == ["shape or place of the target"]


@pytest.mark.parametrize(
    "change",
    [
        lambda ground: setattr(ground.data.vertices[7].co, "z", 3.0),
        lambda ground: setattr(ground.modifiers[0], "levels", 2),
        lambda ground: setattr(ground.modifiers[0], "subdivision_type", "SIMPLE"),
        lambda ground: setattr(ground.modifiers[0], "boundary_smooth", "PRESERVE_CORNERS"),
        lambda ground: setattr(ground.modifiers[0], "show_viewport", False),
        lambda ground: ground.modifiers.new("Again", "SUBSURF"),
        lambda ground: ground.modifiers.new("Wave", "SIMPLE_DEFORM"),
        crease,
        simplify,
        follow_a_driver,
    ],
)
def test_what_subdivides_ground_otherwise_is_something_of_its_shape(subdivided, change):
    assert_change_is_told(subdivided, change)


@pytest.fixture
def terrain(subdivided):
    """Subdivided ground with hills of a texture, thick as a slab."""
    hills = subdivided.target.modifiers.new("Hills", "DISPLACE")
    hills.texture = bpy.data.textures.new("Hills", "CLOUDS")
    subdivided.target.modifiers.new("Slab", "SOLIDIFY").thickness = 0.3
    bpy.context.view_layer.update()
    subdivided.ran_with = subdivided.fingerprint()
    assert subdivided.changes() == []
    return subdivided


def test_a_uv_map_is_nothing_of_the_shape_of_ground_with_several_modifiers(terrain):
    ground = terrain.target
    while ground.data.uv_layers:
        ground.data.uv_layers.remove(ground.data.uv_layers[0])
    bpy.context.view_layer.update()
    before = checksums.of_shape(ground)
    terrain.ran_with = terrain.fingerprint()
    ground.data.uv_layers.new(name="Unwrapped")
    bpy.context.view_layer.update()
    assert checksums.of_shape(ground) != before, "subdivision rounds otherwise now"
    assert terrain.changes() == []


def color_texture(texture):
    texture.use_color_ramp = True
    texture.color_ramp.elements[0].color = (0.5, 0.5, 0.5, 1.0)


@pytest.mark.parametrize(
    "change",
    [
        lambda ground: setattr(ground.data.vertices[7].co, "z", 3.0),
        lambda ground: setattr(ground.modifiers["Hills"], "strength", 0.7),
        lambda ground: setattr(ground.modifiers["Hills"].texture, "noise_scale", 0.6),
        lambda ground: color_texture(ground.modifiers["Hills"].texture),
        lambda ground: setattr(ground.modifiers["Hills"], "vertex_group", "here"),
        lambda ground: setattr(ground.modifiers["Hills"], "texture_coords", "UV"),
        lambda ground: setattr(ground.modifiers["Slab"], "thickness", 0.2),
        lambda ground: ground.modifiers.move(2, 0),
        lambda ground: ground.modifiers.new("Smooth", "SMOOTH"),
    ],
)
def test_what_else_makes_terrain_otherwise_is_something_of_its_shape(terrain, change):
    assert_change_is_told(terrain, change)


def test_of_what_looks_elsewhere_the_shape_itself_counts(terrain):
    """A vertex group, or an object that a texture lies about, are not among the settings."""
    ground = terrain.target
    ground.modifiers["Hills"].vertex_group = "here"
    bpy.context.view_layer.update()
    terrain.ran_with = terrain.fingerprint()
    assert terrain.changes() == []
    ground.vertex_groups["here"].add([0, 1, 2, 3, 4, 5], 0.37, "REPLACE")
    bpy.context.view_layer.update()
    assert "shape or place of the target" in terrain.changes()


def test_subdivided_ground_of_an_older_file_is_up_to_date(subdivided):
    number = checksums.of_shape(subdivided.target)
    record = json.loads(subdivided.ran_with)
    subdivided.ran_with = json.dumps({**record, "target": [number, record["target"][1]]})
    assert record["target"][0] != number and subdivided.changes() == []
    subdivided.target.data.vertices[7].co.z = 3.0
    subdivided.target.data.update()
    assert subdivided.changes() == ["shape or place of the target"]


def test_renaming_changes_nothing(scatter):
    for items in (bpy.data.objects, bpy.data.images, bpy.data.meshes, bpy.data.collections, bpy.data.scenes):
        for number, item in enumerate(items):
            item.name = f"{'zyxwvutsrqponmlkjihg'[number % 20]} {number}"
    assert not active().outdated and active().changes() == []


@pytest.mark.parametrize("name", ["Ground", "Tree 1", "Tree 4"])
def test_in_edit_mode_nothing_has_changed_until_what_was_edited_is_left(scatter, name):
    """Blender keeps to itself what is edited: ground and objects that nobody had touched were called changed."""
    item = bpy.data.objects[name]
    same_mesh = item.copy()
    bpy.context.scene.collection.objects.link(same_mesh)
    edit_and_change(same_mesh, 0.0)
    assert active().changes() == []
    said = "shape or place of the target" if name == "Ground" else f"{name} edited"
    edit_and_change(item, 0.3)
    assert said in active().changes()


def edit_and_change(item, by):
    """Move the vertices of an object in Edit Mode; there, nothing is called changed yet."""
    bpy.context.view_layer.objects.active = item
    bpy.ops.object.mode_set(mode="EDIT")
    bm = bmesh.from_edit_mesh(item.data)
    bm.verts.ensure_lookup_table()
    bm.verts[0].co.z += by
    bmesh.update_edit_mesh(item.data)
    assert active().changes() == []
    bpy.ops.object.mode_set(mode="OBJECT")


@pytest.mark.parametrize("kind", ["LINK_COPY", "FULL_COPY"])
def test_copying_a_scene_changes_nothing(scatter, kind):
    first = bpy.context.scene
    bpy.ops.scene.new(type=kind)
    bpy.context.view_layer.update()
    copies = [scene for scene in bpy.data.scenes if scene != first]
    assert len(copies) == 1
    for scene in (first, copies[0]):
        assert scene.esh_scatter.active.changes() == [], scene.name
        assert not scene.esh_scatter.active.outdated
    if kind == "FULL_COPY":
        assert copies[0].esh_scatter.active.target != first.esh_scatter.active.target


def test_saving_and_reading_changes_nothing(scatter, tmp_path):
    for one in bpy.data.images:
        one.pack()
    assert scatter.changes() == [], "a packed image holds what it held"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "saved.blend"))
    assert active().changes() == []


@pytest.fixture
def many_weights():
    """A scatter whose only class follows the weights of 100,489 vertices."""
    bpy.ops.mesh.primitive_grid_add(size=20, x_subdivisions=316, y_subdivisions=316)
    ground = bpy.context.object
    ground.vertex_groups.new(name="here").add(range(len(ground.data.vertices)), 0.5, "REPLACE")
    bpy.ops.mesh.primitive_cube_add(size=0.3, location=(30, 0, 0))
    made = bpy.context.scene.esh_scatter.add_scatter(ground)
    made.add_class().add_layer("VERTEX_GROUP", vertex_group="here")
    made.classes[0].sizes[0].source_object, made.classes[0].sizes[0].count = bpy.context.object, 60
    made.device, made.max_steps = "CPU", 2
    bpy.ops.esh.scatter()
    assert made.report and not made.outdated
    return made


@pytest.mark.parametrize("vertex", [0, 50_001, 100_487])
def test_the_weight_of_one_vertex_of_100000_makes_a_result_out_of_date(many_weights, vertex):
    many_weights.target.vertex_groups["here"].add([vertex], 0.55, "REPLACE")
    assert many_weights.outdated and many_weights.changes() == ["here painted"]
    many_weights.target.vertex_groups["here"].add([vertex], 0.5, "REPLACE")
    assert not many_weights.outdated


@pytest.mark.alone
def test_looking_at_the_weights_of_100000_vertices_takes_little_time(many_weights):
    ground = many_weights.target
    seconds, one_by_one = [], []
    for _ in range(5):
        start = time.thread_time()
        checksums.of_weights(ground, "here")
        seconds.append(time.thread_time() - start)
        start = time.thread_time()
        _ = [element.weight for vertex in ground.data.vertices for element in vertex.groups]
        one_by_one.append(time.thread_time() - start)
    # As long as to look at each once; more than one line of Python for each takes four times as long.
    assert min(seconds) < 2.0 * min(one_by_one)


def test_in_a_window_numbers_are_told_again_for_a_while_and_said_to_be_old(scatter, monkeypatch):
    from types import SimpleNamespace

    monkeypatch.setattr(
        checksums, "bpy", SimpleNamespace(app=SimpleNamespace(background=False), types=bpy.types, context=bpy.context)
    )
    mask = bpy.data.images["mask.png"]
    worked_out = []
    honest = checksums._image_number
    monkeypatch.setattr(checksums, "_image_number", lambda item: worked_out.append(item) or honest(item))
    with checksums.now():
        first = checksums.of_image(mask)
    checksums.is_old()
    mask.pixels[3] = 0.5
    assert checksums.of_image(mask) == first and len(worked_out) == 1
    assert not checksums.is_old(), "this was just worked out"
    kept = checksums._kept["image", mask.session_uid]
    checksums._kept["image", mask.session_uid] = kept._replace(time=kept.time - 0.2)
    assert checksums.of_image(mask) == first and checksums.is_old() and not checksums.is_old()
    with checksums.now():
        assert checksums.of_image(mask) != first
    kept = checksums._kept["image", mask.session_uid]
    checksums._kept["image", mask.session_uid] = kept._replace(time=kept.time - 1.0, cost=0.01)
    mask.pixels[3] = 0.25
    before = len(worked_out)
    checksums.of_image(mask)
    assert len(worked_out) == before + 1, "after a second it is looked at again"
    assert time.perf_counter() > checksums._kept["image", mask.session_uid].time


def test_what_layers_look_at_makes_a_result_outdated_when_it_moves(scatter):
    rock = bpy.data.objects.new("Rock", None)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    for item in (rock, camera):
        bpy.context.scene.collection.objects.link(item)
    bpy.context.scene.camera = camera
    mask, wet = scatter.classes["Mask"], scatter.classes["Wet"]
    mask.add_layer("DISTANCE", source_object=rock, distance_far=50.0)
    wet.add_layer("CAMERA", camera_margin=10.0)
    bpy.context.view_layer.update()
    scatter.remember(scatter.result, scatter.report)
    assert not scatter.outdated
    rock.location.x = 1.0
    bpy.context.view_layer.update()
    assert scatter.changes() == ["Rock edited"]
    rock.location.x = 0.0
    camera.data.lens = 20.0
    bpy.context.view_layer.update()
    assert scatter.changes() == ["camera of Wet, Camera View"]
