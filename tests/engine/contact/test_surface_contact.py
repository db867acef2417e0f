"""Contact on a surface: how bodies of all sizes find each other."""

import time

import esh
import numpy as np
import pytest
import trimesh
import warp as wp
from esh.engine.contact import kernels_surface_contact, surface_contact
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.solve import solve
from esh.engine.solver.solver import Solver


@pytest.fixture
def among_trees() -> Problem:
    """1,500 tufts of grass and 4 trees that are 40 times as wide, on a ball: together they cover a third of it."""
    ball = trimesh.creation.icosphere(4)
    ground = esh.Surface(esh.SurfaceMesh(ball.vertices, ball.faces))
    grass = BodyClass("grass", [Size("tuft", 5e-4, 1500)])
    trees = BodyClass("trees", [Size("tree", 0.8, 4)])
    return Problem(ground, [grass, trees], avoid_overlap=True, seed=2)


def test_who_is_listed_as_near_is_who_is_found_in_every_round(among_trees):
    """Where all bodies stand alike, nobody but those of the lists is found in the cells around them, rounds after these were made."""
    anew = kernels_surface_contact.Nearby()
    touched = 0
    with Solver(among_trees, device="cpu") as solver:
        solver.run(5)
        contact, n = solver.descent.contact, solver.model.body_count
        anew.room, anew.body = 0, contact._nearby.body
        for _ in range(8):
            solver.run(1)
            contact._find()
            for _ in range(3):
                contact._round()
                is_listed = contact._nearby.count.numpy() >= 0
                assert is_listed.mean() > 0.9
                anew.count = wp.full(n, -1, dtype=wp.int32, device="cpu")
                found = []
                for nearby in (contact._nearby, anew):
                    seen = [contact._position, contact._neighbors, surface_contact.SLACK, surface_contact.DAMPING]
                    outputs = [nearby, contact._pushes]
                    contact._launcher.launch(kernels_surface_contact.push_apart, n, [*seen, contact._lanes], outputs)
                    found.append([array.numpy().copy() for array in (contact._pushes.shift, contact._pushes.count)])
                (shift, count), (shift_anew, count_anew) = found
                np.testing.assert_array_equal(count, count_anew)
                # The same, but for the order in which pushes are added up.
                np.testing.assert_allclose(shift, shift_anew, atol=1e-6)
                touched += np.count_nonzero(count[is_listed])
    assert touched > 500


def test_several_threads_find_together_what_one_finds(among_trees, monkeypatch):
    found = []
    for many in (64, np.inf):
        monkeypatch.setattr(surface_contact, "MANY_AROUND", many)
        with Solver(among_trees, device="cpu") as solver:
            trees = np.flatnonzero(solver.model.body.class_index == 1)
            contact = solver.descent.contact
            assert set(contact._lanes.body.numpy()) == (set(trees) if many == 64 else set())
            contact._find()
            contact._round()
            found.append([array.numpy()[trees] for array in (contact._pushes.shift, contact._pushes.overlaps)])
    (several, overlaps), (one, others) = found
    # The same, but for the order in which pushes are added up.
    np.testing.assert_allclose(several, one, rtol=1e-4)
    np.testing.assert_array_equal(overlaps, others)
    assert (overlaps > 10).all() and (np.linalg.norm(one, axis=1) > 0.0).all()


def test_large_bodies_find_small_ones_and_keep_them_off(among_trees):
    start = time.process_time()
    placement = solve(among_trees, device="cpu")
    assert time.process_time() - start < 60.0 and placement.report.overlaps == 0
    large = placement.class_index == 1
    away = np.linalg.norm(placement.position[large][:, None] - placement.position[~large], axis=2).min(axis=1)
    # Chords are a little shorter than ways along the ball.
    assert (away > 0.95 * (np.sqrt(0.8 / np.pi) + np.sqrt(5e-4 / np.pi))).all()
