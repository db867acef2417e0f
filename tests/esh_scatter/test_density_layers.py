"""Densities of layers, and what layers can read."""

import math

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import esh  # noqa: E402
from esh.engine.surface.chart import Chart  # noqa: E402
from esh.esh_scatter.densities.density_source import DensityReader, attribute_names  # noqa: E402
from esh.esh_scatter.densities.image_density import stored_density  # noqa: E402
from esh.esh_scatter.targets.target import read_target  # noqa: E402

pytestmark = pytest.mark.usefixtures("bare_file")


def new_object(name, vertices, faces=(), edges=()):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, edges, faces)
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


def new_curve(name, points, closed):
    curve = bpy.data.curves.new(name, "CURVE")
    curve.dimensions = "3D"
    spline = curve.splines.new("POLY")
    spline.points.add(len(points) - 1)
    for point, (x, y) in zip(spline.points, points, strict=True):
        point.co = (x, y, 2.0, 1.0)
    spline.use_cyclic_u = closed
    item = bpy.data.objects.new(name, curve)
    bpy.context.scene.collection.objects.link(item)
    return item


@pytest.fixture
def ground():
    """Flat, 10 m wide."""
    return new_object("Ground", [(0, 0, 0), (10, 0, 0), (10, 10, 0), (0, 10, 0)], [(0, 1, 2, 3)])


def points_of(target, density=1.0, resolution=100):
    return Chart(read_target(target, bpy.context, attribute_names(density)), resolution).points


def values(target, density, resolution=100):
    """A density as an image, row 0 at the smallest y."""
    read = stored_density(density, "`density`")
    found = DensityReader(points_of(target, density, resolution), {"it": read}).class_density("it")
    return found.reshape(-1, resolution)[::-1]


def stack(*layers):
    return esh.DensityStack(
        [layer if isinstance(layer, esh.DensityLayer) else esh.DensityLayer(layer) for layer in layers]
    )


ACROSS = (np.arange(100) + 0.5)[None, :] / 100.0
UP = ACROSS.T[::-1]


def test_a_plain_density_is_a_stack_of_one(ground):
    group = ground.vertex_groups.new(name="wet")
    group.add([1, 2], 3.0, "REPLACE")
    for density in (esh.VertexGroupDensity("wet"), esh.VertexGroupDensity("wet", invert=True), 2.5, ACROSS):
        np.testing.assert_array_equal(values(ground, density), values(ground, stack(density)))


@pytest.mark.parametrize(
    ("blend", "expected"),
    [
        ("multiply", lambda a, b: a * b),
        ("add", lambda a, b: a + b),
        ("subtract", lambda a, b: np.maximum(a - b, 0.0)),
        ("minimum", np.minimum),
    ],
)
def test_layers_act_on_those_above_them(ground, blend, expected):
    a, b = values(ground, ACROSS), values(ground, UP)
    found = values(ground, stack(ACROSS, esh.DensityLayer(UP, blend)))
    np.testing.assert_allclose(found, expected(a, b), atol=1e-6)
    half = values(ground, stack(ACROSS, esh.DensityLayer(UP, blend, strength=0.5)))
    np.testing.assert_allclose(
        half, 0.5 * (a + expected(a, b)) if blend != "subtract" else np.maximum(a - b / 2, 0), atol=1e-6
    )
    none = values(ground, stack(ACROSS, esh.DensityLayer(UP, blend, strength=0.0)))
    np.testing.assert_allclose(none, a, atol=1e-6)


def test_the_first_layer_acts_on_everything_or_adds_to_nothing(ground):
    a = values(ground, ACROSS)
    for blend, expected in (("multiply", a), ("minimum", a), ("subtract", 1.0 - a), ("add", a)):
        np.testing.assert_allclose(values(ground, stack(esh.DensityLayer(ACROSS, blend))), expected, atol=1e-6)
    found = values(ground, stack(esh.DensityLayer(ACROSS, "add", strength=0.25)))
    np.testing.assert_allclose(found, 0.25 * a, atol=1e-6)


