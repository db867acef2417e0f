"""From selected objects to a scatter: classes, counts, and what the buttons do with many classes."""

import math

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh.engine.problem.scatter_settings import TargetSettings  # noqa: E402
from esh.esh_scatter.classes.sunk_objects import sunk_share_of_class  # noqa: E402
from esh.esh_scatter.editing import selection  # noqa: E402
from esh.esh_scatter.editing.class_copy import copy_class  # noqa: E402
from esh.esh_scatter.editing.selection import SelectionSurvey  # noqa: E402
from mathutils import Matrix  # noqa: E402

pytestmark = pytest.mark.usefixtures("empty_file")


def box(name: str, width: float, depth: float, height: float) -> bpy.types.Object:
    mesh = bpy.data.meshes.new(name)
    corners = [(x, y, z) for z in (0.0, height) for x, y in ((0, 0), (width, 0), (width, depth), (0, depth))]
    faces = [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    mesh.from_pydata(corners, [], faces if height else [(0, 1, 2, 3)])
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


def select(*items: bpy.types.Object, active: bpy.types.Object) -> None:
    for item in bpy.context.scene.objects:
        item.select_set(item in items)
    bpy.context.view_layer.objects.active = active


@pytest.fixture
def ground():
    return box("Ground", 20.0, 20.0, 0.0)


@pytest.fixture
def objects():
    light = bpy.data.objects.new("Light", bpy.data.lights.new("Light", "POINT"))
    bpy.context.scene.collection.objects.link(light)
    return [box("Tree", 1.0, 1.0, 3.0), box("Log", 2.0, 0.2, 0.2), box("Pebble", 0.1, 0.1, 0.05), light]


def test_one_class_per_object_with_pleasant_counts_solved_and_shown(ground, objects):
    select(*objects, ground, active=ground)
    assert bpy.ops.esh.scatter_selection() == {"FINISHED"}
    scatter = bpy.context.scene.esh_scatter.active
    assert scatter.target == ground and scatter.class_index == 0
    assert [c.name for c in scatter.classes] == ["Log", "Pebble", "Tree"], "a light has no footprint"
    assert [c.align_to_normal for c in scatter.classes] == [1.0, 1.0, 0.0], (
        "a tree stands upright, what lies follows the slope"
    )
    counts = {c.name: c.count for c in scatter.classes}
    assert counts["Pebble"] > counts["Log"] > counts["Tree"] > 0
    areas = {"Log": 0.4, "Pebble": 0.01, "Tree": 1.0}
    covered = sum(areas[name] * count for name, count in counts.items()) / 400.0
    assert covered == pytest.approx(0.25, rel=0.02)
    assert len(scatter.result.data.vertices) == sum(counts.values())
    assert not scatter.outdated and scatter.report["overlaps"] == 0


def test_how_high_something_is_counts_all_that_is_shown_of_it_as_it_stands(ground):
    """A stack of slabs that nodes instance is taller than wide, though the slab itself is flat; so is a model with another axis up."""
    slab = box("Slab", 1.0, 1.0, 0.1)
    tree = bpy.data.node_groups.new("Stack", "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    given, line, stack, result = (
        tree.nodes.new(kind)
        for kind in ("NodeGroupInput", "GeometryNodeMeshLine", "GeometryNodeInstanceOnPoints", "NodeGroupOutput")
    )
    tree.links.new(line.outputs[0], stack.inputs["Points"])
    tree.links.new(given.outputs[0], stack.inputs["Instance"])
    tree.links.new(stack.outputs[0], result.inputs[0])
    slab.modifiers.new("Stack", "NODES").node_group = tree
    lying, imported = box("Post", 0.2, 0.2, 3.0), box("Imported", 0.2, 3.0, 0.2)
    lying.rotation_euler.y = imported.rotation_euler.x = 0.5 * math.pi
    bpy.context.view_layer.update()
    ahead = {one.item.name: one.upright for one in selection.measure([slab, lying, imported], bpy.context)[0]}
    assert ahead == {"Slab": True, "Post": False, "Imported": True}
    select(slab, ground, active=ground)
    bpy.ops.esh.scatter_selection(most=9)
    assert [c.align_to_normal for c in bpy.context.scene.esh_scatter.active.classes] == [0.0]


def test_a_card_with_grass_on_it_stands_upright_and_takes_the_ground_of_a_disc_around_it(ground):
    """Its only face stands upright, and covers nothing seen from above."""
    card = box("Grass", 0.5, 0.3, 0.0)
    card.rotation_euler.x = 0.5 * math.pi
    card.rotation_euler.z = 0.3
    edge = bpy.data.objects.new("Edge", bpy.data.curves.new("Edge", "CURVE"))
    bpy.context.scene.collection.objects.link(edge)
    bpy.context.view_layer.update()
    select(card, edge, ground, active=ground)
    assert bpy.ops.esh.scatter_selection(most=50) == {"FINISHED"}
    scatter = bpy.context.scene.esh_scatter.active
    (body_class,) = scatter.classes
    size = body_class.sizes[0]
    assert (size.area_kind, body_class.align_to_normal, scatter.report["overlaps"]) == ("MESH", 0.0, 0)
    place = np.array([vertex.co for vertex in scatter.result.data.vertices])
    gap = np.linalg.norm(place[:, None] - place[None], axis=-1)[~np.eye(len(place), dtype=bool)]
    assert len(place) == 50 and gap.min() > 0.49
    counted = scatter.classes[0].count
    assert bpy.ops.esh.classes_from_selection(count=7) == {"FINISHED"}
    assert [(c.count, c.sizes[0].area_kind) for c in scatter.classes] == [(counted, "MESH"), (7, "MESH")]
    # As one of several, too.
    cards = bpy.data.collections.new("Cards")
    bpy.context.scene.collection.children.link(cards)
    for one in (card, box("Stone", 0.3, 0.3, 0.2)):
        cards.objects.link(one)
    size.source_kind, size.source_collection = "COLLECTION", cards
    assert bpy.ops.esh.scatter() == {"FINISHED"} and scatter.report["overlaps"] == 0


@pytest.mark.parametrize(("below", "stand_on"), [(0.0, "ORIGIN"), (0.5, "ORIGIN"), (1.5, "LOWEST"), (-0.5, "ORIGIN")])
def test_what_has_its_origin_in_its_middle_stands_on_its_lowest_point(ground, objects, below, stand_on):
    tree = objects[0]
    tree.data.transform(Matrix.Translation((0.0, 0.0, -below)))
    select(tree, ground, active=ground)
    bpy.ops.esh.scatter_selection()
    scatter = bpy.context.scene.esh_scatter.active
    assert scatter.classes[0].stand_on == stand_on, "roots are meant to be in the ground"
    mesh = scatter.result.data
    heights = {round(vertex.co.z, 4) for vertex in mesh.vertices}
    assert heights == {below if stand_on == "LOWEST" else 0.0}


def heights_above(ground, name):
    """Return how high the points of a class are above the flat ground."""
    scatter = bpy.context.scene.esh_scatter.active
    mesh = scatter.result.data
    number = [c.name for c in scatter.classes].index(name)
    of = np.array([one.value for one in mesh.attributes["class_index"].data])
    return np.array([vertex.co.z for vertex in mesh.vertices])[of == number] - ground.location.z


def test_what_is_flat_lies_a_little_above_the_ground_and_all_else_on_it(ground, objects):
    leaf, card = box("Leaf", 0.4, 0.2, 0.0), box("Card", 0.4, 0.2, 0.0)
    card.rotation_euler.x = 0.5 * math.pi
    bpy.context.view_layer.update()
    select(*objects, leaf, card, ground, active=ground)
    bpy.ops.esh.scatter_selection()
    offsets = {c.name: c.offset for c in bpy.context.scene.esh_scatter.active.classes}
    assert offsets.pop("Leaf") == pytest.approx(0.008) and not any(offsets.values())
    assert heights_above(ground, "Leaf") == pytest.approx(0.008, abs=1e-5)
    assert heights_above(ground, "Log") == pytest.approx(0.0, abs=1e-5)


def test_of_flat_objects_that_were_chosen_by_hand_it_is_said_and_one_click_lifts_them(scatter):
    body_class = scatter.classes[scatter.class_index]
    size = body_class.sizes[0]
    assert not bpy.ops.esh.class_lift.poll(), "a log is thick"
    size.source_object = box("Leaf", 0.4, 0.2, 0.0)
    bpy.context.view_layer.update()
    body_class.scale = 2.0
    assert bpy.ops.esh.class_lift() == {"FINISHED"} and body_class.offset == pytest.approx(0.016)
    assert not bpy.ops.esh.class_lift.poll(), "once is enough"
    body_class.offset, body_class.scale = 0.0, 1.0
    size.area_kind, size.area = "VALUE", 0.02
    bpy.ops.esh.class_lift()
    assert body_class.offset == pytest.approx(0.004), "of a quarter of the ground, half as long"


def test_of_objects_that_are_half_sunk_it_is_said_and_one_click_has_them_stand_on_their_lowest_points(scatter):
    body_class = scatter.classes[scatter.class_index]
    size = body_class.sizes[0]
    assert not bpy.ops.esh.class_raise.poll(), "its origin is at its foot"
    size.source_object = crate = box("Crate", 1.0, 1.0, 1.0)
    for low, share in ((-0.5, 0.5), (-0.2, 0.0), (-1.0, 0.0)):
        crate.data.transform(Matrix.Translation((0.0, 0.0, low - crate.data.vertices[0].co.z)))
        bpy.context.view_layer.update()
        assert sunk_share_of_class(body_class) == pytest.approx(share), "roots are in the ground, and lamps hang"
    crate.rotation_euler.x = math.pi
    crate.data.transform(Matrix.Translation((0.0, 0.0, 0.6)))
    bpy.context.view_layer.update()
    assert sunk_share_of_class(body_class) == pytest.approx(0.6), "as it is turned"
    assert bpy.ops.esh.class_raise() == {"FINISHED"} and body_class.stand_on == "LOWEST"
    assert not bpy.ops.esh.class_raise.poll(), "once is enough"


def test_collections_that_are_placed_as_one_are_looked_into_for_what_is_half_sunk(scatter):
    body_class = scatter.classes[scatter.class_index]
    size = body_class.sizes[0]
    stack = bpy.data.collections.new("Stack")
    for name, z in (("Lower", 5.0), ("Upper", 6.0)):
        part = box(name, 1.0, 1.0, 1.0)
        part.location.z = z
        bpy.context.scene.collection.objects.unlink(part)
        stack.objects.link(part)
    # Two meters, of which the offset is at a quarter, a half, and at the foot.
    size.source_kind, size.source_collection = "ASSET", stack
    for offset, share in ((5.5, 0.0), (6.0, 0.5), (5.0, 0.0)):
        stack.instance_offset.z = offset
        assert sunk_share_of_class(body_class) == pytest.approx(share)
    stack.instance_offset.z = 6.0
    empty = bpy.data.objects.new("Stacked", None)
    empty.instance_type, empty.instance_collection, empty.location.z = "COLLECTION", stack, 9.0
    bpy.context.scene.collection.objects.link(empty)
    bpy.context.view_layer.update()
    size.source_kind, size.source_object = "OBJECT", empty
    assert sunk_share_of_class(body_class) == pytest.approx(0.5), "what an empty shows, too"
    size.source_kind = "ASSET"
    assert bpy.ops.esh.class_raise() == {"FINISHED"} and body_class.stand_on == "LOWEST"
    assert sunk_share_of_class(body_class) == 0.0
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    assert heights_above(scatter.target, body_class.name) == pytest.approx(1.0, abs=1e-5)


def test_an_object_far_from_its_origin_is_not_left_in_the_air(ground):
    """Its location was applied while it stood on a shelf, and there it floated, five times as high as it is."""
    crate, crown = box("Crate", 1.0, 1.0, 1.0), box("Crown", 1.0, 1.0, 1.0)
    crate.data.transform(Matrix.Translation((30.0, 7.0, 5.0)))
    crown.data.transform(Matrix.Translation((-0.5, -0.5, 5.0)))
    bpy.context.view_layer.update()
    select(crate, crown, ground, active=ground)
    assert bpy.ops.esh.scatter_selection(cover=0.05, most=20) == {"FINISHED"}
    scatter = bpy.context.scene.esh_scatter.active
    stand_on = {one.name: one.stand_on for one in scatter.classes}
    assert stand_on == {"Crate": "LOWEST", "Crown": "ORIGIN"}, "what is above its origin is meant to be there"
    assert heights_above(ground, "Crate") == pytest.approx(-5.0, abs=1e-5)


def test_a_tree_whose_trunk_stands_on_its_origin_is_not_sunk_though_leaves_hang_below(ground):
    trunk, leaves = box("Trunk", 0.3, 0.3, 2.0), box("Leaves", 1.0, 1.0, 4.0)
    leaves.parent, leaves.location.z = trunk, -2.0
    select(trunk, ground, active=ground)
    bpy.ops.esh.scatter_selection()
    body_class = bpy.context.scene.esh_scatter.active.classes[0]
    assert body_class.stand_on == "ORIGIN" and sunk_share_of_class(body_class) == 0.0
    trunk.data.transform(Matrix.Translation((0.0, 0.0, -1.0)))
    bpy.context.view_layer.update()
    assert sunk_share_of_class(body_class) == pytest.approx(0.5)


def test_cover_most_mixing_and_seed_can_be_tuned(ground, objects):
    select(*objects, ground, active=ground)
    bpy.ops.esh.scatter_selection(cover=0.05, most=60, class_separation=0.9, boundary="OPEN", seed=5)
    scatter = bpy.context.scene.esh_scatter.active
    assert scatter.boundary == "OPEN"
    assert sum(c.count for c in scatter.classes) == pytest.approx(60, abs=2)
    assert (scatter.seed, scatter.class_separation) == (5, pytest.approx(0.9))


def test_small_objects_are_spread_evenly_among_large_ones(ground, objects):
    """Pebbles among trees stood in rows between these, with all ground beside them empty, and the status said "even"."""
    tree, _, pebble, _ = objects
    select(tree, pebble, ground, active=ground)
    assert bpy.ops.esh.scatter_selection(boundary="OPEN") == {"FINISHED"}
    scatter = bpy.context.scene.esh_scatter.active
    # Of independent random points the mean is half of this unit, of a hexagonal lattice 1.07.
    apart = nearest_in_class(scatter, pebble.name)
    assert apart.mean() > 0.8 and np.percentile(apart, 5) > 0.55
    assert scatter.report["overlaps"] == 0


def nearest_in_class(scatter, name):
    """How far each object of a class is from the nearest other one, in units of the root of the ground that each has."""
    mesh = scatter.result.data
    place, of_class = np.empty(3 * len(mesh.vertices), np.float32), np.empty(len(mesh.vertices), np.int32)
    mesh.attributes["position"].data.foreach_get("vector", place)
    mesh.attributes["class_index"].data.foreach_get("value", of_class)
    number = [one.name for one in scatter.ready_classes()].index(name)
    own = place.reshape(-1, 3)[of_class == number, :2]
    away = np.linalg.norm(own[:, None] - own, axis=2)
    np.fill_diagonal(away, np.inf)
    return away.min(axis=1) / np.sqrt(scatter.target.data.polygons[0].area / len(own))


def test_that_most_has_held_the_number_is_told(ground, objects, capfd):
    select(*objects, ground, active=ground)
    bpy.ops.esh.scatter_selection(most=60)
    said = capfd.readouterr().out
    wanted = sum(selection.pleasant_counts([1.0, 0.4, 0.01], 400.0, 0.25, 100_000))
    told = f"Held at 60 by Max Objects: 25% cover would take {wanted:,}"
    assert told in said and bpy.context.scene.esh_scatter.active.report["held"] == told
    bpy.ops.esh.scatter()
    assert not bpy.context.scene.esh_scatter.active.report["held"], "by then the count is the user's own"
    bpy.ops.esh.scatter_remove()
    select(*objects, ground, active=ground)
    bpy.ops.esh.scatter_selection(most=wanted + 10)
    assert "Held at" not in capfd.readouterr().out


@pytest.mark.once
def test_a_selection_asks_for_what_fits_between_what_stands_there(ground, objects, capfd):
    for item in (objects[0], objects[1], objects[0]):
        select(item, ground, active=ground)
        assert bpy.ops.esh.scatter_selection() == {"FINISHED"}
        assert bpy.context.scene.esh_scatter.active.report["overlaps"] == 0
    said = capfd.readouterr().out
    counts = [sum(c.count for c in scatter.classes) for scatter in bpy.context.scene.esh_scatter.scatters]
    assert counts[0] == pytest.approx(100, abs=1) and counts[2] < counts[0]
    assert f"Only {counts[2]} of " in said and bpy.context.scene.esh_scatter.active.report["held"].startswith("Only ")
    # On another ground there is all of it.
    other = box("Other", 20.0, 20.0, 0.0)
    select(objects[0], other, active=other)
    bpy.ops.esh.scatter_selection()
    assert bpy.context.scene.esh_scatter.active.classes[0].count == counts[0]


def test_the_ground_that_was_not_selected_last_is_named(ground, objects):
    select(*objects, ground, active=objects[0])
    with pytest.raises(
        RuntimeError, match='"Ground" is larger than "Tree", which is taken for the ground: select the ground last'
    ):
        bpy.ops.esh.scatter_selection()
    assert not bpy.context.scene.esh_scatter.scatters and len(bpy.context.scene.objects) == 5


def test_that_removed_settings_leave_what_they_have_placed_is_told(ground, objects, capfd):
    bpy.ops.esh.scatter_add()
    bpy.ops.esh.scatter_remove()
    assert "stays" not in capfd.readouterr().out, "nothing was placed"
    select(*objects, ground, active=ground)
    bpy.ops.esh.scatter_selection(most=20)
    result = bpy.context.scene.esh_scatter.active.result
    bpy.ops.esh.scatter_remove()
    assert f'"{result.name}" stays in the scene' in capfd.readouterr().out and result.name in bpy.context.scene.objects


def test_rings_cover_as_much_of_the_ground_as_was_asked_for(ground):
    """Others are kept off their insides, too."""
    bpy.ops.mesh.primitive_torus_add(major_radius=1.0, minor_radius=0.1, location=(50.0, 0.0, 0.0))
    select(bpy.context.object, ground, active=ground)
    bpy.ops.esh.scatter_selection(boundary="OPEN")
    assert bpy.context.scene.esh_scatter.active.report["covered"] == pytest.approx(0.25, abs=0.02)


@pytest.mark.once
def test_nothing_lines_up_along_the_edges(ground, objects):
    select(objects[2], ground, active=ground)
    side, crowding = 20.0, {}
    for boundary in ({}, {"boundary": "OPEN"}):
        bpy.ops.esh.scatter_selection(cover=0.02, **boundary)
        place = np.array([vertex.co[:2] for vertex in bpy.context.scene.esh_scatter.active.result.data.vertices])
        spacing = side / math.sqrt(len(place))
        edges = 0.2 * spacing * np.arange(11)
        even = np.diff(side**2 - (side - 2.0 * edges) ** 2) / spacing**2
        crowding[not boundary] = (np.histogram(np.minimum(place, side - place).min(axis=1), edges)[0] / even).max()
    assert crowding[True] < 2.0 < crowding[False], "a hedge has several times as many as there is ground"


def solid(*size, where=(0.0, 0.0, 0.0)):
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=where)
    bpy.context.object.scale = size
    return bpy.context.object


