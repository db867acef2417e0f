"""Collections: each object as often as its weight says, or all of them together at their places."""

import time

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import esh  # noqa: E402
from esh.esh_scatter.classes.object_outline import measure_footprint  # noqa: E402
from esh.esh_scatter.result import pins  # noqa: E402
from esh.esh_scatter.result.node_group_contents import placing_inputs  # noqa: E402
from esh.esh_scatter.solving import live  # noqa: E402
from esh.esh_scatter.targets import mesh_attributes  # noqa: E402

pytestmark = pytest.mark.usefixtures("empty_file")


def quad(name, width, at=(0.0, 0.0, 0.0), collection=None):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(0, 0, 0), (width, 0, 0), (width, width, 0), (0, width, 0)], [], [(0, 1, 2, 3)])
    item = bpy.data.objects.new(name, mesh)
    (collection or bpy.context.scene.collection).objects.link(item)
    item.location = at
    return item


def collection_of(name):
    made = bpy.data.collections.new(name)
    bpy.context.scene.collection.children.link(made)
    return made


def placed(ground, size, **more):
    return esh.scatter(ground, [esh.ScatterClass("c", [size], **more)], device="cpu", max_steps=3, seed=2)


def test_objects_of_a_collection_are_placed_as_often_as_their_weights_say():
    ground, trees = quad("Ground", 40.0), collection_of("Trees")
    for name, width in (("Ash", 0.2), ("Birch", 0.3), ("Oak", 0.4)):
        quad(name, width, (50.0, 0.0, 0.0), trees)
    even = placed(ground, esh.ScatterSize("s", 900, trees)).instances.source
    np.testing.assert_allclose(np.bincount(even) / 900, 1 / 3, atol=0.06)
    same = placed(ground, esh.ScatterSize("s", 900, trees, weights={"Ash": 2.0, "Birch": 2.0, "Oak": 2.0}))
    np.testing.assert_array_equal(same.instances.source, even)
    weighted = placed(ground, esh.ScatterSize("s", 900, trees, weights={"Oak": 6.0, "Ash": 0.0, "Gone": 9.0}))
    share = np.bincount(weighted.instances.source, minlength=3) / 900
    names = [source.name for source in weighted.sources]
    assert share[names.index("Ash")] == 0.0 and share[names.index("Oak")] == pytest.approx(6 / 7, abs=0.05)
    # The mean of their areas is weighed, too, where all take as much ground.
    classes = [esh.ScatterClass("c", [esh.ScatterSize("s", 9, trees, weights={"Oak": 2.0})])]
    job = esh.ScatterJob(ground, classes, avoid_overlap=False)
    assert job.problem.classes[0].sizes[0].area == pytest.approx((0.04 + 0.09 + 2 * 0.16) / 4)


@pytest.mark.parametrize(
    ("weights", "words"),
    [
        ({"Ash": -1.0}, '"Ash" has -1'),
        ([1.0], "by the names of objects"),
        ({"Ash": 0.0, "Oak": 0.0}, "0 for all of them"),
    ],
)
def test_weights_without_meaning_are_named(weights, words):
    ground, trees = quad("Ground", 40.0), collection_of("Trees")
    for name in ("Ash", "Oak"):
        quad(name, 0.2, collection=trees)
    with pytest.raises(esh.ProblemError, match="`weights`") as caught:
        placed(ground, esh.ScatterSize("s", 9, trees, weights=weights))
    assert words in str(caught.value)


def test_what_has_no_faces_is_passed_over_among_the_objects_of_a_collection():
    ground, parts = quad("Ground", 40.0), collection_of("Parts")
    wall, crate = quad("Wall", 1.0, collection=parts), quad("Crate", 0.5, collection=parts)
    guide = bpy.data.objects.new("Guide", bpy.data.curves.new("Guide", "CURVE"))
    parts.objects.link(guide)
    result = placed(ground, esh.ScatterSize("s", 30, parts, weights={"Wall": 2.0, "Guide": 5.0}))
    shown = [one.object.original for one in bpy.context.evaluated_depsgraph_get().object_instances if one.is_instance]
    assert {shown.count(wall) + shown.count(crate), len(shown), len(result.instances.position)} == {30}
    assert shown.count(wall) > shown.count(crate) > 0
    # Of a given area, as it was asked for; and alone it cannot be measured.
    placed(ground, esh.ScatterSize("s", 30, parts, area=0.5))
    parts.objects.unlink(wall)
    parts.objects.unlink(crate)
    with pytest.raises(esh.ProblemError, match='object "Guide" has no faces'):
        placed(ground, esh.ScatterSize("s", 30, parts))


