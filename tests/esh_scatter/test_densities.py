"""Densities as the chart reads them, seen in where bodies are placed."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh.engine.errors import EshError  # noqa: E402
from esh.esh_scatter.api import (  # noqa: E402
    AttributeDensity,
    ImageDensity,
    ScatterClass,
    ScatterSize,
    VertexGroupDensity,
    scatter,
)
from esh.esh_scatter.densities.density_source import DensityReader  # noqa: E402
from esh.esh_scatter.densities.image_density import stored_density  # noqa: E402
from esh.esh_scatter.densities.image_pixels import image_pixels, read_image  # noqa: E402

pytestmark = pytest.mark.usefixtures("bare_file")


def new_object(name, vertices, faces):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


@pytest.fixture
def ground():
    """One face, 10 m wide: whatever is read, is read per point."""
    item = new_object("Ground", [(0, 0, 0), (10, 0, 0), (10, 10, 0), (0, 10, 0)], [(0, 1, 2, 3)])
    uv = item.data.uv_layers.new(name="Turned")
    # u runs along y: the map is not the position.
    for corner, value in enumerate([(0, 0), (0, 1), (1, 1), (1, 0)]):
        uv.data[corner].uv = value
    return item


@pytest.fixture
def stone():
    return new_object("Stone", [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])


def new_image(values, alpha=1.0):
    """``values``: gray, row 0 at the top."""
    image = bpy.data.images.new("density", values.shape[1], values.shape[0], alpha=True, float_buffer=True)
    pixels = np.repeat(values[::-1, :, None], 4, axis=2).astype(np.float32)
    pixels[..., 3] = np.asarray(alpha, np.float32)
    image.pixels.foreach_set(pixels.ravel())
    return image


def placed(ground, stone, density, count=150):
    classes = [ScatterClass("stone", [ScatterSize("s", count, stone, area=0.01)], density)]
    item = scatter(ground, classes, device="cpu", max_steps=20).object
    position = np.empty(3 * len(item.data.vertices), np.float32)
    item.data.vertices.foreach_get("co", position)
    assert len(position) == 3 * count
    return position.reshape(-1, 3)


STRIPE = np.zeros((64, 64))
STRIPE[:, 16:20] = 1.0


def test_a_sharp_stripe_on_one_face_holds_every_body(ground, stone):
    x, _, _ = placed(ground, stone, new_image(STRIPE)).T
    assert (x >= 2.5 - 1e-4).all() and (x <= 3.125 + 1e-4).all()


def test_a_uv_map_turns_the_stripe(ground, stone):
    _, y, _ = placed(ground, stone, ImageDensity(new_image(STRIPE), mapping="UV", uv_map="Turned")).T
    assert (y >= 2.5 - 0.05).all() and (y <= 3.125 + 0.05).all()


def test_inverted_it_holds_none(ground, stone):
    x, _, _ = placed(ground, stone, ImageDensity(new_image(STRIPE), invert=True)).T
    assert ((x <= 2.5 + 1e-4) | (x >= 3.125 - 1e-4)).all()


def test_the_top_row_is_at_the_largest_y(ground, stone):
    image = np.zeros((8, 8))
    image[0] = 1.0
    _, y, _ = placed(ground, stone, new_image(image)).T
    assert (y >= 8.75 - 1e-4).all()


def test_transparent_pixels_hold_nothing(ground, stone):
    x, _, _ = placed(ground, stone, new_image(np.ones((64, 64)), alpha=STRIPE)).T
    assert (x >= 2.5 - 1e-4).all() and (x <= 3.125 + 1e-4).all()


def test_a_vertex_group_is_followed_between_its_vertices(ground, stone):
    group = ground.vertex_groups.new(name="right")
    group.add([1, 2], 1.0, "REPLACE")
    x, _, _ = placed(ground, stone, VertexGroupDensity("right"), count=600).T
    # The density grows linearly from 0 at the left: its mean lies at two thirds.
    assert np.mean(x) == pytest.approx(20.0 / 3.0, abs=0.15)


@pytest.mark.parametrize(("domain", "values"), [("POINT", [0, 1, 1, 0]), ("CORNER", [0, 1, 1, 0]), ("FACE", [1])])
def test_attributes_are_followed(ground, stone, domain, values):
    attribute = ground.data.attributes.new("wanted", "FLOAT", domain)
    attribute.data.foreach_set("value", np.array(values, np.float32))
    x, _, _ = placed(ground, stone, AttributeDensity("wanted"), count=600).T
    assert np.mean(x) == pytest.approx(5.0 if domain == "FACE" else 20.0 / 3.0, abs=0.15)


class Places:
    """Points of which only the UV coordinates are asked."""

    target_name = "target"

    def __init__(self, coordinates):
        self.coordinates = np.array(coordinates, np.float64)

    def uv(self, name, key):
        return self.coordinates


def read_at(density, coordinates):
    return DensityReader(Places(coordinates)).values(stored_density(density, "key"), "key")


def test_images_are_linear_between_pixels_and_repeat():
    x, y = np.meshgrid(np.arange(7), np.arange(4))
    image = ImageDensity(new_image(1.0 + 2.0 * x + 3.0 * y), mapping="UV")
    inside = np.random.default_rng(0).uniform([0.5 / 7, 0.5 / 4], [6.5 / 7, 3.5 / 4], (500, 2))
    expected = 1.0 + 2.0 * (7 * inside[:, 0] - 0.5) + 3.0 * (4 * (1.0 - inside[:, 1]) - 0.5)
    for shift in ([0, 0], [3, -2]):
        np.testing.assert_allclose(read_at(image, inside + shift), expected, rtol=1e-5)
    # Within half a pixel of the border, and on it, nothing of the other side is mixed in.
    corners = read_at(image, [[0, 0], [1, 1], [0.01, 0.99], [2, 1]])
    np.testing.assert_allclose(corners, [1 + 9, 1 + 12, 1, 1])


def test_a_black_pixel_is_black_to_its_edge():
    image = np.ones((3, 3))
    image[1, 1] = 0.0
    along = np.linspace(0.0, 1.0, 301)[:-1] + 0.5 / 300
    places = np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)
    values = read_at(ImageDensity(new_image(image), mapping="UV"), places)
    middle = (np.abs(places - 0.5) < 1.0 / 6.0).all(axis=1)
    assert not values[middle].any() and (values[~middle] > 0.0).all()


@pytest.mark.parametrize(
    ("density", "words"),
    [
        (VertexGroupDensity("nowhere"), ["stone", "nowhere", "Ground"]),
        (AttributeDensity("nowhere"), ["stone", "nowhere", "Ground"]),
        ("white", ["stone", "white"]),
        (-1.0, ["stone", "-1"]),
        (float("nan"), ["stone"]),
        (np.zeros((4, 4)), ["stone", "0"]),
    ],
)
def test_what_is_no_density_is_named(ground, stone, density, words):
    before = set(bpy.data.objects)
    with pytest.raises(EshError) as caught:
        placed(ground, stone, density)
    assert all(word in str(caught.value) for word in words), str(caught.value)
    assert set(bpy.data.objects) == before


def test_a_missing_file_and_a_missing_uv_map_are_named(ground, stone):
    missing = bpy.data.images.new("gone", 4, 4)
    missing.source = "FILE"
    missing.filepath = "//nowhere.png"
    with pytest.raises(EshError, match="gone"):
        placed(ground, stone, missing)
    with pytest.raises(EshError, match="Ground"):
        placed(ground, stone, ImageDensity(new_image(STRIPE), mapping="UV", uv_map="nowhere"))
    with pytest.raises(EshError, match='`uv_map` of an ImageDensity must be empty unless its `mapping` is "UV"; got'):
        ImageDensity(new_image(STRIPE), uv_map="Turned")


@pytest.mark.parametrize(("source", "word"), [("SEQUENCE", "an image sequence"), ("MOVIE", "a movie")])
def test_what_has_frames_is_not_said_to_miss_its_file(ground, stone, tmp_path, source, word):
    kept = new_image(np.ones((4, 4)))
    kept.filepath_raw, kept.file_format = str(tmp_path / "frame_001.png"), "PNG"
    kept.save()
    image = bpy.data.images.load(str(tmp_path / "frame_001.png"))
    image.source = source
    with pytest.raises(EshError, match=f"must have pixels; it is {word}, of which no frame can be read: "):
        placed(ground, stone, image)
    image.source = "FILE"
    assert len(placed(ground, stone, image, 20)) == 20


def test_density_counts_per_area_of_surface(stone):
    """A flat half and one that rises by 60 degrees, of equal width seen from above: the steep one has twice the surface."""
    roof = new_object(
        "Roof",
        [(0, 0, 0), (5, 0, 0), (5, 10, 0), (0, 10, 0), (10, 0, 5 * 3**0.5), (10, 10, 5 * 3**0.5)],
        [(0, 1, 2, 3), (1, 4, 5, 2)],
    )
    x, _, _ = placed(roof, stone, 1.0, count=900).T
    assert np.mean(x > 5.0) == pytest.approx(2.0 / 3.0, abs=0.02)


def test_a_hidden_target_is_refused(ground, stone):
    ground.hide_viewport = True
    with pytest.raises(EshError, match=r"Ground.*visible"):
        placed(ground, stone, 1.0)


def tiled_image(folder, grays, kind):
    """An image of UDIM tiles of one gray each: generated, in files, or packed."""
    if kind == "generated":
        image = bpy.data.images.new("tiles", 8, 8, tiled=True)
        with bpy.context.temp_override(edit_image=image):
            bpy.ops.image.tile_fill(color=(*(grays[1001],) * 3, 1.0))
            for number in sorted(set(grays) - {1001}):
                bpy.ops.image.tile_add(number=number, width=8, height=4, fill=True, color=(*(grays[number],) * 3, 1.0))
        return image
    for number, gray in grays.items():
        tile = new_image(np.full((4, 6), gray))
        tile.file_format = "PNG"
        tile.filepath_raw = str(folder / f"gray.{number}.png")
        tile.save()
        bpy.data.images.remove(tile)
    image = bpy.data.images.load(str(folder / "gray.1001.png"))
    image.source = "TILED"
    image.filepath = str(folder / "gray.<UDIM>.png")
    for number in sorted(set(grays) - {1001}):
        image.tiles.new(number)
    image.reload()
    if kind == "packed":
        image.pack()
        for number in grays:
            (folder / f"gray.{number}.png").unlink()
    return image


@pytest.mark.parametrize("kind", ["generated", "files", "packed"])
def test_every_tile_of_a_udim_image_is_read_where_it_lies(ground, stone, tmp_path, kind):
    # Tile 1002 is black, 1011 (above 1001) white, and 1012 is missing.
    image = tiled_image(tmp_path, {1001: 1.0, 1002: 0.0, 1011: 1.0}, kind)
    uv = ground.data.uv_layers["Turned"]
    for corner, value in enumerate([(0, 0), (2, 0), (2, 2), (0, 2)]):
        uv.data[corner].uv = value
    before = set(bpy.data.images)
    x, y, _ = placed(ground, stone, ImageDensity(image, mapping="UV")).T
    assert (x <= 5.0 + 0.02).all() and (y > 5.0).sum() == pytest.approx(75, abs=8)
    # Inverted, the black tile holds all of them, and the missing one still none.
    x, y, _ = placed(ground, stone, ImageDensity(image, mapping="UV", invert=True)).T
    assert (x >= 5.0 - 0.02).all() and (y <= 5.0 + 0.02).all()
    assert set(bpy.data.images) == before


def write_png(path, depth, values):
    """A PNG of 4 x 4 pixels of these red, green, blue and alpha, in 8 or 16 bits."""
    png = pytest.importorskip("png")
    row = [round(value * (2**depth - 1)) for value in values] * 4
    with path.open("wb") as file:
        png.Writer(4, 4, greyscale=False, alpha=True, bitdepth=depth).write(file, [row] * 4)


@pytest.mark.parametrize("alpha_mode", ["STRAIGHT", "PREMUL", "CHANNEL_PACKED", "NONE"])
@pytest.mark.parametrize("color_space", ["sRGB", "Non-Color", "Linear Rec.709"])
@pytest.mark.parametrize("depth", [8, 16])
def test_tiles_have_the_values_that_an_image_of_its_own_has(tmp_path, depth, color_space, alpha_mode):
    paths = [tmp_path / f"mask.{number}.png" for number in (1001, 1002)]
    for path, values in zip(paths, [(0.2, 0.3, 0.1, 1.0), (0.4, 0.5, 0.3, 0.6)], strict=True):
        write_png(path, depth, values)
    images = [bpy.data.images.load(str(path)) for path in (*paths, paths[0])]
    tiled = images[2]
    tiled.source = "TILED"
    tiled.filepath = str(tmp_path / "mask.<UDIM>.png")
    tiled.tiles.new(1002)
    for image in images:
        image.colorspace_settings.name, image.alpha_mode = color_space, alpha_mode
        image.reload()
    read = read_image(tiled, "`density`", whole=True)
    assert tiled.file_format == "PNG"
    assert not tiled.is_dirty
    for single, number in zip(images, (1001, 1002), strict=False):
        np.testing.assert_allclose(read.tiles[number], image_pixels(single, "`density`"), atol=2e-3, rtol=2e-3)


def test_tiles_of_floating_point_numbers_go_beyond_one():
    image = bpy.data.images.new("tiles", 8, 8, tiled=True, float_buffer=True)
    with bpy.context.temp_override(edit_image=image):
        bpy.ops.image.tile_add(number=1002, width=8, height=8, fill=True, float=True, color=(2.0, 2.0, 2.0, 1.0))
    pixels = np.full(8 * 8 * 4, 3.0, np.float32)
    image.pixels.foreach_set(pixels)
    read = read_image(image, "`density`", whole=True)
    np.testing.assert_allclose(read.tiles[1001][..., :3], 3.0, rtol=1e-3)
    assert read.tiles[1002][..., :3].min() > 2.0


def test_a_missing_tile_is_a_sentence(ground, stone, tmp_path):
    bpy.data.images.remove(tiled_image(tmp_path, {1001: 1.0, 1002: 0.5}, "files"))
    (tmp_path / "gray.1002.png").unlink()
    image = bpy.data.images.load(str(tmp_path / "gray.1001.png"))
    image.source = "TILED"
    image.filepath = str(tmp_path / "gray.<UDIM>.png")
    image.tiles.new(1002)
    with pytest.raises(EshError, match=r'image "gray\.1001\.png" must have pixels in all its tiles; \w+ has none'):
        placed(ground, stone, ImageDensity(image, mapping="UV"))
