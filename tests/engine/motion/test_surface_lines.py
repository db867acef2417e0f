"""Lines on a surface: they lie along it, in the directions that they are to have, whole, apart, and as evenly as dots."""

from dataclasses import replace

import numpy as np
import pytest

trimesh = pytest.importorskip("trimesh")

import esh  # noqa: E402
from esh import EshError  # noqa: E402
from esh.engine.problem.surface_directions import AlongCurves, SurfaceVectors  # noqa: E402
from esh.engine.quality.measurement import measure  # noqa: E402

BALL = trimesh.creation.icosphere(subdivisions=3)
RUN = {"device": "cpu", "max_steps": 60}


def ball(**named):
    return esh.Surface(esh.SurfaceMesh(BALL.vertices, BALL.faces, **named))


def square(side=10):
    x, y = np.meshgrid(np.linspace(0, 1, side), np.linspace(0, 1, side))
    index = np.arange(side * side).reshape(side, side)
    quad = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], axis=-1).reshape(-1, 4)
    place = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    return esh.Surface(esh.SurfaceMesh(place, np.concatenate([quad[:, :3], quad[:, [0, 2, 3]]])))


def sticks(surface, direction="none", count=150, length=0.24, width=0.04, density=1.0, bending=None, **named):
    line = esh.Line(length, direction, width=width, **(bending or {}))
    size = esh.Size("stick", length * width, count, line=line)
    return esh.Problem(surface, [esh.BodyClass("wood", [size], density=density)], **named)


def cosine(placement, wanted):
    """Between the axes and some directions along the surface, and how steep these are."""
    wanted = wanted - (wanted * placement.normal).sum(axis=1, keepdims=True) * placement.normal
    steep = np.linalg.norm(wanted, axis=1)
    return np.abs((wanted * placement.tangent).sum(axis=1)) / np.maximum(steep, 1e-9), steep


def ends(placement):
    half = 0.5 * placement.length[:, None] * placement.tangent
    return np.concatenate([placement.position - half, placement.position + half])


