"""What an edit on a surface takes again of the forces before it: it is what would be found anew."""

import esh
import numpy as np
import pytest
import trimesh
from esh.engine.cascade import kernels_near_target
from esh.engine.descent.surface_descent import SurfaceDescent
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.model.model import Model


def ball():
    mesh = trimesh.creation.icosphere(subdivisions=4)
    return np.array(mesh.vertices), np.array(mesh.faces)


def open_ball():
    vertices, faces = ball()
    return vertices, faces[(vertices[faces][:, :, 2] > -0.3).all(axis=1)]


def rough():
    vertices, faces = ball()
    return vertices * (1.0 + 0.03 * np.random.default_rng(3).normal(size=len(vertices)))[:, None], faces


def box():
    mesh = trimesh.creation.box(extents=(1.0, 1.0, 0.6))
    return np.array(mesh.vertices), np.array(mesh.faces)


def rising(points):
    return 1.0 + 0.5 * points.position[:, 2] ** 2


def dab(factor):
    """The same with a spot of another density."""

    def density(points):
        place = points.position / np.linalg.norm(points.position, axis=1, keepdims=True)
        near = np.linalg.norm(place - (0.6, 0.0, 0.8), axis=1) < 0.2
        return np.where(near, factor, 1.0) * rising(points)

    return density


def problem(surface, density, counts=(5000, 3000)):
    classes = [esh.BodyClass(f"class {k}", [esh.Size("s", 1e-6, count)], density) for k, count in enumerate(counts)]
    return esh.Problem(surface, classes)


@pytest.fixture(scope="module")
def launcher():
    result = Launcher(resolve_device("cpu"))
    yield result
    result.close()


@pytest.fixture
def counted(monkeypatch):
    """Numbers of corners at which the near part of the target was summed, launch after launch."""
    counts, launch = [], Launcher.launch

    def watched(self, kernel, count, *arguments, **options):
        if kernel is kernels_near_target.sum_near_target:
            counts.append(count)
        launch(self, kernel, count, *arguments, **options)

    monkeypatch.setattr(Launcher, "launch", watched)
    return counts


@pytest.mark.parametrize("mesh", [ball, open_ball, rough, box])
@pytest.mark.parametrize("factor", [0.0, 0.3, 3.0])
def test_forces_after_an_edit_are_those_that_are_found_anew(launcher, mesh, factor, counted, monkeypatch):
    surface = esh.Surface(esh.SurfaceMesh(*mesh()))
    before = SurfaceDescent(Model(problem(surface, rising)), launcher)
    model = Model(problem(surface, dab(factor), (5030, 2970)), unit=before.model.unit)
    summed = sum(counted)
    after = SurfaceDescent(model, launcher, before=before)
    few = sum(counted) - summed
    monkeypatch.setattr("esh.engine.cascade.cascade.kept_facets", lambda *given: None)
    fresh = SurfaceDescent(model, launcher, before=before)
    assert few < 0.75 * (sum(counted) - summed - few)
    assert after.cascade.nodes is fresh.cascade.nodes is before.cascade.nodes
    is_full = after.share.max(axis=0) > 0.0
    tiles = after.cascade._centers
    np.testing.assert_array_equal(after.cascade.home.numpy(), before.cascade.nodes.homes(tiles, is_full).numpy())
    for name in ("node_share", "node_area"):
        np.testing.assert_allclose(getattr(after.cascade, name), getattr(fresh.cascade, name), rtol=1e-3, atol=1e-9)
    force, expected = (d.cascade._near_target.force.numpy() for d in (after, fresh))
    assert np.abs(force - expected).max() < 0.01 * np.abs(expected).max()
    variance, expected = (d.cascade._near_target.variance.numpy() for d in (after, fresh))
    assert np.abs(variance / expected - 1.0).max() < 0.05


def test_nothing_is_summed_where_no_density_changes(launcher, counted):
    surface = esh.Surface(esh.SurfaceMesh(*ball()))
    before = SurfaceDescent(Model(problem(surface, rising)), launcher)
    summed = len(counted)
    after = SurfaceDescent(
        Model(problem(surface, rising, (4990, 3010)), unit=before.model.unit), launcher, before=before
    )
    assert len(counted) == summed
    np.testing.assert_array_equal(after.cascade.node_area, before.cascade.node_area)
    np.testing.assert_array_equal(after.cascade._near_target.force.numpy(), before.cascade._near_target.force.numpy())


def test_many_small_changes_of_counts_are_noticed_at_last(launcher, counted):
    """What charges are blurred by follows how many there are: a twentieth is let pass, ten of them are not."""
    surface, count = esh.Surface(esh.SurfaceMesh(*ball())), 2000
    descent = SurfaceDescent(Model(problem(surface, rising, (count,))), launcher)
    unit, seen = descent.model.unit, []
    for _ in range(4):
        count = round(1.03 * count)
        summed = len(counted)
        descent = SurfaceDescent(Model(problem(surface, rising, (count,)), unit=unit), launcher, before=descent)
        seen.append(len(counted) > summed)
    assert seen == [False, True, False, True]


def test_what_a_surface_is_at_the_spacing_of_points_that_are_spread_is_found_once(monkeypatch):
    made, averages = [], esh.engine.cascade.seen_from_afar._averages
    monkeypatch.setattr(
        "esh.engine.cascade.seen_from_afar._averages", lambda *given: made.append(1) or averages(*given)
    )
    surface = esh.Surface(esh.SurfaceMesh(*rough()))
    with esh.Solver(problem(surface, rising, (3000,)), device="cpu") as solver:
        solver.run(20)
        for factor in (0.1, 1.0, 0.1, 1.0):
            solver.edit(problem(surface, dab(factor), (3000,)))
    # For bodies, and for those that came and went.
    assert len(made) == 2
