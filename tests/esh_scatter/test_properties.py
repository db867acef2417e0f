"""Settings on the scene: saved, undone, pointing at data rather than naming it, and sensible when data goes away."""

import dataclasses
import json
import math

import pytest

bpy = pytest.importorskip("bpy")

import esh  # noqa: E402
from esh.engine.problem.scatter_settings import ScatterSettings, Standing  # noqa: E402
from esh.esh_scatter.properties.body_class import CLASS_COLORS  # noqa: E402
from esh.esh_scatter.properties.described import shown_settings, values_from  # noqa: E402
from esh.esh_scatter.properties.influential_settings import WITHOUT_INFLUENCE  # noqa: E402
from esh.esh_scatter.properties.names import unused_name  # noqa: E402
from esh.esh_scatter.properties.scatter import BY_HAND  # noqa: E402
from esh.esh_scatter.properties.size import ESH_PG_size, can_be_placed  # noqa: E402

pytestmark = pytest.mark.usefixtures("empty_file")


def new_object(name: str) -> bpy.types.Object:
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [], [(0, 1, 2, 3)])
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


@pytest.fixture
def scatter():
    made = bpy.context.scene.esh_scatter.add_scatter(new_object("Ground"))
    tree = new_object("Tree")
    for name in ("Pine", "Beech"):
        body_class = made.add_class()
        body_class.name = name
        body_class.sizes[0].source_object = tree
    return made


def test_names_in_a_list_differ(scatter):
    scatter.classes[1].name = "Pine"
    assert [c.name for c in scatter.classes] == ["Pine", "Pine 2"]
    scatter.classes[1].name = "   "
    assert scatter.classes[1].name == "Class"
    scatter.classes[1].sizes[0].source_object = bpy.data.objects["Tree"]
    assert scatter.classes[1].name == "Tree", "it is named after what it places"
    scatter.classes[1].sizes[0].source_object = scatter.target
    assert scatter.classes[1].name == "Ground", "whatever that is"
    scatter.classes[0].may_overlap = "Ground"
    scatter.classes[1].sizes[0].source_object = bpy.data.objects["Tree"]
    assert scatter.classes[1].name == scatter.classes[0].may_overlap == "Tree"
    scatter.classes[1].name = "Beech"
    scatter.classes[1].sizes[0].source_object = scatter.target
    assert scatter.classes[1].name == "Beech", "unless somebody names it"
    first, second = scatter.classes[0].sizes[0], scatter.classes[0].add_size()
    assert scatter.classes[0].sizes[0].name != second.name
    second.name = scatter.classes[0].sizes[0].name
    assert len({size.name for size in scatter.classes[0].sizes}) == 2
    assert first.name not in {"", second.name}


def test_only_what_can_be_placed_is_offered(scatter):
    def empty(name, data=None):
        item = bpy.data.objects.new(name, data)
        bpy.context.scene.collection.objects.link(item)
        return item

    camera, plain = empty("Camera", bpy.data.cameras.new("Camera")), empty("Plain")
    drop, shows = empty("Drop", bpy.data.metaballs.new("Drop")), empty("Shows")
    shows.instance_type, shows.instance_collection = "COLLECTION", bpy.data.collections.new("Shown")
    shows.instance_collection.objects.link(new_object("Bush"))
    scatter.device, scatter.max_steps, scatter.avoid_overlap = "CPU", 5, False
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    size = scatter.classes[0].sizes[0]
    offered = {item for item in bpy.data.objects if can_be_placed(size, item)}
    assert offered == set(bpy.data.objects) - {camera, plain, drop, scatter.result}
    assert ESH_PG_size.__annotations__["source_object"].keywords["poll"] is can_be_placed


@pytest.mark.parametrize(
    ("name", "taken", "expected"),
    [
        ("a", set(), "a"),
        ("a", {"a"}, "a 2"),
        ("a 2", {"a 2"}, "a 3"),
        ("a", {"a", "a 2"}, "a 3"),
        ("v1.b", {"v1.b"}, "v1.b 2"),
        ("a.001", {"a.001"}, "a.001 2"),
    ],
)
def test_names_that_are_taken_are_numbered(name, taken, expected):
    assert unused_name(name, taken) == expected


