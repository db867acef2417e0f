"""Fixed bodies are checked against their problem, brought into its order, and counted beside the new ones or among them."""

from dataclasses import replace

import numpy as np
import pytest
from esh import (
    BodyClass,
    Domain,
    FixedBodies,
    FixedBody,
    Footprint,
    Footprints,
    Line,
    Placement,
    Problem,
    ProblemError,
    Size,
)
from esh.engine.problem.size import with_count

DOMAIN = Domain((20.0, 10.0))
PINE = BodyClass("pine", [Size("large", 3.0, 4), Size("small", (0.5, 1.5), 6)])
ROCK = BodyClass("rock", [Size("any", 2.0, 0)])
FIXED = [
    FixedBody((9.0, 9.0), "rock", id=40),
    FixedBody((1.0, 2.0), "pine", "small", angle=0.5, area=0.7),
    FixedBody((3.0, 4.0), 0, 0),
]


def test_bodies_stand_in_class_then_size_order_the_fixed_ones_of_a_size_last():
    problem = Problem(DOMAIN, [PINE, ROCK], fixed=FIXED)
    assert [size.count for c in problem.classes for size in c.sizes] == [5, 7, 1]
    assert np.flatnonzero(problem.body_is_fixed()).tolist() == [4, 11, 12]
    area = problem.body_areas()
    assert area[[4, 11, 12]].tolist() == [3.0, 0.7, 2.0]
    # Fixed bodies do not change the footprints of the others.
    alone = Problem(DOMAIN, [PINE, replace(ROCK, sizes=[Size("any", 2.0, 1)])])
    assert area[~problem.body_is_fixed()].tolist() == alone.body_areas()[:10].tolist()
    assert problem.fixed.position.tolist() == [[3.0, 4.0], [1.0, 2.0], [9.0, 9.0]]


@pytest.mark.parametrize("area", [None, (0.05, 2.0)], ids=["of the outlines", "a range"])
def test_fixed_bodies_whose_outlines_are_known_take_the_ground_of_these(area):
    outlines = [Footprint.rectangle(2.0, 1.0), Footprint.rectangle(0.4, 0.2)]
    size = Size("any", area, 5, footprint=outlines)
    fixed = FixedBodies([(1.0, 1.0), (2.0, 2.0), (3.0, 3.0)], "a", variant=[0, 1, 1], scale=[1.0, 2.0, np.nan])
    problem = Problem(DOMAIN, [BodyClass("a", [size])], fixed=fixed)
    # Whose scale is not said is as large as is usual.
    np.testing.assert_allclose(problem.body_areas()[-3:], [2.0, 0.32, size.mean_area])


def test_identities_are_kept_and_those_of_others_are_free():
    ids = Problem(DOMAIN, [PINE, ROCK], fixed=FIXED).body_ids()
    assert ids[12] == 40
    assert sorted(ids.tolist()) == sorted([40, 41, 42, *range(43, 53)])
    assert Problem(DOMAIN, [PINE]).body_ids().tolist() == list(range(10))


def test_counts_may_include_them():
    problem = Problem(DOMAIN, [PINE, replace(ROCK, sizes=[Size("any", 2.0, 1)])], fixed=FIXED, include_fixed=True)
    assert [size.count for c in problem.classes for size in c.sizes] == [4, 6, 1]
    assert problem.body_is_fixed().sum() == 3
    with pytest.raises(
        ProblemError, match=r'`count` of size "any" of class "rock" must include its 1 fixed bodies; got 0'
    ):
        Problem(DOMAIN, [PINE, ROCK], fixed=FIXED, include_fixed=True)


def test_a_problem_that_is_changed_has_them_once():
    problem = replace(Problem(DOMAIN, [PINE, ROCK], fixed=FIXED), seed=5)
    assert problem.body_count == 13
    assert problem.body_ids()[12] == 40
    assert Problem(DOMAIN, problem.classes[:1]).body_count == 10


def test_a_count_of_0_needs_fixed_bodies():
    with pytest.raises(
        ProblemError, match=r'`count` of size "any" of class "rock" must be a whole number of at least 1, unless bod'
    ):
        Problem(DOMAIN, [PINE, ROCK])
    with pytest.raises(ProblemError, match="must have at least one body to place; all of them are fixed"):
        Problem(DOMAIN, [ROCK], fixed=FIXED[:1])
    assert with_count(PINE.sizes[1], 0).areas([0]).tolist() == []


@pytest.mark.parametrize(
    ("fixed", "message"),
    [
        (3, "`fixed` must be a FixedBodies, or a list of FixedBody; got 3"),
        ([3], "`fixed` must be a FixedBodies, or a list of FixedBody; got 3 among them"),
        (FixedBody((1.0, 11.0)), r"`fixed.position` must lie inside the domain, 20 by 10 m; got \[1.0, 11.0\]"),
        (
            FixedBody((1.0, 1.0), "oak"),
            '`fixed.body_class` must be one of "pine", "rock", or an index of them; got "oak"',
        ),
        (FixedBody((1.0, 1.0), "pine", 2), '`fixed.size` of class "pine" must be one of "large", "small", or an index'),
        (FixedBody((1.0, 1.0), "pine", True), '`fixed.size` of class "pine" must be one of "large", "small"'),
        (
            [FixedBody((1.0, 1.0), id=1), FixedBody((2.0, 1.0), id=1)],
            "`fixed.id` must differ from body to body; got 1 twice",
        ),
    ],
)
def test_what_does_not_fit_the_problem_is_refused_with_a_sentence(fixed, message):
    with pytest.raises(ProblemError, match=message):
        Problem(DOMAIN, [PINE, replace(ROCK, sizes=[Size("any", 2.0, 1)])], fixed=fixed)


