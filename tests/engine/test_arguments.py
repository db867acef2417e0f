"""What public functions are given instead of what they ask for is said in a sentence."""

from __future__ import annotations

import esh
import numpy as np
import pytest


@pytest.fixture(scope="module")
def placement():
    problem = esh.Problem(esh.Domain((4.0, 3.0)), [esh.BodyClass("a", [esh.Size("s", 0.05, 9)])])
    return esh.solve(problem, device="cpu", max_steps=2)


@pytest.mark.parametrize("path", [None, b"x.npz", 3, ["a"]], ids=repr)
def test_what_is_no_path_is_said(placement, path):
    for call in (
        lambda: esh.write_placement(path, placement),
        lambda: esh.load_placement(path),
        lambda: esh.read_recipe(path),
        lambda: esh.write_recipe(path, placement.problem),
        lambda: esh.read_density(path),
        lambda: esh.read_color(path),
        lambda: esh.read_fixed_bodies(path),
    ):
        with pytest.raises(esh.EshError, match="`path` must be the path of"):
            call()


@pytest.mark.parametrize("wrong", [None, 3, "x"], ids=repr)
def test_what_is_no_placement_or_problem_is_said(wrong, tmp_path):
    for key, call in (
        ("`placement`", lambda: esh.write_placement(tmp_path / "a.npz", wrong)),
        ("`placement`", lambda: esh.draw_plan(wrong, tmp_path / "a.png")),
        ("`placement`", lambda: esh.write_halftone_svg(tmp_path / "a.svg", wrong)),
        ("`placement`", lambda: esh.write_halftone_png(tmp_path / "a.png", wrong, pixels_per_metre=10.0)),
        ("`placement`", lambda: esh.render_halftone(wrong, pixels_per_metre=10.0)),
        ("`placement`", lambda: esh.FixedBodies.of_placement(wrong)),
        ("`bodies`", lambda: esh.write_bodies(tmp_path / "a.ply", wrong)),
        ("`problem`", lambda: esh.write_recipe(tmp_path / "a.toml", wrong)),
        ("`problem`", lambda: esh.Solver(wrong, device="cpu")),
        ("`problem`", lambda: esh.solve(wrong, device="cpu")),
        ("`problems", lambda: esh.solve_many(wrong)),
    ):
        with pytest.raises(esh.EshError, match=f"{key}.* must be a"):
            call()
    assert not list(tmp_path.iterdir())


def test_an_edit_with_no_problem_is_said_and_changes_nothing(placement):
    with esh.Solver(placement.problem, device="cpu") as solver:
        before = solver.placement().position
        with pytest.raises(esh.EshError, match="`problem` must be a Problem"):
            solver.edit(None)
        np.testing.assert_array_equal(solver.placement().position, before)


@pytest.mark.parametrize("chosen", [[99], [-10], "ab", [0.5], [[0, 1]], [True]], ids=repr)
def test_bodies_that_are_none_of_a_placement_cannot_be_fixed(placement, chosen):
    with pytest.raises(esh.EshError, match="`chosen` must be numbers of bodies, 0 to 8"):
        esh.FixedBodies.of_placement(placement, chosen)


def test_some_bodies_of_a_placement_can_be_fixed(placement):
    for chosen in ([3, 1], np.isin(np.arange(9), [1, 3])):
        assert sorted(esh.FixedBodies.of_placement(placement, chosen).position.tolist()) == sorted(
            placement.position[[1, 3]].tolist()
        )


def test_assets_that_are_no_table_are_said(placement, tmp_path):
    with pytest.raises(esh.EshError, match="`assets` must be a dict"):
        esh.write_placement(tmp_path / "a.glb", placement, assets=["a"])
