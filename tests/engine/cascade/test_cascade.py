"""The forces on a surface, beside sums over all pairs in float64."""

import numpy as np
import pytest
import trimesh
import warp as wp
from esh.engine.cascade.points import alike, chosen, empty_points, lists_of, nearest_of, thinned
from esh.engine.cascade.seen_from_afar import looks_other_from_afar, seen_from_afar
from esh.engine.descent.surface_descent import SurfaceDescent
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.model.model import Model
from esh.engine.model.surface_softness import softness_of
from esh.engine.problem.balance import Balance
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.fixed_bodies import FixedBodies
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.problem.surface import Surface, SurfaceMesh
from esh.engine.surface import kernels_facets
from esh.engine.surface.facets import Facets
from scipy.spatial import cKDTree


@pytest.fixture(scope="module")
def launcher():
    result = Launcher(resolve_device("cpu"))
    yield result
    result.close()


def sphere():
    mesh = trimesh.creation.icosphere(subdivisions=4)
    return Surface(SurfaceMesh(np.array(mesh.vertices), np.array(mesh.faces)))


def points_on_sphere(launcher, count, seed=0):
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=(count, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    points = empty_points(launcher, count)
    points.position.assign((10.0 * normal).astype(np.float32))
    points.normal.assign(normal.astype(np.float32))
    points.label.assign((normal[:, 2] > 0.0).astype(np.int32))
    return points


def test_lists_hold_every_neighbor_of_the_same_part_and_side_once(launcher):
    points = points_on_sphere(launcher, 3000)
    position, label = points.position.numpy(), points.label.numpy()
    lists = lists_of(launcher, points, points, 1.3, 0.995)
    start, entry = lists.start.numpy(), lists.entry.numpy()
    normal = points.normal.numpy()
    for i, near in enumerate(cKDTree(position).query_ball_point(position, 1.3)):
        near = np.array(near)
        same = (label[near] == label[i]) & (normal[near] @ normal[i] > 0.995)
        assert sorted(entry[start[i] : start[i + 1]].tolist()) == sorted(near[same].tolist())


def test_thinned_points_keep_a_distance_and_leave_no_room(launcher):
    points = points_on_sphere(launcher, 5000)
    numbers = thinned(launcher, points, 0.8)
    kept = numbers.numpy()
    position, label = points.position.numpy(), points.label.numpy()
    for side in (0, 1):
        own, all_of_it = kept[label[kept] == side], np.flatnonzero(label == side)
        distance = cKDTree(position[own]).query(position[own], k=2)[0][:, 1]
        assert distance.min() >= 0.8 - 1e-5
        assert cKDTree(position[own]).query(position[all_of_it])[0].max() < 0.8 + 1e-5
    nodes = chosen(launcher, points, numbers)
    home = nearest_of(launcher, points, nodes, 1.6, 0.0).numpy()
    found = np.linalg.norm(position - position[kept][home], axis=1)
    for side in (0, 1):
        own, all_of_it = kept[label[kept] == side], np.flatnonzero(label == side)
        np.testing.assert_allclose(found[all_of_it], cKDTree(position[own]).query(position[all_of_it])[0], atol=1e-5)


def test_points_that_are_alike_are_known_by_the_first_of_them(launcher):
    rng = np.random.default_rng(3)
    place, normal, label = (rng.integers(0, 3, (9000, width)) for width in (3, 3, 1))
    points = empty_points(launcher, 9000)
    points.position.assign((0.5 * place - 7.0 + rng.uniform(0.01, 0.49, place.shape)).astype(np.float32))
    points.normal.assign((0.25 * (normal - 1) + rng.uniform(-0.1, 0.1, normal.shape)).astype(np.float32))
    points.label.assign(label.ravel().astype(np.int32))
    first, which = (found.numpy() for found in alike(launcher, points, np.full(3, -7.0), 0.5, 4.0))
    index, inverse = np.unique(np.hstack([place, normal, label]), axis=0, return_index=True, return_inverse=True)[1:]
    np.testing.assert_array_equal(first, np.sort(index))
    np.testing.assert_array_equal(first[which], index[inverse.ravel()])


def forces(launcher, problem):
    """Forces on all charges at the start; their positions in units, groups and charges."""
    model = Model(problem)
    descent = SurfaceDescent(model, launcher)
    charges = descent.charges
    descent.cascade.evaluate(charges.points, charges.facet, charges.weight, charges.home, charges.field)
    return model, descent, charges.field.numpy().astype(np.float64)


def direct(launcher, model, descent):
    """The same by all pairs; the target by the octaves that go beyond a tile, tile by tile.

    A target that pulls into the ball pulls along flat facets, too.
    """
    points = descent.charges.points
    position, normal = points.position.numpy().astype(np.float64), points.normal.numpy().astype(np.float64)
    group, charge = model.body.group, model.charge.charge
    matrix = model.groups.matrix

    def pull(other, other_normal, strength, of_distance):
        way = position[:, None] - other[None]
        square = (way**2).sum(axis=2)
        amount = strength * of_distance(np.where(square > 0.0, square, np.inf)) * 0.5 * (1.0 + normal @ other_normal.T)
        return (amount[:, :, None] * way).sum(axis=1)

    def octaves(square):
        widths = [2.0 ** (2 * level + 1) for level in range(7)]
        return sum(np.log(2.0) / width * np.exp(-0.5 * square / width) for width in widths)

    soft = softness_of(model)

    def between_charges(square):
        if soft is None:
            return 1.0 / square
        # Small charges are blurred less, where the blur differs.
        variance = (
            0.5 * soft.blur**2 * (np.clip(charge, 0.125, 1.0) if soft.following is not None else np.ones(len(charge)))
        )
        squares = square / (variance[:, None] + variance)
        core = soft.core * np.maximum(1.0 - squares * (soft.blur / soft.reach) ** 2, 0.0) ** 2
        return (1.0 - np.exp(-0.5 * squares) + core) / square

    force = pull(position, normal, charge * matrix[group][:, group], between_charges)
    tiles, count = empty_points(launcher, descent.facets.tile_count), descent.facets.tile_count
    launcher.launch(
        kernels_facets.locate_tiles,
        count,
        [descent.facets.count, descent.ground.facets],
        [tiles.position, tiles.normal, tiles.label],
    )
    share = descent.facets.tile_area / descent.facets.tile_area.sum()
    attraction = (matrix @ model.group_charge)[group]
    force -= pull(tiles.position.numpy(), tiles.normal.numpy(), attraction[:, None] * share, octaves)
    return force - (force * normal).sum(axis=1, keepdims=True) * normal


def test_the_blur_follows_the_density(launcher):
    """Its variance falls with the density to the power of 3/4, between bounds, and is the usual one where the average body stands."""
    classes = [BodyClass("a", [Size("s", 1.0, 3000)], lambda points: 1.0 + 0.9 * points.position[:, 2])]
    model = Model(Problem(sphere(), classes))
    descent = SurfaceDescent(model, launcher)
    at = empty_points(launcher, descent.facets.corner_count)
    tile = launcher.empty(descent.facets.corner_count, wp.int32)
    outputs = [at.position, at.normal, tile]
    facets = descent.ground.facets
    launcher.launch(kernels_facets.locate_corners, len(tile), [descent.facets.count, facets], outputs)
    z = at.normal.numpy()[:, 2]
    number = 3000 / (4.0 * np.pi) * (1.0 + 0.9 * z) * model.unit**2
    soft = softness_of(model)
    usual = 0.5 * soft.blur**2
    expected = np.clip(usual * number**-0.75, 0.5 * usual, 2.0 * usual)
    assert expected.max() > 1.99 * usual
    assert expected.min() < 0.8 * usual
    np.testing.assert_allclose(descent.cascade._near_target.variance.numpy(), expected, rtol=0.05)


@pytest.mark.parametrize("groups", [1, 3])
def test_forces_agree_with_all_pairs_on_a_sphere(launcher, groups):
    classes = [BodyClass(str(k), [Size("s", 1.0 + k, 400)]) for k in range(groups)]
    model, descent, found = forces(launcher, Problem(sphere(), classes, Balance(0.5)))
    expected = direct(launcher, model, descent)
    scale = np.sqrt((expected**2).sum(axis=1).mean())
    error = np.linalg.norm(found - expected, axis=1)
    # What is blurred is a polynomial that is wrong by .006, over the distance, and some pairs of the start are close.
    assert np.sqrt((error**2).mean()) < (0.08 if groups == 1 else 0.06) * scale
    assert error.max() < 0.4 * scale


def test_the_target_is_shared_out_without_loss(launcher):
    _, descent, _ = forces(launcher, Problem(sphere(), [BodyClass("a", [Size("s", 1.0, 500)])]))
    cascade = descent.cascade
    assert cascade.node_share.sum() == pytest.approx(1.0, abs=1e-4)
    assert cascade.node_area.sum() == pytest.approx(descent.facets.area.sum(), rel=1e-4)
    assert (cascade.home.numpy() >= 0).all()


@pytest.mark.parametrize("groups", [1, 3])
def test_what_lies_behind_the_last_node_does_not_count(launcher, groups):
    """Loops read a few numbers beyond the end of what they sum up."""
    classes = [BodyClass(str(k), [Size("s", 1.0 + k, 60)]) for k in range(groups)]
    _, descent, found = forces(launcher, Problem(sphere(), classes))
    cascade = descent.cascade
    nodes = cascade.node_count
    potential = cascade._potentials[0]
    assert len(potential) >= (nodes + 7) * groups
    assert len(cascade.nodes.weights.plane) >= 6 * nodes + 7
    assert len(cascade._sorted.plane) >= 14 * len(found) + 7
    expected = found.copy()
    behind = potential.numpy()
    behind[nodes * groups :] = 1e30
    potential.assign(behind)
    charges = descent.charges
    cascade.evaluate(charges.points, charges.facet, charges.weight, charges.home, charges.field)
    np.testing.assert_array_equal(charges.field.numpy(), expected.astype(np.float32))


def test_charges_have_homes_where_there_is_no_density(launcher):
    """Bodies that are fixed may lie there, and ends of lines."""

    def upper(points):
        return (points.position[:, 2] > 0.0).astype(float)

    low = np.array([[0.0, 0.1, -1.0], [0.1, 0.0, -0.995], [0.0, -0.9, -0.4]])
    fixed = FixedBodies(low)
    problem = Problem(sphere(), [BodyClass("a", [Size("s", 1.0, 200)], upper)], fixed=[fixed], include_fixed=True)
    _, descent, found = forces(launcher, problem)
    home = descent.cascade.home.numpy()
    assert home.min() == 0 and home.max() < descent.cascade.node_count
    assert np.isfinite(found).all()
    # Just below the rim it is a node above it.
    facet, _ = descent.facets.tiles(np.arange(descent.facets.count))
    below = np.abs(descent.facets.corner.mean(axis=1)[facet, 2] + 0.5) < 0.4
    assert (home[below] > 0).mean() > 0.9


def test_uniform_bodies_on_a_plate_are_not_pushed_about_by_the_target_alone(launcher):
    # The field of a uniform target far from its edges is 0, and towards an edge it leads inwards: it pulls.
    side = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    surface = Surface(SurfaceMesh(side, [[0, 1, 2], [0, 2, 3]]))
    _, descent, _ = forces(launcher, Problem(surface, [BodyClass("a", [Size("s", 1e-4, 900)])]))
    near = descent.cascade._near_target.force.numpy() * 900
    count = descent.facets.corner_count
    corners = [launcher.empty(count, kind) for kind in (wp.vec3, wp.vec3, wp.int32)]
    launcher.launch(kernels_facets.locate_corners, count, [descent.facets.count, descent.ground.facets], corners)
    place = corners[0].numpy()
    inside = np.abs(place[:, :2]).max(axis=1) < 11.0
    assert inside.sum() > 100
    assert np.linalg.norm(near[inside], axis=1).max() < 0.05
    edge = place[:, 0] > 14.9
    # What pushes bodies out is the force of the target with the other sign.
    assert (near[edge, 0] > 0.5).all()


def test_no_charge_is_lost_between_levels_beside_edges_of_several_parts(launcher):
    parts = [trimesh.creation.box(extents=(1.0, 1.0, 0.6))]
    for place in ((0.5, 0.0, 0.45), (-0.3, 0.55, 0.4), (0.0, -0.6, 0.0)):
        small = trimesh.creation.box(extents=(0.3, 0.25, 0.2))
        small.apply_translation(place)
        parts.append(small)
    surface = Surface([SurfaceMesh(np.array(mesh.vertices), np.array(mesh.faces)) for mesh in parts])
    problem = Problem(surface, [BodyClass("a", [Size("s", 1e-6, 2000)])])
    descent = SurfaceDescent(Model(problem), launcher)
    descent.take_step()
    charges = descent.cascade._charges
    assert len(charges) > 3
    for charge in charges:
        assert abs(float(charge.numpy().sum())) < 0.02
    # There are nodes above the boxes, and none of them is the home of a body.
    node = descent.cascade.nodes.points.position.numpy() * descent.facets.unit + descent.facets.middle
    assert node[:, 2].max() > 0.6
    home = np.unique(descent.cascade.home.numpy())
    assert node[home, 2].max() < 0.551


def test_levels_do_not_make_more_of_a_charge_where_the_surface_folds(launcher):
    # A star whose arms are narrower than what coarse nodes stand for: many of these have all others to one side.
    angle = np.arange(10) * np.pi / 5
    radius = np.where(np.arange(10) % 2, 0.5, 1.0)
    outline = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    low, high = (np.column_stack([outline, np.full(10, z)]) for z in (0.0, 0.8))
    i, j = np.arange(10), (np.arange(10) + 1) % 10
    faces = [
        np.stack(f, axis=1)
        for f in ((i, j, j + 10), (i, j + 10, i + 10), (i * 0 + 20, j, i), (i * 0 + 21, i + 10, j + 10))
    ]
    surface = Surface(SurfaceMesh(np.concatenate([low, high, [[0, 0, 0], [0, 0, 0.8]]]), np.concatenate(faces)))
    descent = SurfaceDescent(Model(Problem(surface, [BodyClass("a", [Size("s", 1e-6, 2000)])])), launcher)
    levels = descent.cascade.nodes.levels
    assert len(levels) > 3
    for level in levels[:-1]:
        start, value = level.up.start.numpy(), level.up_value.numpy()
        np.testing.assert_allclose(np.add.reduceat(value, start[:-1]), 1.0, atol=1e-4)
        assert np.add.reduceat(np.abs(value), start[:-1]).max() < 1.2


def corner_normals_from_afar(launcher, vertices, faces, length, label=None):
    """Corners of facets, their normals, and what they are from so far away, shapes ``[f, 3, 3]``."""
    surface = Surface(SurfaceMesh(vertices, faces))
    count = len(surface.triangle)
    label = np.zeros(count, int) if label is None else label
    facets = Facets(launcher, surface, 1.0, label, np.zeros((count, 3), bool))
    seen = seen_from_afar(launcher, facets, facets.for_kernels(), length)
    return facets, seen.corner_normal.numpy().reshape(-1, 3, 3)


def test_rough_ground_is_smooth_from_afar(launcher):
    mesh = trimesh.creation.icosphere(subdivisions=4)
    rng = np.random.default_rng(2)
    rough = np.array(mesh.vertices) * (40.0 + rng.normal(size=(len(mesh.vertices), 1)))
    facets, seen = corner_normals_from_afar(launcher, rough, np.array(mesh.faces), 16.0)
    out = facets.corner / np.linalg.norm(facets.corner, axis=2, keepdims=True)
    assert np.allclose(np.linalg.norm(seen, axis=2), 1.0, atol=1e-5)
    before, after = ((normal * out).sum(axis=2) for normal in (facets.corner_normal, seen))
    assert np.sqrt((1.0 - before**2).mean()) > 0.2
    assert np.sqrt((1.0 - after**2).mean()) < 0.08


def test_sides_of_a_thin_wall_and_touching_parts_do_not_blend_from_afar(launcher):
    box = trimesh.creation.box(extents=(60.0, 60.0, 0.2))
    facets, seen = corner_normals_from_afar(launcher, np.array(box.vertices), np.array(box.faces), 8.0)
    flat = np.abs(facets.normal[:, 2]) > 0.9
    own = np.broadcast_to(facets.normal[:, None], seen.shape)
    far = flat[:, None] & (np.abs(facets.corner)[..., :2].max(axis=2) < 30.0 - 0.75 * 8.0 * 2.5)
    assert far.any() and np.allclose(seen[far], own[far], atol=1e-3)
    # Beside the narrow rim this blends in a little, the other side does not.
    assert np.allclose(seen[flat], own[flat], atol=0.05)
    # A step with a slope beside it: by themselves, both look where they do.
    vertices = np.array([[0, 0, 0], [9, 0, 0], [9, 9, 0], [0, 9, 0], [-9, 9, 9], [-9, 0, 9]], float)
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])
    blended = corner_normals_from_afar(launcher, vertices, faces, 8.0)
    apart = corner_normals_from_afar(launcher, vertices, faces, 8.0, np.array([0, 0, 1, 1]))
    assert np.allclose(apart[1], apart[0].normal[:, None], atol=1e-4)
    assert np.abs(blended[1] - blended[0].normal[:, None]).max() > 0.2


