"""Collections: each object as often as its weight says, or all of them together at their places."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import esh  # noqa: E402
from esh.esh_scatter.classes.object_outline import measure_footprint  # noqa: E402

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
    # The mean of their areas is weighed, too.
    job = esh.ScatterJob(ground, [esh.ScatterClass("c", [esh.ScatterSize("s", 9, trees, weights={"Oak": 2.0})])])
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
    with pytest.raises(esh.EshError, match='collection "Tree" as one'):
        esh.export_result("tree.usda", result.object)


def test_the_sidebar_has_weights_and_collections_as_one():
    ground, trees = quad("Ground", 40.0), collection_of("Trees")
    ash, oak = (quad(name, 0.2, (50.0, 0.0, 0.0), trees) for name in ("Ash", "Oak"))
    scatter = bpy.context.scene.esh_scatter.add_scatter(ground)
    size = scatter.add_class().sizes[0]
    size.source_kind, size.source_collection = "COLLECTION", trees
    assert [entry.item for entry in size.variants] == [ash, oak] and size.as_argument().weights is None
    scatter.remember(quad("Result", 1.0), {"steps": 3})
    size.variants[1].weight = 3.0
    assert size.as_argument().weights == {"Oak": 3.0} and scatter.changes() == ["weights of Class"]
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