def test_new_classes_get_colors_of_their_own(scatter):
    for _ in range(len(CLASS_COLORS) - 2):
        scatter.add_class()
    colors = {tuple(round(v, 3) for v in c.color) for c in scatter.classes}
    assert len(colors) == len(CLASS_COLORS)


def test_what_a_layer_or_the_faces_name_and_is_gone_is_named(scatter):
    """What is only renamed is followed, see test_followed_names.py."""
    scene, target = bpy.context.scene, scatter.target
    scatter.classes[1].mute = True
    layer = scatter.classes[0].add_layer("VERTEX_GROUP")
    group = target.vertex_groups.new(name="Mask")
    group.add(range(len(target.data.vertices)), 1.0, "REPLACE")
    assert scatter.obstacle(scene) == f'Class "Pine": choose a vertex group of "{target.name}"'
    layer.vertex_group = "Mask"
    assert scatter.obstacle(scene) is None
    group.name = "Other"
    layer.vertex_group = "Mask"
    assert scatter.obstacle(scene) == f'Class "Pine": "{target.name}" has no vertex group "Mask"; choose another one'
    target.data.uv_layers.new(name="Layout")
    layer.kind, layer.image = "IMAGE", bpy.data.images.new("Where", 4, 4)
    layer.image_mapping, layer.uv_map = "UV", "Map"
    assert scatter.obstacle(scene) == f'Class "Pine": "{target.name}" has no UV map "Map"; choose another one'
    layer.use = False
    bpy.ops.mesh.primitive_cube_add(size=0.1)
    for one in scatter.classes:
        one.sizes[0].source_object, one.sizes[0].count = bpy.context.object, 5
    for setting, what, has in (
        ("face_group", "vertex group", "Other"),
        ("face_attribute", "attribute", ""),
        ("face_material", "material", "none"),
    ):
        setattr(scatter, setting, "Mask")
        with pytest.raises(RuntimeError) as raised:
            bpy.ops.esh.scatter()
        told = str(raised.value)
        assert f'"{target.name}" has no {what} "Mask"; it has' in told and has in told
        setattr(scatter, setting, "")


def test_every_obstacle_is_said_and_none_is_left_when_all_is_set(scatter):
    scene = bpy.context.scene
    assert scatter.obstacle(scene) is None
    pine = scatter.classes[0]
    scatter.classes[1].mute = True
    layer = pine.add_layer("IMAGE")
    lacking = [("IMAGE", "image"), ("VERTEX_GROUP", "vertex group"), ("ATTRIBUTE", "attribute"), ("CAMERA", "camera")]
    lacking += [
        ("DISTANCE", "an object to be near"),
        ("INSIDE", "an object to be inside"),
        ("CLASS", "the class"),
    ]
    for kind, word in lacking:
        layer.kind = kind
        assert word in scatter.obstacle(scene) and '"Pine"' in scatter.obstacle(scene)
    layer.use = False
    assert scatter.obstacle(scene) is None
    layer.use = True
    for kind in ("SLOPE", "ALTITUDE", "FACING", "NOISE"):
        layer.kind = kind
        assert scatter.obstacle(scene) is None
    layer.kind, layer.class_name = "CLASS", "Beech"
    assert scatter.obstacle(scene) == 'Class "Pine": it follows "Beech", which is muted'
    layer.kind, layer.source_kind = "DISTANCE", "COLLECTION"
    layer.source_collection = bpy.data.collections.new("Rocks")
    assert 'collection "Rocks" is empty' in scatter.obstacle(scene)
    layer.vertex_group, layer.kind = "trees", "VERTEX_GROUP"
    scatter.target.vertex_groups.new(name="trees")
    assert scatter.obstacle(scene) is None
    layer.image, layer.kind = bpy.data.images.new("where", 4, 4), "IMAGE"
    assert scatter.obstacle(scene) is None
    layer.image_mapping = "UV"
    assert "UV map" in scatter.obstacle(scene)
    scatter.target.data.uv_layers.new(name="layout")
    assert scatter.obstacle(scene) is None
    layer.uv_map = "gone"
    assert '"gone"' in scatter.obstacle(scene)
    pine.add_layer("NOISE")
    assert scatter.obstacle(scene).startswith('Class "Pine", layer 1:')
    layer.use, pine.direction_kind = False, "IMAGE"
    assert "choose its flow image" in scatter.obstacle(scene)
    pine.direction_image = bpy.data.images["where"]
    assert scatter.obstacle(scene) is None
    pine.may_overlap = " Beech, , Oak"
    assert scatter.obstacle(scene) is None and scatter.non_overlap() is None, (
        "a class that is muted or gone is no obstacle"
    )
    scatter.classes[1].mute = False
    assert scatter.non_overlap() == [[1.0, 0.0], [0.0, 1.0]]
    pine.mute = scatter.classes[1].mute = True
    assert "All classes are muted" in scatter.obstacle(scene)
    pine.mute = False
    pine.sizes[0].source_kind = "COLLECTION"
    assert "choose a collection" in scatter.obstacle(scene)
    pine.sizes[0].source_collection = bpy.data.collections.new("Bushes")
    assert '"Bushes" is empty' in scatter.obstacle(scene)
    pine.sizes[0].source_kind, pine.sizes[0].source_object = "OBJECT", scatter.target
    assert "target" in scatter.obstacle(scene)
    pine.sizes.clear()
    assert "add a size" in scatter.obstacle(scene)
    scatter.classes.clear()
    assert "Add a class" in scatter.obstacle(scene)