@pytest.mark.parametrize(
    ("shapes", "surface"),
    [
        ("a wall", "WHOLE"),
        ("a wall and a head", "WHOLE"),
        ("a wall on a floor", "ABOVE"),
        ("a thick slab", "ABOVE"),
        ("a slope", "ABOVE"),
        ("a floor that looks down", "ABOVE"),
        ("a cliff", "ABOVE"),
    ],
)
def test_what_is_mostly_walls_or_hidden_is_scattered_on_all_over(objects, shapes, surface):
    """From above a wall would get a row of objects along its top; the bottom of a slab is none that anybody means."""
    ground = bpy.data.collections.new("Shapes")
    bpy.context.scene.collection.children.link(ground)
    if "wall" in shapes:
        ground.objects.link(solid(6.0, 0.3, 3.0, where=(0.0, 3.0, 1.5)))
    if "head" in shapes:
        bpy.ops.mesh.primitive_monkey_add()
        ground.objects.link(bpy.context.object)
    if "slab" in shapes:
        ground.objects.link(solid(10.0, 10.0, 3.0))
    if shapes.split()[1] in ("slope", "floor", "cliff") or "on a floor" in shapes:
        angle = {"slope": 45.0, "cliff": 75.0}.get(shapes.split()[1], 180.0 if "down" in shapes else 0.0)
        bpy.ops.mesh.primitive_plane_add(size=10.0, rotation=(math.radians(angle), 0.0, 0.0))
        ground.objects.link(bpy.context.object)
    survey = SelectionSurvey(ground, objects[2:], bpy.context)
    survey.solve()
    assert survey.settings.surface.upper() == surface
    asked = SelectionSurvey(ground, objects[2:], bpy.context, TargetSettings(surface="above"))
    asked.solve()
    assert asked.settings.surface == "above", "what was chosen is left alone"