def test_a_collection_as_one_keeps_its_objects_at_their_places():
    ground, tree = quad("Ground", 40.0), collection_of("Tree")
    trunk = quad("Trunk", 0.2, (5.0, 5.0, 0.0), tree)
    leaves = quad("Leaves", 1.0, (1.0, 0.5, 2.0), tree)
    leaves.parent = trunk
    tree.instance_offset = (5.0, 5.0, 0.0)
    bpy.context.view_layer.update()
    result = placed(ground, esh.ScatterSize("s", 30, tree, as_one=True), standing=esh.Standing(scale_jitter=0.2))
    found = {"Trunk": [], "Leaves": []}
    for instance in bpy.context.evaluated_depsgraph_get().object_instances:
        if instance.is_instance:
            found[instance.object.original.name].append(np.array(instance.matrix_world))
    trunks, crowns = np.array(found["Trunk"]), np.array(found["Leaves"])
    assert len(trunks) == len(crowns) == 30
    np.testing.assert_allclose(np.sort(trunks[:, :3, 3], axis=0), np.sort(result.instances.position, axis=0), atol=1e-4)
    # Every crown where its trunk has it.
    local = np.linalg.inv(trunks) @ crowns
    np.testing.assert_allclose(local[:, :3, 3], np.broadcast_to([1.0, 0.5, 2.0], (30, 3)), atol=1e-4)
    # Its ground is what all of it covers.
    outline = measure_footprint(tree)
    assert outline.area > measure_footprint(leaves).area


def test_the_sidebar_has_weights_and_collections_as_one():
    ground, trees = quad("Ground", 40.0), collection_of("Trees")
    ash, oak = (quad(name, 0.2, (50.0, 0.0, 0.0), trees) for name in ("Ash", "Oak"))
    scatter = bpy.context.scene.esh_scatter.add_scatter(ground)
    size = scatter.add_class().sizes[0]
    size.source_kind, size.source_collection = "COLLECTION", trees
    assert [entry.item for entry in size.variants] == [ash, oak] and size.as_argument().weights is None
    scatter.remember(quad("Result", 1.0), {"steps": 3})
    size.variants[1].weight = 3.0
    assert size.as_argument().weights == {"Oak": 3.0} and scatter.changes() == ["weights of Trees"]
    quad("Birch", 0.3, collection=trees)
    assert bpy.ops.esh.variants_list() == {"FINISHED"}
    assert [(entry.item.name, entry.weight) for entry in size.variants] == [("Ash", 1.0), ("Birch", 1.0), ("Oak", 3.0)]
    size.source_kind, trees.instance_offset = "ASSET", (50.0, 0.0, 0.0)
    bpy.data.objects["Birch"].location.x = 50.0
    argument = size.as_argument()
    assert argument.as_one and argument.weights is None and argument.source == trees
    scatter.device, scatter.max_steps, size.count = "CPU", 2, 5
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    shown = [i for i in bpy.context.evaluated_depsgraph_get().object_instances if i.is_instance]
    assert len(shown) == 3 * 5


def higher(name, width, collection=None):
    """Another shape that covers the same ground."""
    item = quad(name, width, collection=collection)
    for vertex in item.data.vertices:
        vertex.co.z = 1.0
    return item


@pytest.fixture
def scattered():
    """Flowers of equal footprint, and trees that differ, as the sidebar has placed them."""
    flowers, trees = collection_of("Flowers"), collection_of("Trees")
    for name in ("Blue", "Red", "White"):
        quad(name, 0.3, (50.0, 0.0, 0.0), flowers)
    for name, width in (("Ash", 0.3), ("Oak", 0.5)):
        quad(name, width, (50.0, 0.0, 0.0), trees)
    scatter = bpy.context.scene.esh_scatter.add_scatter(quad("Ground", 20.0))
    for chosen in (flowers, trees):
        size = scatter.add_class().sizes[0]
        size.source_kind, size.source_collection, size.count = "COLLECTION", chosen, 150
    scatter.device, scatter.max_steps = "CPU", 3
    return scatter