def test_renamed_data_is_followed_and_deleted_data_leaves_an_empty_field(scatter):
    scatter.target.name = "Meadow"
    assert scatter.target.name == "Meadow" and scatter.obstacle(bpy.context.scene) is None
    tree = scatter.classes[0].sizes[0].source_object
    bpy.context.scene.collection.objects.unlink(tree)
    assert scatter.classes[0].sizes[0].source == tree, "it stays in the file"
    assert '"Tree" was deleted' in scatter.obstacle(bpy.context.scene)
    bpy.data.objects.remove(tree)
    assert scatter.classes[0].sizes[0].source is None
    assert "choose an object" in scatter.obstacle(bpy.context.scene)
    bpy.data.objects.remove(scatter.target)
    assert scatter.target is None and "Choose a target" in scatter.obstacle(bpy.context.scene)


def test_images_of_which_nothing_can_be_read_are_told_of_before_a_run(scatter):
    image = bpy.data.images.new("Clouds", 4, 4)
    scatter.classes[0].add_layer("IMAGE", image=image)
    assert scatter.left_out() == []
    image.source = "SEQUENCE"
    assert '"Clouds" is an image sequence, of which no frame can be read: set its Source' in scatter.left_out()[0]


def test_a_target_without_faces_is_told_of_before_a_run(scatter):
    assert scatter.target_obstacle(bpy.context.scene) is None
    nodes = scatter.target.modifiers.new("Empty", "NODES")
    nodes.node_group = bpy.data.node_groups.new("Empty", "GeometryNodeTree")
    nodes.node_group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    nodes.node_group.nodes.new("NodeGroupOutput")
    bpy.context.view_layer.update()
    assert "has no faces to stand on; Realize Instances" in scatter.obstacle(bpy.context.scene)
    nodes.show_viewport = False
    bpy.context.view_layer.update()
    assert scatter.target_obstacle(bpy.context.scene) is None
    scatter.target.modifiers.clear()
    scatter.target.data.clear_geometry()
    assert "has no faces to stand on; choose another target" in scatter.obstacle(bpy.context.scene)
    group = bpy.data.collections.new("Tiles")
    bpy.context.scene.collection.children.link(group)
    group.objects.link(scatter.target)
    scatter.target_kind, scatter.target_collection = "COLLECTION", group
    said = 'No visible mesh of collection "Tiles" has faces to stand on; choose another target'
    assert scatter.obstacle(bpy.context.scene) == said
    bpy.ops.mesh.primitive_grid_add(size=4.0)
    tile = bpy.context.object
    group.objects.link(tile)
    assert scatter.target_obstacle(bpy.context.scene) is None
    assert f'"{scatter.target.name}" is left out: it has no faces to stand on' in scatter.left_out()
    tile.hide_set(True)
    assert scatter.obstacle(bpy.context.scene) == said


