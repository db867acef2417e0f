"""Classes from an image: inks with their densities, dots, and which may overlap; scattered as they are."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh.engine.problem.color_separation import MODELS, separate  # noqa: E402


@pytest.fixture
def scatter_settings(empty_file):
    bpy.ops.mesh.primitive_plane_add(size=20.0)
    bpy.ops.esh.scatter_add()
    return bpy.context.scene.esh_scatter.active


def picture(width=16, height=8):
    rng = np.random.default_rng(3)
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :3] = rng.random((height, width, 3))
    image = bpy.data.images.new("Photo", width, height, float_buffer=True)
    image.pixels.foreach_set(pixels[::-1].ravel())
    return image, pixels[..., :3]


@pytest.mark.parametrize("model", MODELS)
def test_one_class_per_ink_with_its_channel_and_counts(scatter_settings, model):
    image, pixels = picture()
    assert bpy.ops.esh.classes_from_image(image=image.name, model=model, dots=1000) == {"FINISHED"}
    channels = separate(pixels, model)
    names = [f"Photo {ink.name}" for ink in MODELS[model].inks]
    assert [c.name for c in scatter_settings.classes] == names
    for body_class, channel, ink in zip(scatter_settings.classes, channels, MODELS[model].inks, strict=True):
        stored = np.empty(4 * channel.size, np.float32)
        body_class.layers[0].image.pixels.foreach_get(stored)
        np.testing.assert_allclose(stored.reshape(*channel.shape, 4)[::-1, :, 0], channel, atol=1e-6)
        assert body_class.layers[0].image.packed_file is not None or body_class.layers[0].image.packed_files
        assert abs(body_class.count - 1000 * channel.mean()) <= 0.5
        assert tuple(body_class.color) == pytest.approx(ink.rgb)
        assert body_class.sizes[0].area == pytest.approx(0.4)
    heights = [c.offset for c in scatter_settings.classes]
    assert heights[0] > 0.0 and np.all(np.diff(heights) > 0.5 * heights[0]), (
        "no two inks are in one plane, or in the ground's"
    )
    matrix = scatter_settings.non_overlap()
    np.testing.assert_array_equal(np.ones((len(names),) * 2) if matrix is None else matrix, MODELS[model].non_overlap)


def test_dots_are_counted_on_the_surface_and_not_on_its_bounding_rectangle(scatter_settings):
    """A disc in a white image whose black part it only half reaches; the image's name has a comma."""
    bpy.ops.mesh.primitive_circle_add(vertices=256, radius=10.0, fill_type="NGON")
    scatter_settings.target = bpy.context.object
    values = np.ones((64, 64, 4), np.float32)
    values[:, :32, :3] = 0.0
    image = bpy.data.images.new("Half, black", 64, 64, float_buffer=True)
    image.pixels.foreach_set(values.ravel())
    bpy.ops.esh.classes_from_image(image=image.name, model="CMYK", dots=1000)
    (black,) = scatter_settings.classes
    assert abs(black.count - 500) <= 1
    # Of a polygon of 256 corners.
    assert black.sizes[0].area == pytest.approx(100.0 * 128 * np.sin(np.pi / 128) / 1000, rel=0.01)


def test_inks_of_an_image_with_a_comma_in_its_name_may_overlap_and_can_be_renamed(scatter_settings):
    image, _ = picture()
    image.name = "Photo, final"
    bpy.ops.esh.classes_from_image(image=image.name, model="CMY", dots=1000)
    np.testing.assert_array_equal(scatter_settings.non_overlap(), np.eye(3))
    assert scatter_settings.obstacle(bpy.context.scene) is None
    scatter_settings.classes[0].name = "Cyan"
    np.testing.assert_array_equal(scatter_settings.non_overlap(), np.eye(3))


def test_inks_scatter_as_colored_dots(scatter_settings):
    image, _ = picture()
    bpy.ops.esh.classes_from_image(image=image.name, model="CMYK", dots=600)
    scatter_settings.max_steps = 5
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    graph = bpy.context.evaluated_depsgraph_get()
    colors = [i.object.data.materials[0].name for i in graph.object_instances if i.is_instance]
    assert len(colors) == sum(c.count for c in scatter_settings.classes)
    assert set(colors) == {"C dot", "M dot", "Y dot", "K dot"}