def test_the_button_leaves_a_surface_that_was_chosen(objects):
    wall = solid(6.0, 0.3, 3.0)
    for given, made in (({}, "WHOLE"), ({"surface": "ABOVE"}, "ABOVE")):
        select(objects[2], wall, active=wall)
        assert bpy.ops.esh.scatter_selection(cover=0.02, **given) == {"FINISHED"}
        assert bpy.context.scene.esh_scatter.active.surface == made


def test_walls_and_balls_are_scattered_on_all_over(objects):
    """Of a wall nothing is seen from above; which part of others is meant, the panel of the last operation asks."""
    bpy.ops.mesh.primitive_plane_add(size=8.0, rotation=(math.pi / 2.0, 0.0, 0.0))
    wall = bpy.context.object
    select(objects[2], wall, active=wall)
    assert bpy.ops.esh.scatter_selection(cover=0.02) == {"FINISHED"}
    scatter = bpy.context.scene.esh_scatter.active
    assert scatter.surface == "WHOLE" and not scatter.outdated
    assert sum(0.01 * c.count for c in scatter.classes) == pytest.approx(0.02 * 64.0, rel=0.02)
    z = np.array([vertex.co.z for vertex in scatter.result.data.vertices])
    assert np.ptp(z) > 7.0
    bpy.ops.mesh.primitive_uv_sphere_add(radius=2.0)
    ball, low = bpy.context.object, {}
    select(objects[2], ball, active=ball)
    for surface in ("ABOVE", "WHOLE"):
        bpy.ops.esh.scatter_selection(cover=0.02, surface=surface)
        scatter = bpy.context.scene.esh_scatter.active
        assert scatter.surface == surface
        low[surface] = min(vertex.co.z for vertex in scatter.result.data.vertices)
    assert low["WHOLE"] < -1.5 < -0.1 < low["ABOVE"]
    assert bpy.ops.esh.scatter_selection.get_rna_type().properties["surface"].is_skip_save, "the next ground is another"