@pytest.mark.parametrize("how", ["hidden", "disabled", "excluded"])
def test_a_target_that_is_not_shown_is_said_before_the_button_is_pressed(scatter, how):
    """The status said that all was well, and Update made an error."""
    ground, layer = scatter.target, bpy.context.view_layer
    group = bpy.data.collections.new("Tiles")
    bpy.context.scene.collection.children.link(group)
    bpy.context.scene.collection.objects.unlink(ground)
    group.objects.link(ground)
    scatter.target_collection = group
    assert scatter.target_obstacle(bpy.context.scene) is None
    ground.hide_set(how == "hidden")
    ground.hide_viewport = how == "disabled"
    layer.layer_collection.children["Tiles"].exclude = how == "excluded"
    said = f'"{ground.name}" is hidden; make it visible to scatter on it'
    if how == "excluded":
        said = f'"{ground.name}" is excluded from view layer "{layer.name}"; include its collection to scatter on it'
    assert scatter.target_obstacle(bpy.context.scene) == said and not bpy.ops.esh.scatter.poll()
    scatter.target_kind = "COLLECTION"
    assert (
        scatter.target_obstacle(bpy.context.scene)
        == 'No mesh of collection "Tiles" is visible; show one to scatter on it'
    )
    assert scatter.target_obstacle(bpy.data.scenes.new("Other")) != scatter.target_obstacle(bpy.context.scene)
    group.objects.link(new_object("Tile"))
    assert how == "excluded" or scatter.target_obstacle(bpy.context.scene) is None


def test_of_a_tile_that_is_added_it_is_said_that_counts_stay(scatter):
    scatter.add_class().sizes[0].source_object = new_object("Tree")
    scatter.remember(scatter.target, {"steps": 3})
    group = bpy.data.collections.new("Tiles")
    bpy.context.scene.collection.children.link(group)
    for item in (scatter.target, new_object("Tile")):
        group.objects.link(item)
    scatter.target_kind, scatter.target_collection = "COLLECTION", group
    bpy.context.view_layer.update()
    assert scatter.changes() == ["target (1 more mesh; fixed counts stay)"]
    scatter.remember(scatter.target, {"steps": 3})
    for name in ("East", "West"):
        group.objects.link(new_object(name))
    bpy.context.view_layer.update()
    assert scatter.changes() == ["target (2 more meshes; fixed counts stay)"]
    for body_class in scatter.classes:
        body_class.count_kind = "PER_AREA"
    assert "target (2 more meshes)" in scatter.changes()


def test_a_target_deleted_in_the_viewport_counts_as_gone(scatter):
    """Blender keeps such an object alive, because the settings still point to it."""
    bpy.context.scene.collection.objects.unlink(scatter.target)
    assert "no longer in this scene" in scatter.obstacle(bpy.context.scene)


def test_a_change_makes_the_report_outdated_and_taking_it_back_does_not(scatter):
    scatter.remember(new_object("Result"), {"steps": 3})
    assert scatter.report["steps"] == 3 and not scatter.outdated
    size = scatter.classes[0].sizes[0]
    layer = scatter.classes[0].add_layer("IMAGE", image=bpy.data.images.new("where", 4, 4))
    scatter.remember(scatter.result, {"steps": 3})
    changes = [
        (scatter, "seed", 5), (scatter, "class_separation", 0.25), (scatter, "size_emphasis", 3.0),
        (scatter, "max_steps", 20), (scatter, "device", "CPU"), (scatter, "target", new_object("Other")),
        (layer, "kind", "NOISE"), (layer, "invert", True), (layer, "strength", 0.5), (layer, "use", False),
        (layer, "blend", "ADD"), (layer, "image_tiling", (2.0, 1.0)), (layer, "use_curve", True),
        (size, "count", 7), (size, "area", 3.0), (size, "area_kind", "VALUE"), (size, "source_object", new_object("Bush")),
        (scatter, "avoid_overlap", False), (size, "shape", "LINE"), (size, "area_largest", 9.0),
        (scatter.classes[0], "direction_kind", "IMAGE"), (scatter.classes[0], "direction_angle", 0.3),
        (scatter.classes[0], "density_correction", True), (scatter.classes[0], "may_overlap", "Beech"),
        (scatter.classes[0], "use_unsharp", True), (scatter.classes[0], "unsharp_amount", 0.3),
        (scatter.classes[0], "unsharp_radius", 9.0),
    ]  # fmt: skip
    for group, name, value in changes:
        before = getattr(group, name)
        before = tuple(before) if name == "image_tiling" else before
        setattr(group, name, value)
        assert scatter.outdated, name
        setattr(group, name, before)
        assert not scatter.outdated, name
    layer.noise_scale, layer.slope_low, layer.name = 3.0, 0.1, "Mask"
    assert not scatter.outdated, "what a layer does not follow moves nothing"
    scatter.classes[0].name = "Fir"
    scatter.classes[0].color = (1, 0, 0)
    scatter.classes[0].show_viewport = False
    assert not scatter.outdated, "neither a name nor a color moves anything"
    scatter.target.location.x += 1
    bpy.context.view_layer.update()
    assert scatter.outdated


