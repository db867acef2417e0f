"""Classes that are named after what they place follow where that is renamed, and layers follow groups and maps of the ground."""

from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh.esh_scatter.properties.names import follow_names, outnamed  # noqa: E402
from esh.esh_scatter.result import pins  # noqa: E402
from esh.esh_scatter.sidebar import followed_names  # noqa: E402
from esh.esh_scatter.targets import checksums  # noqa: E402
from esh.esh_scatter.targets.mesh_attributes import read_attribute  # noqa: E402

with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(Path(__file__).parent)
    from drawn_panels import draw_all

pytestmark = pytest.mark.usefixtures("empty_file")


def cone(name):
    bpy.ops.mesh.primitive_cone_add(vertices=24, radius1=0.4, depth=1.0, location=(80, 0, 0))
    bpy.context.object.name = name
    return bpy.context.object


def active():
    return bpy.context.scene.esh_scatter.active


def names():
    return [one.name for one in active().classes]


@pytest.fixture
def made():
    bpy.ops.mesh.primitive_grid_add(size=20, x_subdivisions=30, y_subdivisions=30)
    settings = bpy.context.scene.esh_scatter.add_scatter(bpy.context.object)
    for name in ("Cone", "Cylinder"):
        size = settings.add_class().sizes[0]
        size.source_object, size.count = cone(name), 40
    settings.classes["Cylinder"].may_overlap = "Cone"
    settings.device, settings.max_steps = "CPU", 10
    return settings


def draw_and_wait():
    """Draw the sidebar, and do what it asked to be done in a moment."""
    draw_all()
    if bpy.app.timers.is_registered(followed_names._follow):
        followed_names.detach()
        followed_names._follow()
        return True
    return False


def test_the_sidebar_has_classes_follow_at_once_and_those_that_refer_to_them_know(made):
    bpy.ops.esh.scatter()
    mesh = made.result.data
    mesh.vertices[5].co.x += 0.3
    bpy.ops.esh.scatter()
    assert not draw_and_wait()
    bpy.data.objects["Cone"].name = "Pine"
    assert draw_and_wait() and names() == ["Pine", "Cylinder"] and not draw_and_wait()
    assert made.classes["Cylinder"].may_overlap == "Pine"
    with checksums.now():
        assert not made.outdated
    (one,) = np.flatnonzero(pins.staying(made.result.data))
    stays = read_attribute(made.result.data, "position")[one]
    made.seed += 1
    bpy.ops.esh.scatter()
    now = read_attribute(made.result.data, "position")
    assert np.abs(now - stays).max(axis=1).min() < 1e-4, "what was moved by hand is still of that class"


def test_what_somebody_has_named_keeps_its_name(made):
    made.classes["Cone"].name = "Tall Tree"
    bpy.data.objects["Cone"].name = "Pine"
    assert not draw_and_wait() and names() == ["Tall Tree", "Cylinder"]


def test_a_name_that_another_class_has_is_numbered_once(made):
    made.classes["Cone"].name = "Larch"
    bpy.data.objects["Cylinder"].name = "Larch"
    assert draw_and_wait() and names() == ["Larch", "Larch 2"] and not outnamed(made)
    made.classes["Larch"].name = "Spruce"
    assert not outnamed(made), "a number stays"
    bpy.data.objects["Larch"].name = " Fir "
    follow_names(made)
    assert names() == ["Spruce", "Fir"] and not outnamed(made)