def test_with_only_the_ground_selected_the_active_collection_is_placed(ground, objects):
    select(ground, active=ground)
    assert not bpy.ops.esh.scatter_selection.poll()
    plants = bpy.data.collections.new("Plants")
    bpy.context.scene.collection.children.link(plants)
    plants.objects.link(objects[0])
    plants.objects.link(ground)
    layer = bpy.context.view_layer.layer_collection
    bpy.context.view_layer.active_layer_collection = layer.children["Plants"]
    assert bpy.ops.esh.scatter_selection(most=20) == {"FINISHED"}
    assert [c.name for c in bpy.context.scene.esh_scatter.active.classes] == ["Tree"]


@pytest.mark.parametrize(
    ("what", "said"),
    [
        ("nothing else", "Select the objects to place as well"),
        ("light is active", "which must be a mesh"),
    ],
)
def test_the_button_says_what_to_select(ground, objects, what, said):
    select(ground, active=ground)
    if what == "light is active":
        select(*objects, active=objects[3])
    with pytest.raises(RuntimeError, match=said):
        bpy.ops.esh.scatter_selection()


def test_of_ground_that_an_empty_only_shows_it_is_said_how_it_becomes_ground(ground, objects):
    """A terrain of a library is linked as an instance; its mesh was called deleted."""
    terrain, empty = bpy.data.collections.new("Terrain"), bpy.data.objects.new("Land", None)
    terrain.objects.link(ground)
    bpy.context.scene.collection.objects.unlink(ground)
    bpy.context.scene.collection.objects.link(empty)
    empty.instance_type, empty.instance_collection = "COLLECTION", terrain
    select(objects[0], empty, active=empty)
    said = '"Land" only shows its objects: Object > Apply > Make Instances Real, and select the ground among them'
    with pytest.raises(RuntimeError, match=said):
        bpy.ops.esh.scatter_selection()
    bpy.ops.esh.scatter_add()
    scatter = bpy.context.scene.esh_scatter.active
    scatter.target = ground
    assert scatter.obstacle(bpy.context.scene) == said
    bpy.data.objects.remove(empty)
    assert "no longer in this scene" in scatter.obstacle(bpy.context.scene)