def test_an_image_that_is_not_there_or_white_changes_nothing(scatter_settings):
    with pytest.raises(RuntimeError, match='There is no image "Nothing"'):
        bpy.ops.esh.classes_from_image(image="Nothing")
    white = bpy.data.images.new("White", 4, 4)
    white.pixels.foreach_set(np.ones(64, np.float32))
    with pytest.raises(RuntimeError, match="needs no ink"):
        bpy.ops.esh.classes_from_image(image="White")
    assert len(scatter_settings.classes) == 0


def test_settings_of_lines_ranges_and_overlap_reach_the_api(scatter_settings):
    body_class = scatter_settings.add_class()
    size = body_class.sizes[0]
    bpy.ops.mesh.primitive_cube_add(size=0.2, location=(0, 0, -50))
    size.source_object = bpy.context.object
    size.area_kind, size.area, size.area_largest, size.shape = "RANGE", 0.02, 0.06, "DOT"
    body_class.direction_kind, body_class.direction_angle = "ANGLE", 0.3
    body_class.use_unsharp, body_class.unsharp_amount = True, 0.7
    scatter_settings.avoid_overlap = False
    (target, (made,)), named = scatter_settings.arguments(bpy.context.scene)
    assert target == scatter_settings.target
    assert made.sizes[0].area == pytest.approx((0.02, 0.06))
    assert made.sizes[0].line is False
    assert made.direction == pytest.approx(0.3)
    assert (made.unsharp.amount, made.unsharp.radius) == pytest.approx((0.7, 20.0))
    assert named["avoid_overlap"] is False and named["non_overlap"] is None
    size.area_largest = 0.01
    assert "largest area is smaller" in scatter_settings.obstacle(bpy.context.scene)


@pytest.mark.parametrize(("kind", "expected"), [("TOTAL", 90), ("COVER", None)])
def test_counts_in_all_and_from_the_density_are_shared_by_footprint(scatter_settings, kind, expected):
    body_class = scatter_settings.add_class()
    body_class.add_size()
    bpy.ops.mesh.primitive_cube_add(size=0.2, location=(0, 0, -50))
    for size, area, share in zip(body_class.sizes, (1.0, 0.5), (2.0, 2.0), strict=True):
        size.source_object, size.shape = bpy.context.object, "DOT"
        size.area_kind, size.area, size.share = "VALUE", area, share
    body_class.count_kind, body_class.total = kind, 90
    scatter_settings.max_steps = 3
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    large, small = (size["placed"] for size in scatter_settings.report["classes"][0]["sizes"])
    # Half of the footprints each: twice as many of half the size. The plane has 400 m², of which discs that keep apart can cover 82 %.
    assert (large, small) == ((30, 60) if expected else (164, 328))
    body_class.total = 120
    assert scatter_settings.outdated


def test_where_there_is_no_image_its_file_is_opened(scatter_settings, tmp_path):
    path = str(tmp_path / "ink.png")
    image = bpy.data.images.new("Ink", 8, 8)
    image.filepath_raw, image.file_format = path, "PNG"
    image.save()
    bpy.data.images.remove(image)
    assert bpy.ops.esh.classes_from_image(filepath=path, dots=100) == {"FINISHED"}
    assert len(scatter_settings.classes) > 0 and "ink.png" in bpy.data.images
    with pytest.raises(RuntimeError, match="cannot be read as an image"):
        bpy.ops.esh.classes_from_image(filepath=str(tmp_path / "nothing.png"))


def test_the_dialog_begins_with_an_image_that_was_made_in_blender():
    """Blender has a type of its own for those, also once they are painted."""
    from esh.esh_scatter.densities.image_pixels import any_image

    for image in list(bpy.data.images):
        bpy.data.images.remove(image)
    assert any_image() is None
    painted = bpy.data.images.new("Painted", 8, 8)
    assert painted.type == "UV_TEST" and any_image() == painted
