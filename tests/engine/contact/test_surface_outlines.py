"""Convex outlines on surfaces: parted in the planes between neighbors, turned as they may be, measured with shapely."""

import dataclasses

import esh
import numpy as np
import pytest
import shapely
import trimesh
from esh.engine.problem.footprint import Footprint
from esh.engine.problem.footprints import Footprints
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

BOX, PLANK = Footprint.rectangle(1.0, 1.0), Footprint.rectangle(3.0, 0.7)
# Its origin is beside it.
WEDGE = Footprint.polygon([[0.2, -0.5], [1.4, -0.2], [1.4, 0.2], [0.2, 0.5]], 0.05)


def ball(detail=4):
    mesh = trimesh.creation.icosphere(detail)
    return esh.Surface(esh.SurfaceMesh(mesh.vertices, mesh.faces))


def square(cells=16):
    x, y = np.meshgrid(np.linspace(0, 1, cells + 1), np.linspace(0, 1, cells + 1))
    number = np.arange((cells + 1) ** 2).reshape(cells + 1, cells + 1)
    a, b, c, d = (part.ravel() for part in (number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]))
    vertices = np.stack([x.ravel(), y.ravel(), 0.0 * x.ravel()], axis=1)
    return esh.Surface(esh.SurfaceMesh(vertices, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])))


def asked(surface, outlines, count, cover, **settings):
    """As many of each outline, which take the same share of what is covered; names are their numbers."""
    settings.setdefault("avoid_overlap", True)
    turn, sizes = settings.pop("turn", "free"), []
    for number, outline in enumerate(outlines):
        scale = np.sqrt(cover * surface.area / (len(outlines) * count * outline.area))
        footprint = Footprints(outline.scaled(scale), turn=turn)
        sizes.append(esh.Size(str(number), None, count, footprint=footprint))
    return esh.Problem(surface, [esh.BodyClass("a", sizes)], **settings)


def outline_of(placement, i):
    size = placement.problem.classes[placement.class_index[i]].sizes[placement.size_index[i]]
    return size.footprint.outlines[placement.variant[i]].scaled(placement.scale[i])


def turned(vector, normal, other):
    """Vectors, turned as their normals must be turned the shortest way to become other ones, all of shape ``[n, 3]``."""
    axis = np.cross(normal, other)
    size = np.linalg.norm(axis, axis=1, keepdims=True)
    cosine = (normal * other).sum(axis=1, keepdims=True)
    return Rotation.from_rotvec(axis / np.maximum(size, 1e-300) * np.arctan2(size, cosine)).apply(vector)


def overlapping(placement, tolerance=1e-3, flat_faces=False):
    """Pairs that lie deeper in each other than a share of the smaller width, in the plane between those that touch at the two."""
    outlines = [outline_of(placement, i) for i in range(len(placement.position))]
    corners, width = [outline.outline() for outline in outlines], [outline.width for outline in outlines]
    reach = max(outline.circumradius for outline in outlines)
    pairs = np.array(sorted(cKDTree(placement.position).query_pairs(2.0 * reach))).reshape(-1, 2)
    # The surface that the triangles of a ball stand for.
    round_ = np.ptp(placement.position[:, 2]) > 0.5 and not flat_faces
    out = placement.position / np.linalg.norm(placement.position, axis=1, keepdims=True) if round_ else placement.normal
    cosine = (out[pairs[:, 0]] * out[pairs[:, 1]]).sum(axis=1)
    pairs = pairs[cosine >= (-0.1 if flat_faces else 1e-12)]
    n, m = out[pairs[:, 0]], out[pairs[:, 1]]
    between = (n + m) / np.linalg.norm(n + m, axis=1, keepdims=True)
    upright = turned(placement.tangent, placement.normal, out)
    x, axis = (turned(upright[pairs[:, k]], out[pairs[:, k]], between) for k in (0, 1))
    y = np.cross(between, x)
    line, sine = np.cross(n, m), np.linalg.norm(np.cross(n, m), axis=1)
    way = placement.position[pairs[:, 1]] - placement.position[pairs[:, 0]]
    flat = np.stack([(way * x).sum(axis=1), (way * y).sum(axis=1)], axis=1)
    flat *= (np.linalg.norm(way, axis=1) / np.linalg.norm(flat, axis=1))[:, None]
    for p in np.flatnonzero(sine > 0.3) if flat_faces else ():
        # Over the edge, which both are before: as far as the way rises out of the other face, over the sine of their angle.
        before, behind = way[p] @ m[p] / sine[p], -way[p] @ n[p] / sine[p]
        if before * behind > 0.0:
            edge = line[p] / sine[p]
            across = np.cross(edge, between[p])
            flat[p] = [(before + behind) * across @ k + way[p] @ edge * (edge @ k) for k in (x[p], y[p])]
    angle = np.arctan2((axis * y).sum(axis=1), (axis * x).sum(axis=1))
    found = []
    for p, (i, j) in enumerate(pairs.tolist()):
        shrink = -0.5 * tolerance * min(width[i], width[j])
        c, s = np.cos(angle[p]), np.sin(angle[p])
        polygons = [corners[i], corners[j] @ np.array([[c, s], [-s, c]]) + flat[p]]
        one, other = (shapely.Polygon(each).buffer(shrink, join_style="mitre") for each in polygons)
        if one.intersects(other):
            found.append((i, j))
    return found