def test_what_takes_no_ground_is_left_out_and_nothing_else_changes_nothing(ground, objects, capfd):
    edge = bpy.data.objects.new("Edge", bpy.data.curves.new("Edge", "CURVE"))
    bpy.context.scene.collection.objects.link(edge)
    bpy.context.view_layer.update()
    select(edge, ground, active=ground)
    with pytest.raises(RuntimeError, match="None of the objects has faces; curves get some by a Bevel"):
        bpy.ops.esh.scatter_selection()
    assert len(bpy.context.scene.esh_scatter.scatters) == 0
    wall = box("Wall", 0.0, 0.0, 0.0)
    select(edge, wall, ground, active=ground)
    with pytest.raises(RuntimeError, match="None of the objects covers ground"):
        bpy.ops.esh.scatter_selection()
    select(edge, objects[0], ground, active=ground)
    capfd.readouterr()
    assert bpy.ops.esh.scatter_selection(most=20) == {"FINISHED"}
    assert "because they have no faces; curves get some by a Bevel: Edge" in capfd.readouterr().out
    assert [c.name for c in bpy.context.scene.esh_scatter.active.classes] == ["Tree"]


def test_metaballs_of_which_nothing_can_be_shown_are_passed_over(ground, objects):
    ball = bpy.data.objects.new("Ball", bpy.data.metaballs.new("Ball"))
    bpy.context.scene.collection.objects.link(ball)
    select(ball, ground, active=ground)
    assert not bpy.ops.esh.scatter_selection.poll()
    select(ball, objects[0], ground, active=ground)
    assert bpy.ops.esh.scatter_selection(most=20) == {"FINISHED"}
    assert [c.name for c in bpy.context.scene.esh_scatter.active.classes] == ["Tree"]


