"""Where overlap is avoided, the objects themselves do not overlap: seen from above, as large and as turned as they stand."""

from __future__ import annotations

import math

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")
pytest.importorskip("shapely")

import esh  # noqa: E402
from esh.engine.problem.interaction import group_bodies  # noqa: E402
from esh.engine.problem.scatter_settings import Standing  # noqa: E402
from esh.engine.quality.measurement import measure  # noqa: E402
from esh.engine.solver.solver import Solver  # noqa: E402
from esh.esh_scatter.classes.standing import draw  # noqa: E402
from shapely.affinity import translate  # noqa: E402
from shapely.geometry import MultiPoint, Polygon  # noqa: E402
from shapely.strtree import STRtree  # noqa: E402

# Blender gives triangles here; all that is looked at comes of these.
pytestmark = [pytest.mark.once, pytest.mark.usefixtures("bare_file")]

# Share of the narrower one's width that two outlines may lie in each other.
TOLERANCE = 1e-3


def flat(name: str, corners: list[tuple[float, float]], scale: float = 1.0) -> bpy.types.Object:
    """An object with one face, whose origin need not be in its middle."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(x, y, 0.0) for x, y in corners], [], [tuple(range(len(corners)))])
    item = bpy.data.objects.new(name, mesh)
    item.scale = (scale,) * 3
    bpy.context.collection.objects.link(item)
    bpy.context.view_layer.update()
    return item


def rectangle(name: str, length: float, width: float) -> bpy.types.Object:
    x, y = 0.5 * length, 0.5 * width
    return flat(name, [(-x, -y), (x, -y), (x, y), (-x, y)])


def disc(name: str, radius: float, corners: int = 24) -> bpy.types.Object:
    angle = np.arange(corners) * (2.0 * math.pi / corners)
    return flat(name, list(zip(np.cos(angle) * radius, np.sin(angle) * radius, strict=True)))


def outlines_in_the_scene() -> list[Polygon]:
    """The outline of every instance that a scatter placed, as Blender shows it."""
    found = []
    for entry in bpy.context.evaluated_depsgraph_get().object_instances:
        if entry.is_instance and entry.object.type == "MESH" and entry.parent.original.get("esh_scatter"):
            matrix = np.array(entry.matrix_world, float)
            points = np.array([vertex.co for vertex in entry.object.data.vertices], float)
            found.append(MultiPoint((points @ matrix[:3, :3].T + matrix[:3, 3])[:, :2]).convex_hull)
    return found


def width_of(polygon: Polygon) -> float:
    if polygon.is_empty or polygon.minimum_rotated_rectangle.geom_type != "Polygon":
        return 0.0
    corners = np.array(polygon.minimum_rotated_rectangle.exterior.coords)
    return float(min(np.hypot(*(corners[1] - corners[0])), np.hypot(*(corners[2] - corners[1]))))


def overlapping(polygons: list[Polygon], least: float = 2.0 * TOLERANCE) -> int:
    """Pairs that lie in each other by more than this share of the smaller width."""
    first, second = STRtree(polygons).query(polygons, predicate="intersects")
    pairs = [(polygons[i], polygons[j]) for i, j in zip(first, second, strict=True) if i < j]
    return sum(width_of(a.intersection(b)) > least * min(width_of(a), width_of(b)) for a, b in pairs)


def collection(*items: bpy.types.Object) -> bpy.types.Collection:
    result = bpy.data.collections.new("Variants")
    for item in items:
        result.objects.link(item)
    return result


def scenes():
    wedge = [(-1.0, -0.1), (2.0, -0.45), (2.0, 0.45), (-1.0, 0.1)]
    triangle = [(0.0, 0.0), (0.8, 0.0), (0.0, 0.8)]
    yield "jitter", 20.0, lambda: [("disc", 240, disc("Disc", 0.5), None)], {"scale_jitter": 0.5}
    yield "mixed collection", 20.0, lambda: [("mixed", 100, collection(disc("L", 1.0), disc("S", 0.1)), None)], {}
    yield "planks", 10.0, lambda: [("plank", 100, rectangle("Plank", 2.0, 0.3), None)], {}
    yield "boxes, turned at random", 10.0, lambda: [("box", 110, rectangle("Box", 0.8, 0.6), None)], {}
    yield "a range", 10.0, lambda: [("box", 60, rectangle("Box", 0.8, 0.6), (0.2, 1.5))], {"scale_jitter": 0.2}
    yield "wedges", 12.0, lambda: [("wedge", 40, flat("Wedge", wedge), None)], {}
    yield (
        "beside their origin",
        12.0,
        lambda: [("triangle", 150, flat("Triangle", triangle), None), ("wedge", 10, flat("Wedge", wedge), None)],
        {"scale_jitter": 0.3},
    )


@pytest.mark.parametrize(("side", "things", "settings"), [s[1:] for s in scenes()], ids=[s[0] for s in scenes()])
def test_no_two_objects_overlap(side, things, settings):
    ground = rectangle("Ground", side, side)
    classes = [esh.ScatterClass(n, [esh.ScatterSize("all", c, item, area)]) for n, c, item, area in things()]
    result = esh.scatter(ground, classes, device="cpu", avoid_overlap=True, seed=2, **settings)
    seen = outlines_in_the_scene()
    assert len(seen) == sum(c.sizes[0].count for c in classes)
    assert overlapping(seen) == 0
    assert result.report.overlaps == 0


def random_polygon(rng: np.random.Generator, area: float) -> list[tuple[float, float]]:
    """A convex polygon of this area around the origin."""
    angle = np.sort(rng.uniform(0.0, 2.0 * math.pi, int(rng.integers(5, 13))))
    hull = MultiPoint(np.stack([np.cos(angle) * rng.uniform(1.0, 2.0), np.sin(angle)], axis=1)).convex_hull
    if hull.area < 1.2:
        return random_polygon(rng, area)
    corners = np.array(hull.exterior.coords)[:-1] - np.array(hull.centroid.coords[0])
    return [tuple(corner) for corner in corners * math.sqrt(area / hull.area)]


@pytest.mark.parametrize("seed", [1, 2])
def test_polygons_of_all_sizes_are_parted_at_80_percent_and_stay_as_even(seed):
    """They are so close together that they must turn, and that large ones need more room than small ones."""
    rng = np.random.default_rng(seed)
    area = np.exp(rng.normal(0.0, 1.0, 40))
    kinds = collection(*(flat(f"Kind {k:02}", random_polygon(rng, a)) for k, a in enumerate(area)))
    classes = [esh.ScatterClass("all", [esh.ScatterSize("all", 240, kinds)])]
    side = math.sqrt(240.0 * area.mean() / 0.8)
    settings = {"device": "cpu", "avoid_overlap": True, "seed": seed}
    # Which of them are drawn decides how much they cover.
    covered = esh.cover_of(esh.ScatterJob(rectangle("Measured", side, side), classes, **settings).problem).covered
    side *= math.sqrt(covered / 0.8)
    ground = rectangle("Ground", side, side)
    with Solver(esh.ScatterJob(ground, classes, **settings).problem, device="cpu") as solver:
        solver.run(100)
        before = measure(solver.placement(), solver.launcher).coverage_error
    result = esh.scatter(ground, classes, **settings)
    assert result.report.covered == pytest.approx(0.8, abs=0.01)
    assert overlapping(outlines_in_the_scene()) == result.report.overlaps == 0
    assert result.report.coverage_error < before + 0.03


def test_only_objects_that_may_point_anywhere_turn_as_they_fit():
    ground, box = rectangle("Ground", 10.0, 10.0), rectangle("Box", 0.8, 0.6)
    for random_turn in (2.0 * math.pi, 1.0, 0.0):
        classes = [esh.ScatterClass("box", [esh.ScatterSize("all", 150, box)])]
        result = esh.scatter(ground, classes, device="cpu", avoid_overlap=True, seed=2, random_turn=random_turn)
        w, _, _, z = result.instances.rotation.T
        turn = np.abs(np.angle(np.exp(2j * np.arctan2(z, w))))
        assert result.report.overlaps == overlapping(outlines_in_the_scene()) == 0
        assert turn.max() <= 0.5 * random_turn + 1e-5
        drawn = np.array(draw(Standing(random_turn=random_turn), result.placement.id, np.zeros(150, bool), 2)[1])
        turned = np.abs(np.angle(np.exp(1j * (2.0 * np.arctan2(z, w) - drawn))))
        assert (turned > 0.01).any() == (random_turn > 6.0)


@pytest.mark.parametrize("surface", ["above", "whole"])
def test_cover_asks_for_fewer_where_scales_vary(surface):
    """With scales between 0.1 and 1.9 objects take 1.27 times as much ground."""
    ground, box = rectangle("Ground", 10.0, 10.0), rectangle("Box", 0.8, 0.6)
    classes = [esh.ScatterClass("box", [esh.ScatterSize("all", None, box)], count="cover")]
    settings = {"device": "cpu", "avoid_overlap": True, "surface": surface}
    same, varied = (esh.ScatterJob(ground, classes, scale_jitter=j, **settings).problem for j in (0.0, 0.9))
    assert varied.body_count == pytest.approx(same.body_count / 1.27, abs=1)
    assert esh.cover_of(varied).covered == pytest.approx(esh.cover_of(same).covered, abs=0.06)


def test_sizes_of_the_same_object_are_equal_whatever_their_scales():
    """By chance one of them had more weight than another one."""
    ground, box = rectangle("Ground", 14.0, 14.0), rectangle("Box", 0.8, 0.6)
    classes = [esh.ScatterClass("box", [esh.ScatterSize(name, 40, box) for name in "abc"])]
    for settings in ({"scale_jitter": 0.2}, {"scale_jitter": 0.5, "size_emphasis": (2.0, 3.0)}):
        job = esh.ScatterJob(ground, classes, device="cpu", avoid_overlap=True, **settings)
        assert (group_bodies(job.problem).matrix == 1.0).all()


@pytest.mark.parametrize("surface", ["above", "whole"])
def test_what_is_pinned_takes_the_ground_of_its_own_outline(surface):
    ground = rectangle("Ground", 14.0, 14.0)
    kinds = collection(rectangle("Large", 3.0, 2.0), rectangle("Small", 0.3, 0.2))
    classes = [esh.ScatterClass("all", [esh.ScatterSize("all", 60, kinds, weights={"Large": 1.0, "Small": 9.0})])]
    settings = {"device": "cpu", "avoid_overlap": True, "seed": 3, "surface": surface, "scale_jitter": 0.2}
    first = esh.scatter(ground, classes, **settings)
    moved = [int(np.argmax(first.placement.area)), int(np.argmin(first.placement.area))]
    for point in moved:
        first.object.data.attributes["position"].data[point].vector.x += 0.1
    placement = esh.scatter(ground, classes, result=first.object, **settings).placement
    assert placement.fixed.sum() == 2
    np.testing.assert_allclose(
        np.sort(placement.area[placement.fixed]), np.sort(first.placement.area[moved]), rtol=1e-4
    )


@pytest.mark.parametrize("shape", ["plank", "box"])
def test_far_from_the_origin_the_report_counts_what_blender_shows(shape):
    """At the coordinates of a map Blender rounds positions to half a meter: objects that were parted lie in each other there."""
    ground = rectangle("Ground", 12.0, 12.0)
    ground.location.xy = (500_000.0, 5_000_000.0)
    bpy.context.view_layer.update()
    item = rectangle("Plank", 2.0, 0.3) if shape == "plank" else rectangle("Box", 0.8, 0.6)
    classes = [esh.ScatterClass("all", [esh.ScatterSize("all", 90, item)])]
    result = esh.scatter(ground, classes, device="cpu", avoid_overlap=True, seed=2)
    # Shapely, too, counts better near the origin.
    shown = [translate(outline, -500_000.0, -5_000_000.0) for outline in outlines_in_the_scene()]
    seen = overlapping(shown)
    assert (seen > 0) == (shape == "plank")
    # What lies in each other by the tolerance may count or not.
    assert seen <= result.report.overlaps <= overlapping(shown, 0.5 * TOLERANCE)
    assert result.report.converged == (seen == 0)
    assert any("0.5 m" in note for note in result.report.notes)


def excluded(item: bpy.types.Object) -> bpy.types.Object:
    """Put an object into a collection of a library, which the view layer leaves out."""
    library = bpy.data.collections.new("Library")
    bpy.context.scene.collection.children.link(library)
    library.objects.link(item)
    bpy.context.collection.objects.unlink(item)
    bpy.context.view_layer.layer_collection.children["Library"].exclude = True
    return item


def arrayed() -> bpy.types.Object:
    item = rectangle("Box", 0.8, 0.6)
    item.modifiers.new("Array", "ARRAY").count = 3
    return item


def with_key() -> bpy.types.Object:
    item = rectangle("Box", 0.8, 0.6)
    item.shape_key_add(name="Basis")
    key = item.shape_key_add(name="Long")
    for point in key.data:
        point.co.x *= 2.5
    key.value = 1.0
    return item


def hidden(item: bpy.types.Object) -> bpy.types.Object:
    item.hide_viewport = True
    return item


def sheared() -> bpy.types.Object:
    parent = rectangle("Parent", 1.0, 1.0)
    parent.scale = (3.0, 1.0, 1.0)
    item = rectangle("Child", 1.0, 1.0)
    item.parent = parent
    item.rotation_euler.z = 0.25 * math.pi
    return item


def constrained() -> bpy.types.Object:
    large = rectangle("Large", 1.0, 1.0)
    large.scale = (2.0, 2.0, 1.0)
    item = rectangle("Box", 0.8, 0.6)
    item.constraints.new("COPY_SCALE").target = large
    return item


def leafy() -> bpy.types.Object:
    """A plank with squares at its corners, instanced by its own nodes."""
    item = rectangle("Plank", 1.0, 0.4)
    tree = bpy.data.node_groups.new("Leaves", "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    given, result = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    instances, square = tree.nodes.new("GeometryNodeInstanceOnPoints"), tree.nodes.new("GeometryNodeMeshGrid")
    both = tree.nodes.new("GeometryNodeJoinGeometry")
    tree.links.new(given.outputs[0], instances.inputs["Points"])
    tree.links.new(square.outputs[0], instances.inputs["Instance"])
    tree.links.new(given.outputs[0], both.inputs[0])
    tree.links.new(instances.outputs[0], both.inputs[0])
    tree.links.new(both.outputs[0], result.inputs[0])
    item.modifiers.new("Leaves", "NODES").node_group = tree
    return item


def as_one() -> bpy.types.Collection:
    """A plank, and an empty that shows another collection."""
    empty = shown_by("Empty", rectangle("Inner", 0.5, 2.0))
    empty.location.x = 1.5
    return collection(rectangle("Plank", 1.0, 0.4), empty)


def shown_by(name: str, *items: bpy.types.Object) -> bpy.types.Object:
    """An empty that shows objects, which are in no scene themselves."""
    empty = bpy.data.objects.new(name, None)
    empty.instance_type, empty.instance_collection = "COLLECTION", collection(*items)
    empty.instance_collection.instance_offset = (0.2, -0.1, 0.0)
    bpy.context.collection.objects.link(empty)
    for item in items:
        bpy.context.collection.objects.unlink(item)
    return empty


def shown_turned() -> bpy.types.Object:
    item = rectangle("Box", 0.8, 0.3)
    item.location, item.rotation_euler.z = (0.4, 0.1, 0.3), 0.4
    empty = shown_by("Turned", item)
    empty.location, empty.rotation_euler, empty.scale = (30.0, 5.0, 2.0), (0.2, 0.0, 0.7), (2.0, 2.0, 2.0)
    return empty


def shown_twice() -> bpy.types.Object:
    """An empty, mirrored and stretched, that shows another one beside a plank."""
    inner = shown_turned()
    inner.location = (1.0, 0.0, 0.0)
    empty = shown_by("Outer", inner, rectangle("Plank", 0.3, 3.0))
    empty.scale, empty.rotation_euler.z = (1.0, -1.5, 0.8), 1.0
    return empty


def shown_sheared() -> bpy.types.Object:
    """On an object that is stretched across."""
    item = shown_turned()
    item.parent = rectangle("Parent", 1.0, 1.0)
    item.parent.scale = (3.0, 1.0, 1.0)
    return item


EMPTIES = (shown_turned, shown_twice, shown_sheared)


@pytest.mark.parametrize(
    "make",
    [
        *(arrayed, with_key, constrained, sheared, leafy, as_one, *EMPTIES),
        *(lambda make=make: excluded(make()) for make in (arrayed, with_key, constrained, sheared, leafy, *EMPTIES)),
        *(lambda make=make: hidden(make()) for make in (arrayed, *EMPTIES)),
        *(lambda make=make: collection(make()) for make in EMPTIES),
    ],
    ids=lambda make: make.__name__,
)
def test_what_is_measured_is_what_is_shown(make):
    """Modifiers of objects outside of the view layer, instances by nodes and shear were left out, and objects overlapped."""
    source = make()
    bpy.context.view_layer.update()
    ground = rectangle("Ground", 40.0, 40.0)
    before = {kind: len(getattr(bpy.data, kind)) for kind in ("objects", "meshes", "node_groups")}
    measured = esh.measure_footprint(source)
    assert before == {kind: len(getattr(bpy.data, kind)) for kind in before}
    size = esh.ScatterSize("all", 1, source, as_one=isinstance(source, bpy.types.Collection))
    esh.scatter(ground, [esh.ScatterClass("all", [size])], device="cpu")
    points = [point for part in outlines_in_the_scene() for point in part.exterior.coords]
    hull = MultiPoint(points).convex_hull
    outline = Polygon(measured.corners)
    assert (outline.area, outline.length) == pytest.approx((hull.area, hull.length), rel=1e-3)


def test_empties_are_placed_as_they_stand_and_kept_apart():
    """Two of them show the same box: each is as large and as turned as its own empty."""
    box = rectangle("Box", 0.8, 0.4)
    small = shown_by("Small", box)
    large = bpy.data.objects.new("Large", None)
    large.instance_type, large.instance_collection = "COLLECTION", small.instance_collection
    large.scale, large.rotation_euler.z = (2.5, 1.5, 1.0), 0.6
    bpy.context.collection.objects.link(large)
    ground = rectangle("Ground", 12.0, 12.0)
    sizes = [esh.ScatterSize("mixed", 60, collection(small, large)), esh.ScatterSize("large", 15, large)]
    result = esh.scatter(ground, [esh.ScatterClass("boxes", sizes)], device="cpu", seed=3)
    seen = outlines_in_the_scene()
    areas = np.array([one.area for one in seen])
    is_large = np.isclose(areas, 0.32 * 2.5 * 1.5, rtol=1e-3)
    assert len(seen) == 75 and (is_large | np.isclose(areas, 0.32, rtol=1e-3)).all()
    assert 25 <= is_large.sum() <= 60
    assert overlapping(seen) == result.report.overlaps == 0


def test_what_an_empty_shows_is_looked_through():
    ground = rectangle("Ground", 10.0, 10.0)
    nothing, on_itself = shown_by("Nothing"), shown_by("Itself", rectangle("Box", 1.0, 1.0))
    on_itself.instance_collection.objects.link(ground)
    for source, said in ((nothing, "must have geometry"), (on_itself, 'must not hold the target "Ground"')):
        with pytest.raises(esh.EshError, match=said):
            esh.scatter(ground, [esh.ScatterClass("all", [esh.ScatterSize("all", 3, source)])], device="cpu")


def test_what_repeats_others_or_is_never_shown_is_refused():
    ground = rectangle("Ground", 10.0, 10.0)
    parent, child = rectangle("Parent", 1.0, 1.0), rectangle("Child", 1.0, 1.0)
    child.parent, parent.instance_type = parent, "VERTS"
    ball = bpy.data.objects.new("Ball", bpy.data.metaballs.new("Ball"))
    bpy.context.collection.objects.link(ball)
    for source, said in ((parent, 'object "Parent" repeats others by its vertices'), (ball, "must have geometry")):
        with pytest.raises(esh.EshError, match=said):
            esh.scatter(ground, [esh.ScatterClass("all", [esh.ScatterSize("all", 3, source)])], device="cpu")


def terrain(name: str, side: float, height) -> bpy.types.Object:
    """A square grid whose heights are a function of x and y."""
    n = 40
    x, y = np.meshgrid(np.linspace(0.0, side, n + 1), np.linspace(0.0, side, n + 1))
    number = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    faces = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1).reshape(-1, 4)
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(np.stack([x, y, height(x, y)], axis=-1).reshape(-1, 3).tolist(), [], faces.tolist())
    item = bpy.data.objects.new(name, mesh)
    bpy.context.collection.objects.link(item)
    bpy.context.view_layer.update()
    return item


GROUNDS = {
    "slope": lambda x, y: 0.9 * x - 0.6 * y,
    "hills": lambda x, y: 1.5 * np.sin(0.9 * x) * np.cos(0.7 * y),
    "roof": lambda x, y: 1.2 * np.abs(x - 5.03),
}


# Smooth normals differ from those of the faces on hills most of all, and on a slope not at all.
SLOPES = [(ground, align, smooth) for ground in GROUNDS for align in (1.0, 0.5, 0.0) for smooth in (False, True)]
SLOPES = [(ground, align, smooth) for ground, align, smooth in SLOPES if not smooth or ground == "hills"]


@pytest.mark.parametrize(("ground", "align", "smooth"), SLOPES)
def test_outlines_on_slopes_lie_in_the_planes_that_objects_stand_in(ground, align, smooth):
    item = terrain("Ground", 10.0, GROUNDS[ground])
    item.data.polygons.foreach_set("use_smooth", [smooth] * len(item.data.polygons))
    classes = [
        esh.ScatterClass("plank", [esh.ScatterSize("all", 60, rectangle("Plank", 0.9, 0.4))]),
        esh.ScatterClass("box", [esh.ScatterSize("all", 45, rectangle("Box", 0.7, 0.5), (0.1, 0.6))]),
        esh.ScatterClass("long", [esh.ScatterSize("all", 20, rectangle("Long", 1.5, 0.25))], direction=0.6),
    ]
    result = esh.scatter(
        item, classes, device="cpu", max_steps=40, avoid_overlap=True, seed=3, align_to_normal=align, scale_jitter=0.3
    )
    seen = outlines_in_the_scene()
    assert len(seen) == 125 and result.report.overlaps == 0
    assert overlapping(seen) == 0
    # Seen from above the objects are as narrow as they lean.
    share = sum(polygon.area for polygon in seen) / float(result.placement.area.sum())
    assert share < 0.9 if align == 1.0 else share < 0.97 if align else share > 1.0


@pytest.mark.parametrize("tilt", [0.2, 0.7])
@pytest.mark.parametrize("align", [1.0, 0.0])
@pytest.mark.parametrize("ground", ["plane", *GROUNDS])
def test_outlines_of_tilted_objects_lie_in_the_planes_that_these_lean_in(ground, align, tilt):
    """As if they stood straight, a third of the planks on hills went through each other, and the report said none."""
    item = rectangle("Ground", 10.0, 10.0) if ground == "plane" else terrain("Ground", 10.0, GROUNDS[ground])
    classes = [
        esh.ScatterClass("box", [esh.ScatterSize("all", 45, rectangle("Box", 0.7, 0.5), (0.1, 0.6))]),
        esh.ScatterClass("long", [esh.ScatterSize("all", 60, rectangle("Long", 1.5, 0.25))]),
        esh.ScatterClass("disc", [esh.ScatterSize("all", 15, disc("Disc", 0.3, 96), area=math.pi * 0.09)]),
    ]
    result = esh.scatter(
        item, classes, device="cpu", avoid_overlap=True, seed=3, align_to_normal=align, tilt=tilt, scale_jitter=0.3
    )
    seen = outlines_in_the_scene()
    assert len(seen) == 120 and result.report.overlaps == 0
    assert overlapping(seen) == 0


def test_a_slope_holds_as_many_as_its_surface_has_room_for():
    """Seen from above the boxes would cover 95 %."""
    item = terrain("Ground", 10.0, lambda x, y: x)
    box = rectangle("Box", 0.8, 0.6)
    count = round(0.67 * 100.0 * math.sqrt(2.0) / 0.48)
    result = esh.scatter(
        item,
        [esh.ScatterClass("box", [esh.ScatterSize("all", count, box)])],
        device="cpu",
        avoid_overlap=True,
        random_turn=0.0,
    )
    assert result.report.overlaps == 0 and overlapping(outlines_in_the_scene()) == 0
    assert result.report.covered == pytest.approx(0.67, abs=0.01)


@pytest.mark.parametrize(("ground", "align"), [("plane", 1.0), ("hills", 1.0), ("hills", 0.0)])
@pytest.mark.parametrize(("turn", "most"), [(0.0, 0.8), (2.0 * math.pi, 0.85)])
def test_cover_asks_for_as_much_as_can_lie_there(ground, align, turn, most):
    """Of boxes of a given turn about three quarters, of free ones more; of upright ones what there is room for seen from above."""
    item = rectangle("Ground", 10.0, 10.0) if ground == "plane" else terrain("Ground", 10.0, GROUNDS[ground])
    box, stone = rectangle("Box", 0.8, 0.6), disc("Stone", 0.25)
    classes = [
        esh.ScatterClass("box", [esh.ScatterSize("all", None, box)], count="cover"),
        esh.ScatterClass("stone", [esh.ScatterSize("all", None, stone)], count="cover", density=0.5),
    ]
    for made in (classes[:1], classes):
        result = esh.scatter(item, made, device="cpu", avoid_overlap=True, align_to_normal=align, random_turn=turn)
        assert 0.7 < result.report.covered < most
        assert result.report.overlaps == overlapping(outlines_in_the_scene()) == 0
        surface = 100.0 if ground == "plane" or align == 0.0 else float(sum(face.area for face in item.data.polygons))
        assert result.placement.area.sum() == pytest.approx(result.report.covered * surface, rel=0.02)


@pytest.mark.parametrize("align", [1.0, 0.0])
def test_long_objects_point_along_their_direction_seen_from_above(align):
    item = terrain("Ground", 10.0, lambda x, y: 1.2 * x)
    long = [esh.ScatterSize("all", 12, rectangle("Long", 1.0, 0.1), line=esh.Line(0.9, 0.7, turn_weights=(0.0, 1.0)))]
    esh.scatter(
        item,
        [esh.ScatterClass("long", long)],
        device="cpu",
        avoid_overlap=False,
        align_to_normal=align,
    )
    for polygon in outlines_in_the_scene():
        corners = np.array(polygon.exterior.coords)[:-1]
        middle = sorted(
            (corners + np.roll(corners, -1, axis=0)) / 2.0, key=lambda p: p @ [math.cos(0.7), math.sin(0.7)]
        )
        way = middle[-1] - middle[0]
        assert math.atan2(way[1], way[0]) == pytest.approx(0.7, abs=0.03)


def test_the_report_counts_the_outlines_that_still_overlap():
    ground = rectangle("Ground", 6.0, 6.0)
    plank = rectangle("Plank", 2.0, 0.3)
    classes = [esh.ScatterClass("plank", [esh.ScatterSize("all", 70, plank)])]
    result = esh.scatter(ground, classes, device="cpu", avoid_overlap=True)
    assert any("at most about" in note for note in result.report.notes)
    # The width of what two share is not quite how deep they lie in each other.
    assert result.report.overlaps == pytest.approx(overlapping(outlines_in_the_scene()), abs=2)
    assert result.report.overlaps > 50 and not result.report.converged


def test_a_disc_that_was_asked_for_stays_one():
    ground = rectangle("Ground", 10.0, 10.0)
    box = rectangle("Box", 1.0, 0.8)
    job = esh.ScatterJob(
        ground,
        [esh.ScatterClass("box", [esh.ScatterSize("all", 20, box, area=0.5)])],
        device="cpu",
        avoid_overlap=True,
    )
    assert job.problem.classes[0].sizes[0].footprint is None


def capsule(name: str, length: float, width: float) -> bpy.types.Object:
    half, radius = 0.5 * (length - width), 0.5 * width
    angle = np.linspace(-0.5 * math.pi, 0.5 * math.pi, 24)
    right = np.stack([half + radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    return flat(name, [*map(tuple, right), *map(tuple, -right)])


@pytest.mark.parametrize("area", [None, 0.35, (0.2, 0.6)], ids=["measured", "one area", "a range"])
@pytest.mark.parametrize("ground", ["plane", "slope", "hills"])
def test_capsules_that_were_asked_for_are_as_large_as_their_objects_and_lean_with_them(ground, area):
    """As long as the longest object at its own scale, level, they let larger ones overlap and kept small ones too far off."""
    item = rectangle("Ground", 10.0, 10.0) if ground == "plane" else terrain("Ground", 10.0, GROUNDS[ground])
    # What stands there are capsules themselves.
    things = collection(capsule("Long", 1.5, 0.3), capsule("Short", 0.9, 0.25))
    size = esh.ScatterSize("all", 75, things, area=area, line=True)
    result = esh.scatter(
        item, [esh.ScatterClass("capsule", [size])], device="cpu", avoid_overlap=True, scale_jitter=0.4, seed=5
    )
    seen = outlines_in_the_scene()
    assert len(seen) == 75 and result.report.overlaps == 0
    assert overlapping(seen) == 0
    assert max(polygon.length for polygon in seen) > 2.0 * min(polygon.length for polygon in seen)
    assert (result.placement.length > 0.0).all()


def test_the_capsules_of_a_line_that_was_given_stay_capsules():
    ground = terrain("Ground", 10.0, GROUNDS["slope"])
    size = esh.ScatterSize("all", 20, rectangle("Box", 1.0, 0.3), area=0.3, line=esh.Line(0.8, width=0.3))
    job = esh.ScatterJob(ground, [esh.ScatterClass("box", [size])], device="cpu", avoid_overlap=True)
    assert job.problem.classes[0].sizes[0].footprint is None


@pytest.mark.parametrize("area", [None, (0.25, 0.45)], ids=["measured", "a range"])
def test_long_objects_that_are_not_to_be_lines_keep_their_outlines_apart(area):
    """As discs of their area, which the report then counted, hundreds of planks lay over each other."""
    item = rectangle("Ground", 9.0, 8.0)
    size = esh.ScatterSize("all", 82, rectangle("Plank", 1.4, 0.25), area=area, line=False)
    result = esh.scatter(item, [esh.ScatterClass("plank", [size])], device="cpu", seed=41)
    assert (result.placement.length == 0.0).all()
    seen = outlines_in_the_scene()
    assert len(seen) == 82 and result.report.overlaps == overlapping(seen) == 0


@pytest.mark.parametrize("area", [math.pi * 0.25, (0.3, 0.9)], ids=["one area", "a range"])
@pytest.mark.parametrize("ground", ["plane", "slope", "hills"])
def test_discs_that_were_asked_for_are_as_large_as_their_objects_and_lean_with_them(ground, area):
    item = rectangle("Ground", 10.0, 10.0) if ground == "plane" else terrain("Ground", 10.0, GROUNDS[ground])
    # What stands there is the disc itself.
    size = esh.ScatterSize("all", 70, disc("Disc", 0.5, 96), area=area, line=False)
    result = esh.scatter(
        item, [esh.ScatterClass("disc", [size])], device="cpu", avoid_overlap=True, scale_jitter=0.4, seed=5
    )
    seen = outlines_in_the_scene()
    assert len(seen) == 70 and result.report.overlaps == 0
    assert overlapping(seen) == 0
    widths = [width_of(polygon) for polygon in seen]
    lengths = [math.hypot(*(np.ptp(np.array(polygon.exterior.coords), axis=0))) for polygon in seen]
    assert max(lengths) > 1.6 * min(lengths)
    if ground == "slope":
        # Foreshortened by 1 / sqrt(1 + 0.9² + 0.6²).
        assert np.median(widths) == pytest.approx(
            np.sqrt(np.median([p.area for p in seen]) * 4.0 / math.pi / 1.473), rel=0.05
        )
    expected = np.mean(area) * 70 * (1.0 + 0.4**2 / 3.0) / 100.0
    surface = 1.0 if ground == "plane" else sum(face.area for face in item.data.polygons) / 100.0
    assert result.report.covered == pytest.approx(expected / surface, rel=0.2)


def test_one_steep_spot_does_not_make_polygons_of_all_discs():
    """Level discs are discs, and the solver parts them faster and more evenly than the polygons around discs that lean."""
    item = terrain("Ground", 10.0, lambda x, y: np.maximum(0.0, 4.0 * (x - 9.95)))
    size = esh.ScatterSize("all", 40, disc("Disc", 0.5, 96), area=math.pi * 0.25)
    result = esh.scatter(item, [esh.ScatterClass("disc", [size])], device="cpu", avoid_overlap=True)
    assert all(given.footprint is None for given in result.placement.problem.classes[0].sizes)
    assert result.report.overlaps == 0 and overlapping(outlines_in_the_scene()) == 0


def test_more_discs_fit_on_a_slope_than_in_its_plan():
    """Seen from above discs of their size would cover 105 %."""
    item = terrain("Ground", 10.0, lambda x, y: 1.2 * x)
    count = round(0.68 * 100.0 * math.hypot(1.0, 1.2) / (math.pi * 0.25))
    size = esh.ScatterSize("all", count, disc("Disc", 0.5, 96), area=math.pi * 0.25)
    result = esh.scatter(item, [esh.ScatterClass("disc", [size])], device="cpu", avoid_overlap=True)
    assert count * math.pi * 0.25 > 105.0
    assert result.report.overlaps == 0 and overlapping(outlines_in_the_scene()) == 0


@pytest.mark.parametrize("origin", [(0.5, 0.2), (-0.5, 0.0), (2.0, 1.0)], ids=["corner", "end", "beside"])
def test_objects_whose_origin_is_at_their_edge_or_beside_them_are_parted_too(origin):
    corners = np.array([(-0.5, -0.2), (0.5, -0.2), (0.5, 0.2), (-0.5, 0.2)]) - origin
    board = flat("board", corners.tolist())
    side = math.sqrt(120 * 0.4 / 0.6)
    bpy.ops.mesh.primitive_plane_add(size=side)
    ground = bpy.context.object
    boards = [esh.ScatterClass("board", [esh.ScatterSize("any", 120, board)])]
    # They turn about their middles, which are on the ground, and not about origins beside them.
    result = esh.scatter(ground, boards, seed=5, device="cpu")
    placed = outlines_in_the_scene()
    assert len(placed) == 120 and result.report.overlaps == overlapping(placed) == 0
    middles = np.array([polygon.centroid.coords[0] for polygon in placed])
    assert (np.abs(middles) <= 0.5 * side + 1e-4).all()
    assert np.allclose(middles, result.placement.position - 0.5 * side, atol=1e-4)
    # Those that stay are known again, wherever their origins are.
    pinned = result.object.data.attributes.new("pinned", "BOOLEAN", "POINT")
    pinned.data.foreach_set("value", np.arange(120) < 5)
    again = esh.scatter(ground, boards, seed=6, device="cpu")
    left = np.array([polygon.centroid.coords[0] for polygon in outlines_in_the_scene()])
    distance = np.linalg.norm(left[:, None] - middles[None, :5], axis=2).min(axis=0)
    assert (distance < 1e-4).all() and again.report.overlaps == 0


def test_an_object_is_on_its_point_with_its_origin_where_that_is_near_its_middle():
    crown = flat("crown", [(-0.45, -0.3), (0.55, -0.3), (0.55, 0.3), (-0.45, 0.3)])
    bpy.ops.mesh.primitive_plane_add(size=12.0)
    result = esh.scatter(
        bpy.context.object, [esh.ScatterClass("crown", [esh.ScatterSize("any", 40, crown)])], device="cpu"
    )
    assert np.allclose(result.instances.position[:, :2], result.placement.position - 6.0, atol=1e-5)
    assert result.report.overlaps == overlapping(outlines_in_the_scene()) == 0


@pytest.mark.parametrize("align", [0.0, 1.0])
def test_origins_beside_the_middle_are_on_the_ground_all_the_same(align):
    """As that of a tree that leans over: on a slope its foot neither floats nor sinks in."""
    crown = flat("crown", [(0.0, -0.3), (1.0, -0.3), (1.0, 0.3), (0.0, 0.3)])
    bpy.ops.mesh.primitive_plane_add(size=12.0, rotation=(math.radians(30.0), 0.0, 0.0))
    bpy.ops.object.transform_apply()
    standing = esh.Standing(align_to_normal=align)
    crowns = [esh.ScatterClass("crown", [esh.ScatterSize("any", 30, crown)], standing=standing)]
    result = esh.scatter(bpy.context.object, crowns, device="cpu")
    y, z = result.instances.position.T[1:]
    assert np.allclose(z, y * math.tan(math.radians(30.0)), atol=1e-4)
    middles = np.array([polygon.centroid.coords[0] for polygon in outlines_in_the_scene()])
    assert np.allclose(middles, result.placement.position - [6.0, 6.0 * math.cos(math.radians(30.0))], atol=1e-4)
    assert result.report.overlaps == 0


def test_outlines_of_what_may_be_turned_over_are_refused():
    ground = rectangle("Ground", 10.0, 10.0)
    classes = [esh.ScatterClass("plank", [esh.ScatterSize("all", 10, rectangle("Plank", 2.0, 0.3))])]
    with pytest.raises(esh.EshError, match="`tilt` must be at most a right angle"):
        esh.scatter(ground, classes, device="cpu", avoid_overlap=True, tilt=2.5)
    assert len(esh.scatter(ground, classes, device="cpu", avoid_overlap=False, tilt=2.5).instances.position) == 10
    in_degrees = float(np.float32(math.radians(90.0)))
    assert in_degrees > 0.5 * math.pi, "as Blender rounds it"
    assert len(esh.scatter(ground, classes, device="cpu", avoid_overlap=True, tilt=in_degrees).instances.position) == 10