def test_layers_are_inverted_before_their_curve_bends_them(ground):
    a = values(ground, ACROSS)
    layer = esh.DensityLayer(ACROSS, invert=True, curve=[(0.0, 0.0), (0.5, 1.0), (1.0, 0.0)])
    np.testing.assert_allclose(values(ground, stack(layer)), 1.0 - np.abs(1.0 - 2.0 * a), atol=1e-6)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: esh.DensityLayer(1.0, "screen"), ["`blend`", "DensityLayer", '"minimum"', '"screen"']),
        (lambda: esh.DensityLayer(1.0, strength=1.5), ["`strength`", "DensityLayer", "1.5"]),
        (lambda: esh.DensityLayer(1.0, curve=[(0.0, 0.0), (0.0, 1.0)]), ["`curve`", "(x, y)"]),
        (lambda: esh.DensityLayer(1.0, curve="up"), ["`curve`", "up"]),
        (lambda: esh.DensityStack([]), ["`layers`", "at least one"]),
        (lambda: esh.DensityStack([1.0]), ["`layers`", "DensityLayer"]),
        (lambda: esh.SlopeDensity(high=4.0), ["`high` of a SlopeDensity", "4"]),
        (lambda: esh.NoiseDensity(scale=0.0), ["`scale` of a NoiseDensity", "0"]),
        (lambda: esh.DistanceDensity("Path"), ["`source` of a DistanceDensity", "Path"]),
        (lambda: esh.ImageDensity(None, channel="hue"), ["`channel` of an ImageDensity", '"alpha"', "hue"]),
    ],
)
def test_what_has_no_meaning_is_named(make, words):
    with pytest.raises(esh.ProblemError) as caught:
        make()
    assert all(word in str(caught.value) for word in words), str(caught.value)


def test_the_layer_that_leaves_nothing_is_named(ground):
    image = bpy.data.images.new("mask", 4, 4)
    image.generated_color = (0.0, 0.0, 0.0, 1.0)
    left, right = (ACROSS < 0.4).astype(float), (ACROSS > 0.6).astype(float)
    for layers, words in (
        ((1.0, esh.ImageDensity(image), 1.0), 'layer 2 (image "mask") is 0 everywhere'),
        ((left, esh.DensityLayer(right, name="rocks")), 'layer 2 ("rocks") leaves nothing of those before it'),
        ((1.0, esh.DensityLayer(1.0, "subtract")), "layer 2 (a number or an image) leaves nothing"),
        ((0.0, esh.DensityLayer(1.0, "add"), 0.0), "layer 3 (a number or an image) is 0 everywhere"),
    ):
        with pytest.raises(esh.ProblemError) as caught:
            values(ground, stack(*layers))
        assert words in str(caught.value), str(caught.value)
    # One that is 0 everywhere is none where another adds.
    assert values(ground, stack(0.0, esh.DensityLayer(1.0, "add"))).min() == 1.0


def roof(degrees):
    """Rises along x as far as the ridge at 5 m, and falls again; level from 10 m on."""
    top = 5.0 * math.tan(math.radians(degrees))
    x = [0, 5, 10, 20]
    corners = [(x[i], y, top * (i == 1)) for y in (0, 20) for i in range(4)]
    return new_object("Roof", corners, [(i, i + 1, i + 5, i + 4) for i in range(3)])


def test_slope_altitude_and_facing():
    target = roof(30.0)
    x = (np.arange(200) + 0.5) / 10.0
    degrees = math.radians
    steep = values(target, esh.SlopeDensity(degrees(25.0), degrees(35.0), falloff=0.0), 200)[50]
    np.testing.assert_array_equal(steep, x < 10.0)
    # 30 degrees are halfway out of what fades from 25 to 35.
    fading = values(target, esh.SlopeDensity(0.0, degrees(25.0), falloff=degrees(10.0)), 200)[50]
    np.testing.assert_allclose(fading, np.where(x < 10.0, 0.5, 1.0), atol=1e-4)
    height = np.where(x < 5.0, x, np.maximum(10.0 - x, 0.0)) * math.tan(degrees(30.0))
    high = values(target, esh.AltitudeDensity(1.0, 2.0, falloff=0.5), 200)[50]
    beside = np.maximum(np.maximum(1.0 - height, height - 2.0), 0.0)
    np.testing.assert_allclose(high, np.maximum(1.0 - beside / 0.5, 0.0), atol=1e-4)
    west = values(target, esh.FacingDensity(math.pi, degrees(60.0), 0.0), 200)[50]
    np.testing.assert_array_equal(west, x < 5.0)
    around = values(target, esh.FacingDensity(degrees(-150.0), 0.0, degrees(60.0)), 200)[50]
    np.testing.assert_allclose(around, np.where(x < 5.0, 0.5, 0.0), atol=1e-4)