def test_what_the_solver_refuses_leaves_no_settings(ground, objects, monkeypatch):
    from esh.engine.errors import ProblemError
    from esh.esh_scatter import api

    def refuse(*_arguments, **_named):
        raise ProblemError("`count` is too large")

    monkeypatch.setattr(api, "scatter", refuse)
    select(*objects, ground, active=ground)
    with pytest.raises(RuntimeError, match="Count is too large"):
        bpy.ops.esh.scatter_selection()
    assert len(bpy.context.scene.esh_scatter.scatters) == 0


def test_another_tile_of_the_ground_among_the_objects_is_told_of(ground, objects, capfd):
    """Two tiles and a stone were selected, and one tile was placed on the other, in silence."""
    told = "is as large as the ground: to scatter on it as well, choose a collection of both as the target"
    select(*objects, ground, active=ground)
    assert bpy.ops.esh.scatter_selection(most=20) == {"FINISHED"}
    assert told not in capfd.readouterr().out
    bpy.ops.esh.scatter_remove()
    select(*objects, box("Tile", 20.0, 20.0, 0.0), box("Tower", 20.0, 20.0, 90.0), ground, active=ground)
    assert bpy.ops.esh.scatter_selection(most=20) == {"FINISHED"}
    said = capfd.readouterr().out
    assert said.count(told) == 1 and f'"Tile" {told}' in said


def test_counts_are_in_inverse_proportion_to_widths():
    assert selection.pleasant_counts([4.0, 1.0, 0.25], 350.0, 0.5, 10_000) == [25, 50, 100]
    assert selection.pleasant_counts([1.0, 1.0], 1e6, 0.5, 100) == [50, 50]
    assert selection.pleasant_counts([100.0], 1.0, 0.1, 100) == [1]
    assert selection.pleasant_counts([], 1.0, 0.1, 100) == []


@pytest.fixture
def scatter(ground, objects):
    made = bpy.context.scene.esh_scatter.add_scatter(ground)
    for item in objects[:3]:
        body_class = made.add_class()
        body_class.name = item.name
        body_class.sizes[0].source_object = item
    return made


def test_a_duplicate_has_everything_but_the_number(scatter):
    scatter.class_index = 1
    log = scatter.classes[1]
    log.add_layer("IMAGE", image=bpy.data.images.new("where", 4, 4), strength=0.5)
    log.tilt, log.count_kind, log.distance, log.use_unsharp = 0.25, "DISTANCE", 3.5, True
    second = log.add_size()
    second.name, second.source_object, second.area_kind, second.area = (
        "Short",
        bpy.data.objects["Pebble"],
        "VALUE",
        0.125,
    )
    bpy.ops.esh.class_duplicate()
    assert [c.name for c in scatter.classes] == ["Tree", "Log", "Log 2", "Pebble"] and scatter.class_index == 2
    log, copy = scatter.classes[1], scatter.classes[2]
    assert copy.uid != log.uid and tuple(copy.color) != tuple(log.color)
    for told in copy.bl_rna.properties:
        if told.identifier not in {
            "rna_type",
            "name",
            "known_name",
            "named_after",
            "uid",
            "color",
            "sizes",
            "size_index",
            "layers",
        }:
            assert str(getattr(copy, told.identifier)) == str(getattr(log, told.identifier)), told.identifier
    assert [(one.kind, one.image, one.strength) for one in copy.layers] == [("IMAGE", bpy.data.images["where"], 0.5)]
    assert [(s.name, s.source, s.area) for s in copy.sizes] == [(s.name, s.source, s.area) for s in log.sizes]


def test_settings_are_copied_to_the_chosen_classes_only(scatter, capfd):
    scatter.class_index = 0
    tree, log, pebble = scatter.classes
    tree.scale_jitter, tree.sizes[0].count = 0.25, 7
    tree.add_layer("ATTRIBUTE", attribute="wet")
    pebble.add_layer("NOISE")
    tree.may_overlap = "Log"
    bpy.ops.esh.class_copy(what={"STANDING"}, classes={str(pebble.uid)})
    assert "Copied settings to 1 class\n" in capfd.readouterr().out
    assert (pebble.scale_jitter, pebble.layers[0].kind, pebble.count) == (0.25, "NOISE", 100)
    assert log.scale_jitter == 0.0
    bpy.ops.esh.class_copy(what={"DENSITY", "COUNT"}, classes={str(log.uid), str(pebble.uid)})
    assert [(c.layers[0].kind, c.count) for c in scatter.classes] == [("ATTRIBUTE", 7)] * 3
    assert pebble.sizes[0].source == bpy.data.objects["Tree"]