def test_normals_near_a_point_are_looked_for_once_where_there_are_blunt_creases(launcher, monkeypatch):
    """They are averaged ten times. Where there are too many to list them, the averages are the same to the last bit."""
    mesh = trimesh.creation.icosphere(subdivisions=0).subdivide()
    launched, launch = [], Launcher.launch

    def counted(self, kernel, count, *given, **options):
        launched.append(kernel.key)
        launch(self, kernel, count, *given, **options)

    monkeypatch.setattr(Launcher, "launch", counted)
    given = launcher, np.array(mesh.vertices) * 6.0, np.array(mesh.faces), 2.0
    facets, listed = corner_normals_from_afar(*given)
    assert facets.surface.has_blunt_creases
    assert launched.count("list_near") == 2
    assert "average_normals" not in launched
    monkeypatch.setattr("esh.engine.cascade.seen_from_afar.MOST_LISTED", 0)
    _, looked_for = corner_normals_from_afar(*given)
    assert launched.count("average_normals") > 10
    np.testing.assert_array_equal(listed, looked_for)
    assert np.abs(listed - facets.corner_normal).max() > 0.05


def test_only_blunt_creases_and_roughness_look_other_from_afar(launcher):
    def looks_other(mesh):
        surface = Surface(SurfaceMesh(np.array(mesh.vertices), np.array(mesh.faces)))
        count = len(surface.triangle)
        facets = Facets(launcher, surface, 0.1, np.zeros(count, int), np.zeros((count, 3), bool))
        return looks_other_from_afar(facets)

    prism = trimesh.creation.cylinder(1.0, 2.0, sections=6)
    assert looks_other(prism)
    assert not looks_other(trimesh.creation.box())
    assert not looks_other(trimesh.creation.icosphere(subdivisions=4))


def test_creases_are_rounded_alike_from_both_of_their_sides(launcher):
    """Two squares that bend by 60° look nearly the same way where they meet, and where they do by themselves far from there."""
    up = np.array([-0.5, 0.0, np.sqrt(0.75)])
    flat = np.array([[0, 0, 0], [9, 0, 0], [9, 9, 0], [0, 9, 0]], float)
    vertices = np.concatenate([flat, 9 * up[None] + flat[[3, 0]]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])
    facets, seen = corner_normals_from_afar(launcher, vertices, faces, 1.0)
    at_crease = np.linalg.norm(facets.corner[..., [0, 2]] + facets.middle[[0, 2]], axis=2) < 1e-3
    first = seen[at_crease & (np.abs(facets.normal[:, 0]) < 0.1)[:, None]].mean(axis=0)
    second = seen[at_crease & (np.abs(facets.normal[:, 0]) > 0.1)[:, None]].mean(axis=0)
    assert first @ second > np.cos(np.radians(30.0))
    far = np.linalg.norm(facets.corner[..., [0, 2]] + facets.middle[[0, 2]], axis=2) > 2.0
    own = np.broadcast_to(facets.normal[:, None], seen.shape)
    assert np.allclose(seen[far], own[far], atol=1e-3)