def test_noise_covers_what_was_asked_for_and_follows_its_seed(ground):
    for cover in (0.2, 0.5, 0.8):
        found = values(ground, esh.NoiseDensity(0.3, cover=cover, softness=0.0), 400)
        assert set(np.unique(found)) == {0.0, 1.0}
        assert found.mean() == pytest.approx(cover, abs=0.05)
    assert values(ground, esh.NoiseDensity(1.0, cover=1.0, softness=1.0)).min() == 1.0
    one, other = (values(ground, esh.NoiseDensity(1.0, seed=seed)) for seed in (1, 2))
    assert np.abs(one - other).mean() > 0.1
    with pytest.raises(esh.ProblemError, match="noise is 0 everywhere"):
        values(ground, esh.NoiseDensity(1.0, cover=0.0))


def centers(resolution=100, width=10.0):
    along = (np.arange(resolution) + 0.5) * width / resolution
    return np.meshgrid(along, along)


def test_distance_to_a_mesh_a_curve_an_empty_and_a_collection(ground):
    x, y = centers()
    # A cube hangs in the air; seen from above, the ground below it is within.
    cube = new_object("Cube", [(2, 2, 5), (4, 2, 5), (4, 4, 9), (2, 4, 9)], [(0, 1, 2, 3)])
    to_cube = np.hypot(np.maximum(np.maximum(2 - x, x - 4), 0), np.maximum(np.maximum(2 - y, y - 4), 0))
    path = new_curve("Path", [(8, 0), (8, 10)], closed=False)
    empty = bpy.data.objects.new("Empty", None)
    bpy.context.scene.collection.objects.link(empty)
    empty.location = (1.0, 9.0, 3.0)
    both = bpy.data.collections.new("Both")
    both.objects.link(cube)
    both.objects.link(empty)
    bpy.context.view_layer.update()
    to_empty = np.hypot(x - 1.0, y - 9.0)
    for source, expected in (
        (cube, to_cube),
        (path, np.abs(x - 8.0)),
        (empty, to_empty),
        (both, np.minimum(to_cube, to_empty)),
        ([cube, path], np.minimum(to_cube, np.abs(x - 8.0))),
    ):
        found = values(ground, esh.DistanceDensity(source, 0.5, 2.5, "linear"))
        np.testing.assert_allclose(found, np.clip((2.5 - expected) / 2.0, 0.0, 1.0), atol=1e-4)
    smooth = values(ground, esh.DistanceDensity(path, 0.0, 4.0))
    fallen = np.clip(1.0 - np.abs(x - 8.0) / 4.0, 0.0, 1.0)
    np.testing.assert_allclose(smooth, fallen**2 * (3.0 - 2.0 * fallen), atol=1e-4)
    hard = values(ground, esh.DistanceDensity(path, 1.0, 1.0))
    np.testing.assert_array_equal(hard, np.abs(x - 8.0) <= 1.0)


def test_distance_to_what_another_scatter_has_placed(ground):
    stone = new_object("Stone", [(0, 0, 0), (0.1, 0, 0), (0, 0.1, 0)], [(0, 1, 2)])
    made = esh.scatter(ground, [esh.ScatterClass("stone", [esh.ScatterSize("s", 5, stone)])], device="cpu", max_steps=5)
    x, y = centers()
    where = made.instances.position[:, :2]
    expected = np.hypot(x[..., None] - where[:, 0], y[..., None] - where[:, 1]).min(axis=-1)
    found = values(ground, esh.DistanceDensity(made.object, 0.0, 3.0, "linear"))
    np.testing.assert_allclose(found, np.clip(1.0 - expected / 3.0, 0.0, 1.0), atol=1e-4)


