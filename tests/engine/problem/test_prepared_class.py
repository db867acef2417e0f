"""What is asked stays as it was asked; what is placed follows from it, once."""

import dataclasses

import numpy as np
import pytest
from esh.engine.errors import ProblemError
from esh.engine.problem import prepared_class
from esh.engine.problem.body_class import BodyClass, Unsharp
from esh.engine.problem.domain import Domain
from esh.engine.problem.prepared_class import count_sizes, prepare, prepare_density
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size

STEP = np.repeat([[0.2, 0.95]], 16, axis=1) * np.ones((8, 1))
SIZES = [Size("large", 2.0, share=0.5), Size("small", 1.0, share=0.5)]


def asked(**changes):
    return BodyClass("ink", SIZES, STEP, **{"count": "cover", **changes})


def test_what_is_asked_is_kept_beside_what_is_placed():
    request = asked(density_correction=True, unsharp=Unsharp(0.5, 2.0, 1.0))
    problem = Problem(Domain((20.0, 10.0)), [request])
    (placed,) = problem.classes
    assert placed.asked is request
    assert request.count == "cover" and [size.count for size in request.sizes] == [None, None]
    np.testing.assert_array_equal(request.density, STEP.astype(np.float32))
    assert all(size.count >= 1 and size.share is None for size in placed.sizes)
    assert placed.density_image.max() > 1.0, "corrected"
    assert placed.body_count == problem.body_count


def test_a_prepared_class_is_placed_as_it_is(monkeypatch):
    (first,) = Problem(Domain((20.0, 10.0)), [asked()]).classes
    monkeypatch.setattr(prepared_class, "prepare_density", lambda _: pytest.fail("prepared twice"))
    again = Problem(Domain((20.0, 10.0)), [first], seed=3)
    assert again.classes == (first,)
    assert dataclasses.replace(again, seed=4).classes == (first,)


def test_a_density_is_prepared_once_where_it_is_given():
    density = prepare_density(asked())
    assert prepare(asked(), 200.0, density).density_image is density.image


def test_a_density_that_is_not_changed_is_not_copied():
    request = BodyClass("a", [Size("s", 1.0, 3)], STEP)
    assert prepare(request, 1.0).density_image is request.density


def test_counts_follow_the_area_that_is_covered():
    # Half of 60 m² each: 15 bodies of 2 m² and 30 of 1 m².
    assert [size.count for size in count_sizes(asked(), 60.0)] == [15, 30]
    assert [size.count for size in count_sizes(asked(count=9), 60.0)] == [3, 6]


def test_what_is_no_class_is_refused():
    with pytest.raises(ProblemError, match="`classes` must be a list of BodyClass; got"):
        Problem(Domain((1.0, 1.0)), [STEP])
