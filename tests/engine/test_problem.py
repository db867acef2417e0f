"""Every value of a problem is either meant or refused with a sentence; nothing else can happen."""

from __future__ import annotations

import math
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
from esh import Balance, BodyClass, Domain, EshError, Problem, ProblemError, Size
from esh.engine.checks import show
from hypothesis import given, settings
from hypothesis import strategies as st

SIZE = Size("large", 1.0, 3)

# Whatever a script may hand over by mistake.
ANYTHING = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.integers(min_value=10**300, max_value=10**6000),
    st.floats(),
    st.complex_numbers(),
    st.text(),
    st.binary(),
    st.fractions(),
    st.decimals(),
    st.lists(st.one_of(st.floats(), st.integers(), st.text(), st.none()), max_size=3),
    st.lists(st.lists(st.floats(), max_size=3), max_size=3),
    st.dictionaries(st.text(), st.floats(), max_size=2),
    st.sampled_from(
        [
            np.float32(2),
            np.int64(-1),
            np.bool_(True),
            np.array(3.0),
            np.array([1.0, 2.0]),
            np.array([["a", "b"]]),
            np.array([[None, 1.0]]),
            np.array([[1j]]),
            np.zeros((2, 2, 3)),
            np.full((2, 2), np.nan),
            np.array([[np.datetime64("2020-01-01")]]),
            np.zeros(2, dtype=[("a", float)]),
            np.ma.masked_array([[1.0, 2.0]], mask=[[True, False]]),
            object(),
            object,
            Size,
            SIZE,
            [SIZE],
            [SIZE, SIZE],
            "open",
            math.inf,
        ]
    ),
)


@given(first=ANYTHING, second=ANYTHING, third=ANYTHING)
@settings(max_examples=300, deadline=None)
def test_nothing_but_a_sentence_comes_of_any_input(first, second, third):
    makers = [
        lambda: Domain(first, second),
        lambda: Domain((first, second)),
        lambda: Domain((1.0, 1.0), first),
        lambda: Balance(first, second),
        lambda: Balance(0.5, first),
        lambda: Size(first, second, third),
        lambda: Size("a", first, second),
        lambda: Size("a", 1.0, first),
        lambda: BodyClass(first, second, third),
        lambda: BodyClass("a", [SIZE], first),
        lambda: Problem(first, second, third),
        lambda: Problem(Domain((1.0, 1.0)), [BodyClass("a", [SIZE])], seed=first),
    ]
    for make in makers:
        try:
            made = make()
        except EshError as error:
            sentence = str(error)
            assert sentence.isprintable() and "`" in sentence + "`"
            assert len(sentence) < 400
        else:
            _check_meaning(made)


def _check_meaning(made):
    """What was accepted is of the type, and in the range, that the solver counts on."""
    if isinstance(made, Domain):
        assert all(type(length) is float and 0 < length < math.inf for length in made.size)
        assert 0 < made.area < math.inf and made.boundary in ("open", "periodic")
    elif isinstance(made, Balance):
        assert type(made.class_separation) is float and 0 <= made.class_separation <= 1
        emphasis = made.size_emphasis if isinstance(made.size_emphasis, tuple) else (made.size_emphasis,)
        assert all(type(factor) is float and 1 <= factor < math.inf for factor in emphasis)
    elif isinstance(made, Size):
        assert made.count is None or (type(made.count) is int and made.count >= 1)
        areas = made.area if isinstance(made.area, tuple) else (made.area,)
        assert all(type(area) is float and 0 < area < math.inf for area in areas)
        assert type(made.name) is str and made.name.isprintable()
    elif isinstance(made, BodyClass):
        image = made.density_image
        assert image.dtype == np.float32 and image.ndim == 2 and image.size > 0
        assert np.isfinite(image).all() and image.min() >= 0 and image.max() > 0
        assert np.isfinite(image.sum(dtype=np.float64))
    else:
        assert type(made.seed) is int and made.seed >= 0


@pytest.mark.parametrize(
    ("count", "kept"),
    [(3, 3), (120.0, 120), (np.int32(7), 7), (np.uint64(7), 7), (np.float32(8), 8), (Fraction(9), 9), (10**30, 10**30)],
)
def test_whole_counts_of_every_type_are_kept(count, kept):
    assert Size("a", 1.0, count).count == kept


@pytest.mark.parametrize(
    "count", [0, -1, 0.5, 119.5, math.nan, math.inf, -math.inf, "3", True, np.bool_(True), 2j, [3], Decimal(3)]
)
def test_other_counts_are_refused_by_value(count):
    with pytest.raises(ProblemError, match='`count` of size "a" must be a whole number of at least 1; got '):
        Size("a", 1.0, count)


def test_a_size_needs_a_count_or_a_share_of_its_classes_count():
    with pytest.raises(
        ProblemError, match='`count` of size "a" of class "k" must be a whole number of at least 1; it is missing'
    ):
        BodyClass("k", [Size("a", 1.0)])
    with pytest.raises(ProblemError, match="shares need a `count` of the class"):
        BodyClass("k", [Size("a", 1.0, share=0.5)])
    with pytest.raises(ProblemError, match="must not stand beside a `count`"):
        Size("a", 1.0, 3, share=0.5)


