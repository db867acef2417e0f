"""The matrix against the paper's figures 5, 6 and 8, and its definiteness."""

from dataclasses import replace

import numpy as np
import pytest
from esh.engine.problem.balance import SHARED_POWER, Balance
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.domain import Domain
from esh.engine.problem.footprint import Footprint
from esh.engine.problem.footprints import Footprints
from esh.engine.problem.interaction import group_bodies
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from hypothesis import given, settings
from hypothesis import strategies as st


def problem_of(areas, alpha=0.5, emphasis=2.0):
    classes = [
        BodyClass(f"class {i}", [Size(f"size {j}", area, 1) for j, area in enumerate(sizes)])
        for i, sizes in enumerate(areas)
    ]
    return Problem(Domain((1.0, 1.0)), classes, Balance(alpha, emphasis))


def test_three_sizes_as_in_figure_6():
    matrix = group_bodies(problem_of([[1.0, 2.0, 4.0]], emphasis=3.0)).matrix
    np.testing.assert_array_equal(matrix, [[1, 1, 1], [1, 3, 3], [1, 3, 9]])


def test_two_classes_with_two_sizes_as_in_figure_8():
    a, c = 0.25, 2.0
    matrix = group_bodies(problem_of([[1.0, 3.0], [1.0, 3.0]], a, c)).matrix
    np.testing.assert_array_equal(matrix, [[1, 1, a, a], [1, c, a, a * c], [a, a, 1, 1], [a, a * c, 1, c]])


def test_rank_follows_the_area_and_not_the_order():
    np.testing.assert_array_equal(group_bodies(problem_of([[4.0, 1.0]])).matrix, [[2, 1], [1, 1]])
    np.testing.assert_array_equal(group_bodies(problem_of([[1.0, 1.0]])).matrix, np.ones((2, 2)))


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.lists(st.floats(0.1, 10.0), min_size=1, max_size=4), min_size=1, max_size=4),
    st.floats(0.0, 1.0),
    st.floats(1.0, 20.0),
)
def test_is_positive_semidefinite_for_every_allowed_balance(areas, alpha, emphasis):
    matrix = group_bodies(problem_of(areas, alpha, emphasis)).matrix
    np.testing.assert_array_equal(matrix, matrix.T)
    values = np.linalg.eigvalsh(matrix)
    assert values.min() >= -1e-9 * values.max()


@settings(max_examples=60, deadline=None)
@given(st.data(), st.floats(0.0, 1.0), st.floats(0.0, 2.0))
def test_is_positive_semidefinite_for_classes_of_any_counts_of_which_any_may_overlap(data, alpha, rare):
    """A chain, in which all that are not neighbors may overlap, has a negative eigenvalue by itself."""
    size = data.draw(st.integers(2, 6))
    kinds = st.integers(1, 10**6), st.floats(1e-3, 1e3)
    counts, areas = (data.draw(st.lists(kind, min_size=size, max_size=size)) for kind in kinds)
    chain = (np.abs(np.subtract.outer(np.arange(size), np.arange(size))) < 2).astype(float)
    alpha /= 1.0 - np.linalg.eigvalsh(chain)[0]
    matrix = Balance(min(alpha, 1.0), non_overlap=chain, rare_emphasis=rare).class_factors(counts, areas)
    np.testing.assert_array_equal(matrix, matrix.T)
    values = np.linalg.eigvalsh(matrix)
    assert values.min() >= -1e-9 * values.max()