def shown(scatter):
    """Which object stands on every point, by name, in the order of the points."""
    inputs = placing_inputs(scatter.result)
    index = mesh_attributes.read_attribute(scatter.result.data, "instance_index")
    return np.array([inputs[number].default_value.name for number in index.tolist()])


def places(scatter):
    return {
        name: mesh_attributes.read_attribute(scatter.result.data, name).tobytes()
        for name in ("position", "rotation", "scale", "id")
    }


def test_an_object_changed_for_a_collection_is_one_change(scattered):
    scatter, (flowers, trees) = scattered, [one.sizes[0].source_collection for one in scattered.classes]
    size = scatter.classes[0].sizes[0]
    size.source_kind, size.source_object = "OBJECT", flowers.objects[0]
    assert bpy.ops.esh.scatter() == {"FINISHED"} and scatter.changes() == []
    size.source_kind, size.source_collection = "COLLECTION", trees
    assert scatter.changes() == [f"what {scatter.classes[0].name} places"]
    assert bpy.ops.esh.scatter() == {"FINISHED"} and scatter.changes() == []
    size.source_kind = "ASSET"
    assert scatter.changes() == [f"what {scatter.classes[0].name} places"]


@pytest.mark.parametrize("apart", [True, False])
def test_weights_of_objects_with_equal_footprints_are_followed_at_once(scattered, apart):
    scattered.avoid_overlap = apart
    scattered.classes[0].scale_jitter = 0.2
    bpy.ops.esh.scatter()
    where, before = places(scattered), shown(scattered)
    scattered.classes[0].sizes[0].variants[1].weight = 5.0
    now = shown(scattered)
    assert not scattered.outdated and places(scattered) == where, "nothing moves"
    assert (now[:150] == "Red").mean() == pytest.approx(5 / 7, abs=0.12) and (before[:150] == "Red").mean() < 0.5
    np.testing.assert_array_equal(now[150:], before[150:])
    bpy.ops.esh.scatter()
    np.testing.assert_array_equal(shown(scattered), now, "as after another run")
    # None of them at all is a matter for the next run, which says so.
    for entry in scattered.classes[0].sizes[0].variants:
        entry.weight = 0.0
    np.testing.assert_array_equal(np.unique(shown(scattered)[:150]), ["White"])
    assert scattered.outdated


def test_weights_of_objects_with_other_footprints_need_a_run(scattered):
    bpy.ops.esh.scatter()
    before = shown(scattered)
    scattered.classes[1].sizes[0].variants[1].weight = 5.0
    np.testing.assert_array_equal(shown(scattered), before)
    assert scattered.changes() == ["weights of Trees"]
    # Of discs that were asked for, all are alike.
    scattered.classes[1].sizes[0].area_kind, scattered.classes[1].sizes[0].shape = "VALUE", "DOT"
    scattered.classes[1].sizes[0].area = 0.1
    bpy.ops.esh.scatter()
    scattered.classes[1].sizes[0].variants[1].weight = 0.0
    assert not scattered.outdated and (shown(scattered)[150:] == "Ash").all()


def test_pinned_objects_stay_what_they_are(scattered):
    bpy.ops.esh.scatter()
    before = shown(scattered)
    pins.pin(scattered.result.data, np.arange(20))
    bpy.ops.esh.scatter()
    pinned = mesh_attributes.read_attribute(scattered.result.data, "pinned")
    before = shown(scattered)
    scattered.classes[0].sizes[0].variants[0].weight = 0.0
    now = shown(scattered)
    np.testing.assert_array_equal(now[pinned], before[pinned])
    assert "Blue" in before[pinned] and "Blue" not in now[~pinned] and not scattered.outdated


def test_an_object_of_the_same_footprint_takes_the_place_of_another_at_once(scattered):
    size = scattered.classes[1].sizes[0]
    size.source_kind, size.source_object = "OBJECT", quad("Fir", 0.4)
    bpy.ops.esh.scatter()
    where = places(scattered)
    size.source_object = higher("Spruce", 0.4)
    assert not scattered.outdated and (shown(scattered)[150:] == "Spruce").all() and places(scattered) == where
    drawn = [i.object.original.name for i in bpy.context.evaluated_depsgraph_get().object_instances if i.is_instance]
    assert drawn.count("Spruce") == 150 and "Fir" not in drawn
    bpy.ops.esh.scatter()
    assert places(scattered) == where and not scattered.outdated
    size.source_object = quad("Bush", 0.8)
    assert scattered.changes() == ["object of Bush"] and (shown(scattered)[150:] == "Spruce").all()