@pytest.fixture(scope="module")
def parted():
    """Boxes and planks that cover half of a sphere, by how they may turn."""
    return {
        turn: esh.solve(asked(ball(), [BOX, PLANK], 200, 0.5, turn=turn), device="cpu") for turn in ("free", "random")
    }


@pytest.mark.parametrize("turn", ["free", "random"])
def test_boxes_and_planks_on_half_of_a_sphere_do_not_overlap(parted, turn):
    placement = parted[turn]
    assert overlapping(placement) == []
    assert placement.report.overlaps == 0
    assert placement.report.covered == pytest.approx(0.5, abs=0.01)
    # They are still even.
    assert placement.report.coverage_error < 0.02
    # Where they are put down as if they were discs, many overlap, and the report knows which.
    loose = esh.solve(dataclasses.replace(placement.problem, avoid_overlap=False), device="cpu")
    # Some lie as deep in each other as is just not counted.
    deep, most = (overlapping(loose, tolerance) for tolerance in (1.1e-3, 0.9e-3))
    assert len(deep) > 100
    assert len(deep) <= loose.report.overlaps <= len(most) <= len(deep) + 3
    assert {i for pair in deep for i in pair} <= set(loose.report.overlapping) <= {i for pair in most for i in pair}


@pytest.mark.parametrize("thickness", [1.0, 0.05])
def test_outlines_keep_apart_across_the_edges_of_boxes_however_these_are_turned(thickness):
    box = trimesh.creation.box((thickness, 1.0, 1.0))
    box.apply_transform(trimesh.transformations.rotation_matrix(0.7, [1, 2, 3]))
    placement = esh.solve(asked(esh.Surface(esh.SurfaceMesh(box.vertices, box.faces)), [BOX], 300, 0.6), device="cpu")
    assert overlapping(placement, flat_faces=True) == [] and placement.report.overlaps == 0