def test_rare_classes_weigh_more_by_themselves_and_beside_rare_ones():
    counts = {"many": 4000, "few": 400, "rare": 40, "one": 1}
    classes = [BodyClass(name, [Size("s", 1e-4, count)]) for name, count in counts.items()]
    matrix = group_bodies(Problem(Domain((1.0, 1.0)), classes)).matrix
    # Ten and, at most, a hundred times as rare as the largest; two push each other as the less rare of them.
    shared = 0.25 * (np.minimum.outer(rarity := np.array([1.0, 10.0, 100.0, 100.0]), rarity) ** SHARED_POWER - 1.0)
    np.testing.assert_allclose(matrix, 0.5 * np.diag(rarity) + 0.5 + shared)
    np.testing.assert_array_equal(matrix[0], [1.0, 0.5, 0.5, 0.5])
    # Less where their areas differ: what is much smaller is another kind of thing.
    apart = [BodyClass(name, [Size("s", area, 40)]) for name, area in (("few", 1e-4), ("large", 1e-2))]
    beside = group_bodies(Problem(Domain((1.0, 1.0)), [classes[0], *apart])).matrix[1, 2]
    assert beside == pytest.approx(0.5 + 0.01 * (matrix[2, 3] - 0.5))
    papers = group_bodies(Problem(Domain((1.0, 1.0)), classes, Balance(rare_emphasis=0.0))).matrix
    np.testing.assert_array_equal(papers, 0.5 + 0.5 * np.eye(4))
    # Where only the union counts there is nothing of its own to weigh.
    union = group_bodies(Problem(Domain((1.0, 1.0)), classes, Balance(1.0))).matrix
    np.testing.assert_array_equal(union, np.ones((4, 4)))


def test_a_list_of_emphases_is_taken_as_it_is():
    matrix = group_bodies(problem_of([[4.0, 1.0, 2.0]], emphasis=[5.0, 7.0])).matrix
    np.testing.assert_array_equal(matrix, [[7, 1, 5], [1, 1, 1], [5, 1, 5]])


def test_classes_that_may_overlap_do_not_see_each_other():
    inks = [BodyClass(name, [Size("dot", 1.0, 3)]) for name in "CMYK"]
    apart = np.eye(4)
    apart[3] = apart[:, 3] = 1.0
    matrix = group_bodies(Problem(Domain((1.0, 1.0)), inks, Balance(0.5, non_overlap=apart))).matrix
    np.testing.assert_array_equal(matrix, [[1, 0, 0, 0.5], [0, 1, 0, 0.5], [0, 0, 1, 0.5], [0.5, 0.5, 0.5, 1]])


def test_a_range_of_areas_has_nearly_the_papers_continuous_matrix():
    """Figure 12: i / (A_j A_k) = min(A_j², A_k²), over that of the smallest body."""
    problem = Problem(Domain((1.0, 1.0)), [BodyClass("a", [Size("s", (0.5, 2.0), 3000)])])
    groups = group_bodies(problem)
    squared = problem.body_areas() ** 2
    wanted = np.minimum(squared[:, None], squared[None])
    got = groups.matrix[np.ix_(groups.body_group, groups.body_group)]
    # Only ratios count.
    got *= (wanted / got).mean()
    assert np.abs(got / wanted - 1.0).max() < 0.15
    assert np.sqrt(np.mean((got / wanted - 1.0) ** 2)) < 0.06
    assert groups.count <= 24
    assert np.linalg.eigvalsh(groups.matrix).min() > 0.0


@pytest.mark.parametrize("area", [1.0, (0.2, 3.0)], ids=["one area", "a range"])
def test_bodies_of_groups_are_counted(area):
    """Groups of single areas come one after the other, levels of a range mixed."""
    sizes = [Size("a", area, count=30), Size("b", 2.0, count=7)]
    shuffled = [replace(sizes[0], distribution="uniform"), sizes[1]]
    groups = group_bodies(Problem(Domain((10.0, 10.0)), [BodyClass("one", shuffled), BodyClass("two", sizes[1:])]))
    np.testing.assert_array_equal(groups.body_count, np.bincount(groups.body_group))
    assert (groups.first_body is None) == isinstance(area, tuple)
    if groups.first_body is not None:
        assert groups.first_body.tolist() == [0, 30, 37, 44]