def test_members_of_a_collection_instance_count_where_they_stand(ground):
    kept = bpy.data.collections.new("Kept")
    member = new_object("Member", [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2, 3)])
    bpy.context.scene.collection.objects.unlink(member)
    kept.objects.link(member)
    kept.instance_offset = (1.0, 0.0, 0.0)
    instance = bpy.data.objects.new("Instance", None)
    instance.instance_type, instance.instance_collection = "COLLECTION", kept
    bpy.context.scene.collection.objects.link(instance)
    instance.location = (5.0, 5.0, 0.0)
    bpy.context.view_layer.update()
    x, y = centers()
    found = values(ground, esh.InsideDensity(instance))
    np.testing.assert_array_equal(found, (x > 4) & (x < 5) & (y > 5) & (y < 6))


def test_inside_of_curves_closed_or_not_and_of_meshes(ground):
    x, y = centers()
    square = [(2, 3), (7, 3), (7, 8), (2, 8)]
    within = (x > 2) & (x < 7) & (y > 3) & (y < 8)
    beside = np.hypot(np.maximum(np.maximum(2 - x, x - 7), 0), np.maximum(np.maximum(3 - y, y - 8), 0))
    closed, open_one = new_curve("Closed", square, True), new_curve("Open", square, False)
    plate = new_object("Plate", [(a, b, 4) for a, b in square], [(0, 1, 2, 3)])
    loop = new_object("Loop", [(a, b, 4) for a, b in square], edges=[(0, 1), (1, 2), (2, 3), (3, 0)])
    for source in (closed, open_one, plate, loop, [closed, plate], [closed, open_one]):
        np.testing.assert_array_equal(values(ground, esh.InsideDensity(source)), within)
    for source in (closed, plate):
        found = values(ground, esh.InsideDensity(source, falloff=2.0))
        np.testing.assert_allclose(found, np.maximum(1.0 - beside / 2.0, 0.0), atol=1e-4)
    # Stretched by its object.
    closed.scale = (1.0, 0.5, 1.0)
    bpy.context.view_layer.update()
    found = values(ground, esh.InsideDensity(closed))
    np.testing.assert_array_equal(found, (x > 2) & (x < 7) & (y > 1.5) & (y < 4))


def test_an_empty_collection_and_one_that_was_removed_are_named(ground):
    empty = bpy.data.collections.new("Bare")
    with pytest.raises(esh.ProblemError, match='collection "Bare" is empty'):
        values(ground, esh.DistanceDensity(empty))
    gone = new_object("Gone", [(0, 0, 0)])
    density = esh.DistanceDensity(gone)
    bpy.data.objects.remove(gone)
    with pytest.raises(esh.ProblemError, match="removed"):
        values(ground, density)


def test_what_a_camera_sees(ground):
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    bpy.context.scene.collection.objects.link(camera)
    with pytest.raises(esh.ProblemError, match="needs a camera"):
        values(ground, esh.CameraDensity())
    camera.data.type, camera.data.ortho_scale = "ORTHO", 4.0
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y = 200, 100
    # Looks straight down on a rectangle of 4 by 2 m.
    camera.location, camera.scale = (5.0, 5.0, 10.0), (3.0, 3.0, 3.0)
    bpy.context.scene.camera = camera
    bpy.context.view_layer.update()
    x, y = centers()
    expected = (np.abs(x - 5) < 2) & (np.abs(y - 5) < 1)
    np.testing.assert_array_equal(values(ground, esh.CameraDensity(margin=0.0)), expected)
    np.testing.assert_array_equal(values(ground, esh.CameraDensity(camera, margin=0.0)), expected)
    # Half of what fades out within a quarter of the picture, an eighth of it beside.
    soft = values(ground, esh.CameraDensity(margin=0.25))
    assert soft[50, 18] == 0.0 and soft[50, 24] == pytest.approx(1.0 - (5 - 2.45 - 2) / 4 / 0.25, abs=1e-3)
    camera.data.type = "PERSP"
    camera.rotation_euler = (math.pi, 0.0, 0.0)
    bpy.context.view_layer.update()
    with pytest.raises(esh.ProblemError, match='view of "Camera" is 0 everywhere'):
        values(ground, esh.CameraDensity(camera))
    camera.rotation_euler = (0.0, 0.0, 0.0)
    bpy.context.view_layer.update()
    width = 10.0 * camera.data.sensor_width / camera.data.lens
    seen = values(ground, esh.CameraDensity(margin=0.0))
    np.testing.assert_array_equal(seen, (np.abs(x - 5) < width / 2) & (np.abs(y - 5) < width / 4))
    near = values(ground, esh.CameraDensity(margin=10.0, distance=10.5, falloff=0.0))
    np.testing.assert_array_equal(near > 0.0, np.sqrt(100 + (x - 5) ** 2 + (y - 5) ** 2) <= 10.5)
    bad = new_object("Bad", [(0, 0, 0)])
    with pytest.raises(esh.ProblemError, match='"Bad" is of type MESH'):
        esh.CameraDensity(bad)