def first_axis(normal):
    """Direction along a surface that is nearest to x, to y where it looks along x."""
    wanted = np.where(np.abs(normal[:, :1]) > 0.9, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
    axis = wanted - (wanted * normal).sum(axis=1, keepdims=True) * normal
    return axis / np.linalg.norm(axis, axis=1, keepdims=True)


@pytest.mark.parametrize("angle", [120.0, 90.0, 75.0, 45.0, 30.0])
def test_outlines_keep_apart_across_creases_as_along_both_sides(angle):
    """A ridge of two faces, unfolded to measure: at 45 degrees all of eight seeds had overlaps, up to 6 % of an outline, untold."""
    half = np.radians(0.5 * angle)
    down = np.array([[np.sin(half), 0.0, -np.cos(half)], [-np.sin(half), 0.0, -np.cos(half)]])
    ridge = np.array([[0.0, 0.0, 0.0], [0.0, 3.0, 0.0]])
    vertices = np.concatenate([ridge, ridge + 1.5 * down[0], ridge + 1.5 * down[1]])
    surface = esh.Surface(esh.SurfaceMesh(vertices, [[0, 2, 3], [0, 3, 1], [0, 5, 4], [0, 1, 5]]))
    for seed in range(4):
        placement = esh.solve(asked(surface, [BOX, PLANK], 40, 0.65, seed=seed), device="cpu")
        side = (placement.position[:, 0] < 0.0).astype(int)
        sign = 1.0 - 2.0 * side

        def flat(vectors, side=side, sign=sign):
            return np.stack([sign * np.einsum("nd,nd->n", vectors, down[side]), vectors[:, 1]], axis=1)

        at, along = flat(placement.position), flat(placement.tangent)
        shapes = []
        for i in range(len(at)):
            corners = outline_of(placement, i).corners
            x = along[i] / np.linalg.norm(along[i])
            shapes.append(shapely.Polygon(at[i] + corners @ np.array([x, [-x[1], x[0]]])))
        width = min(outline_of(placement, i).width for i in (0, 40))
        tree = shapely.STRtree(shapes)
        one, other = tree.query(shapes, predicate="intersects")
        deep = [shapes[i].intersection(shapes[j]).area for i, j in zip(one, other, strict=True) if i < j]
        assert max(deep, default=0.0) < 2e-3 * width**2
        assert placement.report.overlaps == 0


def test_turns_that_are_given_are_kept_and_others_follow_from_contact(parted):
    for placement in parted.values():
        first = first_axis(placement.normal)
        along = np.cos(placement.angle)[:, None] * first + np.sin(placement.angle)[:, None] * np.cross(
            placement.normal, first
        )
        np.testing.assert_allclose(placement.tangent, along, atol=1e-9)
    drawn = [parted[turn].problem.classes[0].sizes[0].footprints([0, 5, 0, 0]).turn for turn in ("free", "random")]
    differ = [
        np.abs(np.mod(parted[turn].angle[:200] - angle + np.pi, 2.0 * np.pi) - np.pi)
        for turn, angle in zip(("free", "random"), drawn, strict=True)
    ]
    np.testing.assert_allclose(differ[1], 0.0, atol=1e-5)
    # Whoever is in nobody's way stays as it was drawn.
    assert 20 < (differ[0] > 0.05).sum() < 180


@pytest.mark.parametrize("turn", ["free", "random", 0.4])
def test_crowds_of_wedges_with_their_origins_beside_them_are_parted(turn):
    placement = esh.solve(asked(ball(), [WEDGE, Footprint.disc(0.4)], 120, 0.62, turn=turn), device="cpu")
    assert overlapping(placement) == []
    assert placement.report.overlaps == 0
    if turn == 0.4:
        np.testing.assert_allclose(placement.angle[:120], 0.4, atol=1e-6)


def test_on_a_square_outlines_are_as_even_as_those_of_the_plane():
    flat = asked(square(), [BOX, PLANK], 100, 0.5)
    there = esh.solve(flat, device="cpu")
    plane = esh.solve(
        esh.Problem(
            esh.Domain((1.0, 1.0)), flat.classes[0:0] or [esh.BodyClass("a", flat.classes[0].sizes)], avoid_overlap=True
        ),
        device="cpu",
    )
    assert there.report.overlaps == plane.report.overlaps == 0
    assert there.report.coverage_error < 1.2 * plane.report.coverage_error + 0.01


def test_outlines_on_the_two_sides_of_a_wall_ignore_each_other():
    box = trimesh.creation.box((1.0, 1.0, 0.02))
    for _ in range(4):
        box = box.subdivide()
    surface = esh.Surface(esh.SurfaceMesh(box.vertices, box.faces))
    placement = esh.solve(asked(surface, [BOX], 120, 0.5), device="cpu")
    up = placement.normal[:, 2] > 0.9
    down = placement.normal[:, 2] < -0.9
    assert abs(int(up.sum()) - int(down.sum())) < 6
    across = cKDTree(placement.position[up]).query(placement.position[down])[0]
    assert across.min() < 0.5 * placement.problem.classes[0].sizes[0].footprint.outlines[0].width
    assert placement.report.overlaps == 0


def test_long_objects_with_outlines_lie_along_the_slope_and_keep_apart():
    line = esh.Line(0.3, "slope", width=0.1)
    wedge = Footprint.polygon([[-0.2, -0.05], [0.2, -0.02], [0.2, 0.02], [-0.2, 0.05]])
    size = esh.Size("s", 0.03, 120, line=line, footprint=Footprints(wedge, turn="random"))
    placement = esh.solve(esh.Problem(ball(), [esh.BodyClass("a", [size])], avoid_overlap=True), device="cpu")
    assert overlapping(placement) == []
    assert placement.report.overlaps == 0
    # Some lie the other way round.
    assert 20 < (placement.tangent[:, 2] > 0.0).sum() < 100


def test_outlines_keep_gaps_and_keep_out_of_balls_as_a_whole():
    scale = np.sqrt(0.35 * 4.0 * np.pi / (150 * PLANK.area))
    plank = PLANK.scaled(scale)
    size = esh.Size("s", None, 150, footprint=Footprints(plank))
    hole = esh.Obstacle(ball=(0.0, 0.0, 1.0, 0.4))
    problem = esh.Problem(ball(), [esh.BodyClass("a", [size], gap=0.04)], avoid_overlap=True, obstacles=[hole])
    placement = esh.solve(problem, device="cpu")
    assert placement.report.overlaps == 0
    away = np.linalg.norm(placement.position - (0.0, 0.0, 1.0), axis=1)
    assert away.min() > 0.4 + plank.circumradius - 1e-4
    # Outlines that are wider by the gap would not overlap either.
    wide = dataclasses.replace(size, footprint=Footprints(Footprint(plank.corners, 0.0195)))
    wider = dataclasses.replace(
        placement, problem=esh.Problem(ball(), [esh.BodyClass("a", [wide])]), variant=placement.variant
    )
    assert overlapping(wider) == []


def test_outlines_that_look_at_a_point_do_so_where_they_have_been_parted():
    look = esh.LookAt((0.0, 0.0, 3.0), front="x")
    problem = asked(ball(), [PLANK], 150, 0.45, turn=0.0)
    problem = esh.Problem(
        problem.domain, [esh.BodyClass("a", problem.classes[0].sizes, look_at=look)], avoid_overlap=True
    )
    placement = esh.solve(problem, device="cpu")
    assert placement.report.overlaps == 0
    way = np.array([0.0, 0.0, 3.0]) - placement.position
    way -= (way * placement.normal).sum(axis=1, keepdims=True) * placement.normal
    beside = np.linalg.norm(way, axis=1)
    past = np.arccos(np.clip((placement.tangent * way).sum(axis=1) / beside, -1.0, 1.0))
    assert np.quantile(past, 0.9) < 0.036
    # Below the point a small move is a large turn. Of eight seeds the largest are 0.09 to 0.33.
    assert (past * beside).max() < 0.4


def test_edits_leave_outlines_as_they_lay_and_fixed_ones_as_they_are():
    surface = ball()
    with esh.Solver(asked(surface, [BOX, PLANK], 100, 0.5), device="cpu") as solver:
        solver.run(30)
        assert solver.separate()
        before = solver.placement()
        pinned = esh.FixedBodies.of_placement(before, np.arange(100, 130))
        solver.edit(dataclasses.replace(before.problem, fixed=[pinned], include_fixed=True))
        after = solver.placement()
        assert overlapping(after) == []
        turns = []
        for row, identity in enumerate(before.id):
            now = int(np.flatnonzero(after.id == identity)[0])
            turned = np.arccos(np.clip(before.tangent[row] @ after.tangent[now], -1.0, 1.0))
            if 100 <= row < 130:
                assert after.fixed[now]
                np.testing.assert_allclose(after.position[now], before.position[row], atol=1e-6)
                assert turned < 1e-3
            else:
                turns.append(turned)
        # A little, where somebody is in the way.
        assert np.quantile(turns, 0.9) < 0.2 and max(turns) < 1.0
        kept = np.isin(after.id, before.id)
        assert kept.all()


def test_bytes_do_not_depend_on_threads(monkeypatch):
    problem = asked(ball(3), [BOX, WEDGE], 150, 0.66, turn="random")
    free = asked(ball(3), [BOX, WEDGE], 150, 0.7)
    for one in (problem, free):
        found = []
        for threads in ("1", "3"):
            monkeypatch.setenv("ESH_THREADS", threads)
            found.append(esh.solve(one, device="cpu", max_steps=5))
        for name in ("position", "tangent", "angle", "barycentric"):
            np.testing.assert_array_equal(getattr(found[0], name), getattr(found[1], name))
        assert dataclasses.replace(found[0].report, seconds=0.0) == dataclasses.replace(found[1].report, seconds=0.0)


def test_outlines_that_lean_need_a_rectangle():
    with pytest.raises(esh.ProblemError, match=r"`tilt` of the `footprint` of size .* must be 0 on a surface"):
        tilted = Footprints(BOX, tilt=0.2)
        esh.Problem(ball(1), [esh.BodyClass("a", [esh.Size("s", None, 3, footprint=tilted)])])
    leaning = Footprints(BOX, slope=np.ones((2, 2, 2)))
    with pytest.raises(esh.ProblemError, match=r"`slope` of the `footprint` of size .* must be None on a surface"):
        esh.Problem(ball(1), [esh.BodyClass("a", [esh.Size("s", None, 3, footprint=leaning)])])
