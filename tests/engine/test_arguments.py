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


@pytest.mark.parametrize("wrong", [True, 3, "x", np.array(3), [[1, 2], [3]]], ids=repr)
def test_what_no_argument_can_be_is_said(placement, wrong, tmp_path):
    problem = placement.problem
    for key, call in (
        ("profile", lambda: esh.solve(problem, device="cpu", profile=wrong)),
        ("profile", lambda: esh.Solver(problem, device="cpu", profile=wrong)),
        ("launcher", lambda: esh.Solver(problem, launcher=wrong)),
        ("state", lambda: esh.Solver(problem, device="cpu", state=wrong)),
        ("flags", lambda: esh.Solver(problem, device="cpu", flags=wrong)),
        ("progress", lambda: esh.solve_many([problem], device="cpu", workers=0, progress=wrong)),
        ("problems", lambda: esh.solve_many(wrong, device="cpu", workers=0)),
        ("colors", lambda: esh.draw_plan(placement, tmp_path / "a.png", colors=wrong)),
        ("background", lambda: esh.draw_plan(placement, tmp_path / "a.png", background=wrong)),
        ("colors", lambda: esh.write_recipe(tmp_path / "a.toml", problem, colors=wrong)),
        ("colors", lambda: esh.write_halftone_svg(tmp_path / "a.svg", placement, colors=wrong)),
    ):
        with pytest.raises(esh.EshError, match=rf"`{key}(\[0\])?` must|a color is"):
            call()
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("path", [None, b"x.png", 3, ["a"]], ids=repr)
def test_pictures_go_to_a_path_or_an_open_file(placement, path):
    for call in (
        lambda: esh.draw_plan(placement, path),
        lambda: esh.write_halftone_svg(path, placement),
        lambda: esh.write_halftone_png(path, placement, pixels_per_metre=10.0),
    ):
        with pytest.raises(esh.EshError, match="`path` must be the path of"):
            call()


@pytest.mark.parametrize("steps", [None, 0, -1, 2.5, "x", True], ids=repr)
def test_steps_of_a_solver_are_a_number(placement, steps):
    with esh.Solver(placement.problem, device="cpu") as solver:
        with pytest.raises(esh.EshError, match="`max_steps` must be a whole number"):
            solver.run(steps)
        with pytest.raises(esh.EshError, match="`count` must be a whole number"):
            solver.step(steps)
        with pytest.raises(esh.EshError, match="`progress` must be a function"):
            solver.run(1, "x")
        with pytest.raises(esh.EshError, match="`state` must be a State"):
            solver.start_from(steps)


@pytest.mark.parametrize("wrong", [3, "x", [[1, 2], [3]], 10**400], ids=lambda value: repr(value)[:9])
def test_what_is_no_attribute_or_map_of_a_mesh_is_said(wrong):
    corners, triangle = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]
    for what in ({"attributes": wrong}, {"attributes": {"a": wrong}}, {"uv": wrong}):
        with pytest.raises(esh.EshError, match=r"must (be|hold|have)"):
            esh.SurfaceMesh(corners, triangle, **what)


@pytest.mark.parametrize("boundary", ["periodic", "mirror"])
def test_a_domain_that_goes_on_beyond_its_edges_is_no_thread(boundary):
    with pytest.raises(esh.EshError, match=rf'3,000 times longer than wide where the boundary is "{boundary}"'):
        esh.Domain((5000.0, 1.0), boundary)