def test_an_outline_that_its_size_does_not_have_is_refused_with_a_sentence():
    tile = Size("tile", count=5, footprint=Footprints([Footprint.disc(0.5), Footprint.rectangle(1.0, 0.5)]))
    plank = Size("plank", count=5, footprint=Footprint.rectangle(1.0, 0.5))

    def fixed(size, variant):
        return Problem(
            DOMAIN, [BodyClass("roof", [tile, plank])], fixed=FixedBodies([[1.0, 1.0]], 0, size, variant=variant)
        )

    assert fixed("tile", 1).fixed.variant.tolist() == [1]
    with pytest.raises(
        ProblemError, match=r'`fixed.variant` of size "tile" of class "roof" must be .* from 0 to 1; got 2'
    ):
        fixed("tile", 2)
    with pytest.raises(ProblemError, match='"plank" of class "roof" must be 0, its only footprint; got 1'):
        fixed("plank", 1)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (
            {"position": [1.0, 2.0]},
            r"`fixed.position` must be a list of positions, each x and y in meters, and z on a surface; got \[1.0, 2.0\]",
        ),
        ({"position": [[1.0, np.nan]]}, "`fixed.position` must be finite everywhere"),
        ({"position": "here"}, '`fixed.position` must be a list of positions, .*; got "here"'),
        ({"angle": [0.0, 1.0]}, r"`fixed.angle` must be one number, or one for each of 1 bodies; got shape \[2\]"),
        ({"angle": np.inf}, "`fixed.angle` must be finite everywhere"),
        ({"area": 0.0}, "`fixed.area` must be above 0, and finite; got 0"),
        ({"length": -1.0}, "`fixed.length` must be above 0, and finite; got -1"),
        ({"id": [0.5]}, "`fixed.id` must be whole numbers of 0 or more"),
        ({"body_class": ["a", "b"]}, "`fixed.body_class` must be a name or an index, or one for each of 1 bodies"),
    ],
)
def test_values_that_are_none_are_refused_with_a_sentence(values, message):
    with pytest.raises(ProblemError, match=message):
        FixedBodies(**{"position": [[1.0, 2.0]], **values})


def test_bodies_of_a_placement_are_fixed_with_all_that_they_have():
    problem = Problem(DOMAIN, [PINE, replace(ROCK, sizes=[Size("stick", 2.0, 2, line=Line(1.0))])])
    class_index, size_index = problem.body_indices()
    n = problem.body_count
    placement = Placement(
        problem, np.full((n, 2), 1.0), class_index, size_index, np.full(n, 0.1), np.full(n, 0.9), np.zeros(n)
    )
    chosen = np.array([2, 9, 11])
    again = Problem(DOMAIN, [PINE, problem.classes[1]], fixed=FixedBodies.of_placement(placement, chosen))
    assert again.fixed.class_index.tolist() == [0, 0, 1]
    assert again.fixed.size_index.tolist() == [0, 1, 0]
    assert again.fixed.id.tolist() == [2, 9, 11]
    assert again.fixed.area.tolist() == placement.area[chosen].tolist()
    # Only lines have a length.
    np.testing.assert_array_equal(again.fixed.length, [np.nan, np.nan, 0.9])


@pytest.mark.parametrize(
    ("boundary", "kind", "values", "message"),
    [
        (
            "open",
            "disc",
            {"area": 1e300},
            r"`fixed\.area` must not be more than 1e\+08 times another body's.*; got 1e\+300",
        ),
        ("open", "disc", {"area": 1e-300}, r"`fixed\.area` must not be more than 1e\+08 times .*; got 1e-300 beside"),
        (
            "open",
            "plank",
            {"scale": 1e300},
            r"`fixed\.scale` of size \"s\" of class \"k\" must make bodies no longer than 10,0",
        ),
        (
            "open",
            "plank",
            {"scale": 1e-12},
            r"`fixed\.scale` of size .* and at least 1e-09 m wide; got 1\.24e-12 by 3e-13 m",
        ),
        (
            "periodic",
            "plank",
            {"scale": 200.0},
            r"no longer than 16 times the shorter side of the periodic domain, 8 m",
        ),
        ("periodic", "disc", {"area": 1e5}, r"no longer than 16 times the shorter side of the periodic domain, 8 m"),
        (
            "open",
            "plank",
            {"angle": 1e300},
            r"`fixed\.angle` must be angles between -10000 and 10000 radians; got 1e\+300",
        ),
    ],
)
def test_what_no_size_may_be_no_fixed_body_is(boundary, kind, values, message):
    outline = Footprints([Footprint.rectangle(1.2, 0.3)]) if kind == "plank" else None
    size = Size("s", 0.3 if outline is None else None, 30, footprint=outline)
    with pytest.raises(ProblemError, match=message):
        Problem(Domain((10.0, 8.0), boundary), [BodyClass("k", [size])], fixed=FixedBodies([[5.0, 4.0]], **values))