def test_another_class_of_the_scatter_is_followed_but_not_in_a_circle(ground):
    points = points_of(ground)
    classes = {"pine": ACROSS, "moss": esh.ClassDensity("pine"), "a": esh.ClassDensity("b"), "b": esh.ClassDensity("a")}
    classes["stone"] = stack(esh.DensityLayer(esh.ClassDensity("moss"), invert=True))
    classes["lost"] = esh.ClassDensity("oak")
    reader = DensityReader(points, classes)
    np.testing.assert_array_equal(reader.class_density("stone"), 1.0 - reader.class_density("pine"))
    with pytest.raises(esh.ProblemError, match='"a" follows "b" follows "a"'):
        reader.class_density("a")
    with pytest.raises(esh.ProblemError, match='"oak" is none of them: "pine", "moss", "a", "b", "stone"'):
        reader.class_density("lost")


def test_bodies_follow_layers(ground):
    stone = new_object("Stone", [(0, 0, 0), (0.1, 0, 0), (0, 0.1, 0)], [(0, 1, 2)])
    border = new_curve("Border", [(0, 0), (6, 0), (6, 10), (0, 10)], True)
    group = ground.vertex_groups.new(name="top")
    group.add([2, 3], 1.0, "REPLACE")
    size = [esh.ScatterSize("s", 300, stone)]
    # Above the middle, left of 6 m, and not where the pines are.
    layers = [
        esh.DensityLayer(esh.VertexGroupDensity("top"), curve=[(0.0, 0.0), (0.5, 0.0), (0.501, 1.0), (1.0, 1.0)]),
        esh.DensityLayer(esh.InsideDensity(border)),
        esh.DensityLayer(esh.ClassDensity("pine"), "subtract"),
    ]
    pine = esh.ScatterClass("pine", size, (ACROSS < 0.2).astype(float))
    classes = [esh.ScatterClass("stone", size, esh.DensityStack(layers)), pine]
    placement = esh.scatter(ground, classes, device="cpu", max_steps=30).placement
    x, y = placement.position[placement.class_index == 0].T
    assert (x > 1.98).all() and (x < 6.02).all() and (y > 4.97).all()


def painted(width, height, rgba, is_data=True, is_float=False):
    image = bpy.data.images.new("painted", width, height, alpha=True, float_buffer=is_float, is_data=is_data)
    image.pixels.foreach_set(np.broadcast_to(np.array(rgba, np.float32), (height, width, 4)).ravel())
    return image


@pytest.mark.parametrize(
    ("channel", "expected"), [("red", 0.4), ("green", 0.2), ("blue", 0.1), ("alpha", 0.5), ("luminance", None)]
)
def test_channels_of_an_image(ground, channel, expected):
    image = painted(4, 4, (0.8, 0.4, 0.2, 0.5), is_float=True)
    found = values(ground, esh.ImageDensity(image, channel=channel))
    expected = 0.5 * (0.2126 * 0.8 + 0.7152 * 0.4 + 0.0722 * 0.2) if expected is None else expected
    np.testing.assert_allclose(found, expected, atol=0.03 if channel == "luminance" else 1e-6)