def test_one_class_has_no_other_to_copy_to(scatter):
    assert bpy.ops.esh.class_copy.poll()
    for _ in range(2):
        bpy.ops.esh.class_remove()
    assert len(scatter.classes) == 1 and not bpy.ops.esh.class_copy.poll()


def test_the_names_of_a_dialog_that_is_open_stay_in_memory(scatter):
    """Blender shows what it was given, also after it has asked again: one class had the name of another."""
    from esh.esh_scatter.operators.classes import _list_other_classes

    scatter.class_index = 0
    given = list(_list_other_classes(None, bpy.context))
    again = list(_list_other_classes(None, bpy.context))
    assert [one[1] for one in given] == [one.name for one in scatter.classes][1:] and given == again
    assert all(
        one is other
        for before, after in zip(given, again, strict=True)
        for one, other in zip(before, after, strict=True)
    )


def test_every_property_of_a_class_belongs_to_one_part():
    from esh.esh_scatter.editing.class_copy import CLASS_PARTS
    from esh.esh_scatter.properties.body_class import ESH_PG_class

    parts = [name for _, _, names in CLASS_PARTS.values() for name in names]
    own = {"rna_type", "name", "known_name", "uid", "color", "size_index", "mute", "show_viewport", "show_render"}
    own |= {"waits_for_first", "named_after"}
    assert len(parts) == len(set(parts))
    assert set(parts) | own == {told.identifier for told in ESH_PG_class.bl_rna.properties}


def test_classes_come_from_a_selection_or_a_collection(scatter, objects, ground):
    select(objects[0], objects[3], ground, active=ground)
    bpy.ops.esh.classes_from_selection(count=12)
    assert [(c.name, c.count) for c in scatter.classes][3:] == [("Tree 2", 12)]
    select(ground, active=ground)
    assert not bpy.ops.esh.classes_from_selection.poll()
    plants = bpy.data.collections.new("Plants")
    for item in objects:
        plants.objects.link(item)
    bpy.ops.esh.classes_from_collection(collection="Plants", count=3)
    assert [c.name for c in scatter.classes][4:] == ["Log 2", "Pebble 2", "Tree 3"]
    with pytest.raises(RuntimeError, match='no collection "Nothing"'):
        bpy.ops.esh.classes_from_collection(collection="Nothing")


def test_sorting_keeps_the_selected_class(scatter):
    scatter.classes[2].sizes[0].count = 500
    scatter.class_index = 2
    bpy.ops.esh.classes_sort(by="NAME")
    assert [c.name for c in scatter.classes] == ["Log", "Pebble", "Tree"] and scatter.class_index == 1
    bpy.ops.esh.classes_sort(by="COUNT")
    assert scatter.classes[0].name == "Pebble" and scatter.class_index == 0


def test_may_overlap_is_switched_for_both(scatter):
    scatter.classes[1].may_overlap = "Tree"
    scatter.class_index = 0
    tree, log, pebble = scatter.classes
    assert tree.overlaps_with(log)
    bpy.ops.esh.class_overlap(other="Log")
    assert not tree.overlaps_with(log) and log.may_overlap == ""
    bpy.ops.esh.class_overlap(other="Pebble")
    assert pebble.overlaps_with(tree) and scatter.non_overlap() is not None
    with pytest.raises(RuntimeError, match="no other class"):
        bpy.ops.esh.class_overlap(other="Tree")


def test_a_class_with_a_comma_in_its_name_may_overlap(scatter):
    tree, log, pebble = scatter.classes
    log.name = "Pebble, Log"
    scatter.class_index = 0
    bpy.ops.esh.class_overlap(other="Pebble, Log")
    assert tree.overlaps_with(log) and not tree.overlaps_with(pebble)
    log.name = "Oak, red"
    assert tree.overlaps_with(log)
    bpy.ops.esh.class_overlap(other="Oak, red")
    assert not tree.overlaps_with(log) and tree.may_overlap == ""


def test_another_scatter_is_chosen(scatter, ground):
    bpy.context.scene.esh_scatter.add_scatter(ground)
    bpy.ops.esh.scatter_choose(index=0)
    assert bpy.context.scene.esh_scatter.active == scatter


def test_where_a_result_is_active_its_ground_is_scattered_on(ground, objects):
    select(*objects, ground, active=ground)
    bpy.ops.esh.scatter_selection()
    settings = bpy.context.scene.esh_scatter
    first = settings.active.result
    # A click on free ground between the objects may pick the result.
    select(objects[0], first, active=first)
    assert bpy.ops.esh.scatter_selection() == {"FINISHED"}
    assert settings.active.target == ground and [c.name for c in settings.active.classes] == ["Tree"]
    select(first, active=first)
    bpy.ops.esh.scatter_add()
    assert settings.active.target == ground and len(settings.scatters) == 3
    # With nothing suitable active, it is the ground of the scatter that the sidebar shows.
    select(objects[3], active=objects[3])
    bpy.ops.esh.scatter_add()
    assert settings.active.target == ground and len(settings.scatters) == 4