@pytest.mark.parametrize("emphasis", [2.0, (2.0, 3.0)], ids=["a number", "a list"])
def test_sizes_that_differ_by_chance_only_share_a_rank(emphasis):
    """Their outlines were drawn elsewhere, and so their mean areas differ a little."""
    scale = np.random.default_rng(3).uniform(0.7, 1.3, (3, 20))
    box = Footprint.rectangle(1.0, 1.0)
    sizes = [Size(f"{k}", None, 20, footprint=Footprints(box, scale=scale[k]), usual_area=1.0) for k in range(3)]
    sizes.append(Size("large", None, 20, footprint=Footprints(box, scale=2.0 * scale[0]), usual_area=4.0))
    balance = Balance(size_emphasis=emphasis)
    groups = group_bodies(Problem(Domain((30.0, 30.0)), [BodyClass("a", sizes)], balance))
    np.testing.assert_array_equal(groups.matrix, [[1, 1, 1, 1], [1, 1, 1, 1], [1, 1, 1, 1], [1, 1, 1, 2]])


def test_outlines_of_all_areas_have_the_emphasis_that_is_listed_for_their_size():
    """Nobody asked for a range there."""
    kinds = [Footprint.rectangle(1.0, 1.0), Footprint.rectangle(3.0, 3.0)]
    sizes = [Size(f"{k}", None, 20, footprint=[kind.scaled(k) for kind in kinds]) for k in (1.0, 2.0)]
    groups = group_bodies(Problem(Domain((60.0, 60.0)), [BodyClass("a", sizes)], Balance(size_emphasis=[3.0])))
    np.testing.assert_array_equal(groups.matrix, [[1, 1], [1, 3]])


def beside(*sizes, alpha=0.5):
    """The matrix of classes of an area and a count each."""
    classes = [BodyClass(str(k), [Size("s", area, count)]) for k, (area, count) in enumerate(sizes)]
    return group_bodies(Problem(Domain((100.0, 100.0)), classes, Balance(alpha, rare_emphasis=0.0))).matrix


@pytest.mark.parametrize("small", [(0.5, 40), (0.1, 40), (1e-4, 5), (1e-2, 10)])
def test_small_bodies_that_fill_gaps_or_have_one_each_get_no_term_of_their_own(small):
    np.testing.assert_array_equal(beside((1.0, 10), small), [[1.0, 0.5], [0.5, 1.0]])


def test_small_bodies_that_would_gather_between_large_ones_get_one():
    charge = np.array([10.0, 0.2])
    found = beside((1.0, 10), (1e-3, 200))
    np.testing.assert_allclose(found[1, 1] * charge[1], 0.5 * (found[1] @ charge), err_msg="half of what they feel")
    np.testing.assert_array_equal(found[0], [1.0, 0.5])
    # Where each class is even by itself, none feels another; and small ones of two classes mix as these do.
    np.testing.assert_array_equal(beside((1.0, 10), (1e-3, 200), alpha=0.0), np.eye(2))
    three = beside((1.0, 10), (1e-3, 200), (1e-3, 200))
    np.testing.assert_allclose(three[1, 2], 0.5 * three[1, 1])
    assert three[1, 1] == three[2, 2] > 10.0 and (np.linalg.eigvalsh(three) > 0.0).all()


def test_samples_of_classes_have_the_term_of_what_they_stand_for():
    """Tiles are solved by the matrix of all bodies, which is that of a few of them."""
    whole = beside((1.0, 10), (1e-3, 2000))
    classes = [BodyClass("0", [Size("s", 1.0, 10)]), BodyClass("1", [Size("s", 1e-3, 20)])]
    domain, balance = Domain((100.0, 100.0)), Balance(0.5, rare_emphasis=0.0)
    classes_of_all = [BodyClass("0", [Size("s", 1.0, 10)]), BodyClass("1", [Size("s", 1e-3, 2000)])]
    problem = Problem(domain, classes_of_all, balance)
    np.testing.assert_allclose(group_bodies(Problem(domain, classes, balance), sample_of=problem).matrix, whole)