def test_a_collection_of_the_same_footprints_takes_the_place_of_another_at_once(scattered):
    size = scattered.classes[0].sizes[0]
    size.variants[0].weight = 4.0
    bpy.ops.esh.scatter()
    others = collection_of("Others")
    for name in ("Pink", "Violet", "Yellow"):
        higher(name, 0.3, others)
    size.source_collection = others
    now = shown(scattered)[:150]
    assert not scattered.outdated and set(now) == {"Pink", "Violet", "Yellow"}
    bpy.ops.esh.scatter()
    np.testing.assert_array_equal(shown(scattered)[:150], now, "their weights are even again")
    # What another class places, too, would change there.
    scattered.classes[1].sizes[0].source_collection = others
    bpy.ops.esh.scatter()
    size.source_collection = bpy.data.collections["Flowers"]
    assert scattered.outdated and set(shown(scattered)) == {"Pink", "Violet", "Yellow"}


def test_live_goes_on_with_what_was_chosen_at_once(scattered, follow):
    bpy.ops.esh.scatter()
    scattered.live = True
    follow()
    where = places(scattered)
    scattered.classes[0].sizes[0].variants[2].weight = 0.0
    now = shown(scattered)
    follow()
    assert places(scattered) == where and not scattered.outdated and "White" not in now
    np.testing.assert_array_equal(shown(scattered), now)
    numbers = dict(zip(mesh_attributes.read_attribute(scattered.result.data, "id").tolist(), now, strict=True))
    scattered.classes[1].sizes[0].count = 155
    follow()
    after = zip(mesh_attributes.read_attribute(scattered.result.data, "id").tolist(), shown(scattered), strict=True)
    assert all(numbers.get(number, name) == name for number, name in after)
    assert len(scattered.result.data.vertices) == 305 and not scattered.outdated
    # And with what is chosen while it is being solved.
    scattered.classes[1].sizes[0].count = 160
    for one in live._followed.values():
        one._looked = 0.0
    live._tick()
    assert any(one.busy for one in live._followed.values())
    scattered.classes[0].sizes[0].variants[0].weight = 0.0
    follow()
    assert set(shown(scattered)) == {"Red", "Ash", "Oak"} and not scattered.outdated
    assert len(scattered.result.data.vertices) == 310
    scattered.live = False
    live.end(wait=True)


@pytest.mark.alone
def test_a_hundred_thousand_get_other_variants_in_a_moment(scattered, slowness):
    bpy.ops.esh.scatter()
    result, count = scattered.result.data, 100_000
    mesh = bpy.data.meshes.new("Many")
    mesh.vertices.add(count)
    own = np.arange(count) % 150
    for attribute in result.attributes:
        if attribute.name != "position":
            mesh.attributes.new(attribute.name, attribute.data_type, "POINT")
    for attribute in result.attributes:
        mesh_attributes.write_attribute(
            mesh, attribute.name, mesh_attributes.read_attribute(result, attribute.name)[own]
        )
    mesh_attributes.write_attribute(mesh, "id", np.arange(count, dtype=np.int32))
    for name, value in result.items():
        mesh[name] = value
    scattered.result.data = mesh
    started = time.process_time()
    scattered.classes[0].sizes[0].variants[1].weight = 2.0
    took = time.process_time() - started
    assert took < 0.1 * slowness()
    assert (shown(scattered) == "Red").mean() == pytest.approx(0.5, abs=0.01) and not scattered.outdated


def test_variants_of_a_scatter_that_has_lost_its_target_are_listed_all_the_same():
    """The result was to tell of them at once, and there is nothing that it would be a result of: there was a traceback."""
    ground, trees = quad("Ground", 20.0), collection_of("Trees")
    for name in ("Ash", "Oak"):
        quad(name, 0.3, (50.0, 0.0, 0.0), trees)
    made = bpy.context.scene.esh_scatter.add_scatter(ground)
    size = made.add_class().sizes[0]
    size.source_kind, size.source_collection, size.count = "COLLECTION", trees, 20
    made.device, made.max_steps = "CPU", 3
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    made.target_kind = "COLLECTION"
    assert not made.targets and made.result is not None
    quad("Yew", 0.3, (50.0, 0.0, 0.0), trees)
    assert bpy.ops.esh.variants_list() == {"FINISHED"} and len(size.variants) == 3
