"""Files that change during a run, things that only look like results, and scenes that share one."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh.esh_scatter.api import EshError, ScatterClass, ScatterJob, ScatterSize, scatter  # noqa: E402
from esh.esh_scatter.result.node_group_contents import placed_objects  # noqa: E402
from esh.esh_scatter.result.result import find_result  # noqa: E402
from esh.esh_scatter.targets.references import Reference  # noqa: E402
from esh.esh_scatter.targets.target import RESULT_TAG, RESULT_TARGET, is_result  # noqa: E402

pytestmark = pytest.mark.usefixtures("bare_file")

OPTIONS = {"device": "cpu", "max_steps": 3}


def quad(name, size=10.0):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(0, 0, 0), (size, 0, 0), (size, size, 0), (0, size, 0)], [], [(0, 1, 2, 3)])
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


def classes_of(source, count=12):
    return [ScatterClass("tree", [ScatterSize("any", count, source)])]


def positions(item):
    values = np.empty(3 * len(item.data.vertices), np.float32)
    item.data.vertices.foreach_get("co", values)
    return values.tolist()


def everything():
    return {(kind, item.name) for kind in ("objects", "meshes", "node_groups") for item in getattr(bpy.data, kind)}


@pytest.mark.parametrize(("lost", "named"), [("Ground", "target"), ("Tree", "object to place")])
@pytest.mark.parametrize("when", ["before writing", "in the progress callback"])
def test_what_is_removed_during_a_run_ends_it_in_a_sentence(lost, named, when):
    ground, tree = quad("Ground"), quad("Tree", 0.5)

    def remove(*_):
        if lost in bpy.data.objects:
            bpy.data.objects.remove(bpy.data.objects[lost])
            bpy.ops.outliner.orphans_purge(do_recursive=True)

    with pytest.raises(EshError) as refused:
        if when == "before writing":
            job = ScatterJob(ground, classes_of(tree), **OPTIONS)
            job.solve()
            remove()
            before = everything()
            job.write()
        else:
            try:
                scatter(ground, classes_of(tree), progress=remove, **OPTIONS)
            finally:
                before = everything()
    assert str(refused.value).startswith(
        f'{named} "{lost}" was removed from the file during the run; nothing was placed'
    )
    assert everything() == before and len(bpy.data.objects) == 1


def test_a_scene_that_is_removed_ends_the_run_in_a_sentence():
    first = bpy.context.scene
    second = bpy.data.scenes.new("Second")
    with bpy.context.temp_override(scene=second, view_layer=second.view_layers[0]):
        ground, tree = quad("Ground"), quad("Tree", 0.5)
        job = ScatterJob(ground, classes_of(tree), **OPTIONS)
    job.solve()
    bpy.data.scenes.remove(second)
    assert bpy.context.scene == first
    with pytest.raises(EshError, match='scene "Second" was removed'):
        job.write()


def test_renamed_and_reallocated_objects_are_found_again():
    ground, tree = quad("Ground"), quad("Tree", 0.5)
    job = ScatterJob(ground, classes_of(tree), **OPTIONS)
    job.solve()
    ground.name, tree.name = "Soil", "Ground"
    for k in range(200):
        bpy.data.objects.new(f"{k}", None)
    made = job.write().object
    assert made[RESULT_TARGET] == ground
    assert placed_objects(made.modifiers[0].node_group) == [tree]


def test_a_reference_never_finds_another_object_of_the_same_name():
    item = quad("Ground")
    reference = Reference(item, "target")
    bpy.data.objects.remove(item)
    quad("Ground")
    assert reference.find() is None


def test_a_mesh_that_is_marked_as_a_result_is_none_and_is_never_replaced():
    ground, tree = quad("Ground"), quad("Tree", 0.5)
    fake = quad("My house")
    for item in (fake, fake.data):
        item[RESULT_TAG] = True
    fake[RESULT_TARGET], fake["esh_scatter_name"] = ground, "ESH Scatter"
    assert not is_result(fake) and find_result(bpy.context.scene, ground, "ESH Scatter") is None
    house = fake.data
    made = scatter(ground, classes_of(tree), **OPTIONS).object
    assert made != fake and fake.data == house and len(house.polygons) == 1
    with pytest.raises(EshError, match=r"must be an object that an earlier scatter made; \"My house\" is not one"):
        scatter(ground, classes_of(tree), result=fake, **OPTIONS)
    # And it is a mesh like any other.
    assert len(scatter(fake, classes_of(tree), **OPTIONS).object.data.vertices) == 12
    assert len(scatter(ground, classes_of(fake), **OPTIONS).object.data.vertices) == 12


def test_a_result_of_a_library_is_not_replaced_even_if_asked_for(tmp_path):
    scatter(quad("Ground"), classes_of(quad("Tree", 0.5)), **OPTIONS)
    library = tmp_path / "library.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(library))
    bpy.ops.wm.read_homefile(use_empty=True)
    with bpy.data.libraries.load(str(library), link=True) as (_, wanted):
        wanted.objects = ["Ground", "Tree", "ESH Scatter"]
    for item in wanted.objects:
        bpy.context.scene.collection.objects.link(item)
    ground, tree, result = wanted.objects
    before = positions(result)
    with pytest.raises(EshError, match=r'`result` must belong to this file; "ESH Scatter" is linked from another one'):
        scatter(ground, classes_of(tree), result=result, seed=2, **OPTIONS)
    assert positions(result) == before
    made = scatter(ground, classes_of(tree), seed=2, **OPTIONS).object
    assert made != result and made.is_editable and positions(result) == before


def test_of_a_result_and_its_copy_the_result_is_replaced():
    ground, tree = quad("Ground"), quad("Tree", 0.5)
    first = scatter(ground, classes_of(tree), **OPTIONS).object
    copy = first.copy()
    copy.data = first.data.copy()
    first.name, copy.name = "B", "A"
    bpy.context.scene.collection.objects.link(copy)
    kept = positions(copy)
    assert scatter(ground, classes_of(tree), seed=1, **OPTIONS).object == first
    assert positions(copy) == kept != positions(first)


def test_a_linked_copy_of_a_scene_gets_a_result_of_its_own():
    ground, tree = quad("Ground"), quad("Tree", 0.5)
    first = scatter(ground, classes_of(tree), **OPTIONS).object
    kept, one = positions(first), bpy.context.scene
    other = one.copy()
    assert len(first.users_scene) == 2
    with bpy.context.temp_override(scene=other, view_layer=other.view_layers[0]):
        second = scatter(ground, classes_of(tree), seed=1, **OPTIONS).object
        assert second != first and positions(first) == kept
        # Each scene shows one of them, and replaces that from now on.
        assert set(first.users_scene) == {one} and set(second.users_scene) == {other}
        assert scatter(ground, classes_of(tree), seed=2, **OPTIONS).object == second
    assert positions(first) == kept
    assert scatter(ground, classes_of(tree), seed=3, **OPTIONS).object == first
    assert positions(first) != kept


@pytest.mark.parametrize("turn", [1e39, 1e5, -1.0, float("inf"), float("nan")])
def test_turns_that_float32_cannot_hold_are_refused(turn):
    ground, tree = quad("Ground"), quad("Tree", 0.5)
    with pytest.raises(EshError, match="`random_turn` must be a number between 0 and 10000; got "):
        scatter(ground, classes_of(tree), random_turn=turn, **OPTIONS)


def test_the_largest_turn_gives_unit_quaternions():
    made = scatter(quad("Ground"), classes_of(quad("Tree", 0.5)), random_turn=1e4, **OPTIONS).object
    rotation = np.empty(4 * 12, np.float32)
    made.data.attributes["rotation"].data.foreach_get("value", rotation)
    np.testing.assert_allclose(np.linalg.norm(rotation.reshape(-1, 4), axis=1), 1.0, atol=1e-4)