def test_shapes_and_directions_are_those_of_the_api(scatter):
    pine = scatter.classes[0]
    size, flow = pine.sizes[0], bpy.data.images.new("flow", 4, 4)
    pine.direction_angle, pine.direction_image = 0.25, flow
    for kind, expected in (("DENSITY", "density"), ("NONE", "none"), ("ANGLE", 0.25), ("IMAGE", flow)):
        pine.direction_kind = kind
        assert pine.as_argument().direction == expected
    for shape, expected in (("AUTO", None), ("DOT", False), ("LINE", True)):
        size.shape = shape
        assert size.as_argument().line is expected


def test_a_broken_report_counts_as_none(scatter):
    scatter.report_json = "{"
    assert scatter.report is None


def test_settings_of_two_scenes_are_saved_and_read_back(scatter, tmp_path):
    scatter.seed = 11
    scatter.classes[1].sizes[0].count = 77
    scatter.remember(new_object("Result"), {"steps": 3})
    other = bpy.data.scenes.new("Second")
    other.esh_scatter.add_scatter(scatter.target).seed = 22
    first_name = bpy.context.scene.name
    path = str(tmp_path / "settings.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=path)
    loaded = bpy.data.scenes[first_name].esh_scatter.active
    assert (loaded.seed, loaded.classes[1].sizes[0].count, loaded.target.name) == (11, 77, "Ground")
    assert loaded.report["steps"] == 3 and not loaded.outdated and loaded.result.name == "Result"
    assert bpy.data.scenes["Second"].esh_scatter.active.seed == 22


def test_arguments_are_those_of_the_api(scatter):
    image = bpy.data.images.new("where", 4, 4)
    pine = scatter.classes[0]
    pine.add_layer("IMAGE", image=image, image_mapping="UV", invert=True)
    small = pine.add_size()
    small.count, small.area_kind, small.area = 9, "VALUE", 0.25
    small.source_kind, small.source_collection = "COLLECTION", bpy.data.collections.new("Bushes")
    small.source_collection.objects.link(new_object("Bush"))
    scatter.target.data.uv_layers.new(name="layout")
    scatter.device = "CUDA"
    (target, classes), named = scatter.arguments(bpy.context.scene)
    assert target == scatter.target and [c.name for c in classes] == ["Pine", "Beech"]
    assert (classes[0].density.image, classes[0].density.mapping, classes[0].density.invert) == (image, "UV", True)
    assert classes[1].density == 1.0
    assert [(s.count, s.area) for s in classes[0].sizes] == [(100, None), (9, 0.25)]
    assert classes[0].sizes[1].source == bpy.data.collections["Bushes"]
    assert named["device"] == "cuda:0" and named["result"] is None and named["name"] == scatter.name
    assert json.dumps({key: value for key, value in named.items() if key != "result"})


def test_limits_of_numbers_can_be_set_and_are_taken(scatter):
    """Blender rounds them: its pi is above pi."""
    pine = scatter.classes[0]
    for group, cls, by_hand in ((scatter, ScatterSettings, BY_HAND), (pine, Standing, ())):
        numbers = [one for one in shown_settings(cls, by_hand) if one.setting.kind == "number" and not one.switch]
        assert numbers
        for name, one, _ in numbers:
            for limit in {one.setting.low, one.setting.high} - {None}:
                setattr(group, name, limit)
                assert getattr(cls(**values_from(group, cls, by_hand)), name) == limit, name
    pine.use_look_at, pine.look_at_spread = True, math.pi
    assert pine.look_at().spread == math.pi


def test_an_object_that_never_was_in_a_scene_is_not_deleted(scatter):
    """The dots of inks, and what is linked from a library, show only where they are placed."""
    dot = bpy.data.objects.new("Dot", bpy.data.objects["Tree"].data)
    for body_class in scatter.classes:
        body_class.sizes[0].source_object = dot
    assert scatter.obstacle(bpy.context.scene) is None


def test_muted_and_incomplete_classes_do_not_block_the_others(scatter):
    pine, beech = scatter.classes
    pine.sizes[0].source_object = None
    assert [c.name for c in scatter.arguments(bpy.context.scene)[0][1]] == ["Beech"]
    assert scatter.left_out() == ["Pine is left out: choose an object to place"]
    pine.mute = True
    assert scatter.left_out() == [] and scatter.obstacle(bpy.context.scene) is None
    beech.mute = True
    assert scatter.obstacle(bpy.context.scene) is not None


def test_what_has_changed_is_said_in_the_words_of_the_sidebar(scatter):
    pine, beech = scatter.classes
    scatter.remember(new_object("Result"), {"steps": 3})
    assert scatter.changes() == []
    scatter.seed, pine.sizes[0].count = 4, 7
    for name in ("trees", "bushes"):
        scatter.target.vertex_groups.new(name=name)
    layer = pine.add_layer("VERTEX_GROUP", vertex_group="trees")
    assert scatter.changes() == ["seed", "density of Pine", "count of Pine"]
    scatter.remember(scatter.result, {"steps": 3})
    layer.vertex_group, layer.use_curve = "bushes", True
    assert scatter.changes() == ["vertex group of Pine", "curve of Pine"]
    pine.add_layer("NOISE")
    scatter.remember(scatter.result, {"steps": 3})
    pine.layers[1].noise_scale = 3.0
    pine.layers[0].curve.nodes[0].mapping.curves[0].points[1].location = (1.0, 0.5)
    assert scatter.changes() == ["curve of Pine, bushes", "scale of Pine, Noise"]
    scatter.remember(scatter.result, {"steps": 3})
    beech.add_size().source_object = bpy.data.objects["Tree"]
    assert scatter.changes() == ["sizes of Beech"]
    beech.mute = True
    assert scatter.changes() == ["without Beech"]
    scatter.remove_class(1)
    assert scatter.changes() == ["Beech was removed"]
    scatter.add_class().sizes[0].source_object = bpy.data.objects["Tree"]
    scatter.classes[1].stand_on = "LOWEST"
    assert scatter.changes() == ["Tree is new", "Beech was removed"]
    scatter.class_index = 0
    assert bpy.ops.esh.class_duplicate() == {"FINISHED"}
    assert scatter.changes() == ["Pine 2 is new", "Tree is new", "Beech was removed"]
    scatter.remove_class(1)
    scatter.remember(scatter.result, {"steps": 3})
    scatter.classes.move(0, 1)
    assert scatter.changes() == ["the order of the classes"]
    scatter.classes.move(0, 1)
    scatter.target.location.x += 1
    bpy.context.view_layer.update()
    assert scatter.changes() == ["shape or place of the target"]
    scatter.ran_with = "written by another version"
    assert scatter.changes() == ["settings"]


def test_renaming_and_removing_a_class_is_followed_by_what_may_overlap(scatter):
    pine, beech = scatter.classes
    pine.may_overlap = "Beech"
    beech.name = "Oak"
    assert pine.names_that_may_overlap == {"Oak"} and scatter.non_overlap() == [[1.0, 0.0], [0.0, 1.0]]
    pine.name = "Fir"
    assert pine.overlaps_with(beech) and beech.overlaps_with(pine)
    scatter.remove_class(1)
    assert scatter.classes[0].may_overlap == ""


@pytest.mark.parametrize(
    ("kind", "name", "value", "told"),
    [
        ("PER_AREA", "per_area", 0.25, "0.25/m²"),
        ("DISTANCE", "distance", 1.5, "1.5 m apart"),
        ("SHARE", "cover_share", 0.5, "50% cover"),
    ],
)
def test_counts_can_be_said_in_other_ways(scatter, kind, name, value, told):
    pine = scatter.classes[0]
    pine.count_kind = kind
    setattr(pine, name, value)
    assert pine.amount == told
    amount = pine.as_argument().count
    assert getattr(amount, {"cover_share": "cover"}.get(name, name)) == pytest.approx(value)


def test_a_collection_is_a_target(scatter):
    scene = bpy.context.scene
    scatter.target_kind = "COLLECTION"
    assert "Choose a collection" in scatter.obstacle(scene)
    scatter.target_collection = holder = bpy.data.collections.new("Rocks")
    assert '"Rocks" has no mesh in this scene' in scatter.obstacle(scene)
    scene.collection.children.link(holder)
    rocks = [new_object(name) for name in ("Rock", "Boulder")]
    for rock in rocks:
        holder.objects.link(rock)
    assert scatter.obstacle(scene) is None and scatter.targets == rocks[::-1]
    assert scatter.arguments(scene)[0][0] == holder
    # One of them has what a class asks for.
    scatter.classes[0].add_layer("VERTEX_GROUP", vertex_group="moss")
    assert scatter.left_out()[0] == 'Pine is left out: "Boulder" has no vertex group "moss"; choose another one'
    rocks[0].vertex_groups.new(name="moss")
    assert scatter.left_out() == []
    scatter.remember(rocks[0], {"steps": 3})
    assert not scatter.outdated
    rocks[1].location.x += 1.0
    bpy.context.view_layer.update()
    assert scatter.changes() == ["shape or place of the target"]
    rocks[1].location.x -= 1.0
    holder.objects.unlink(rocks[1])
    assert "target" not in scatter.changes(), "it is the same collection"
    holder.objects.link(rocks[1])
    holder.name = "Stones"
    scatter.target_collection = bpy.data.collections.new("Others")
    assert "target" in scatter.changes()
    scatter.target_kind = "OBJECT"
    bpy.context.view_layer.update()
    assert scatter.changes() == ["target", "without Pine"], "it is another one, and no more is to be said of it"


def with_defaults(values, group, every):
    """What older versions kept of a group: defaults, too, of every so many of its settings, the others being newer."""
    told = [told for told in group.bl_rna.properties if told.identifier not in WITHOUT_INFLUENCE | {"rna_type"}]
    for one in told[::every]:
        if one.type not in ("POINTER", "COLLECTION"):
            default = list(one.default_array) if getattr(one, "is_array", False) else one.default
            values.setdefault(one.identifier, default)


@pytest.mark.parametrize("every", [1, 2, 3])
def test_a_setting_that_is_newer_than_a_result_had_its_default_then(scatter, every):
    pine = scatter.classes[0]
    pine.add_layer("NOISE")
    pine.room, scatter.seed = 1.5, 4
    scatter.remember(new_object("Result"), {"steps": 3})
    record = json.loads(scatter.ran_with)
    own = record["classes"][str(pine.uid)]
    with_defaults(record["scatter"], scatter, every)
    record["scatter"] |= {"obstacles": [], "free_places": [[], []], "keep_off_others": []}
    with_defaults(own["values"], pine, every)
    own["sizes"][0].setdefault("variants", [])
    own["layers"][0].update({"noise_scale": pine.layers[0].noise_scale, "curve": [], "strength": 1.0})
    scatter.ran_with = json.dumps(record)
    assert not scatter.outdated and scatter.changes() == []
    scatter.surface, pine.gap, pine.sizes[0].distribution, pine.layers[0].noise_scale = "WHOLE", 0.5, "UNIFORM", 3.0
    assert scatter.outdated
    said = [words.lower() for words in scatter.changes()]
    assert said == ["surface", "gap of pine", "scale of pine", "distribution of pine"]


def test_a_setting_that_is_at_its_default_again_is_named(scatter):
    pine = scatter.classes[0]
    scatter.seed, pine.room = 4, 1.5
    scatter.remember(new_object("Result"), {"steps": 3})
    record = json.loads(scatter.ran_with)
    # How objects stand, as an older version kept it; of what is not kept apart it shows at once.
    record["classes"][str(pine.uid)]["values"]["align_to_normal"] = 0.5
    scatter.ran_with = json.dumps(record)
    assert scatter.changes() == ["align to ground of Pine"]
    scatter.seed, pine.room = 0, 1.0
    assert scatter.changes() == ["seed", "room of Pine", "align to ground of Pine"]
    scatter.avoid_overlap = False
    assert scatter.changes() == ["avoid overlap", "seed", "room of Pine"]


def test_layers_become_what_scripts_take(scatter):
    pine, beech = scatter.classes
    assert pine.as_argument().density == 1.0
    stone = new_object("Rock")
    made = {
        "SLOPE": esh.SlopeDensity(high=0.25), "ALTITUDE": esh.AltitudeDensity(1.0, 2.0), "FACING": esh.FacingDensity(0.5),
        "NOISE": esh.NoiseDensity(4.0, seed=3), "CLASS": esh.ClassDensity("Beech"), "CAMERA": esh.CameraDensity(margin=0.5),
        "DISTANCE": esh.DistanceDensity(stone, far=2.0, falloff="linear"), "INSIDE": esh.InsideDensity(stone, 0.5),
    }  # fmt: skip
    layer = pine.add_layer(
        "SLOPE", slope_high=0.25, altitude_low=1.0, altitude_high=2.0, facing_direction=0.5, noise_scale=4.0, noise_seed=3,
        class_name="Beech", camera_margin=0.5, source_object=stone, distance_far=2.0, distance_falloff="LINEAR",
        inside_falloff=0.5,
    )  # fmt: skip
    for kind, expected in made.items():
        layer.kind = kind
        found = pine.as_argument().density
        assert type(found) is type(expected)
        for one in dataclasses.fields(expected):
            value = getattr(expected, one.name)
            assert getattr(found, one.name) == (pytest.approx(value) if isinstance(value, float) else value), one.name
    # What is more than what a layer reads is a stack.
    layer.kind, layer.invert = "NOISE", True
    (only,) = pine.as_argument().density.layers
    assert only.invert and only.curve is None and only.density.seed == 3
    layer.invert, layer.use_curve = False, True
    layer.curve.nodes[0].mapping.curves[0].points[1].location = (1.0, 0.5)
    (only,) = pine.as_argument().density.layers
    assert only.curve[0] == (0.0, 0.0) and only.curve[-1] == (1.0, pytest.approx(0.5, abs=1e-3))
    layer.use_curve = False
    pine.add_layer("SLOPE", blend="ADD", strength=0.5, name="cliffs")
    pine.add_layer("CAMERA", use=False)
    beech.name = "Elm"
    layer.kind = "CLASS"
    first, second = pine.as_argument().density.layers
    assert first.density.name == "Elm" and (second.blend, second.strength, second.name) == ("add", 0.5, "cliffs")


def test_a_copy_of_a_layer_has_a_curve_of_its_own(scatter):
    layer = scatter.classes[0].add_layer("NOISE", use_curve=True)
    scatter.class_index = 0
    assert bpy.ops.esh.class_duplicate() == {"FINISHED"}
    layer, copy = scatter.classes[0].layers[0], scatter.classes[1].layers[0]
    assert copy.curve is not None and copy.curve != layer.curve and copy.use_curve and copy.kind == "NOISE"
    copy.curve.nodes[0].mapping.curves[0].points[1].location = (1.0, 0.5)
    assert layer.curve_record() != copy.curve_record()
    scatter.class_index = 1
    groups = len(bpy.data.node_groups)
    assert bpy.ops.esh.layer_remove() == {"FINISHED"}
    assert len(bpy.data.node_groups) == groups - 1 and not scatter.classes[1].layers
