"""Every value of a problem is either meant or refused with a sentence; nothing else can happen."""

from __future__ import annotations

import math
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
from esh import Balance, BodyClass, Domain, EshError, Obstacle, Problem, ProblemError, Size
from esh.engine.problem.body_class import Unsharp
from esh.engine.problem.given_values import show
from esh.engine.problem.line import Line
from esh.engine.problem.prepared_class import prepare
from hypothesis import example, given, settings
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
# Classes can be called, as functions of points can.
@example(first=object, second=Size, third=object)
@example(first="a", second=[SIZE], third=object)
@example(first=1.0, second=object, third=None)
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
        lambda: Line(first, second),
        lambda: Line(1.0, width=first, charges=second, middle_charge=third),
        lambda: Line(1.0, turn_weights=first, stretch_weights=second, straightness=third),
        lambda: Line(1.0, tensor_scales=first),
        lambda: Unsharp(first, second),
        lambda: Size("a", 1.0, share=first),
        lambda: Size("a", (0.5, 2.0), 3, distribution=first),
        lambda: BodyClass("a", [Size("b", 1.0)], count=first),
        lambda: Balance(non_overlap=first),
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
        assert 0 < made.area < math.inf and made.boundary in ("open", "mirror", "natural", "periodic")
    elif isinstance(made, Balance):
        assert type(made.class_separation) is float and 0 <= made.class_separation <= 1
        emphasis = made.size_emphasis if isinstance(made.size_emphasis, tuple) else (made.size_emphasis,)
        assert all(type(factor) is float and 1 <= factor < math.inf for factor in emphasis)
    elif isinstance(made, Size):
        assert made.count is None or (type(made.count) is int and made.count >= 0)
        areas = made.area if isinstance(made.area, tuple) else (made.area,)
        assert all(type(area) is float and 0 < area < math.inf for area in areas)
        assert type(made.name) is str and made.name.isprintable()
    elif isinstance(made, BodyClass):
        image = made.density
        if callable(image):
            # A function of points, which is asked on a surface only.
            assert not isinstance(image, type)
            return
        assert image.dtype == np.float32 and image.ndim == 2 and image.size > 0
        assert np.isfinite(image).all() and image.min() >= 0 and image.max() > 0
        assert np.isfinite(image.sum(dtype=np.float64))
    elif isinstance(made, Line):
        assert not isinstance(made.direction, type)
        assert made.longest > 0 and np.min(made.length) > 0
        assert type(made.charges) is int and made.charges >= 2
        assert made.charge_shares().sum() == pytest.approx(1.0) and (made.charge_shares() > 0).all()
        assert made.straightness is None or 0 <= made.straightness <= 1
        assert made.width is None or 0 < made.width < math.inf
        for weights in (made.turn_weights, made.stretch_weights):
            assert min(weights) >= 0 and sum(weights) <= 1 + 1e-6
    elif isinstance(made, Unsharp):
        assert 0 <= made.amount < math.inf and 0 < made.radius < math.inf
    else:
        assert type(made.seed) is int and made.seed >= 0


def test_complex_numbers_are_no_numbers():
    with pytest.raises(ProblemError, match="must be a square matrix of numbers"):
        Balance(non_overlap=np.array([[1j]]))
    with pytest.raises(ProblemError, match="a list of one area per body"):
        Size("a", (0.5, 2.0), 1, distribution=np.array([1.0 + 1j]))
    with pytest.raises(ProblemError, match="must be three or more corners"):
        Obstacle(polygon=[(0.0, 0.0), (1.0, 0.0), (1.0, 1j)])


@pytest.mark.parametrize("given", [object, Size, np.ndarray, float])
def test_a_class_is_no_function_of_points(given):
    sentence = rf"`density` of class \"a\" must be an image .*, a number or a function of points; got the class {given.__name__}"
    with pytest.raises(ProblemError, match=sentence):
        BodyClass("a", [SIZE], given)
    with pytest.raises(ProblemError, match=r"`line.direction` must be .*; got <class"):
        Line(1.0, given)


@pytest.mark.parametrize(
    ("count", "kept"),
    [(3, 3), (120.0, 120), (np.int32(7), 7), (np.uint64(7), 7), (np.float32(8), 8), (Fraction(9), 9), (10**30, 10**30)],
)
def test_whole_counts_of_every_type_are_kept(count, kept):
    assert Size("a", 1.0, count).count == kept


