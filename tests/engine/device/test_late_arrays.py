"""A GPU has what arrays hold from the next launch on: nothing else reads or changes them before that.

Tested on the CPU, by a launcher that gives arrays their values as late as a GPU has them.
"""

from dataclasses import replace
from pathlib import Path

import esh
import numpy as np
import pytest
import trimesh
import warp as wp
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.solve import solve_on
from esh.engine.solver.solver import Solver

RECIPES = sorted((Path(__file__).parents[2] / "recipes").glob("*.toml"))
NOTHING = 0x5A
STEPS = 4


class LateLauncher(Launcher):
    """Arrays hold nonsense until something is launched."""

    def __init__(self) -> None:
        self.late = []
        super().__init__(resolve_device("cpu"))

    def array(self, values, dtype):
        filled = super().own_array(values, dtype)
        if filled.size == 0:
            return filled
        result = wp.empty(filled.shape, dtype=dtype, device=self.device)
        memory = np.ctypeslib.as_array((wp.uint8._type_ * filled.capacity).from_address(result.ptr))
        memory[...] = NOTHING
        self.late.append((result, filled))
        return result

    def send(self):
        for result, filled in self.late:
            wp.copy(result, filled)
        self.late.clear()


def bytes_of(placement: esh.Placement) -> dict[str, bytes]:
    """All that a placement and its report say."""
    names = ("position", "angle", "length", "width", "class_index", "size_index", "id")
    said = {name: np.ascontiguousarray(getattr(placement, name)).tobytes() for name in names}
    report = placement.report and replace(placement.report, seconds=0.0)
    return said | {"report": repr(report).encode()}


def on_sphere(*sizes: esh.Size, fixed: bool = False, subdivisions: int = 3, **settings) -> esh.Problem:
    """A few bodies on a sphere."""
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions)
    surface = esh.Surface([esh.SurfaceMesh(np.array(mesh.vertices), np.array(mesh.faces))])
    stay = [esh.FixedBodies([[0.0, 0.0, 1.0]], body_class="a")] if fixed else []
    return esh.Problem(
        surface, [esh.BodyClass("a", list(sizes), lambda p: 1.5 + p.position[:, 2])], fixed=stay, **settings
    )


ON_SURFACES = {
    "dots": on_sphere(esh.Size("s", 0.01, 300), esh.Size("t", 0.02, 30), fixed=True),
    "dots on a fine mesh": on_sphere(esh.Size("s", 0.01, 60), subdivisions=4),
    "a range": on_sphere(esh.Size("s", (0.005, 0.02), 300), avoid_overlap=True),
    "lines": on_sphere(esh.Size("s", 0.004, 200, line=esh.Line(0.2, "slope", width=0.02)), avoid_overlap=True),
    "outlines": on_sphere(
        esh.Size("s", None, 150, footprint=esh.Footprint([[-0.1, -0.05], [0.1, -0.05], [0.1, 0.05], [-0.1, 0.05]])),
        avoid_overlap=True,
    ),
}


@pytest.mark.parametrize("problem", [*RECIPES, *ON_SURFACES], ids=lambda given: getattr(given, "stem", given))
def test_nothing_reads_an_array_before_something_was_launched(problem):
    problem = ON_SURFACES[problem] if problem in ON_SURFACES else esh.read_recipe(problem)
    found = []
    for make in (lambda: Launcher(resolve_device("cpu")), LateLauncher):
        launcher = make()
        try:
            solved = solve_on(launcher, problem, STEPS)
            with Solver(problem, launcher=launcher) as solver:
                solver.run(STEPS)
                solver.edit(replace(problem, seed=problem.seed + 1), steps=2)
                edited = solver.placement()
                solver.start_at(edited.position, angle=edited.angle, length=edited.length)
                solver.step(1)
                found.append((bytes_of(solved), bytes_of(edited), bytes_of(solver.placement())))
        finally:
            launcher.close()
    usual, late = found
    assert usual == late


def test_a_late_launcher_shows_who_reads_too_early():
    launcher = LateLauncher()
    try:
        values = np.arange(5.0, dtype=np.float32)
        array, result = launcher.array(values, float), launcher.zeros(5, float)
        assert not (array.numpy() == values).any()
        launcher.send()
        assert (array.numpy() == values).all() and not result.numpy().any()
    finally:
        launcher.close()