@pytest.mark.parametrize("area", [0, -1.0, math.nan, math.inf, 10**400, "1", None, True, 1e-400])
def test_areas_are_above_zero_and_finite(area):
    with pytest.raises(ProblemError, match='`area` of size "a" must be a number in m² above 0, and finite; got '):
        Size("a", area, 1)


@pytest.mark.parametrize(
    "size",
    [(0, 1), (1, -1), (math.inf, 1), (math.nan, 1), (1,), (1, 2, 3), "12", 5, None, (1e200, 1e200), (1e-200, 1e-200)],
)
def test_domains_have_two_lengths_and_an_area(size):
    with pytest.raises(ProblemError, match=r"`domain\.size` must "):
        Domain(size)


@pytest.mark.parametrize("value", [-0.001, 1.001, math.nan, "0.5", None, True, 10**400])
def test_class_separation_is_within_0_and_1(value):
    with pytest.raises(ProblemError, match=r"`balance\.class_separation` must be a number between 0 .* and 1 .*; got "):
        Balance(class_separation=value)


@pytest.mark.parametrize("value", [0.999, 0, -1, math.inf, math.nan, "2", None, True])
def test_size_emphasis_is_at_least_1(value):
    with pytest.raises(
        ProblemError,
        match=r"`balance\.size_emphasis` must be a number of 1 or more, and finite, or a list of such; got ",
    ):
        Balance(size_emphasis=value)


@pytest.mark.parametrize(
    ("density", "complaint"),
    [
        (np.full((2, 2), np.nan), "must be finite"),
        (np.array([[1.0, np.inf]]), "must be finite"),
        (np.array([[1.0, -0.25]]), "its smallest value is -0.25"),
        (np.zeros((3, 3)), "it is 0 everywhere"),
        (np.zeros((0, 3)), "must have shape"),
        (np.ones(4), "must have shape"),
        (np.ones((2, 2, 3)), r"got shape \[2, 2, 3\]"),
        (np.array([[1, "a"]], dtype=object), "must be an image"),
        (np.array([["1.5"]]), "must be an image"),
        ("1.5", "must be an image"),
        (None, "must be an image"),
        (True, "must be an image"),
        ([[1, 2], [3]], "must be an image"),
        (0, "it is 0 everywhere"),
        (-1, "smallest value is -1"),
        (math.nan, "must be finite"),
    ],
)
def test_densities_without_meaning_are_refused(density, complaint):
    with pytest.raises(ProblemError, match=f'^`density` of class "pine" .*{complaint}'):
        BodyClass("pine", [SIZE], density)


@pytest.mark.parametrize(
    "dtype", [bool, np.uint8, np.int16, np.uint16, np.int64, np.uint64, np.float16, np.float64, ">f4"]
)
def test_images_of_every_depth_keep_their_ratios(dtype):
    image = np.array([[0, 1], [1, 0]] if dtype is bool else [[0, 1], [3, 6]], dtype=dtype)
    kept = BodyClass("a", [SIZE], image).density_image
    np.testing.assert_array_equal(kept / kept.max(), image.astype(np.float32) / image.astype(np.float32).max())


@pytest.mark.parametrize("scale", [1e300, 1e38, 1e-45, 1e-300])
def test_densities_beyond_float32_keep_their_ratios(scale):
    kept = BodyClass("a", [SIZE], np.array([[1.0, 2.0, 4.0]]) * scale).density_image
    np.testing.assert_allclose(kept / kept.max(), [[0.25, 0.5, 1.0]], rtol=0.4 if scale == 1e-45 else 1e-6)


def test_a_density_is_a_copy():
    image = np.ones((2, 2), dtype=np.float32)
    body_class = BodyClass("a", [SIZE], image)
    image[:] = -1
    assert (body_class.density_image == 1).all()


def test_names_must_differ_and_be_writable():
    with pytest.raises(
        ProblemError, match='size names of class "a" must differ from each other; "large" stands there 2 times'
    ):
        BodyClass("a", [SIZE, SIZE])
    body_class = BodyClass("a", [SIZE])
    with pytest.raises(ProblemError, match='class names must differ from each other; "a" stands there 2 times'):
        Problem(Domain((1.0, 1.0)), [body_class, body_class])
    for name in ("", "  ", "two\nlines", "\ud800", "\0", 3, None):
        with pytest.raises(ProblemError, match="`name` of a size must be a text"):
            Size(name, 1.0, 1)


@pytest.mark.parametrize("seed", [-1, 0.5, 7.0, "7", None, True, 2**63])
def test_seeds_are_whole_numbers(seed):
    with pytest.raises(ProblemError, match="`seed` must be a whole number of at least 0"):
        Problem(Domain((1.0, 1.0)), [BodyClass("a", [SIZE])], seed=seed)


@given(ANYTHING)
@settings(max_examples=200, deadline=None)
def test_values_are_shown_short_and_on_one_line(value):
    assert len(show(value)) <= 80 and "\n" not in show(value)