def test_a_class_of_several_sizes_follows_the_one_that_it_was_named_after(made):
    made.class_index = 0
    made.classes[0].add_size().source_object = cone("Bush")
    bpy.data.objects["Bush"].name = "Shrub"
    assert not draw_and_wait()
    bpy.ops.esh.size_move(direction="UP")
    bpy.data.objects["Cone"].name = "Pine"
    assert draw_and_wait() and names() == ["Pine", "Cylinder"]
    bpy.ops.esh.class_duplicate()
    assert names() == ["Pine", "Pine 2", "Cylinder"]
    bpy.data.objects["Pine"].name = "Fir"
    assert draw_and_wait() and names() == ["Fir", "Fir 2", "Cylinder"]
    made.classes["Fir 2"].name = "Old Fir"
    bpy.data.objects["Fir"].name = "Spruce"
    assert draw_and_wait() and names() == ["Spruce", "Old Fir", "Cylinder"]
    made.class_index, made.classes[0].size_index = 0, 1
    bpy.ops.esh.size_add()
    made.classes[0].size_index = 1
    bpy.ops.esh.size_remove()
    assert not draw_and_wait() and names()[0] == "Spruce", "it is named after nothing that is placed"


def test_undo_and_redo_of_a_new_name(made):
    bpy.ops.ed.undo_push(message="made")
    bpy.data.objects["Cone"].name = "Pine"
    bpy.ops.ed.undo_push(message="renamed")
    draw_and_wait()
    bpy.ops.ed.undo()
    assert names() == ["Cone", "Cylinder"] and not draw_and_wait()
    bpy.ops.ed.redo()
    draw_and_wait()
    assert names() == ["Pine", "Cylinder"]


def test_without_a_sidebar_the_next_run_has_them_follow(made):
    bpy.data.objects["Cone"].name = "Pine"
    bpy.ops.esh.scatter()
    assert names() == ["Pine", "Cylinder"] and [one["name"] for one in made.report["classes"]] == names()


def test_a_collection_is_followed_too(made):
    trees = bpy.data.collections.new("Trees")
    trees.objects.link(bpy.data.objects["Cone"])
    made.classes[0].sizes[0].source_kind = "COLLECTION"
    made.classes[0].sizes[0].source_collection = trees
    assert names()[0] == "Trees"
    trees.name = "Wood"
    assert draw_and_wait() and names()[0] == "Wood"


def test_what_may_overlap_is_no_change_where_it_is_called_otherwise(made):
    bpy.ops.esh.scatter()
    # As earlier versions kept it.
    made.ran_with = made.ran_with.replace(f'"may_overlap":["{made.classes[0].uid}"]', '"may_overlap":"Cone"')
    assert '"may_overlap":"Cone"' in made.ran_with and not made.outdated
    made.classes["Cone"].name = "Pine"
    assert not made.outdated
    made.classes["Cylinder"].may_overlap = ""
    assert made.outdated and len(made.changes()) == 1


@pytest.fixture
def masked(made):
    """A scatter whose first class follows one of three vertex groups, and whose second one a UV map."""
    ground = made.target
    for name in ("dry", "wet", "cold"):
        ground.vertex_groups.new(name=name).add(range(len(ground.data.vertices)), 1.0, "REPLACE")
    ground.data.uv_layers.new(name="Fine")
    image = bpy.data.images.new("Map", 8, 8)
    image.generated_color = (1.0, 1.0, 1.0, 1.0)
    made.classes[0].add_layer("VERTEX_GROUP", vertex_group="wet")
    made.classes[1].add_layer("IMAGE", image=image, image_mapping="UV", uv_map="Fine")
    return made


def named_on_mesh(scatter):
    return scatter.classes[0].layers[0].vertex_group, scatter.classes[1].layers[0].uv_map


def test_a_vertex_group_or_a_uv_map_that_was_renamed_is_followed_by_the_sidebar(masked):
    draw_and_wait()
    masked.target.vertex_groups["wet"].name = "damp"
    masked.target.data.uv_layers["Fine"].name = "Detail"
    drawn = draw_all()
    assert not masked.left_out() and not any("wet" in text or "left out" in text for text in drawn)
    assert named_on_mesh(masked) == ("wet", "Fine"), "nothing is written while it is drawn"
    assert draw_and_wait() and named_on_mesh(masked) == ("damp", "Detail") and not draw_and_wait()
    # Again, and with others renamed at the same time.
    masked.target.vertex_groups["cold"].name = "frozen"
    masked.target.vertex_groups["damp"].name = "moist"
    assert draw_and_wait() and named_on_mesh(masked) == ("moist", "Detail") and not draw_and_wait()


