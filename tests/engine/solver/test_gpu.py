"""A GPU places as well as the CPU does, whatever is asked: by the same kernels, but sums in another order."""

from __future__ import annotations

import math
from pathlib import Path

import esh
import numpy as np
import pytest
from esh.engine.problem.footprint import Footprint
from esh.engine.problem.footprints import Footprints
from esh.engine.solve import moved

pytestmark = pytest.mark.cuda

RECIPES = sorted((Path(__file__).parents[2] / "recipes").glob("*.toml"))
BOX, PLANK = Footprint.rectangle(0.8, 0.6), Footprint.rectangle(1.5, 0.3)


def both(problem: esh.Problem) -> tuple[esh.Placement, esh.Placement]:
    return esh.solve(problem, device="cuda:0"), esh.solve(problem, device="cpu")


def check(problem: esh.Problem) -> esh.Placement:
    """Solve on both; the GPU's placement is as complete, and nearly as even, as the CPU's."""
    gpu, cpu = both(problem)
    assert gpu.report.device == "cuda:0" and cpu.report.device == "cpu"
    assert np.isfinite(gpu.position).all() and len(gpu.position) == len(cpu.position)
    assert [s.placed for c in gpu.report.classes for s in c.sizes] == [
        s.placed for c in cpu.report.classes for s in c.sizes
    ]
    # Where not everything fits, which pairs are left over is chance.
    assert gpu.report.overlaps <= 1.3 * cpu.report.overlaps + (2 if cpu.report.overlaps else 0)
    assert gpu.report.coverage_error <= 1.25 * cpu.report.coverage_error + 0.003
    return gpu


@pytest.mark.parametrize("path", RECIPES, ids=lambda path: path.stem)
def test_recipes_come_out_alike(path):
    check(esh.read_recipe(path))


def sphere(radius: float) -> esh.Surface:
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.creation.icosphere(4, radius)
    return esh.Surface(esh.SurfaceMesh(mesh.vertices, mesh.faces))


@pytest.mark.parametrize("where", ["plane", "slope"])
def test_outlines_that_lean_are_parted(where):
    rows, columns = np.mgrid[0:40, 0:40] / 39.0
    slope = None if where == "plane" else np.stack([np.sin(6.0 * columns), np.cos(5.0 * rows)], axis=-1)
    footprints = [Footprints(one, turn="random", scale_jitter=0.2, slope=slope, tilt=0.3) for one in (BOX, PLANK)]
    classes = [
        esh.BodyClass(name, [esh.Size("s", None, 90, footprint=f)]) for name, f in zip("ab", footprints, strict=True)
    ]
    gpu = check(esh.Problem(esh.Domain((12.0, 12.0)), classes, avoid_overlap=True, seed=1))
    assert gpu.report.overlaps == 0


@pytest.mark.parametrize("turn", ["free", "random"])
def test_outlines_on_a_surface_are_parted(turn):
    count = round(0.25 * 4.0 * math.pi * 25.0 / BOX.area)
    classes = [
        esh.BodyClass(
            name, [esh.Size("s", None, round(count * BOX.area / one.area), footprint=Footprints(one, turn=turn))]
        )
        for name, one in (("box", BOX), ("plank", PLANK))
    ]
    gpu = check(esh.Problem(sphere(5.0), classes, avoid_overlap=True, seed=2))
    assert gpu.report.overlaps == 0


def test_outlines_on_a_surface_are_parted_from_those_that_stand_there():
    surface, count = sphere(5.0), round(0.2 * 4.0 * math.pi * 25.0 / BOX.area)

    def asked(seed: int, obstacles: list[esh.Obstacle]) -> esh.Problem:
        sizes = [esh.Size("s", None, count, footprint=Footprints(BOX, turn="random"))]
        classes = [esh.BodyClass("box", sizes)]
        return esh.Problem(surface, classes, avoid_overlap=True, seed=seed, obstacles=obstacles)

    first = esh.solve(asked(1, []), device="cuda:0")
    there = esh.Obstacle(
        polygon=BOX.corners, position=first.position, normal=first.normal, tangent=first.tangent, margin=0.05
    )
    gpu = check(asked(2, [there]))
    assert gpu.report.overlaps == 0 and gpu.report.in_obstacles == 0


def test_rare_classes_and_few_bodies_are_even():
    classes = [esh.BodyClass(str(n), [esh.Size("s", 1e-3, n)]) for n in (2000, 200, 20)]
    check(esh.Problem(esh.Domain((40.0, 40.0)), classes, seed=3))
    check(esh.Problem(esh.Domain((8.0, 8.0)), [esh.BodyClass(n, [esh.Size("s", 1.0, 7)]) for n in "ab"], seed=3))


def test_edits_go_on_from_where_bodies_are():
    def asked(right: float) -> esh.Problem:
        density = np.where(np.arange(64) < 32, 1.0, right)[None, :]
        return esh.Problem(esh.Domain((50.0, 50.0)), [esh.BodyClass("a", [esh.Size("s", 0.3, 2500)], density)], seed=5)

    with esh.Solver(asked(1.0), device="cuda:0") as solver:
        solver.run(100)
        solver.edit(asked(0.5))
        placed = solver.placement()
    assert len(placed.position) == 2500
    assert (placed.position[:, 0] < 25.0).mean() == pytest.approx(2.0 / 3.0, abs=0.01)


@pytest.mark.parametrize("boundary", ["open", "periodic"])
def test_outlines_beside_obstacles_are_parted_and_counted(boundary):
    rng = np.random.default_rng(1)
    corners = [rng.uniform(0.0, 12.0, 2) + rng.uniform(-1.0, 1.0, (3, 2)) for _ in range(12)]
    image = np.zeros((60, 60), bool)
    image[20:24, 30:50] = True
    obstacles = [
        *(esh.Obstacle(polygon=c) for c in corners),
        esh.Obstacle(disc=(3.0, 3.0, 0.1)),
        esh.Obstacle(image=image),
    ]
    classes = [
        esh.BodyClass(name, [esh.Size("s", None, 40, footprint=Footprints(one))])
        for name, one in (("box", BOX), ("plank", PLANK))
    ]
    problem = esh.Problem(esh.Domain((12.0, 12.0), boundary), classes, avoid_overlap=True, obstacles=obstacles, seed=1)
    gpu = check(problem)
    assert gpu.report.clean
    strewn = rng.uniform(0.0, 12.0, gpu.position.shape)
    one, other = (moved(gpu, strewn, device).report for device in ("cuda:0", "cpu"))
    assert one.in_obstacles == other.in_obstacles > 0
    assert one.deepest_in_obstacle == pytest.approx(other.deepest_in_obstacle, rel=1e-6)
