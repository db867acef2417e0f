"""Directions along edges, angle by angle, and every way to give them."""

import numpy as np
import pytest
from esh.engine.errors import ProblemError
from esh.engine.problem.direction_field import (
    density_directions,
    direction_field,
    direction_from_angle_image,
    direction_from_rg,
    structure_tensor,
)
from esh.engine.quality.line_quality import angle_errors

FLAT = np.ones((6, 8))


def centers(height, width, size=None):
    """Positions of pixels, y up, row 0 at the top."""
    size = size or (width, height)
    x = (np.arange(width) + 0.5) * size[0] / width
    y = size[1] - (np.arange(height) + 0.5) * size[1] / height
    return np.meshgrid(x, y)


def edge(angle, height=64, width=80, size=None, softness=1.5):
    """An image with one soft edge through its middle that runs in direction ``angle``."""
    x, y = centers(height, width, size)
    across = np.cos(angle) * (y - y.mean()) - np.sin(angle) * (x - x.mean())
    return 0.5 + 0.5 * np.tanh(across / softness)


def inner(image, margin=12):
    return image[margin:-margin, margin:-margin]


@pytest.mark.parametrize("degrees", [0, 10, 30, 45, 60, 90, 120, 135, 150, 179])
def test_directions_run_along_edges(degrees):
    angle = np.radians(degrees)
    field = density_directions(edge(angle))
    clear = inner(field.weight) > 0.2
    assert clear.sum() > 100
    # Central differences shorten steep gradients, by less than 2 degrees here.
    assert np.degrees(angle_errors(inner(field.angle)[clear], angle)).max() < 2.0
    assert inner(field.coherence)[clear].min() > 0.98
    assert ((field.angle >= 0.0) & (field.angle <= np.pi)).all()


@pytest.mark.parametrize("degrees", [20, 45, 110])
@pytest.mark.parametrize("shape", [(100, 100), (60, 200)])
def test_directions_are_those_of_the_domain_whatever_the_pixels_aspect(degrees, shape):
    size = (10.0, 5.0)
    height, width = shape
    image = edge(np.radians(degrees), height, width, size, softness=0.25)
    field = density_directions(image, pixel_size=(size[0] / width, size[1] / height))
    clear = inner(field.weight) > 0.3
    assert clear.sum() > 100
    assert np.degrees(angle_errors(inner(field.angle)[clear], np.radians(degrees))).max() < 2.5
    if height == width:
        square = density_directions(image)
        assert np.degrees(angle_errors(inner(square.angle)[clear], np.radians(degrees))).mean() > 5.0


def test_directions_run_around_a_disc():
    x, y = centers(90, 90)
    radius = np.hypot(x - 45.0, y - 45.0)
    field = density_directions(1.0 / (1.0 + np.exp(radius - 25.0)))
    clear = np.abs(radius - 25.0) < 4.0
    assert field.weight[clear].min() > 0.3
    tangent = np.arctan2(y - 45.0, x - 45.0) + 0.5 * np.pi
    assert np.degrees(angle_errors(field.angle[clear], tangent[clear])).max() < 2.0
    # Nothing happens in its middle, nor far outside.
    assert field.weight[radius < 5.0].max() < 1e-3


def test_directions_turn_with_the_image():
    image = np.random.default_rng(3).random((40, 40))
    field, turned = density_directions(image), density_directions(np.rot90(image))
    strong = np.rot90(field.coherence) > 1e-3
    assert angle_errors(turned.angle, np.rot90(field.angle) + 0.5 * np.pi)[strong].max() < 1e-9
    np.testing.assert_allclose(turned.weight, np.rot90(field.weight), atol=1e-12)
    np.testing.assert_allclose(turned.coherence, np.rot90(field.coherence), atol=1e-9)


def test_scale_and_offset_of_the_density_do_not_matter():
    image = np.random.default_rng(4).random((30, 50))
    field = density_directions(image)
    for other in (1e-6 * image, 1e6 * image, image + 5.0, 1.0 - image):
        found = density_directions(other)
        assert angle_errors(found.angle, field.angle)[field.coherence > 1e-3].max() < 1e-6
        np.testing.assert_allclose(found.weight, field.weight, atol=1e-8)