def test_lines_lie_along_the_surface_and_are_as_long_as_asked():
    placement = esh.solve(sticks(ball(), avoid_overlap=True), **RUN)
    assert np.abs((placement.tangent * placement.normal).sum(axis=1)).max() < 1e-6
    np.testing.assert_allclose(np.linalg.norm(placement.tangent, axis=1), 1.0, atol=1e-6)
    assert placement.length.mean() == pytest.approx(0.24, rel=0.03) and np.ptp(placement.length) < 0.1
    np.testing.assert_array_equal(placement.width, 0.04)
    report = placement.report
    assert report.overlaps == 0 and report.coverage_error < 0.03
    # Angles count from the direction nearest to x, counter-clockwise seen from outside.
    first = np.where(np.abs(placement.normal[:, :1]) > 0.9, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
    first = first - (first * placement.normal).sum(axis=1, keepdims=True) * placement.normal
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    again = np.cos(placement.angle)[:, None] * first + np.sin(placement.angle)[:, None] * np.cross(
        placement.normal, first
    )
    assert np.abs((again * placement.tangent).sum(axis=1)).min() > 1.0 - 1e-6


def test_lines_run_down_the_slope():
    placement = esh.solve(sticks(ball(), "slope"), **RUN)
    along, steep = cosine(placement, np.broadcast_to([0.0, 0.0, -1.0], placement.position.shape))
    assert np.quantile(along[steep > 0.4], 0.05) > 0.95


@pytest.mark.parametrize("given", ["function", "attribute", "curve"])
def test_lines_follow_vectors(given):
    def around(place):
        return np.cross([0.0, 0.0, 1.0], place)

    turn = np.linspace(0.0, 2.0 * np.pi, 200)
    direction = {
        "function": lambda points: around(points.position),
        "attribute": SurfaceVectors("flow"),
        "curve": AlongCurves([2.0 * np.stack([np.cos(turn), np.sin(turn), np.zeros(200)], axis=1)]),
    }[given]
    surface = ball(attributes={"flow": around(BALL.vertices)})
    placement = esh.solve(sticks(surface, direction), **RUN)
    along, steep = cosine(placement, around(placement.position))
    assert np.quantile(along[steep > 0.4], 0.05) > 0.95


def test_lines_run_along_the_edges_of_a_density():
    """Around a disc on a square: at its rim lines lie along it."""
    middle = np.array([0.5, 0.5, 0.0])

    def density(points):
        away = np.linalg.norm(points.position - middle, axis=1)
        return 1.0 / (1.0 + np.exp((away - 0.3) / 0.03)) + 0.25

    placement = esh.solve(sticks(square(), "density", 260, 0.06, 0.012, density), **RUN)
    out = placement.position - middle
    away = np.linalg.norm(out, axis=1)
    at_rim = np.abs(away - 0.3) < 0.03
    along = np.abs((np.cross([0.0, 0.0, 1.0], out / away[:, None]) * placement.tangent).sum(axis=1))
    assert at_rim.sum() > 20 and np.median(along[at_rim]) > 0.95
    assert placement.report.coverage_error < 0.06


def test_lines_stay_on_a_surface_that_ends():
    placement = esh.solve(sticks(square(), "none", 60, 0.2, 0.02), **RUN)
    assert ends(placement)[:, :2].min() > -0.02 and ends(placement)[:, :2].max() < 1.02
    np.testing.assert_allclose(placement.position[:, 2], 0.0, atol=1e-9)


def test_on_a_square_lines_are_as_even_as_those_of_the_plane():
    flat = esh.solve(
        esh.Problem(
            esh.Domain((1, 1)),
            [esh.BodyClass("wood", [esh.Size("stick", 0.0008, 300, line=esh.Line(0.08, "none", width=0.01))])],
        ),
        **RUN,
    )
    bent = esh.solve(sticks(square(), "none", 300, 0.08, 0.01), **RUN)
    assert bent.report.coverage_error < 1.5 * flat.report.coverage_error + 0.005


def test_lines_go_round_an_edge():
    """A long thin roof: charges of a line that crosses its ridge lie on both sides."""
    roof = np.array([(0, -1, -1), (4, -1, -1), (4, 0, 0), (0, 0, 0), (4, 1, -1), (0, 1, -1)], float)
    faces = np.array([(0, 1, 2), (0, 2, 3), (3, 2, 4), (3, 4, 5)])
    surface = esh.Surface(esh.SurfaceMesh(roof, faces))
    with esh.Solver(sticks(surface, "slope", 80, 0.6, 0.04), device="cpu") as solver:
        solver.run(40)
        charges = solver.descent.charges.points.position.numpy().reshape(80, 3, 3)
        side = np.sign(charges[:, [0, 2], 1])
        crossing = side[:, 0] * side[:, 1] < 0
        assert crossing.sum() >= 3
        # On the roof, whichever side they are on.
        place = charges.reshape(-1, 3) * solver.model.unit + solver.descent.facets.middle
        np.testing.assert_allclose(place[:, 2], -np.abs(place[:, 1]), atol=1e-4)


def test_dots_and_lines_of_two_classes_keep_apart_and_out_of_balls():
    line = esh.Line(0.2, "slope", width=0.04)
    classes = [
        esh.BodyClass("wood", [esh.Size("stick", 0.008, 80, line=line)]),
        esh.BodyClass("stone", [esh.Size("pebble", 0.004, 200)]),
    ]
    hole = esh.Obstacle(ball=(0, 0, 1, 0.5))
    placement = esh.solve(esh.Problem(ball(), classes, avoid_overlap=True, obstacles=[hole]), **RUN)
    assert placement.report.overlaps == 0
    wood = placement.class_index == 0
    assert (placement.width[wood] > 0).all() and (placement.length[~wood] == 0).all()
    assert np.linalg.norm(ends(placement) - (0, 0, 1), axis=1).min() > 0.5


def test_fixed_lines_and_edits():
    surface = ball()
    with esh.Solver(sticks(surface, "slope", 120), device="cpu") as solver:
        solver.run(40)
        before = solver.placement()
        pinned = esh.FixedBodies.of_placement(before, np.arange(40))
        edit = solver.edit(sticks(surface, "slope", 80, fixed=pinned))
        after = solver.placement()
        assert len(edit.added) == len(edit.removed) == 0
        _, i, j = np.intersect1d(before.id[:40], after.id, return_indices=True)
        np.testing.assert_allclose(after.position[j], before.position[:40][i], atol=1e-6)
        np.testing.assert_allclose(after.length[j], before.length[:40][i], rtol=1e-4)
        assert np.abs((after.tangent[j] * before.tangent[:40][i]).sum(axis=1)).min() > 0.999
        solver.edit(sticks(surface, "slope", 160))
        grown = solver.placement()
        kept = np.isin(grown.id, after.id)
        assert len(grown.id) == 160 and kept.sum() == 120
        assert measure(grown, solver.launcher).coverage_error < 0.06


def test_bytes_do_not_depend_on_threads(monkeypatch):
    bending = {"charges": 5, "straightness": 0.1}
    problem = sticks(ball(), "slope", 200, avoid_overlap=True, bending=bending)
    found = []
    for threads in ("1", "3"):
        monkeypatch.setenv("ESH_THREADS", threads)
        found.append(esh.solve(problem, device="cpu", max_steps=5))
    for name in ("position", "tangent", "length", "angle", "bends"):
        np.testing.assert_array_equal(getattr(found[0], name), getattr(found[1], name))


def rings(place):
    return 0.55 + 0.45 * np.sin(40.0 * np.linalg.norm(place[:, :2] - 0.5, axis=1))


def longer_than_its_chord(bends):
    chord = np.linalg.norm(bends[:, -1] - bends[:, 0], axis=1)
    return np.linalg.norm(np.diff(bends, axis=1), axis=2).sum(axis=1) / chord


def test_lines_bend_as_those_of_the_plane_do():
    """Along the rings of a density on a square: as far."""
    size = {"count": 200, "length": 0.07, "width": 0.008}
    surface = square(40)
    found = {}
    for straightness in (None, 0.02, 0.9):
        bending = {"charges": 5, "straightness": straightness}
        asked = sticks(surface, "none", density=lambda points: rings(points.position), bending=bending, **size)
        found[straightness] = esh.solve(asked, **RUN)
    assert found[None].bends is None
    bent = found[0.02]
    assert bent.bends.shape == (200, 5, 3)
    np.testing.assert_allclose(bent.bends[:, :, 2], 0.0, atol=1e-6)
    assert bent.bends.min() > -1e-6 and bent.bends.max() < 1.0 + 1e-6
    # What a bend adds is neither a shift nor a turn.
    share = np.array([1.0, 1.0, 6.0, 1.0, 1.0]) / 10.0
    np.testing.assert_allclose(np.einsum("k,nkd->nd", share, bent.bends), bent.position, atol=2e-4)
    y, x = (np.mgrid[0:128, 0:128] + 0.5) / 128.0
    image = rings(np.column_stack([x.ravel(), y.ravel()])).reshape(128, 128)
    line = esh.Line(0.07, "none", width=0.008, charges=5, straightness=0.02)
    in_plane = esh.BodyClass("wood", [esh.Size("stick", 0.07 * 0.008, 200, line=line)], image)
    flat = esh.solve(esh.Problem(esh.Domain((1, 1)), [in_plane]), **RUN)
    here, there = longer_than_its_chord(bent.bends).mean() - 1.0, longer_than_its_chord(flat.bends).mean() - 1.0
    assert 0.5 * there < here < 2.0 * there
    assert there > 0.003
    assert longer_than_its_chord(found[0.9].bends).mean() < 1.0 + 0.5 * here
    assert bent.report.coverage_error < 1.3 * found[None].report.coverage_error


@pytest.mark.parametrize("side", [2, 21])
@pytest.mark.parametrize("step", [0.5, 0.513])
def test_lines_run_along_the_steps_of_a_density(side, step):
    """Between tiles and within them: a step has no gradient that could be measured at a point."""
    length = (0.4 / 600 * 6) ** 0.5
    problem = sticks(
        square(side), "density", 600, length, length / 6, lambda points: 1.0 + 4.0 * (points.position[:, 0] > step)
    )
    placement = esh.solve(problem, device="cpu")
    near = np.abs(placement.position[:, 0] - step) < 0.3 * length
    assert near.sum() > 10
    # Of lines that lie anyhow it is 0.64.
    assert np.abs(placement.tangent[near, 0]).mean() < 0.15


def test_lines_that_bend_lie_on_a_ball_as_a_whole():
    bending = {"charges": 7, "straightness": 0.1}
    placement = esh.solve(sticks(ball(), "slope", 60, 0.5, 0.02, bending=bending), **RUN)
    away = np.linalg.norm(placement.bends, axis=2)
    # The ball is one of flat triangles.
    assert away.max() < 1.0 + 1e-6 and away.min() > 0.98
    assert longer_than_its_chord(placement.bends).mean() > 1.01
    way = placement.bends - placement.position[:, None]
    share = np.array([1.0, 1.0, 1.0, 6.0, 1.0, 1.0, 1.0]) / 12.0
    across = np.cross(placement.normal, placement.tangent)
    for axis in (placement.tangent, across):
        assert np.abs(np.einsum("k,nkd,nd->n", share, way, axis)).max() < 0.02
    # The one end lies ahead of the middle, the other one behind it.
    along = np.einsum("nkd,nd->nk", way, placement.tangent)
    assert (along[:, 0] < -0.1).all() and (along[:, -1] > 0.1).all()


def segments_apart(bends):
    """Smallest distance between the polylines of every two lines on a plane, by points on them, shape [n, n]."""
    steps = np.linspace(0.0, 1.0, 24, endpoint=False)[:, None]
    points = np.concatenate([bends[:, k, None] + steps * (bends[:, k + 1] - bends[:, k])[:, None] for k in range(4)], 1)
    far = np.full((len(bends), len(bends)), np.inf)
    for i in range(len(bends)):
        way = points[i][None, :, None, :2] - points[:, None, :, :2]
        far[i] = np.sqrt((way**2).sum(axis=3)).min(axis=(1, 2))
    np.fill_diagonal(far, np.inf)
    return far


def test_lines_that_bend_do_not_overlap_as_they_are_bent():
    line = {"charges": 5, "straightness": 0.02, "turn_weights": (0.4, 0.0)}

    def inside(points):
        # Where the surface ends, a charge that would be beyond it lies on its end.
        return rings(points.position) * (np.abs(points.position[:, :2] - 0.5).max(axis=1) < 0.45)

    problem = sticks(square(41), "none", 50, 0.16, 0.02, inside, avoid_overlap=True, bending=line)
    with esh.Solver(problem, device="cpu") as solver:
        solver.run(40)
        before = solver.state.bend.numpy().copy()
        assert segments_apart(solver.placement().bends).min() < 0.018
        assert solver.separate()
        placement = solver.placement()
        after = solver.state.bend.numpy()
        assert measure(placement, solver.launcher).overlaps == 0
    assert segments_apart(placement.bends).min() > 0.98 * 0.02
    # Some have no room, and others as much as they want.
    widest, left = (np.abs(bend).reshape(-1, 5).max(axis=1) for bend in (before, after))
    kept = left[widest > 1e-3] / widest[widest > 1e-3]
    assert len(kept) > 30
    assert kept.min() < 0.3
    assert 0.7 < kept.max() < 1.001


def test_lines_that_may_lie_on_each_other_leave_each_other_their_bends():
    """Lines of classes that may overlap took each other for neighbors that leave no room, and were straightened."""

    def inside(points):
        return rings(points.position) * (np.abs(points.position[:, :2] - 0.5).max(axis=1) < 0.45)

    line = {"charges": 5, "straightness": 0.02, "turn_weights": (0.4, 0.0)}
    one = sticks(square(41), "none", 25, 0.16, 0.02, inside, avoid_overlap=True, bending=line)
    kept = []
    for matrix in (np.eye(2), np.ones((2, 2))):
        classes = [replace(one.classes[0], name=name) for name in "ab"]
        problem = replace(one, classes=classes, balance=esh.Balance(non_overlap=matrix))
        with esh.Solver(problem, device="cpu") as solver:
            solver.run(40)
            before = np.abs(solver.state.bend.numpy()).reshape(-1, 5).max(axis=1)
            solver.separate()
            after = np.abs(solver.state.bend.numpy()).reshape(-1, 5).max(axis=1)
        kept.append(np.mean(after[before > 1e-3] / before[before > 1e-3]))
    # Without it 0.004 was kept: those of another class lie just there.
    assert kept[0] > 0.5 > 2.0 * kept[1]


def test_an_edit_leaves_lines_as_long_and_as_bent_as_they_were():
    surface, bending = ball(), {"charges": 5, "straightness": 0.0}
    with esh.Solver(sticks(surface, "slope", 100, bending=bending), device="cpu") as solver:
        solver.run(30)
        before = solver.placement()
        solver.edit(sticks(surface, "slope", 160, bending=bending), steps=0)
        after = solver.placement()
        _, i, j = np.intersect1d(before.id, after.id, return_indices=True)
        assert len(i) == 100
        np.testing.assert_allclose(after.length[j], before.length[i], rtol=1e-4)
        np.testing.assert_allclose(after.bends[j], before.bends[i], atol=1e-4)


def test_dots_that_an_edit_makes_lines_have_a_length():
    """They kept the axis that they had as dots, and were without extent for good."""
    surface = ball()

    def problem(line):
        return esh.Problem(surface, [esh.BodyClass("a", [esh.Size("s", 0.002, 60, line=line)])])

    with esh.Solver(problem(None), device="cpu") as solver:
        solver.run(20)
        before = solver.placement()
        solver.edit(problem(esh.Line(0.3, "none")))
        after = solver.placement()
        assert set(after.id) == set(before.id)
        assert after.length.min() > 0.25 and after.length.max() < 0.6
        solver.edit(problem(None))
        assert not solver.placement().length.any()


def test_lines_that_an_edit_puts_on_another_face_have_a_length():
    """They brought the axis along that they would have had elsewhere; what lay across the face was without extent for good."""
    box = trimesh.creation.box((1.0, 1.0, 1.0))
    surface = esh.Surface(esh.SurfaceMesh(box.vertices, box.faces))

    def upright(points):
        return np.tile([0.0, 0.0, 1.0], (len(points.position), 1))

    with esh.Solver(sticks(surface, upright, count=20, length=0.1, width=0.01), device="cpu") as solver:
        solver.run(10)
        for steps in (0, 1, 5):
            solver.edit(sticks(surface, upright, count=90 + steps, length=0.1, width=0.01), steps=steps)
            assert solver.placement().length.min() > 0.0


def test_lines_far_apart_are_as_long_as_asked_after_an_edit():
    """What holds against their own charges was forgotten: they came to be twice as long."""
    ball = trimesh.creation.icosphere(subdivisions=2)
    surface = esh.Surface(esh.SurfaceMesh(ball.vertices, ball.faces))

    def problem(count):
        size = esh.Size("a", 0.002, count, line=esh.Line(0.12, direction="none"))
        return esh.Problem(surface, [esh.BodyClass("stick", [size])], seed=1)

    with esh.Solver(problem(40), device="cpu") as solver:
        solver.run(100)
        solver.edit(problem(42))
        assert solver.placement().length == pytest.approx(np.full(42, 0.12), rel=0.15)


def test_what_lines_cannot_do_on_a_surface_is_said():
    def asked(domain=None, direction="none", length=0.2, **line):
        size = esh.Size("stick", 0.01, 9, line=esh.Line(length, direction, width=0.05, **line))
        return esh.Problem(domain or ball(), [esh.BodyClass("wood", [size])])

    with pytest.raises(EshError, match=r"`line.length` of size .* must be one number on a surface; got an image"):
        asked(length=np.full((2, 2), 0.2))
    with pytest.raises(EshError, match='must be "density", "none", "slope" or a function of points on a surface'):
        asked(direction=0.3)
    for direction in ("slope", lambda points: points.position):
        with pytest.raises(EshError, match=r"must be another in a rectangle; .* needs a Surface"):
            asked(esh.Domain((1, 1)), direction)
    with pytest.raises(EshError, match=r"`line.direction` of class \"wood\" must return a vector per point, shape \["):
        esh.solve(asked(direction=lambda points: np.ones(len(points.triangle))), **RUN)
    with pytest.raises(EshError, match="must be finite everywhere; it returned NaN or infinity"):
        esh.solve(asked(direction=lambda points: np.full((len(points.triangle), 3), np.nan)), **RUN)


@pytest.mark.parametrize(("count", "kept"), [(300, True), (4_000, False)])
def test_lines_that_lie_on_each_other_many_times_are_not_pushed(count, kept):
    ball = trimesh.creation.icosphere(2, radius=0.15)
    line = esh.Line(0.1, "none", width=0.1)
    classes = [esh.BodyClass("a", [esh.Size("s", 1e-5, count, line=line)])]
    problem = esh.Problem(esh.Surface([esh.SurfaceMesh(ball.vertices, ball.faces)]), classes)
    with esh.Solver(problem, device="cpu") as solver:
        assert (solver.descent.contact is not None) == kept
        solver.step()
        assert np.isfinite(solver.placement().position).all()


@pytest.mark.parametrize("shape", ["torus", "box"])
@pytest.mark.parametrize("straightness", [0.0, 1.0])
def test_lines_that_bend_keep_apart_and_off_outlines_on_curved_ground_and_round_edges(shape, straightness):
    mesh = {
        "torus": lambda: trimesh.creation.torus(1.0, 0.4, major_sections=64, minor_sections=32),
        "box": lambda: trimesh.creation.box((1.0, 1.2, 1.4)),
    }[shape]()
    surface = esh.Surface(esh.SurfaceMesh(mesh.vertices, mesh.faces))
    area = 0.12 * surface.area / 120
    first = esh.solve(
        esh.Problem(surface, [esh.BodyClass("stone", [esh.Size("s", area, 120)])], avoid_overlap=True), **RUN
    )
    stones = esh.Obstacle(
        disc=(0, 0, (area / np.pi) ** 0.5), position=first.position, normal=first.normal, tangent=first.tangent
    )
    width = (0.25 * surface.area / 120 / 4) ** 0.5
    bending = {"straightness": straightness}
    problem = sticks(surface, "none", 120, 4 * width, width, avoid_overlap=True, obstacles=[stones], bending=bending)
    placement = esh.solve(problem, **RUN)
    report = placement.report
    assert report.overlaps == 0 and report.in_obstacles == 0
    # Nearly all of them bend, as far as they are let.
    bent = np.isfinite(placement.bends).all(axis=(1, 2))
    assert bent.mean() > 0.7
    if straightness == 0.0:
        assert longer_than_its_chord(placement.bends[bent]).max() > 1.02
    # Points of two neighbors, in a straight line, are no nearer than flat outlines allow where the ground bends little between them.
    if shape == "torus":
        middles = placement.position[bent]
        points = placement.bends[bent]
        for i, j in np.argwhere(np.triu(np.linalg.norm(middles[:, None] - middles[None], axis=2) < 2.0 * width, 1)):
            alike = placement.normal[bent][i] @ placement.normal[bent][j] > 0.95
            nearest = np.linalg.norm(points[i][:, None] - points[j][None], axis=2).min()
            assert not alike or nearest > 0.9 * width


def test_bent_lines_are_laid_as_they_were_parted():
    """In the plane that touches the smooth surface at the middle, points of lines are where axis and bend say."""
    width = 0.06
    problem = sticks(ball(), "none", 60, 6 * width, width, avoid_overlap=True, bending={"straightness": 0.1})
    with esh.Solver(problem, device="cpu") as solver:
        solver.run(40)
        placement = solver.placement()
    bent = np.isfinite(placement.bends).all(axis=(1, 2))
    assert bent.all()
    way = placement.bends - placement.position[:, None]
    # Here it looks away from the middle of the ball, nearly.
    normal = placement.position / np.linalg.norm(placement.position, axis=1, keepdims=True)
    flat = way - np.einsum("nkd,nd->nk", way, normal)[:, :, None] * normal[:, None]
    flat *= (np.linalg.norm(way, axis=2) / np.maximum(np.linalg.norm(flat, axis=2), 1e-12))[:, :, None]
    along = placement.tangent - (placement.tangent * normal).sum(axis=1, keepdims=True) * normal
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    axial = np.einsum("nkd,nd->nk", flat, along)
    share = np.linspace(-0.5, 0.5, placement.bends.shape[1])
    np.testing.assert_allclose(axial, share * placement.length[:, None], atol=0.01 * width)


@pytest.mark.parametrize("seed", range(4))
def test_no_point_of_a_line_reaches_into_a_ball(seed):
    width = (0.2 * 4.0 * np.pi / 200 / 4) ** 0.5
    balls = [(0.6, 0, 0.8, 0.25), (-0.6, 0, -0.8, 0.3), (0, 1, 0, 0.3)]
    mesh = trimesh.creation.icosphere(4)
    surface = esh.Surface(esh.SurfaceMesh(mesh.vertices, mesh.faces))
    problem = sticks(
        surface,
        "slope",
        200,
        4 * width,
        width,
        avoid_overlap=True,
        obstacles=[esh.Obstacle(ball=one) for one in balls],
        seed=seed,
    )
    placement = esh.solve(problem, device="cpu")
    assert placement.report.in_obstacles == 0
    steps = np.linspace(-0.5, 0.5, 41)[:, None, None]
    axis = placement.position + steps * placement.length[:, None] * placement.tangent
    for x, y, z, radius in balls:
        assert np.linalg.norm(axis - [x, y, z], axis=2).min() > radius + 0.5 * width - 1e-5
