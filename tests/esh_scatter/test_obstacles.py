"""Objects keep off other objects, collections, curves with a width, and what other scatters have placed."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")
shapely = pytest.importorskip("shapely")

import esh  # noqa: E402
from esh import EshError, ScatterClass, ScatterObstacle, ScatterSize, scatter  # noqa: E402
from esh.esh_scatter.solving.job import ScatterJob  # noqa: E402
from esh.esh_scatter.targets import checksums  # noqa: E402
from mathutils import Matrix  # noqa: E402

pytestmark = pytest.mark.usefixtures("bare_file")

OPTIONS = {"device": "cpu", "max_steps": 30}


@pytest.fixture
def ground():
    bpy.ops.mesh.primitive_grid_add(size=20, x_subdivisions=30, y_subdivisions=30, location=(5, 5, 0))
    for vertex in bpy.context.object.data.vertices:
        vertex.co.z = 0.2 * np.sin(vertex.co.x)
    return bpy.context.object


@pytest.fixture
def tree():
    bpy.ops.mesh.primitive_cylinder_add(vertices=32, radius=0.3, depth=1.0, location=(80, 0, 0))
    return bpy.context.object


def house(location=(5, 5, 3), size=4.0):
    bpy.ops.mesh.primitive_cube_add(size=size, location=location)
    return bpy.context.object


def path():
    curve = bpy.data.curves.new("Path", "CURVE")
    curve.dimensions = "3D"
    spline = curve.splines.new("POLY")
    spline.points.add(1)
    spline.points[0].co, spline.points[1].co = (-20, 8, 5, 1), (30, 8, 5, 1)
    item = bpy.data.objects.new("Path", curve)
    bpy.context.scene.collection.objects.link(item)
    bpy.context.view_layer.update()
    return item


def placed(ground, tree, count=150, **named):
    classes = [ScatterClass("tree", [ScatterSize("s", count, tree)])]
    result = scatter(ground, classes, **(OPTIONS | named))
    assert result.report.overlaps == 0
    return result


def xy(result):
    return result.instances.position[:, :2]


def from_box(position, middle, half):
    away = np.maximum(np.abs(position - middle) - half, 0.0)
    return np.hypot(*away.T)


CELL = 20.0 / 1024.0


def test_footprints_keep_off_an_object(ground, tree):
    result = placed(ground, tree, obstacles=[house()])
    away = from_box(xy(result), (5, 5), 2.0)
    assert len(away) == 150 and away.min() > 0.3 - 2 * CELL, "not only their middles"
    assert away.min() < 0.6, "and no farther than that"
    assert from_box(xy(placed(ground, tree)), (5, 5), 2.0).min() == 0.0, "without it they stand there"


def test_a_margin_stays_free_and_middles_count_where_overlap_is_allowed(ground, tree):
    result = placed(ground, tree, obstacles=[ScatterObstacle(house(), margin=1.5)])
    assert 1.8 - 3 * CELL < from_box(xy(result), (5, 5), 2.0).min() < 2.2
    classes = [ScatterClass("tree", [ScatterSize("s", 1500, tree)])]
    loose = scatter(ground, classes, **OPTIONS, avoid_overlap=False, obstacles=[ScatterObstacle(house(), margin=1.5)])
    assert 1.5 - 3 * CELL < from_box(xy(loose), (5, 5), 2.0).min() < 1.7


def test_a_curve_is_as_wide_as_it_is_said_to_be(ground, tree):
    narrow = np.abs(xy(placed(ground, tree, obstacles=[path()]))[:, 1] - 8.0).min()
    assert 0.3 - 2 * CELL < narrow < 0.6, "a line without a width"
    wide = np.abs(xy(placed(ground, tree, obstacles=[ScatterObstacle(path(), width=3.0)]))[:, 1] - 8.0).min()
    assert 1.8 - 3 * CELL < wide < 2.2


def test_a_collection_is_one_obstacle_and_the_target_in_it_is_none(ground, tree):
    collection = bpy.data.collections.new("Houses")
    bpy.context.scene.collection.children.link(collection)
    for item in (house((0, 0, 0), 2.0), house((10, 10, 0), 3.0), ground):
        collection.objects.link(item)
    position = xy(placed(ground, tree, obstacles=[collection]))
    assert from_box(position, (0, 0), 1.0).min() > 0.3 - 2 * CELL
    assert from_box(position, (10, 10), 1.5).min() > 0.3 - 2 * CELL


def test_two_scatters_never_coincide(ground, tree):
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(70, 0, 0))
    log = bpy.context.object
    log.scale, log.rotation_euler = (2.0, 0.2, 0.2), (0.0, 0.0, 0.7)
    bpy.context.view_layer.update()
    logs = [ScatterClass("log", [ScatterSize("s", 60, log)], direction=0.4)]
    first = scatter(ground, logs, **OPTIONS, seed=4, name="Logs")
    position = first.instances.position[:, :2]
    w, x, y, z = first.instances.rotation.T
    turn = np.arctan2(2 * (x * y + w * z), 1 - 2 * (y * y + z * z)) + 0.7
    second = placed(ground, tree, 200, seed=4, name="Trees", obstacles=[first.object])
    assert second.object != first.object
    trees = xy(second)
    away = []
    for where, angle in zip(position, turn, strict=True):
        c, s = np.cos(angle), np.sin(angle)
        along = (trees - where) @ np.array([[c, -s], [s, c]])
        away.append(np.hypot(*np.maximum(np.abs(along) - (1.0, 0.1), 0.0).T).min())
    assert min(away) > 0.3 - 3 * CELL and np.median(away) < 1.0
    # Somebody's own nodes may come first.
    own = first.object.modifiers.new("Own", "NODES")
    own.node_group = bpy.data.node_groups.new("Own", "GeometryNodeTree")
    first.object.modifiers.move(1, 0)
    again = placed(ground, tree, 200, seed=4, name="Trees", obstacles=[first.object, second.object])
    np.testing.assert_array_equal(xy(again), trees)


def ground_below(result, half):
    """What boxes of half extents ``half`` cover, seen from above."""
    from shapely import box
    from shapely.affinity import affine_transform

    w, _, _, z = result.instances.rotation.T
    turn = 2.0 * np.arctan2(z, w)
    place = zip(xy(result), turn, strict=True)
    shape = box(-half[0], -half[1], half[0], half[1])
    return [affine_transform(shape, [np.cos(a), -np.sin(a), np.sin(a), np.cos(a), *at]) for at, a in place]


def test_boxes_find_the_gaps_between_the_planks_of_another_scatter(ground, tree):
    from shapely import STRtree

    for vertex in ground.data.vertices:
        vertex.co.z = 0.0
    boxes = []
    for half in ((1.0, 0.15), (0.45, 0.3)):
        bpy.ops.mesh.primitive_cube_add(size=2.0, location=(70, 0, 0))
        bpy.context.object.scale = (*half, 0.2)
        bpy.ops.object.transform_apply(location=False, rotation=False, scale=True)
        boxes.append(bpy.context.object)
    planks = [ScatterClass("plank", [ScatterSize("s", 146, boxes[0], line=False)])]
    first = scatter(ground, planks, device="cpu", name="Planks")
    crates = [ScatterClass("crate", [ScatterSize("s", 140, boxes[1], line=False)])]
    second = scatter(ground, crates, device="cpu", name="Crates", obstacles=[first.object, house(size=2.0)])
    assert second.report.overlaps == 0
    shown, around = ground_below(second, (0.45, 0.3)), ground_below(first, (1.0, 0.15))
    for others in (shown, around):
        tree_of = STRtree(others)
        pairs = [(a, b) for a, one in enumerate(shown) for b in tree_of.query(one) if others[b] is not one]
        assert max(shown[a].intersection(others[b]).area for a, b in pairs) < 1e-4
    assert from_box(xy(second), (5, 5), 1.0).min() > 0.29, "nor in the house"


def instancer(kind):
    """Logs of 3 x 0.4 m that another object shows, and where their middles are."""
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(60, 0, 0))
    log = bpy.context.object
    log.scale = (3.0, 0.4, 0.4)
    bpy.ops.object.transform_apply(location=True, rotation=False, scale=True)
    log.data.transform(Matrix.Translation((-60, 0, 0)))
    corners = [(0.0, 0.0, 1.0), (8.0, 3.0, 1.0), (3.0, 9.0, 1.0)]
    mesh = bpy.data.meshes.new("Instancer")
    mesh.from_pydata(corners, [], [])
    shows = bpy.data.objects.new("Instancer", mesh)
    bpy.context.scene.collection.objects.link(shows)
    if kind == "vertices":
        log.parent, shows.instance_type = shows, "VERTS"
    else:
        group = bpy.data.node_groups.new("Logs", "GeometryNodeTree")
        for way in ("INPUT", "OUTPUT"):
            group.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
        nodes = [
            group.nodes.new(name) for name in ("NodeGroupInput", "GeometryNodeInstanceOnPoints", "NodeGroupOutput")
        ]
        info = group.nodes.new("GeometryNodeObjectInfo")
        info.inputs["Object"].default_value = log
        group.links.new(nodes[0].outputs["Geometry"], nodes[1].inputs["Points"])
        group.links.new(info.outputs["Geometry"], nodes[1].inputs["Instance"])
        group.links.new(nodes[1].outputs["Instances"], nodes[2].inputs["Geometry"])
        shows.modifiers.new("Logs", "NODES").node_group = group
    bpy.context.view_layer.update()
    return shows, [corner[:2] for corner in corners]


@pytest.mark.parametrize("kind", ["vertices", "nodes"])
def test_instances_that_an_object_shows_are_kept_off_as_well(ground, tree, kind):
    shows, middles = instancer(kind)
    position = xy(placed(ground, tree, 200, obstacles=[shows]))
    away = min(from_box(position, middle, np.array([1.5, 0.2])).min() for middle in middles)
    assert 0.3 - 2 * CELL < away < 0.6


def test_what_covers_everything_is_said(ground, tree):
    with pytest.raises(EshError, match=r"must leave (room|some ground)"):
        placed(ground, tree, obstacles=[house(size=100.0)])
    result = placed(ground, tree, obstacles=[house((500, 0, 0))])
    np.testing.assert_array_equal(xy(result), xy(placed(ground, tree)))


@pytest.mark.parametrize(
    ("obstacles", "said"),
    [
        ("Path", "`obstacles` must be a list"),
        ([3], "got 3 among them"),
        ([None], "got None among them"),
    ],
)
def test_what_is_no_obstacle_is_refused(ground, tree, obstacles, said):
    with pytest.raises(EshError, match=said):
        placed(ground, tree, obstacles=obstacles)
    with pytest.raises(EshError, match="`margin` of an obstacle"):
        ScatterObstacle(tree, margin=-1.0)
    assert esh.ScatterObstacle is ScatterObstacle


def tile(name="Tile", length=0.6, width=0.4):
    mesh = bpy.data.meshes.new(name)
    x, y = 0.5 * length, 0.5 * width
    mesh.from_pydata([(-x, -y, 0), (x, -y, 0), (x, y, 0), (-x, y, 0)], [], [(0, 1, 2, 3)])
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


def wall(thickness=0.02, location=(0, 0, 0), mirrored=False):
    bpy.ops.mesh.primitive_cube_add(size=1, location=location)
    item = bpy.context.object
    item.scale = (-thickness if mirrored else thickness, 6, 6)
    bpy.context.view_layer.update()
    return item


def on_surface(target, source, count, name, seed, **named):
    classes = [ScatterClass("a", [ScatterSize("s", count, source)])]
    return scatter(target, classes, name=name, seed=seed, surface="whole", **(OPTIONS | named))


def outlines(result, length=0.6, width=0.4):
    """Outlines of tiles on faces that look along x, by the side that they stand on, from positions and rotations alone."""
    w, x, y, z = result.instances.rotation.T.astype(np.float64)
    along = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)], axis=1)
    up = np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=1)
    beside = np.cross(up, along)
    corners = 0.5 * np.array([[-length, -width], [length, -width], [length, width], [-length, width]])
    found = {side: [] for side in (-1, 1)}
    scale = result.instances.scale[:, None]
    for p, u, v, n, s in zip(result.instances.position.astype(np.float64), along, beside, up, scale, strict=True):
        if abs(n[0]) > 0.99:
            found[int(np.sign(n[0]))].append(shapely.Polygon(p[1:] + s * (corners @ np.stack([u[1:], v[1:]]))))
    return found


def nearest(one, other):
    """Smallest distance of outlines of one list from those of another; below 0 the number of those that overlap."""
    pairs = [(a, b) for a in one for b in other]
    deep = sum(a.buffer(-2e-4).intersects(b.buffer(-2e-4)) for a, b in pairs)
    return -deep if deep else min(a.distance(b) for a, b in pairs)


@pytest.mark.once
@pytest.mark.parametrize("target", ["wall", "mirrored", "sheet", "walls"])
def test_what_another_scatter_has_placed_on_a_wall_keeps_off_with_its_outlines(target):
    source = tile()
    where, named = wall(mirrored=target == "mirrored"), {}
    if target == "sheet":
        where = tile("Sheet", 6.0, 6.0)
        where.rotation_euler = (0.0, np.pi / 2.0, 0.0)
        named = {"both_sides": True}
    if target == "walls":
        where = [where, wall(location=(0, 6, 0))]
    bpy.context.view_layer.update()
    first = on_surface(where, source, 60, "First", 1, **named)
    alone = on_surface(where, source, 60, "Alone", 2, **named)
    for margin in (0.0, 0.05) if target == "walls" else (0.05,):
        kept = ScatterObstacle(first.object, margin=margin)
        second = on_surface(where, source, 60, f"Second {margin}", 2, obstacles=[kept], **named)
        there, here = outlines(first), outlines(second)
        for side in (-1, 1):
            assert len(here[side]) > 20
            assert nearest(outlines(alone)[side], there[side]) < 0.0
            assert nearest(here[side], there[side]) >= margin - 2e-3
            # The other side does not count.
            assert nearest(here[side], there[-side]) < 0.0
        assert (second.report.in_obstacles, second.report.overlaps) == (0, 0)
    allowed = on_surface(where, source, 60, "Allowed", 2, obstacles=[first.object], avoid_overlap=False, **named)
    there, here = outlines(first), outlines(allowed)
    for side in (-1, 1):
        assert not any(a.buffer(-1e-3).contains(b.centroid) for a in there[side] for b in here[side])


@pytest.mark.once
def test_the_report_counts_what_lies_in_those_of_another_scatter():
    source, where = tile(), wall()
    first = on_surface(where, source, 110, "First", 1)
    full = on_surface(where, source, 200, "Second", 2, obstacles=[first.object])
    there, here = outlines(first), outlines(full)

    def count_inside(less):
        return sum(
            any(a.buffer(-less).intersects(b.buffer(-less)) for b in there[side])
            for side in (-1, 1)
            for a in here[side]
        )

    inside = count_inside(2e-4)
    assert inside > 5
    # The others stand on the narrow sides, beside outlines or in them.
    on_narrow = 200 - sum(map(len, here.values()))
    assert inside <= full.report.in_obstacles <= count_inside(0.0) + on_narrow
    assert on_narrow < 20
    assert any("in obstacles" in note for note in full.report.notes)


def test_what_stands_on_a_target_that_was_bent_or_moved_by_hand_keeps_off_where_it_is_now():
    source, where = tile(), wall()
    first = on_surface(where, source, 60, "First", 1)
    where.location.z += 1.0
    for vertex in where.data.vertices:
        vertex.co.y *= 1.3
    point = first.object.data.vertices[0]
    point.co.y += 0.3
    bpy.context.view_layer.update()
    from esh.esh_scatter.result.standing_now import standing_now

    now = standing_now(first.object, bpy.context)
    axes = now.axes / np.linalg.norm(now.axes, axis=1, keepdims=True)
    second = on_surface(where, source, 60, "Second", 2, obstacles=[first.object])
    here = outlines(second)
    corners = 0.5 * np.array([[-0.6, -0.4], [0.6, -0.4], [0.6, 0.4], [-0.6, 0.4]])
    for side in (-1, 1):
        own = np.flatnonzero(np.sign(axes[:, 0, 2]) * (np.abs(axes[:, 0, 2]) > 0.99) == side)
        there = [shapely.Polygon(now.position[k, 1:] + corners @ axes[k, 1:, :2].T) for k in own]
        assert nearest(here[side], there) >= 0.0


def test_objects_of_every_size_that_lean_are_seen_as_they_lie():
    """Upright objects on a slope: their outlines lie along it, as those of the same scatter do."""
    bpy.ops.mesh.primitive_cylinder_add(vertices=64, radius=0.3, depth=1.0)
    post = bpy.context.object
    slope = tile("Slope", 12.0, 12.0)
    slope.rotation_euler = (1.0, 0.0, 0.0)
    bpy.context.view_layer.update()
    options = {"align_to_normal": 0.0, "scale_jitter": 0.5, "stand_on": "lowest"}
    first = on_surface(slope, post, 100, "First", 1, **options)
    second = on_surface(slope, post, 100, "Second", 2, obstacles=[first.object], **options)
    away = np.linalg.norm(first.placement.position[:, None] - second.placement.position, axis=2)
    assert (away - 0.3 * (first.placement.scale[:, None] + second.placement.scale)).min() > -2e-3
    assert second.report.in_obstacles == 0


def test_what_stands_near_another_target_counts_where_it_is_near():
    source, where = tile(), wall()
    # Tiles on a board that hangs before one side of the wall, as near as they are large; and on one that is farther off.
    first = []
    for number, away in enumerate((0.2, 3.0)):
        board = tile(f"Board {number}", 2.0, 2.0)
        board.location, board.rotation_euler = (away, 0.0, 0.0), (0.0, np.pi / 2.0, 0.0)
        bpy.context.view_layer.update()
        first.append(on_surface(board, source, 9, f"First {number}", 5 + number))
    second = on_surface(where, source, 110, "Second", 2, obstacles=[one.object for one in first])
    there, here = outlines(first[0])[1], outlines(second)
    assert len(there) == 9
    assert nearest(here[1], there) >= 0.0
    assert nearest(here[-1], there) < 0.0
    assert nearest(here[1], outlines(first[1])[1]) < 0.0


def on_floor(result):
    return shapely.points(result.instances.position[:, :2].astype(np.float64))


@pytest.fixture(scope="module")
def found():
    """What one test has found out for the others."""
    return {}


@pytest.fixture
def floor():
    return tile("Floor", 20.0, 20.0)


def shapes(kind):
    """An obstacle on or near the floor, and what of it that covers."""
    if kind == "box that stands on it":
        return house((0, 0, 1.0), 2.0), shapely.box(-1, -1, 1, 1)
    if kind == "rock that is sunk in":
        bpy.ops.mesh.primitive_uv_sphere_add(radius=2.0, segments=64, ring_count=32)
        return bpy.context.object, shapely.Point(0, 0).buffer(2.0, 64)
    if kind == "path above":
        item = tile("Path", 12.0, 2.0)
        item.location.z, item.rotation_euler.z = 0.3, 0.5
        bpy.context.view_layer.update()
        corners = np.array([[-6, -1, 0], [6, -1, 0], [6, 1, 0], [-6, 1, 0]]) @ np.array(item.matrix_world)[:3, :3].T
        return item, shapely.Polygon(corners[:, :2])
    if kind == "path below":
        item = tile("Path", 12.0, 2.0)
        item.location.z = -0.3
        bpy.context.view_layer.update()
        return item, shapely.box(-6, -1, 6, 1)
    if kind == "curve":
        item = path()
        for point in item.data.splines[0].points:
            point.co.z = 0.4
        bpy.context.view_layer.update()
        return ScatterObstacle(item, width=1.5), shapely.LineString([(-20, 8), (30, 8)]).buffer(0.75)
    item = bpy.data.objects.new("Here", None)
    bpy.context.scene.collection.objects.link(item)
    item.location = (3.0, 2.0, 0.1)
    bpy.context.view_layer.update()
    return ScatterObstacle(item, width=2.0, margin=0.5), shapely.Point(3.0, 2.0).buffer(1.5, 64)


KINDS = ["box that stands on it", "rock that is sunk in", "path above", "path below", "curve", "empty"]


@pytest.mark.once
@pytest.mark.parametrize("kind", KINDS)
def test_other_obstacles_cover_what_of_a_whole_surface_is_near_them(floor, tree, kind, found):
    obstacle, ground = shapes(kind)
    for avoid, keeps in ((True, 0.3), (False, 0.0)):
        result = on_surface(floor, tree, 500, kind, 1, obstacles=[obstacle], avoid_overlap=avoid)
        away = shapely.distance(ground, on_floor(result))
        # Posts have 32 corners.
        assert away.min() > 0.98 * keeps - 0.02
        assert away.min() < keeps + 0.4
        assert result.report.in_obstacles == 0
    # The same for all kinds.
    if "without" not in found:
        found["without"] = on_floor(on_surface(floor, tree, 500, "Without", 1))
    assert (shapely.distance(ground, found["without"]) < 0.2).sum() > 5


def test_what_is_far_from_a_whole_surface_covers_nothing_of_it(floor, tree):
    without = on_surface(floor, tree, 200, "Without", 1)
    above = on_surface(
        floor, tree, 200, "Above", 1, obstacles=[house((0, 0, 20.0), 4.0), ScatterObstacle(path(), width=1.0)]
    )
    np.testing.assert_array_equal(without.instances.position, above.instances.position)


def test_a_picture_on_a_wall_keeps_its_side_free(tree):
    source, where = tile(), wall()
    picture = tile("Picture", 2.0, 1.5)
    picture.location, picture.rotation_euler = (0.05, 0.0, 0.0), (0.0, np.pi / 2.0, 0.0)
    bpy.context.view_layer.update()
    result = on_surface(where, source, 100, "Ivy", 1, obstacles=[picture])
    ground = shapely.box(-0.75, -1.0, 0.75, 1.0)
    here = outlines(result)
    assert min(ground.distance(one) for one in here[1]) > -1e-6
    assert not any(ground.buffer(-0.01).intersects(one) for one in here[1])
    assert sum(ground.intersects(one) for one in here[-1]) > 3


@pytest.mark.parametrize("kind", ["vertices", "nodes"])
def test_instances_cover_of_a_whole_surface_the_ground_at_their_origins(floor, tree, kind):
    shows, middles = instancer(kind)
    position = on_surface(floor, tree, 400, "Beside", 1, obstacles=[shows]).instances.position[:, :2]
    away = [from_box(position, middle, np.array([1.5, 0.2])).min() for middle in middles]
    assert min(away) > 0.28 and max(away) < 0.9


@pytest.fixture
def sidebar():
    from esh.esh_scatter import registration

    registration.register()
    yield bpy.context.scene.esh_scatter
    registration.unregister()


def in_sidebar(sidebar, ground, tree, count=80):
    made = sidebar.add_scatter(ground)
    size = made.add_class().sizes[0]
    size.source_object, size.count = tree, count
    made.device, made.max_steps = "CPU", 20
    return made


def test_obstacles_of_the_sidebar(sidebar, ground, tree):
    made = in_sidebar(sidebar, ground, tree)
    box, curve = house(), path()
    for item in bpy.context.scene.objects:
        item.select_set(item in (box, curve, ground, tree))
    assert bpy.ops.esh.obstacle_add() == {"FINISHED"}
    assert [entry.item for entry in made.obstacles] == [box, curve], "neither the target nor what is placed"
    assert made.obstacles[1].width > 0.0 == made.obstacles[0].width, "a line alone would keep nothing off"
    made.obstacles[1].width, made.obstacles[0].margin = 2.0, 0.5
    assert [(one.width, one.margin) for one in made.arguments(bpy.context.scene)[1]["obstacles"]] == [(0, 0.5), (2, 0)]
    bpy.ops.esh.scatter()
    position = np.array([v.co[:2] for v in made.result.data.vertices])
    assert from_box(position, (5, 5), 2.0).min() > 0.75 and np.abs(position[:, 1] - 8.0).min() > 1.2
    assert not made.outdated
    box.location.x += 1.0
    bpy.context.view_layer.update()
    assert made.changes() == ["obstacles"]
    box.location.x -= 1.0
    bpy.context.view_layer.update()
    assert not made.outdated
    made.obstacles[1].use = False
    assert made.changes() == ["obstacles"]
    bpy.ops.esh.obstacle_remove()
    assert len(made.obstacles) == 1
    bpy.ops.esh.obstacle_remove()
    assert not bpy.ops.esh.obstacle_remove.poll() and not made.obstacles


def test_lines_have_a_width_from_the_beginning(sidebar, ground, tree):
    made = in_sidebar(sidebar, ground, tree)
    line = path()
    ground.scale = (2.0, 2.0, 1.0)
    bpy.context.view_layer.update()

    def chosen(**given):
        entry = made.obstacles.add()
        for name, value in given.items():
            setattr(entry, name, value)
        return entry.width

    assert chosen(item=line) == 1.0 and chosen(width=0.0, item=line) == 0.0 and chosen(item=line, width=3.0) == 3.0
    holder = bpy.data.collections.new("Holder")
    holder.objects.link(line)
    assert chosen(kind="COLLECTION", collection=holder) == 1.0
    holder.objects.link(house())
    assert chosen(kind="COLLECTION", collection=holder) == 0.0
    bpy.context.scene.unit_settings.scale_length = 2.0
    assert chosen(item=line) == 0.5
    bpy.context.scene.unit_settings.scale_length = 1.0
    ground.scale = (0.02, 0.02, 0.02)
    bpy.context.view_layer.update()
    assert chosen(item=line) == pytest.approx(0.02), "a path on a plate"
    line.data.bevel_depth = 0.4
    bpy.context.view_layer.update()
    assert chosen(item=line) == 0.0, "its faces say how wide it is"


def test_what_cannot_be_an_obstacle_adds_no_entry_and_nothing_is_chosen_in_one_at_most(sidebar, ground, tree):
    made = in_sidebar(sidebar, ground, tree)
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    bpy.context.scene.collection.objects.link(lamp)
    for item in (tree, lamp):
        for other in bpy.context.scene.objects:
            other.select_set(other == item)
        assert bpy.ops.esh.obstacle_add() == {"CANCELLED"} and not made.obstacles
    for other in bpy.context.scene.objects:
        other.select_set(other == ground)
    for _ in range(2):
        assert bpy.ops.esh.obstacle_add() == {"FINISHED"}
        assert [one.item for one in made.obstacles] == [None] and made.obstacle_index == 0


def test_neither_tiles_of_the_target_nor_what_is_placed_become_obstacles(sidebar, ground, tree):
    """All that lies around is selected when somebody wants the house in it."""
    made = in_sidebar(sidebar, ground, tree)
    tiles, trees = (bpy.data.collections.new(name) for name in ("Tiles", "Trees"))
    tiles.objects.link(ground)
    trees.objects.link(tree)
    for item in (tiles, trees):
        bpy.context.scene.collection.children.link(item)
    made.target_kind, made.target_collection = "COLLECTION", tiles
    size = made.classes[0].sizes[0]
    size.source_kind, size.source_collection = "COLLECTION", trees
    home = house()
    for item in (ground, tree, home):
        item.select_set(True)
    assert bpy.ops.esh.obstacle_add() == {"FINISHED"}
    assert [entry.item for entry in made.obstacles] == [home]


def test_a_later_scatter_makes_room_for_the_one_before(sidebar, ground, tree):
    first = in_sidebar(sidebar, ground, tree)
    second = in_sidebar(sidebar, ground, tree)
    bpy.ops.esh.scatter_choose(index=0)
    bpy.ops.esh.scatter()
    bpy.ops.esh.scatter_choose(index=1)
    bpy.ops.esh.scatter()
    one, two = (np.array([v.co[:2] for v in made.result.data.vertices]) for made in (first, second))
    away = np.linalg.norm(one[:, None] - two, axis=2).min()
    assert away > 0.6 - 3 * CELL, "equal seeds and settings, and none of them coincide"
    assert not first.outdated and not second.outdated
    first.result.data.vertices[0].co.x += 0.5
    assert second.changes() == ["other scatters"] and first.changes() == ["instances set by hand"]
    second.keep_off_others = False
    bpy.ops.esh.scatter()
    two = np.array([v.co[:2] for v in second.result.data.vertices])
    assert np.linalg.norm(one[:, None] - two, axis=2).min() < 0.5 and not second.outdated


def test_of_a_later_scatter_that_stands_in_the_way_it_is_said(sidebar, ground, tree, tmp_path):
    """Nothing told of the second one whoever looked at the first, whose objects stood in its."""
    for number in range(3):
        made = in_sidebar(sidebar, ground, tree)
        made.name = f"Wood {number}"
        bpy.ops.esh.scatter_choose(index=number)
        bpy.ops.esh.scatter()

    def told():
        return [[other.name for other in one.later_in_the_way()] for one in bpy.context.scene.esh_scatter.scatters]

    def update(number):
        bpy.ops.esh.scatter_choose(index=number)
        assert bpy.ops.esh.scatter() == {"FINISHED"}
        one = bpy.context.scene.esh_scatter.active.result.data
        return np.array([v.co[:2] for v in one.vertices])

    assert told() == [[], [], []]
    before = update(0)
    assert told() == [[], [], []], "the same again stands where it did"
    bpy.context.scene.esh_scatter.scatters[0].seed = 7
    moved = update(0)
    assert not np.array_equal(before, moved)
    with checksums.now():
        assert told() == [["Wood 1", "Wood 2"], [], []]
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "woods.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "woods.blend"))
    with checksums.now():
        assert told() == [["Wood 1", "Wood 2"], [], []]
    first, third, second = update(0), update(2), update(1)
    assert np.array_equal(first, moved), "a file that is opened again places the same"
    assert np.linalg.norm(first[:, None] - second, axis=2).min() > 0.6 - 3 * CELL
    with checksums.now():
        assert told() == [[], ["Wood 2"], []]
        assert np.linalg.norm(second[:, None] - third, axis=2).min() < 0.6 - 3 * CELL
        bpy.context.scene.esh_scatter.scatters[2].keep_off_others = False
        assert told() == [[], [], []], "what may lie on others is in nobody's way"


@pytest.mark.once
def test_a_later_scatter_makes_room_on_a_wall_for_the_one_before_and_for_what_was_removed(sidebar):
    where, source = wall(), tile()
    first, second = (in_sidebar(sidebar, where, source, 60) for _ in range(2))
    for number, made in enumerate((first, second)):
        made.surface, made.max_steps, made.seed = "WHOLE", 60, 3
        bpy.ops.esh.scatter_choose(index=number)
        assert bpy.ops.esh.scatter() == {"FINISHED"}

    def standing():
        from types import SimpleNamespace

        found = []
        for made in (first, second):
            mesh = made.result.data
            values = {name: np.empty(4 * len(mesh.vertices)) for name in ("rotation", "scale")}
            mesh.attributes["rotation"].data.foreach_get("value", values["rotation"])
            position = np.array([v.co for v in mesh.vertices])
            rotation = values["rotation"].reshape(-1, 4)
            instances = SimpleNamespace(position=position, rotation=rotation, scale=np.ones(len(position)))
            found.append(outlines(SimpleNamespace(instances=instances)))
        return found

    one, two = standing()
    assert all(nearest(two[side], one[side]) >= 0.0 for side in (-1, 1)), "equal seeds and settings"
    assert not first.outdated and not second.outdated
    assert second.report["in_obstacles"] == 0
    # The place of an instance that is removed stays free, on its side.
    gone = next(k for k, v in enumerate(second.result.data.vertices) if v.co.x > 0.0099 and abs(v.co.y) < 2.0)
    place = np.array(second.result.data.vertices[gone].co)
    bpy.context.view_layer.objects.active = second.result
    for vertex in second.result.data.vertices:
        vertex.select = vertex.index == gone
    bpy.ops.esh.instances_remove()
    first.result.data.vertices[0].co.y += 0.2
    assert "other scatters" in second.changes()
    bpy.ops.esh.scatter()
    one, two = standing()
    assert all(nearest(two[side], one[side]) >= 0.0 for side in (-1, 1))
    assert min(a.distance(shapely.Point(place[1:])) for a in two[1]) > 0.2
    assert not second.outdated


def test_obstacles_have_as_many_pixels_as_the_spacing_needs(ground, tree):
    """Few objects do not pay for pixels that nobody sees; of many, and of few in a small spot, gaps are narrow."""

    def cells(count, density=1.0):
        classes = [ScatterClass("tree", [ScatterSize("s", count, tree)], density=density)]
        job = ScatterJob(ground, classes, device="cpu", obstacles=[ScatterObstacle(path(), width=1.0)])
        return max(obstacle.image.shape[0] for obstacle in job.problem.obstacles)

    spot = np.zeros((40, 40), np.float32)
    spot[3:6, 3:6] = 1.0
    assert cells(300) == cells(310) == 512
    assert cells(1500) == 1024 and cells(50_000) == 2048
    assert cells(300, spot) == 2048


def test_what_is_drawn_alike_is_the_same_obstacle_in_the_next_run():
    from esh.esh_scatter.classes.survey import Survey

    survey, image = Survey(), np.eye(8, dtype=bool)
    first = survey.drawn_obstacle(image)
    assert survey.drawn_obstacle(image.copy()) is first
    other = survey.drawn_obstacle(image[::-1].copy())
    assert other is not first and np.array_equal(other.image, image[::-1])