def test_weight_and_coherence_are_those_of_the_eigenvalues():
    image = np.random.default_rng(5).random((24, 31))
    xx, xy, yy = structure_tensor(image, 0.8, 2.0)
    values, vectors = np.linalg.eigh(np.stack([np.stack([xx, xy], -1), np.stack([xy, yy], -1)], -2))
    field = density_directions(image, 0.8, 2.0)
    np.testing.assert_allclose(field.weight, values[..., 1] / values[..., 1].max(), atol=1e-12)
    coherence = (values[..., 1] - values[..., 0]) / values.sum(axis=-1)
    np.testing.assert_allclose(field.coherence, coherence, atol=1e-12)
    along = np.stack([np.cos(field.angle), np.sin(field.angle)], axis=-1)
    assert np.abs((along * vectors[..., 1]).sum(axis=-1)).max() < 1e-7
    assert field.weight.max() == 1.0


def test_structure_tensor_equals_equation_8_by_scipy():
    ndimage = pytest.importorskip("scipy.ndimage")
    image = np.random.default_rng(6).random((30, 41))
    smooth = ndimage.gaussian_filter(image, 1.0, mode="reflect")
    x = ndimage.correlate1d(smooth, [-0.5, 0.0, 0.5], axis=1, mode="reflect")
    # Rows count downwards, y upwards.
    y = -ndimage.correlate1d(smooth, [-0.5, 0.0, 0.5], axis=0, mode="reflect")
    for found, product in zip(structure_tensor(image), (x * x, x * y, y * y), strict=True):
        np.testing.assert_allclose(found, ndimage.gaussian_filter(product, 3.0, mode="reflect"), atol=1e-14)


@pytest.mark.parametrize("value", [1.0, 0.1, 1e-7, 12345.678])
@pytest.mark.parametrize("scales", [(1.0, 3.0), (8.0, 20.0)])
@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (33, 57)])
def test_a_flat_density_asks_for_no_direction(value, scales, shape):
    field = density_directions(np.full(shape, value, dtype=np.float32), *scales)
    assert not field.weight.any() and not field.coherence.any() and np.isfinite(field.angle).all()
    assert not field.double_angle_vectors().any()


def test_the_words():
    image = edge(0.5)
    found, expected = direction_field("density", image, 1.5, 2.0), density_directions(image, 1.5, 2.0)
    np.testing.assert_array_equal(found.angle, expected.angle)
    np.testing.assert_array_equal(found.weight, expected.weight)
    nothing = direction_field("none", image)
    assert not nothing.weight.any() and not nothing.double_angle_vectors().any()
    stretched = direction_field("density", image, pixel_size=(2.0, 1.0))
    np.testing.assert_array_equal(stretched.angle, density_directions(image, pixel_size=(2.0, 1.0)).angle)


@pytest.mark.parametrize("angle", [0, 1, 0.3, -0.3, 3.5, 100.0, np.float32(0.25)])
def test_a_number_is_that_angle_everywhere(angle):
    field = direction_field(angle, FLAT)
    assert angle_errors(field.angle, float(angle)).max() < 1e-9
    assert (field.weight == 1.0).all() and (field.coherence == 1.0).all()
    expected = [np.cos(2.0 * float(angle)), np.sin(2.0 * float(angle))]
    vectors = field.double_angle_vectors()
    assert vectors.dtype == np.float32 and vectors.shape[-1] == 2
    np.testing.assert_allclose(vectors, np.broadcast_to(expected, vectors.shape), atol=1e-5)


def test_an_image_of_angles():
    angle = np.random.default_rng(0).uniform(-10.0, 10.0, (5, 7))
    field = direction_field(angle, FLAT)
    assert field.angle.shape == field.weight.shape == (5, 7)
    assert angle_errors(field.angle, angle).max() < 1e-5
    assert (field.weight == 1.0).all()