def test_a_gray_is_read_as_it_is_stored_or_as_light(ground):
    stored = painted(4, 4, (0.5, 0.5, 0.5, 1.0), is_data=False)
    np.testing.assert_allclose(values(ground, esh.ImageDensity(stored)), 128 / 255, atol=1e-3)
    linear = values(ground, esh.ImageDensity(stored, color_space="linear"))
    np.testing.assert_allclose(linear, ((128 / 255 + 0.055) / 1.055) ** 2.4, atol=1e-3)
    data = painted(4, 4, (0.5, 0.5, 0.5, 1.0), is_data=True)
    np.testing.assert_allclose(values(ground, esh.ImageDensity(data, color_space="linear")), 128 / 255, atol=1e-3)


def test_images_are_tiled_moved_and_turned():
    """On ground twice as wide as high, where a turn must not shear."""
    ground = new_object("Wide", [(0, 0, 0), (20, 0, 0), (20, 10, 0), (0, 10, 0)], [(0, 1, 2, 3)])
    image = bpy.data.images.new("stripe", 8, 8, float_buffer=True, is_data=True)
    pixels = np.ones((8, 8, 4), np.float32)
    pixels[:, 4:, :3] = 0.0
    image.pixels.foreach_set(pixels.ravel())
    x, y = np.meshgrid((np.arange(200) + 0.5) / 10.0, (np.arange(100) + 0.5) / 10.0)

    def white(**more):
        return values(ground, esh.ImageDensity(image, **more), 200) > 0.0

    np.testing.assert_array_equal(white(), x < 10.0)
    # Repeated about its middle.
    np.testing.assert_array_equal(white(tiling=(2.0, 1.0)), (x > 5.0) & (x < 10.0) | (x > 15.0))
    np.testing.assert_array_equal(white(offset=(0.25, 0.0)), (x > 5.0) & (x < 15.0))
    quarter = white(rotation=math.pi / 2)
    # Left has become below.
    np.testing.assert_array_equal(quarter, y < 5.0)
    slanted = white(rotation=math.pi / 4)
    near = (np.abs(x - 10) < 4) & (np.abs(y - 5) < 4)
    away = np.abs((x - 10) + (y - 5)) > 0.2
    np.testing.assert_array_equal(slanted[near & away], (x - 10 + y - 5 < 0)[near & away])


def test_what_says_the_same_is_known_by_it(ground):
    """Whoever keeps densities tells by this which are to be read again."""
    group = ground.vertex_groups.new(name="wet")
    group.add([1, 2], 1.0, "REPLACE")
    near = new_curve("Path", [(8, 0), (8, 10)], closed=False)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    bpy.context.scene.collection.objects.link(camera)
    image = painted(4, 4, (0.5, 0.5, 0.5, 1.0))
    bpy.context.view_layer.update()

    def content(density):
        read = stored_density(density, "`density`")
        reader = DensityReader(points_of(ground, density), {"it": read, "other": 0.5})
        return reader.content("it")

    pairs = [
        (esh.SlopeDensity(0.1), esh.SlopeDensity(0.2)),
        (esh.NoiseDensity(seed=1), esh.NoiseDensity(seed=2)),
        (esh.DistanceDensity(near), esh.DistanceDensity(ground)),
        (esh.InsideDensity(near), esh.InsideDensity(near, 1.0)),
        (esh.CameraDensity(camera), esh.CameraDensity(camera, 0.5)),
        (esh.ImageDensity(image), esh.ImageDensity(image, tiling=(2.0, 1.0))),
        (esh.VertexGroupDensity("wet"), esh.VertexGroupDensity("wet", invert=True)),
        (esh.ClassDensity("other"), 0.25),
        (stack(0.5, 1.0), stack(0.5, esh.DensityLayer(1.0, "minimum"))),
        (ACROSS, UP),
    ]
    for one, other in pairs:
        assert content(one) is not None and content(one) == content(one) != content(other), one
    before = [
        content(density) for density in (esh.DistanceDensity(near), esh.CameraDensity(camera), esh.ImageDensity(image))
    ]
    near.location.x += 1.0
    camera.location.x += 1.0
    image.pixels[0] = 0.25
    bpy.context.view_layer.update()
    after = [
        content(density) for density in (esh.DistanceDensity(near), esh.CameraDensity(camera), esh.ImageDensity(image))
    ]
    assert all(one != other for one, other in zip(before, after, strict=True))
    assert content(esh.ClassDensity("it")) is None