def test_a_result_on_a_collection_stands_for_the_collection(ground, objects):
    grounds = bpy.data.collections.new("Grounds")
    bpy.context.scene.collection.children.link(grounds)
    grounds.objects.link(ground)
    settings = bpy.context.scene.esh_scatter
    one = settings.add_scatter(grounds).add_class().sizes[0]
    one.source_object, one.count = objects[0], 20
    assert settings.active.chosen_target == grounds
    bpy.ops.esh.scatter()
    result = settings.active.result
    select(objects[1], result, active=result)
    assert bpy.ops.esh.scatter_selection() == {"FINISHED"}
    assert settings.active.chosen_target == grounds and settings.active.report["overlaps"] == 0


def test_the_result_of_the_scatter_that_is_shown_is_exported_where_none_is_active(ground, objects, tmp_path):
    select(ground, active=ground)
    assert not bpy.ops.esh.export.poll()
    select(objects[0], ground, active=ground)
    bpy.ops.esh.scatter_selection(most=5)
    path = tmp_path / "trees.ply"
    assert bpy.ops.esh.export(filepath=str(path)) == {"FINISHED"} and path.stat().st_size > 100


def test_what_is_longer_than_the_ground_is_left_out_and_does_not_block_the_others(ground):
    plank, tree = box("Plank", 30.0, 0.5, 0.2), box("Tree", 1.0, 1.0, 3.0)
    select(plank, tree, ground, active=ground)
    assert bpy.ops.esh.scatter_selection(most=40) == {"FINISHED"}
    assert [c.name for c in bpy.context.scene.esh_scatter.active.classes] == ["Tree"]
    select(plank, ground, active=ground)
    with pytest.raises(RuntimeError, match="None of the objects fits on the ground"):
        bpy.ops.esh.scatter_selection()


@pytest.mark.parametrize("degrees", [0, 60, 75, 80])
def test_trees_on_a_steep_plane_are_no_more_than_stand_there(degrees):
    ground = box("Ground", 6.0, 6.0, 0.0)
    ground.rotation_euler.x = math.radians(degrees)
    bpy.context.view_layer.update()
    select(box("Tree", 0.2, 0.2, 0.5), ground, active=ground)
    assert bpy.ops.esh.scatter_selection() == {"FINISHED"}
    report = bpy.context.scene.esh_scatter.active.report
    assert report["overlaps"] == 0
    # Of what is seen from above.
    assert report["classes"][0]["sizes"][0]["placed"] == pytest.approx(225 * math.cos(math.radians(degrees)), rel=0.05)


def test_what_cannot_be_placed_is_named(ground):
    light = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    bpy.context.scene.collection.objects.link(light)
    select(light, ground, active=ground)
    with pytest.raises(RuntimeError, match=r'"Lamp" cannot be placed: select meshes$'):
        bpy.ops.esh.scatter_selection()


def family(name: str, *items: bpy.types.Object) -> bpy.types.Collection:
    made = bpy.data.collections.new(name)
    for item in items:
        made.objects.link(item)
    return made


def added_by_hand(ground):
    select(ground, active=ground)
    if bpy.context.scene.esh_scatter.active is None:
        bpy.ops.esh.scatter_add()
    assert bpy.ops.esh.class_add() == {"FINISHED"}
    return bpy.context.scene.esh_scatter.active.active_class


def test_a_class_added_by_hand_stands_upright_where_its_first_object_is_a_tree(ground, objects):
    tree, log, *_ = objects
    kinds = {"OBJECT": (tree, log), "ASSET": (family("A tree", tree), family("A log", log)), "COLLECTION": ()}
    kinds["COLLECTION"] = kinds["ASSET"]
    for kind, sources in kinds.items():
        for source, align in zip(sources, (0.0, 1.0), strict=True):
            body_class = added_by_hand(ground)
            size = body_class.sizes[0]
            size.source_kind = kind
            setattr(size, "source_object" if kind == "OBJECT" else "source_collection", source)
            assert body_class.align_to_normal == align, (kind, source.name)
    pine = added_by_hand(ground)
    pine.sizes[0].source_object = None
    pine.sizes[0].source_object = log
    pine.sizes[0].source_object = tree
    assert pine.align_to_normal == 1.0, "only the first says how it stands"


def test_how_a_class_stands_is_left_alone_where_it_was_set_or_nobody_added_it_by_hand(ground, objects):
    tree = objects[0]
    body_class = added_by_hand(ground)
    body_class.align_to_normal = 0.75
    body_class.sizes[0].source_object = tree
    assert body_class.align_to_normal == 0.75
    scatter = bpy.context.scene.esh_scatter.active
    by_script = scatter.add_class()
    by_script.sizes[0].source_object = tree
    assert by_script.align_to_normal == 1.0
    assert bpy.ops.esh.class_duplicate() == {"FINISHED"}
    assert scatter.active_class.sizes[0].source_object == tree and scatter.active_class.align_to_normal == 1.0
    copied = added_by_hand(ground)
    copy_class(by_script, copied, ("COUNT",))
    assert copied.sizes[0].source_object == tree and copied.align_to_normal == 1.0, (
        "as the class that it is copied from"
    )