def test_an_image_of_vectors_points_up_and_weighs_by_length():
    vectors = np.zeros((2, 3, 2))
    vectors[0] = [[1.0, 0.0], [0.0, 0.5], [-0.3, -0.4]]
    vectors[1, :2] = [[3.0, 4.0], [-0.1, 0.1]]
    field = direction_field(vectors, FLAT)
    expected = [[1.0, 0.5, 0.5], [1.0, np.hypot(0.1, 0.1), 0.0]]
    np.testing.assert_allclose(field.weight, expected, atol=1e-6)
    degrees = np.degrees(field.angle)
    np.testing.assert_allclose(degrees[0], [0.0, 90.0, np.degrees(np.arctan2(4.0, 3.0))], atol=1e-4)
    np.testing.assert_allclose(degrees[1, :2], [np.degrees(np.arctan2(4.0, 3.0)), 135.0], atol=1e-4)
    assert field.coherence.tolist() == [[1.0, 1.0, 1.0], [1.0, 1.0, 0.0]]
    np.testing.assert_array_equal(field.double_angle_vectors()[1, 2], [0.0, 0.0])


def test_opposite_directions_are_the_same_and_perpendicular_ones_cancel():
    vectors = direction_field(np.array([[0.4, 0.4 + np.pi, 0.4 + 0.5 * np.pi]]), FLAT).double_angle_vectors()[0]
    np.testing.assert_allclose(vectors[0], vectors[1], atol=1e-5)
    np.testing.assert_allclose(vectors[0] + vectors[2], 0.0, atol=1e-5)


@pytest.mark.parametrize(
    ("direction", "said"),
    [
        ("sideways", "sideways"),
        (np.nan, "direction"),
        (np.inf, "finite"),
        (np.array([[0.0, np.nan]]), "NaN"),
        (np.zeros((4, 5, 2)), "are 0"),
        (np.ones((4, 5, 3)), "[4, 5, 3]"),
        (np.ones(4), "image of angles"),
        (np.ones((0, 3)), "image of angles"),
        (np.ones((2, 2), dtype=complex), "image of angles"),
        (None, "None"),
        (True, "True"),
        ([["a", "b"]], "image of angles"),
    ],
)
def test_anything_else_is_refused_in_a_sentence(direction, said):
    with pytest.raises(ProblemError) as caught:
        direction_field(direction, FLAT)
    message = str(caught.value)
    assert "`direction`" in message and said in message and "\n" not in message


def test_vectors_from_red_and_green():
    image = np.array([[[1.0, 0.5, 0.5], [0.5, 1.0, 0.5], [0.0, 0.5, 0.5], [0.5, 0.0, 1.0], [0.75, 0.75, 0.0]]])
    vectors = direction_from_rg(image)
    assert vectors.dtype == np.float32
    np.testing.assert_array_equal(vectors[0], [[1, 0], [0, 1], [-1, 0], [0, -1], [0.5, 0.5]])
    assert np.degrees(direction_field(vectors, FLAT).angle[0]) == pytest.approx([0, 90, 0, 90, 45], abs=1e-3)


@pytest.mark.parametrize("middle", [127, 128])
def test_the_middle_of_8_bits_is_no_direction(middle):
    image = np.full((3, 4, 3), middle / 255.0, dtype=np.float32)
    assert not direction_from_rg(image).any()
    image[0, 0, 0] = 1.0
    np.testing.assert_array_equal(direction_from_rg(image)[0, 0], [1.0, 0.0])


@pytest.mark.parametrize("shape", [(4, 5), (4, 5, 1), (5,)])
def test_an_image_without_green_holds_no_vectors(shape):
    with pytest.raises(ProblemError, match="red and a green"):
        direction_from_rg(np.ones(shape))


def test_angles_from_gray_values():
    angles = direction_from_angle_image(np.array([[0.0, 0.25, 0.5, 0.75, 1.0]]))
    assert np.degrees(angles[0]) == pytest.approx([0.0, 45.0, 90.0, 135.0, 180.0])
    assert angle_errors(angles[0, 4], angles[0, 0]) < 1e-6