@pytest.mark.parametrize(
    "count", [-1, 0.5, 119.5, math.nan, math.inf, -math.inf, "3", True, np.bool_(True), 2j, [3], Decimal(3)]
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
    with pytest.raises(ProblemError, match="cannot be combined with a `count`"):
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
    kept = BodyClass("a", [SIZE], image).density
    np.testing.assert_array_equal(kept / kept.max(), image.astype(np.float32) / image.astype(np.float32).max())


def test_nobody_is_where_a_density_is_masked():
    density = np.ma.masked_array([[1.0, 2.0]], mask=[[True, False]])
    assert BodyClass("a", [Size("s", 1.0, 3)], density).density.tolist() == [[0.0, 2.0]]


@pytest.mark.parametrize("scale", [1e300, 1e38, 1e-45, 1e-300])
def test_densities_beyond_float32_keep_their_ratios(scale):
    kept = BodyClass("a", [SIZE], np.array([[1.0, 2.0, 4.0]]) * scale).density
    np.testing.assert_allclose(kept / kept.max(), [[0.25, 0.5, 1.0]], rtol=0.4 if scale == 1e-45 else 1e-6)


def test_a_density_is_a_copy():
    image = np.ones((2, 2), dtype=np.float32)
    body_class = BodyClass("a", [SIZE], image)
    image[:] = -1
    assert (body_class.density == 1).all()


def test_names_must_differ_and_be_writable():
    with pytest.raises(
        ProblemError, match='size names of class "a" must differ from each other; "large" is used 2 times'
    ):
        BodyClass("a", [SIZE, SIZE])
    body_class = BodyClass("a", [SIZE])
    with pytest.raises(ProblemError, match='class names must differ from each other; "a" is used 2 times'):
        Problem(Domain((1.0, 1.0)), [body_class, body_class])
    for name in ("", "  ", "two\nlines", "\ud800", "\0", 3, None):
        with pytest.raises(ProblemError, match="`name` of a size must be text"):
            Size(name, 1.0, 1)


@pytest.mark.parametrize("seed", [-1, 0.5, 7.0, "7", None, True, 2**63])
def test_seeds_are_whole_numbers(seed):
    with pytest.raises(ProblemError, match="`seed` must be a whole number of at least 0"):
        Problem(Domain((1.0, 1.0)), [BodyClass("a", [SIZE])], seed=seed)


@given(ANYTHING)
@settings(max_examples=200, deadline=None)
def test_values_are_shown_short_and_on_one_line(value):
    assert len(show(value)) <= 80 and "\n" not in show(value)


@pytest.mark.parametrize(
    "length", [0, -1, math.nan, math.inf, "2", None, True, np.zeros((2, 2)), np.ones(3), [[1, -1]]]
)
def test_lines_have_a_length_above_zero(length):
    with pytest.raises(ProblemError, match=r"^`line\.length` must be .*"):
        Line(length)


@pytest.mark.parametrize(
    ("direction", "complaint"),
    [
        ("up", 'must be "density", "none", an angle'),
        (math.inf, "must be finite"),
        (np.array([[0.0, np.nan]]), "must be finite everywhere"),
        (np.zeros((2, 2, 2)), "must have a direction somewhere; all its vectors are 0"),
        (np.ones((2, 2, 3)), r"must have shape \[height, width\] or \[height, width, 2\]; got shape \[2, 2, 3\]"),
        (True, "must be"),
        (None, "must be"),
    ],
)
def test_directions_without_meaning_are_refused(direction, complaint):
    with pytest.raises(ProblemError, match=rf"^`line\.direction` {complaint}"):
        Line(1.0, direction)


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ({"charges": 1}, "`line.charges` must be a whole number from 2 to 64; got 1"),
        ({"charges": 2.5}, "got 2.5"),
        ({"charges": True}, "got True"),
        ({"middle_charge": 0}, "`line.middle_charge` must be a number above 0"),
        ({"turn_weights": (0.6, 0.6)}, "`line.turn_weights` must not add up to more than 1"),
        (
            {"turn_weights": np.array(3)},
            "`line.turn_weights` must be two weights, of the forces and of what is preferred; got array(3)",
        ),
        (
            {"turn_weights": None},
            "`line.turn_weights` must be two weights, of the forces and of what is preferred; got None",
        ),
        ({"tensor_scales": None}, "`line.tensor_scales` must be two standard deviations in pixels; got None"),
        (
            {"tensor_scales": np.array(3)},
            "`line.tensor_scales` must be two standard deviations in pixels; got array(3)",
        ),
        ({"turn_weights": (-0.1, 0.6)}, "must be a number between 0 and 1; got -0.1"),
        ({"stretch_weights": 0.2}, "`line.stretch_weights` must be two weights"),
        ({"straightness": 1.5}, "`line.straightness` must be a number between 0 and 1; got 1.5"),
        ({"width": 0}, "`line.width` must be a number in meters above 0"),
        ({"tensor_scales": (0.0, 1.0)}, "`line.tensor_scales` must be a number above 0"),
    ],
)
def test_lines_without_meaning_are_refused(options, complaint):
    with pytest.raises(ProblemError) as refusal:
        Line(1.0, **options)
    assert complaint in str(refusal.value)