def test_without_a_sidebar_the_next_run_follows_groups_and_maps_that_were_renamed(masked):
    masked.target.vertex_groups["wet"].name = "damp"
    masked.target.data.uv_layers["Fine"].name = "Detail"
    assert bpy.ops.esh.scatter.poll() and len(masked.ready_classes()) == 2
    bpy.ops.esh.scatter()
    assert named_on_mesh(masked) == ("damp", "Detail") and len(masked.report["classes"]) == 2
    # A group that came since the run is known from it.
    masked.target.vertex_groups.new(name="late")
    bpy.ops.esh.scatter()
    masked.target.vertex_groups["damp"].name = "moist"
    bpy.ops.esh.scatter()
    assert named_on_mesh(masked) == ("moist", "Detail") and len(masked.report["classes"]) == 2


def test_a_result_is_as_up_to_date_as_it_was_before_something_was_renamed(masked):
    bpy.ops.esh.scatter()
    for painted in (False, True):
        masked.target.vertex_groups["damp" if painted else "wet"].name = "moist" if painted else "damp"
        if painted:
            masked.target.vertex_groups["moist"].add([0, 1, 2], 0.5, "REPLACE")
            masked.target.data.update()
        assert draw_and_wait()
        with checksums.now():
            assert masked.outdated == painted
    assert masked.changes() == ["moist painted"]


@pytest.mark.parametrize("how", ["removed", "another moved up", "removed, and a new one later", "swapped in", "added"])
def test_what_is_not_only_renamed_is_not_followed(masked, how):
    groups = masked.target.vertex_groups
    draw_and_wait()
    if how == "another moved up":
        groups.remove(groups["wet"])
        groups.new(name="late")
        assert [one.name for one in groups] == ["dry", "cold", "late"]
    elif how == "swapped in":
        groups.remove(groups["cold"])
        groups["wet"].name = "cold"
        groups.new(name="late")
    elif how == "added":
        groups["wet"].name = "damp"
        groups.new(name="late")
    else:
        groups.remove(groups["cold"])
        draw_and_wait()
        groups.remove(groups["wet"])
        if how != "removed":
            draw_and_wait()
            groups.new(name="new")
    draw_and_wait()
    assert named_on_mesh(masked)[0] == "wet"
    assert masked.left_out() == ['Cone is left out: "Grid" has no vertex group "wet"; choose another one']


def test_of_several_targets_all_have_to_call_it_the_same(masked):
    ground = masked.target
    other = ground.copy()
    other.data = ground.data.copy()
    bpy.context.scene.collection.objects.link(other)
    grounds = bpy.data.collections.new("Grounds")
    for item in (ground, other):
        grounds.objects.link(item)
    masked.target_kind, masked.target_collection = "COLLECTION", grounds
    draw_and_wait()
    ground.vertex_groups["wet"].name = "damp"
    assert not draw_and_wait() or named_on_mesh(masked)[0] == "wet", "the other still has it"
    ground.vertex_groups["damp"].name = "wet"
    draw_and_wait()
    for item in (ground, other):
        item.vertex_groups["wet"].name = "damp"
    assert draw_and_wait() and named_on_mesh(masked)[0] == "damp" and not masked.left_out()
    # One that never had it does not count.
    other.vertex_groups.remove(other.vertex_groups["damp"])
    draw_and_wait()
    ground.vertex_groups["damp"].name = "moist"
    assert draw_and_wait() and named_on_mesh(masked)[0] == "moist" and not masked.left_out()


def test_painting_goes_on_in_a_group_that_was_renamed(masked):
    draw_and_wait()
    masked.class_index = masked.classes[0].layer_index = 0
    masked.target.vertex_groups["wet"].name = "damp"
    bpy.ops.esh.layer_paint(kind="SELECTED")
    assert masked.target.vertex_groups.active.name == "damp" and len(masked.target.vertex_groups) == 3
    bpy.ops.object.mode_set(mode="OBJECT")
