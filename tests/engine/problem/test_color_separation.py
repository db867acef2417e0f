"""Ink channels: exact for every color and model, and the problems made of them."""

import numpy as np
import pytest
from esh.engine.errors import ProblemError
from esh.engine.problem.color_separation import MODELS, Ink, InkModel, halftone_problem, ink_colors, separate
from esh.engine.problem.domain import Domain
from esh.engine.problem.size import Size
from hypothesis import given
from hypothesis import strategies as st

COLORS = st.lists(st.tuples(*[st.floats(0.0, 1.0)] * 3), min_size=1, max_size=12)


@given(COLORS, st.sampled_from(sorted(MODELS)))
def test_channels_add_up_to_the_complement_of_every_color(colors, name):
    image = np.array(colors)[None]
    channels = separate(image, name)
    held = np.array([ink.cmy for ink in MODELS[name].inks], dtype=float)
    np.testing.assert_allclose(np.einsum("ihw,ic->hwc", channels, held), 1.0 - image, atol=1e-12)
    assert channels.min() >= 0.0


@given(COLORS)
def test_achromatic_composition_as_in_the_paper(colors):
    """K is the minimum of C, M and Y; red that of what is left of M and Y; afterwards one of C, M and Y is zero."""
    image = np.array(colors)[None]
    cyan, magenta, yellow, red, green, blue, black = separate(image, "CMY-RGB-K")
    cmy = 1.0 - image
    np.testing.assert_allclose(black, cmy.min(axis=-1))
    rest = cmy - black[..., None]
    np.testing.assert_allclose(red, rest[..., 1:].min(axis=-1), atol=1e-12)
    np.testing.assert_allclose(green, rest[..., ::2].min(axis=-1), atol=1e-12)
    np.testing.assert_allclose(blue, rest[..., :2].min(axis=-1), atol=1e-12)
    assert (np.minimum(np.minimum(cyan, magenta), yellow) <= 1e-12).all()
    # At most one pure and one mixed ink beside black.
    assert ((np.stack([cyan, magenta, yellow]) > 1e-9).sum(axis=0) <= 1).all()


def test_the_papers_non_overlap_maps():
    inks = {name: [ink.name for ink in model.inks] for name, model in MODELS.items()}
    assert inks["CMY-RG-K"] == ["C", "M", "Y", "R", "G", "K"]
    np.testing.assert_array_equal(MODELS["CMYK"].non_overlap[3], 1.0)
    np.testing.assert_array_equal(np.asarray(MODELS["CMYK"].non_overlap)[:3, :3], np.eye(3))
    np.testing.assert_array_equal(MODELS["CMY-RGB-K"].non_overlap, 1.0)
    for name, pair in (("CMY-RG-K", "CM"), ("CMY-RB-K", "CY")):
        matrix = np.ones((6, 6))
        i, j = (inks[name].index(letter) for letter in pair)
        matrix[i, j] = matrix[j, i] = 0.0
        np.testing.assert_array_equal(MODELS[name].non_overlap, matrix)


@pytest.mark.parametrize("kind", ["uint8", "uint16", "gray", "alpha", "gray alpha"])
def test_every_kind_of_image(kind):
    rng = np.random.default_rng(0)
    color = rng.random((3, 4, 3))
    expected = separate(color, "CMYK")
    if kind.startswith("uint"):
        most = np.iinfo(kind).max
        given_image = np.round(color * most).astype(kind)
        np.testing.assert_allclose(separate(given_image, "CMYK"), expected, atol=1.0 / most)
    elif kind == "gray":
        np.testing.assert_allclose(separate(color[..., 0], "CMYK")[3], 1.0 - color[..., 0])
    elif kind == "alpha":
        alpha = rng.random((3, 4, 1))
        on_white = color * alpha + 1.0 - alpha
        np.testing.assert_allclose(separate(np.concatenate([color, alpha], axis=2)), separate(on_white))
    else:
        transparent = np.stack([np.zeros((3, 4)), np.zeros((3, 4))], axis=-1)
        assert not separate(transparent).any()


@pytest.mark.parametrize(
    ("image", "complaint"),
    [
        (np.full((2, 2, 3), 1.5), "must hold numbers 0..1"),
        (np.full((2, 2, 3), np.nan), "must hold numbers 0..1"),
        (np.zeros((2, 2, 5)), "1 to 4 channels"),
        (np.zeros(4), "must be an array"),
        ("photo.png", "must be an array"),
        ([[0.1], [0.1, 0.2]], "must be an array"),
    ],
)
def test_what_is_no_image(image, complaint):
    with pytest.raises(ProblemError, match=complaint):
        separate(image)


CMY = [Ink("c", (1, 0, 0)), Ink("m", (0, 1, 0)), Ink("y", (0, 0, 1))]