@given(charges=st.integers(2, 64), middle=st.floats(1e-3, 1e3))
def test_the_middle_charge_counts_where_there_is_a_middle(charges, middle):
    shares = Line(1.0, charges=charges, middle_charge=middle).charge_shares()
    assert len(shares) == charges and shares.sum() == pytest.approx(1.0)
    np.testing.assert_array_equal(shares, shares[::-1])
    ends = shares[0]
    others = np.delete(shares, charges // 2) if charges % 2 else shares
    np.testing.assert_allclose(others, ends)
    if charges % 2:
        assert shares[charges // 2] / ends == pytest.approx(middle)


@pytest.mark.parametrize(("length", "fits"), [(4.0, True), (4.01, False), (np.array([[1.0, 4.5]]), False)])
def test_lines_are_no_longer_than_the_domain(length, fits):
    classes = [BodyClass("a", [Size("s", 1.0, 2, line=Line(length))])]
    if fits:
        assert Problem(Domain((3.0, 4.0)), classes).charge_count == 6
        return
    with pytest.raises(
        ProblemError, match=r"`line\.length` of size \"s\" of class \"a\" must not be longer than the domain, 4 m"
    ):
        Problem(Domain((3.0, 4.0)), classes)


@pytest.mark.parametrize("area", [(2.0, 1.0), (1.0,), (1.0, 2.0, 3.0), (0.0, 1.0), (1.0, math.inf), ("a", 2)])
def test_ranges_of_areas_have_two_ends(area):
    with pytest.raises(ProblemError, match=r'^`area` of size "a" must be'):
        Size("a", area, 3)


def test_how_a_range_is_filled():
    linear = Size("a", (0.5, 2.0), 7).areas([1])
    np.testing.assert_allclose(np.diff(linear), 0.25)
    assert (linear[0], linear[-1]) == (0.5, 2.0)
    drawn = Size("a", (0.5, 2.0), 20_000, distribution="uniform")
    areas = drawn.areas([1, 2])
    assert 0.5 <= areas.min() < 0.51 and 1.99 < areas.max() <= 2.0
    np.testing.assert_allclose(np.histogram(areas, 5, (0.5, 2.0))[0] / 20_000, 0.2, atol=0.015)
    np.testing.assert_array_equal(areas, drawn.areas([1, 2]))
    assert (areas != drawn.areas([1, 3])).any()
    given_areas = [2.0, 0.5, 1.0]
    listed = Size("a", (0.5, 2.0), 3, distribution=given_areas)
    np.testing.assert_array_equal(listed.areas([1]), given_areas)
    assert listed.mean_area == pytest.approx(3.5 / 3)


@pytest.mark.parametrize(
    ("distribution", "complaint"),
    [
        ("normal", 'must be "linear" or "uniform", or a list of one area per body; got "normal"'),
        ([1.0, 1.5], "must hold one area per body, 3; got 2"),
        ([0.4, 1.0, 1.5], "must lie within the `area`, 0.5 to 2; got 0.4 to 1.5"),
        ([1.0, math.nan, 1.5], "must be"),
        ([], "must be"),
    ],
)
def test_distributions_without_meaning_are_refused(distribution, complaint):
    with pytest.raises(ProblemError, match=r'^`distribution` of size "a" ') as refusal:
        Size("a", (0.5, 2.0), 3, distribution=distribution)
    assert complaint in str(refusal.value)


@given(
    weights=st.lists(st.integers(1, 50), min_size=1, max_size=6),
    areas=st.lists(st.floats(0.1, 10.0), min_size=6, max_size=6),
    count=st.integers(2_000, 20_000),
)
@settings(max_examples=60, deadline=None)
def test_shares_of_charge_become_counts_that_are_exact_in_total(weights, areas, count):
    shares = np.array(weights) / sum(weights)
    sizes = [Size(str(i), areas[i], share=share) for i, share in enumerate(shares.tolist())]
    try:
        (body_class,) = Problem(Domain((10.0, 10.0)), [BodyClass("a", sizes, count=count)]).classes
    except ProblemError as error:
        # A share so small that it is worth less than half a body.
        assert "must be larger" in str(error)
        return
    counts = np.array([size.count for size in body_class.sizes])
    assert counts.sum() == count
    wanted = shares / np.array(areas[: len(shares)])
    assert (np.abs(counts - count * wanted / wanted.sum()) <= 1.0).all()


@pytest.mark.parametrize(("total", "fits"), [(1.0, True), (0.9, False), (1.1, False)])
def test_shares_add_up_to_1(total, fits):
    sizes = [Size("a", 1.0, share=0.5), Size("b", 2.0, share=total - 0.5)]
    if fits:
        BodyClass("k", sizes, count=100)
        return
    with pytest.raises(
        ProblemError, match=f'`share` of the sizes of class "k" must add up to 1; they add up to {total:g}'
    ):
        BodyClass("k", sizes, count=100)


@given(
    gray=st.floats(0.05, 1.0), areas=st.tuples(st.floats(0.01, 0.1), st.floats(0.01, 0.1)), share=st.floats(0.1, 0.9)
)
@settings(max_examples=60, deadline=None)
def test_cover_means_as_much_footprint_as_density(gray, areas, share):
    sizes = [Size("a", areas[0], share=share), Size("b", areas[1], share=1.0 - share)]
    problem = Problem(Domain((20.0, 10.0)), [BodyClass("k", sizes, gray, count="cover")])
    assert problem.body_areas().sum() == pytest.approx(200.0 * gray, abs=1.5 * sum(areas))


def test_a_cover_or_a_correction_needs_covered_shares():
    for options in ({"count": "cover"}, {"count": 10, "density_correction": True}):
        with pytest.raises(
            ProblemError, match=r"must be a covered share between 0 and 1 for .*; its largest value is 2"
        ):
            BodyClass("k", [Size("a", 1.0)], 2.0, **options)
    with pytest.raises(ProblemError, match=r'is "cover", but its density covers 0\.0001 m², less than half a body'):
        Problem(Domain((1.0, 1.0)), [BodyClass("k", [Size("a", 1.0)], 1e-4, count="cover")])


def test_unsharp_masking_that_goes_below_zero_is_clipped_and_said():
    step = np.repeat([[0.1, 1.0]], 16, axis=1) * np.ones((8, 1))
    strong = prepare(BodyClass("k", [SIZE], step, unsharp=Unsharp(4.0, 2.0, 1.0)), 1.0)
    assert strong.density_image.min() == 0.0 and strong.density_image.max() > 1.5
    (note,) = strong.notes
    assert note.startswith('`unsharp` of class "k" made ') and note.endswith(", which counts as 0")
    weak = prepare(BodyClass("k", [SIZE], step, unsharp=Unsharp(0.05, 2.0, 1.0)), 1.0)
    assert weak.notes == () and weak.density_image.min() > 0.0
    with pytest.raises(ProblemError, match=r"`unsharp\.radius` must be a number above 0"):
        Unsharp(1.0, 0.0)
    with pytest.raises(ProblemError, match=r"`unsharp\.amount` must be a number of 0 or more"):
        Unsharp(-1.0)


@pytest.mark.parametrize(
    ("matrix", "complaint"),
    [
        ([[1, 0.5], [0.4, 1]], "must be symmetric; row 1, column 2 is 0.5, the other way round 0.4"),
        ([[1, 0, 0], [0, 1, 0]], "must be a square matrix"),
        ([[0.5, 0], [0, 1]], "must be 1 on its diagonal"),
        ([[1, 2], [2, 1]], "between 0 (the two ignore each other) and 1"),
        ([[1, math.nan], [math.nan, 1]], "between 0 (the two ignore each other) and 1"),
        ("matrix", "must be a square matrix"),
        ([], "must be a square matrix"),
    ],
)
def test_overlap_matrices_without_meaning_are_refused(matrix, complaint):
    with pytest.raises(ProblemError, match=r"^`balance\.non_overlap` ") as refusal:
        Balance(non_overlap=matrix)
    assert complaint in str(refusal.value)


def random_matrix(seed: int, size: int) -> np.ndarray:
    upper = np.triu(np.random.default_rng(seed).integers(0, 2, (size, size)).astype(float), 1)
    return upper + upper.T + np.eye(size)


@given(seed=st.integers(0, 10**6), size=st.integers(2, 7), alpha=st.floats(0.0, 1.0))
@settings(max_examples=150, deadline=None)
def test_matrices_are_accepted_exactly_where_no_eigenvalue_is_negative(seed, size, alpha):
    matrix = random_matrix(seed, size)
    factors = (1.0 - alpha) * np.eye(size) + alpha * matrix
    smallest = np.linalg.eigvalsh(factors)[0]
    if abs(smallest) < 1e-6:
        return
    try:
        balance = Balance(alpha, non_overlap=matrix)
    except ProblemError as error:
        assert smallest < 0
        words = str(error).replace(",", "").split()
        assert float(words[words.index("eigenvalue") + 1]) == pytest.approx(smallest, rel=0.01)
        # What it says to lower is enough.
        assert "lower `class_separation` to " in str(error)
        Balance(float(words[words.index("to") + 1]), non_overlap=matrix)
    else:
        assert smallest > 0
        np.testing.assert_allclose(balance.class_factors([7] * size, [0.5] * size), factors)


def test_a_balance_fits_the_classes_and_sizes():
    two = [BodyClass(name, [SIZE]) for name in "ab"]
    with pytest.raises(ProblemError, match="must have one row per class, 2; got 3 rows"):
        Problem(Domain((1.0, 1.0)), two, Balance(non_overlap=np.eye(3)))
    three_sizes = [BodyClass("a", [Size(str(area), area, 2) for area in (1.0, 2.0, 3.0)])]
    with pytest.raises(ProblemError, match='a value for each of the 2 larger sizes of class "a"; got 1'):
        Problem(Domain((1.0, 1.0)), three_sizes, Balance(size_emphasis=[2.0]))
    assert Problem(Domain((1.0, 1.0)), three_sizes, Balance(size_emphasis=[2.0, 3.0])).balance.size_emphasis == (
        2.0,
        3.0,
    )
    with pytest.raises(ProblemError, match="no more values than a class has larger sizes, 2 at most; got 3"):
        Problem(Domain((1.0, 1.0)), three_sizes, Balance(size_emphasis=[2.0, 3.0, 4.0]))
    with pytest.raises(ProblemError, match='must be one number, because areas of class "a" are a range'):
        Problem(Domain((1.0, 1.0)), [BodyClass("a", [Size("r", (1.0, 2.0), 3)])], Balance(size_emphasis=[2.0, 3.0]))
    with pytest.raises(
        ProblemError, match=r"must not fall from one size to the next larger one; lower 3 to 2 or less, because with 2"
    ):
        Balance(size_emphasis=[3.0, 2.0])


@pytest.mark.parametrize("value", [1, 0, "yes", None, 0.5])
def test_avoid_overlap_is_a_switch(value):
    with pytest.raises(ProblemError, match="`avoid_overlap` must be true or false; got "):
        Problem(Domain((1.0, 1.0)), [BodyClass("a", [SIZE])], avoid_overlap=value)


def test_classes_of_equal_densities_share_one_image():
    image = np.random.default_rng(0).random((20, 30))
    other = image.copy()
    other[3, 4] = 0.0
    classes = [BodyClass(f"{k}", [Size("s", 1.0, 3)], density=d.copy()) for k, d in enumerate([image, image, other])]
    problem = Problem(Domain((3.0, 2.0)), classes)
    first, second, third = (c.density_image for c in problem.classes)
    assert first is second and third is not first
    np.testing.assert_array_equal(third, classes[2].density)
    # What was given is as it was.
    assert classes[0].density is not classes[1].density


def test_areas_are_the_callers_own():
    """Those that the engine shares are one number for all, to read only; those that are handed out may be written to."""
    problem = Problem(Domain((10.0, 10.0)), [BodyClass("a", [Size("s", area=0.5, count=40)])])
    shared, own = problem.shared_areas(), problem.body_areas()
    np.testing.assert_array_equal(shared, own)
    assert not shared.flags.writeable and own.flags.writeable
    own[:] = 0.0
    assert problem.body_areas().min() == 0.5 and shared.min() == 0.5
    several = [Size("s", area=0.5, count=40), Size("l", area=2.0, count=3)]
    problem = Problem(Domain((10.0, 10.0)), [BodyClass("a", several)])
    assert problem.shared_areas().tolist() == [0.5] * 40 + [2.0] * 3
