"""The matrix against the paper's figures 5, 6 and 8, and its definiteness."""

import numpy as np
from esh.engine.interaction import interaction_matrix
from esh.engine.problem import Balance, BodyClass, Domain, Problem, Size
from hypothesis import given, settings
from hypothesis import strategies as st


def problem_of(areas, alpha=0.5, emphasis=2.0):
    classes = [
        BodyClass(f"class {i}", [Size(f"size {j}", area, 1) for j, area in enumerate(sizes)])
        for i, sizes in enumerate(areas)
    ]
    return Problem(Domain((1.0, 1.0)), classes, Balance(alpha, emphasis))


def test_three_sizes_as_in_figure_6():
    matrix = interaction_matrix(problem_of([[1.0, 2.0, 4.0]], emphasis=3.0))
    np.testing.assert_array_equal(matrix, [[1, 1, 1], [1, 3, 3], [1, 3, 9]])


def test_two_classes_with_two_sizes_as_in_figure_8():
    a, c = 0.25, 2.0
    matrix = interaction_matrix(problem_of([[1.0, 3.0], [1.0, 3.0]], a, c))
    np.testing.assert_array_equal(matrix, [[1, 1, a, a], [1, c, a, a * c], [a, a, 1, 1], [a, a * c, 1, c]])


def test_rank_follows_the_area_and_not_the_order():
    np.testing.assert_array_equal(interaction_matrix(problem_of([[4.0, 1.0]])), [[2, 1], [1, 1]])
    np.testing.assert_array_equal(interaction_matrix(problem_of([[1.0, 1.0]])), np.ones((2, 2)))


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.lists(st.floats(0.1, 10.0), min_size=1, max_size=4), min_size=1, max_size=4),
    st.floats(0.0, 1.0),
    st.floats(1.0, 20.0),
)
def test_is_positive_semidefinite_for_every_allowed_balance(areas, alpha, emphasis):
    matrix = interaction_matrix(problem_of(areas, alpha, emphasis))
    np.testing.assert_array_equal(matrix, matrix.T)
    values = np.linalg.eigvalsh(matrix)
    assert values.min() >= -1e-9 * values.max()