@pytest.mark.parametrize(
    ("inks", "matrix", "complaint"),
    [
        (CMY, np.eye(2), "one row and column per ink, 3; got 2"),
        (CMY[:2], np.eye(2), "must hold yellow"),
        ([*CMY, Ink("z", (0, 0, 1))], np.eye(4), "must differ"),
        (CMY, [[1, 0.2, 0], [0, 1, 0], [0, 0, 1]], "must be symmetric"),
        (CMY, np.zeros((3, 3)), "1 on its diagonal"),
        (CMY, None, "one row and column per ink, 3; got 0"),
        (None, np.eye(3), "must be a list of Ink"),
        (["C", "M", "Y"], np.eye(3), "must be a list of Ink"),
    ],
)
def test_ink_lists_without_meaning(inks, matrix, complaint):
    with pytest.raises(ProblemError, match=complaint):
        InkModel("own", inks, matrix)


def test_ink_without_color_and_unknown_model():
    with pytest.raises(ProblemError, match="three of 0 and 1"):
        Ink("water", (0, 0, 0))
    with pytest.raises(ProblemError, match="`model` must be one of CMY, CMYK"):
        separate(np.zeros((1, 1, 3)), "RGB")


def test_problem_has_as_many_dots_as_cover_each_channel():
    rng = np.random.default_rng(1)
    image = rng.random((20, 30, 3)) * [1.0, 0.8, 0.6]
    problem = halftone_problem(image, "CMYK", area=0.5)
    channels = separate(image, "CMYK")
    assert problem.domain.size == (30.0, 20.0)
    for body_class, channel in zip(problem.classes, channels, strict=True):
        assert abs(body_class.body_count * 0.5 - channel.sum()) <= 0.25
    assert ink_colors(problem, "CMYK")[0] == (0.0, 1.0, 1.0)
    sizes = [Size("S", 0.5, share=0.5), Size("L", 2.0, share=0.5)]
    problem = halftone_problem(image, "CMYK", sizes=sizes)
    for body_class, channel in zip(problem.classes, channels, strict=True):
        small, large = body_class.sizes
        assert abs(small.count * 0.5 + large.count * 2.0 - channel.sum()) <= 2.0


def test_inks_that_a_picture_does_not_need_are_left_out():
    problem = halftone_problem(np.full((10, 10, 3), [1.0, 0.3, 0.3]), "CMY-RB-K")
    assert [c.name for c in problem.classes] == ["R"]
    np.testing.assert_array_equal(problem.balance.non_overlap, [[1.0]])
    with pytest.raises(ProblemError, match="there is no ink to print"):
        halftone_problem(np.ones((10, 10, 3)))


@pytest.mark.parametrize("green", [1, 2, 3, 5, 20])
def test_a_trace_of_an_ink_does_not_refuse_the_picture(green):
    """What is too little for a dot of every size is printed in those sizes for which it is enough."""
    image = np.full((64, 64, 3), 0.5)
    image.reshape(-1, 3)[:green] = [0.0, 1.0, 0.0]
    sizes = [Size("S", 0.5, share=0.2), Size("M", 1.0, share=0.3), Size("L", 2.0, share=0.5)]
    trace, black = halftone_problem(image, "CMY-RGB-K", sizes=sizes).classes
    assert (trace.name, black.name) == ("G", "K")
    assert [size.name for size in black.sizes] == ["S", "M", "L"]
    assert abs(sum(size.count * size.area for size in trace.sizes) - green) <= 2.0
    assert min(size.count for size in trace.sizes) >= 1
    with pytest.raises(ProblemError, match="less than one body of this size"):
        halftone_problem(image[:1, :1], "CMY-RGB-K", sizes=sizes)


@given(st.lists(st.floats(0.01, 1.0), min_size=2, max_size=5), st.floats(-1e-6, 1e-6))
def test_an_ink_of_half_a_dot_is_in_or_out_but_never_a_failure(parts, more):
    """However its channel is rounded on the way."""
    ink = np.array(parts)
    image = np.ones((4, 4, 3))
    image[0] = 0.0
    image[1, : min(len(ink), 4), 0] = 1.0 - ink[:4]
    cyan = float((1.0 - image[1, :, 0]).sum())
    # Black covers 4 m²: half a dot of 8 m² is the most that it can print.
    problem = halftone_problem(image, "CMYK", area=min(2.0 * cyan * (1.0 + more), 8.0))
    assert [c.name for c in problem.classes][-1] == "K"
    assert all(c.body_count >= 1 for c in problem.classes)


def test_dots_larger_than_the_ink_and_arguments_of_other_kinds():
    image = np.full((4, 4, 3), 0.5)
    with pytest.raises(ProblemError, match="`area` must be smaller: 20 m² is more than twice what ink K covers, 8 m²"):
        halftone_problem(image, area=20.0)
    with pytest.raises(ProblemError, match="`sizes` must be a list of Size"):
        halftone_problem(image, sizes=[1.0])
    with pytest.raises(ProblemError, match="`domain` must be a Domain, or None"):
        halftone_problem(image, domain=(4.0, 4.0))
    assert halftone_problem(image, domain=Domain((8.0, 8.0))).body_count == 32
