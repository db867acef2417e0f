"""esh.scatter: counts, on the surface, replacing its result and nothing else, and a sentence for every bad input."""

import gc
import math
import weakref
from collections import Counter

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import esh  # noqa: E402
import trimesh  # noqa: E402
from esh.esh_scatter.api import (  # noqa: E402
    AttributeDensity,
    EshError,
    ImageDensity,
    ScatterClass,
    ScatterJob,
    ScatterSize,
    Unsharp,
    VertexGroupDensity,
    scatter,
)
from esh.esh_scatter.classes import lent_survey  # noqa: E402
from mathutils import Quaternion  # noqa: E402

pytestmark = pytest.mark.usefixtures("bare_file")

OPTIONS = {"device": "cpu", "max_steps": 5}


def new_object(name, corners, faces):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], faces)
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


def quad(name="Ground", size=20.0):
    return new_object(name, [(0, 0, 0), (size, 0, 0), (size, size, 0), (0, size, 0)], [(0, 1, 2, 3)])


def hills(side=40):
    x, y = np.meshgrid(np.linspace(-10, 10, side), np.linspace(-10, 10, side))
    corners = np.stack([x, y, 1.5 * np.sin(x) * np.cos(0.7 * y)], axis=-1).reshape(-1, 3)
    index = np.arange(side * side).reshape(side, side)
    faces = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], axis=-1).reshape(-1, 4)
    return new_object("Hills", corners.tolist(), faces.tolist())


def image(name, values):
    height, width = values.shape
    made = bpy.data.images.new(name, width, height, float_buffer=True)
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :3] = values[::-1, :, None]
    made.pixels.foreach_set(pixels.ravel())
    return made


def points(item):
    values = np.empty(3 * len(item.data.vertices), np.float32)
    item.data.vertices.foreach_get("co", values)
    return values.reshape(-1, 3)


def instances(item):
    found = Counter()
    for instance in bpy.context.evaluated_depsgraph_get().object_instances:
        if instance.is_instance and instance.parent.original == item:
            found[instance.object.original.name] += 1
    return found


def one_class(source, count=50, **named):
    return [ScatterClass("tree", [ScatterSize("large", count, source, area=0.5)], **named)]


def test_counts_and_instances_are_exact_and_survive_saving(tmp_path):
    tree, stone = quad("Tree", 0.5), quad("Stone", 0.3)
    stone.hide_viewport = True
    classes = [*one_class(tree), ScatterClass("stone", [ScatterSize("small", 70, stone)])]
    result = scatter(hills(), classes, **OPTIONS)
    assert instances(result.object) == {"Tree": 50, "Stone": 70}
    assert len(points(result.object)) == result.placement.problem.body_count == 120
    name, objects = result.object.name, len(bpy.data.objects)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "saved.blend"))
    assert instances(bpy.data.objects[name]) == {"Tree": 50, "Stone": 70}
    assert len(bpy.data.objects) == objects == 4


@pytest.mark.parametrize("scale", [(1, 1, 1), (2, -1, 0.5)])
def test_points_are_on_the_surface_of_a_turned_target(scale):
    ground = hills()
    ground.location, ground.rotation_euler, ground.scale = (30, -7, 4), (0.2, -0.3, 1.1), scale
    result = scatter(ground, one_class(quad("Tree"), 200), **OPTIONS)
    bpy.context.view_layer.update()
    ground.data.calc_loop_triangles()
    faces = [list(t.vertices) for t in ground.data.loop_triangles]
    corners = np.array([ground.matrix_world @ v.co for v in ground.data.vertices])
    _, distance, _ = trimesh.proximity.closest_point_naive(trimesh.Trimesh(corners, faces), points(result.object))
    assert distance.max() < 1e-4 * np.ptp(corners, axis=0).max()


def test_what_a_job_holds_goes_with_it():
    """Without the garbage collector, which does not know how large arrays are."""
    gc.collect()
    gc.disable()
    try:
        job = ScatterJob(hills(), one_class(quad("Tree")), **OPTIONS)
        job.solve()
        result = job.write()
        held = [weakref.ref(item) for item in (job, job.chart, job.chart.view, job.chart.points, job.problem)]
        del job, result
        # What was worked out of the target is lent to the next run, and to no other.
        lent_survey.detach()
        assert [item() for item in held] == [None] * len(held)
    finally:
        gc.enable()


def test_density_is_read_within_one_quad():
    """Half of the texture is black: nothing stands there, although the mesh has four vertices."""
    values = np.zeros((64, 64), np.float32)
    values[:32, :] = 1.0
    ground, tree = quad(), quad("Tree")
    up = points(scatter(ground, one_class(tree, density=ImageDensity(image("half", values))), **OPTIONS).object)
    assert up[:, 1].min() >= 10 - 20 / 1024
    inverted = ImageDensity(bpy.data.images["half"], invert=True)
    down = points(scatter(ground, one_class(tree, density=inverted), **OPTIONS).object)
    assert down[:, 1].max() <= 10 + 20 / 1024
    layer = ground.data.uv_layers.new(name="Sideways")
    layer.uv.foreach_set("vector", [0, 0, 0, 1, 1, 1, 1, 0])
    by_uv = ImageDensity(bpy.data.images["half"], mapping="UV")
    right = points(scatter(ground, one_class(tree, density=by_uv), **OPTIONS).object)
    assert right[:, 0].min() >= 10 - 20 / 1024


def test_vertex_group_and_attribute():
    ground, tree = quad(), quad("Tree")
    ground.vertex_groups.new(name="right").add([1, 2], 1.0, "REPLACE")
    ground.data.attributes.new("rightness", "FLOAT", "POINT").data.foreach_set("value", [0, 1, 1, 0])
    for density in (VertexGroupDensity("right"), AttributeDensity("rightness")):
        x = points(scatter(ground, one_class(tree, 300, density=density), **OPTIONS).object)[:, 0]
        # The mean of a density that rises linearly from 0 to 20.
        assert abs(x.mean() - 20 * 2 / 3) < 0.3


def test_steeper_ground_gets_more_of_it():
    ground = new_object(
        "Roof", [(0, 0, 0), (10, 0, 0), (10, 10, 0), (0, 10, 0), (20, 0, 17.32), (20, 10, 17.32)],
        [(0, 1, 2, 3), (1, 4, 5, 2)],
    )  # fmt: skip
    # Footprints that cannot fit would push each other evenly over the plan.
    x = points(scatter(ground, one_class(quad("Tree"), 300), avoid_overlap=False, **OPTIONS).object)[:, 0]
    assert abs((x > 10).mean() - 2 / 3) < 0.02


def test_running_again_replaces_and_leaves_nothing_behind():
    ground, tree = hills(), quad("Tree")
    theirs = quad("ESH Scatter")
    first = scatter(ground, one_class(tree), **OPTIONS).object
    before = (len(bpy.data.objects), len(bpy.data.meshes), len(bpy.data.node_groups))
    earlier = points(first)
    for seed in (1, 2, 0):
        again = scatter(ground, one_class(tree), seed=seed, **OPTIONS).object
        assert again == first
        assert (points(again) == earlier).all() == (seed == 0), "the same seed, the same points"
    assert before == (len(bpy.data.objects), len(bpy.data.meshes), len(bpy.data.node_groups))
    assert bpy.data.objects["ESH Scatter"] == theirs and len(theirs.data.polygons) == 1


def test_members_of_a_collection_are_variants():
    library = bpy.data.collections.new("Library")
    bpy.context.scene.collection.children.link(library)
    for name in ("A", "B", "C"):
        member = quad(name)
        bpy.context.scene.collection.objects.unlink(member)
        library.objects.link(member)
    bpy.context.view_layer.layer_collection.children["Library"].exclude = True
    found = instances(scatter(hills(), one_class(library, 90), **OPTIONS).object)
    assert set(found) == {"A", "B", "C"} and sum(found.values()) == 90


BAD = {
    "no target": (lambda g, t: scatter(None, one_class(t)), "`target`"),
    "no class": (lambda g, t: scatter(g, []), "`classes`"),
    "itself": (lambda g, t: scatter(g, one_class(g)), "Ground"),
    "no source": (lambda g, t: scatter(g, one_class(None)), "`source`"),
    "no uv": (
        lambda g, t: scatter(g, one_class(t, density=ImageDensity(image("i", np.ones((2, 2))), "UV"))), "UV map"),
    "no group": (lambda g, t: scatter(g, one_class(t, density=VertexGroupDensity("x"))), '"x"'),
    "no attribute": (lambda g, t: scatter(g, one_class(t, density=AttributeDensity("x"))), '"x"'),
    "wrong attribute": (lambda g, t: scatter(g, one_class(t, density=AttributeDensity("position"))), "it holds vectors"),
    "black image": (lambda g, t: scatter(g, one_class(t, density=image("i", np.zeros((2, 2))))), '"i"'),
    "infinite turn": (lambda g, t: scatter(g, one_class(t), random_turn=np.inf), "`random_turn`"),
    "align": (lambda g, t: scatter(g, one_class(t), align_to_normal=2), "`align_to_normal`"),
    "foreign result": (lambda g, t: scatter(g, one_class(t), result=t), "Tree"),
    "unlinked": (lambda g, t: (bpy.context.scene.collection.objects.unlink(g), scatter(g, one_class(t))), "Ground"),
    "no faces": (lambda g, t: (g.data.clear_geometry(), scatter(g, one_class(t))), "faces"),
    "flat": (lambda g, t: (setattr(g, "scale", (1, 0, 1)), scatter(g, one_class(t))), "extent"),
    "edge-on": (lambda g, t: (setattr(g, "rotation_euler", (np.pi / 2, 0, 0.7)), scatter(g, one_class(t))), "above"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_sentence_and_changes_nothing(case):
    ground, tree = quad(), quad("Tree")
    run, words = BAD[case]
    before = set(bpy.data.objects), set(bpy.data.meshes), len(bpy.data.node_groups)
    with pytest.raises(esh.EshError) as caught:
        run(ground, tree)
    assert words in str(caught.value) and "\n" not in str(caught.value)
    assert before == (set(bpy.data.objects), set(bpy.data.meshes), len(bpy.data.node_groups))


def test_a_result_is_neither_target_nor_source():
    ground, tree = quad(), quad("Tree")
    made = scatter(ground, one_class(tree), **OPTIONS).object
    for target, source in ((made, tree), (ground, made)):
        with pytest.raises(esh.EshError, match="result of a scatter"):
            ScatterJob(target, one_class(source))


def sticks(**changes):
    """A long quad whose origin is at one end, on a flat ground of 20 m by 20 m."""
    ground = new_object("Flat", [(0, 0, 0), (20, 0, 0), (20, 20, 0), (0, 20, 0)], [(0, 1, 2, 3)])
    stick = new_object("Stick", [(0, -0.1, 0), (0, 0.1, 0), (0, 0.1, 1.6), (0, -0.1, 1.6)], [(0, 1, 2, 3)])
    stick.rotation_euler = (0.0, math.pi / 2, 0.0)
    bpy.context.view_layer.update()
    size = ScatterSize("one", 120, stick, **changes)
    return ground, [ScatterClass("stick", [size], direction=0.4)]


def instance_ends(result):
    """Both ends of every instance, as Blender evaluates it, shape [n, 2, 2]."""
    graph = bpy.context.evaluated_depsgraph_get()
    ends = []
    for instance in graph.object_instances:
        if instance.is_instance and instance.parent and instance.parent.original == result:
            matrix = np.array(instance.matrix_world)
            corners = np.array([v.co[:] + (1.0,) for v in instance.object.data.vertices]) @ matrix.T
            ends.append([corners[:2, :2].mean(axis=0), corners[2:, :2].mean(axis=0)])
    return np.array(ends)


def test_long_outlines_become_lines_that_lie_along_the_direction_and_do_not_overlap():
    ground, classes = sticks()
    result = scatter(ground, classes, device="cpu")
    placement = result.placement
    assert result.report.overlaps == 0
    np.testing.assert_allclose(placement.length + placement.width, 1.6, rtol=0.02)
    ends = instance_ends(result.object)
    assert len(ends) == 120
    np.testing.assert_allclose(ends.mean(axis=1), placement.position, atol=0.02)
    way = ends[:, 1] - ends[:, 0]
    np.testing.assert_allclose(np.hypot(*way.T), 1.6, rtol=1e-4)
    np.testing.assert_allclose(np.sin(np.arctan2(way[:, 1], way[:, 0]) - placement.angle), 0.0, atol=0.02)
    assert np.abs(np.sin(placement.angle - 0.4)).mean() < 0.1
    # The axis stays inside; the round caps, half a width, may reach over the border.
    assert (ends > -0.12).all() and (ends < 20.12).all()


def test_lines_can_be_forbidden_and_areas_may_be_a_range():
    ground, classes = sticks(line=False)
    assert (scatter(ground, classes, **OPTIONS).placement.length == 0.0).all()
    ground, classes = sticks(line=False, area=(0.1, 0.4))
    result = scatter(ground, classes, **OPTIONS)
    scale = np.empty(120 * 3, np.float32)
    result.object.data.attributes["scale"].data.foreach_get("vector", scale)
    np.testing.assert_allclose(0.32 * scale.reshape(-1, 3)[:, 0] ** 2, result.placement.area, rtol=0.03)
    assert np.ptp(result.placement.area) == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"line": "yes"}, "`line` of size"),
        ({"area": (0.4, 0.1)}, "smallest area first"),
        ({"share": 0.5}, "cannot be combined with a `count`"),
    ],
)
def test_lines_and_ranges_without_meaning(changes, complaint):
    ground, classes = sticks(**changes)
    with pytest.raises(EshError, match=complaint):
        scatter(ground, classes, **OPTIONS)
    with pytest.raises(EshError, match="`progress` must be a function"):
        scatter(*sticks(), progress=5)


def test_what_was_removed_from_the_file_is_said_so():
    ground, tree = quad(), quad("Tree")
    classes = one_class(tree)
    bpy.data.objects.remove(tree)
    with pytest.raises(EshError, match=r"`source` of size .* has been removed"):
        scatter(ground, classes, **OPTIONS)
    bpy.data.objects.remove(ground)
    with pytest.raises(EshError, match="`target` must be in the file"):
        scatter(ground, classes, **OPTIONS)


def test_images_removed_from_the_file_and_directions_without_meaning():
    ground, tree = quad(), quad("Tree")
    gone = image("gone", np.ones((2, 2)))
    wrapped = ImageDensity(gone)
    bpy.data.images.remove(gone)
    for named, words in (
        ({"density": gone}, "`density` of class .* removed"),
        ({"density": wrapped}, "`density` of class .* removed"),
        ({"direction": gone}, "`direction` of class .* removed"),
        ({"direction": "up"}, "`direction` of class"),
        ({"direction": image("none", np.full((2, 2), 0.5))}, "`direction` of class .* have a direction somewhere"),
    ):
        with pytest.raises(EshError, match=words):
            scatter(ground, one_class(tree, **named), **OPTIONS)


def test_an_outline_far_from_its_origin_still_lies_on_its_body_also_on_a_slope():
    ground = quad()
    ground.rotation_euler = (0.5, 0.0, 0.0)
    far = new_object("Far", [(30, -5, 0), (31.6, -5, 0), (31.6, -4.8, 0), (30, -4.8, 0)], [(0, 1, 2, 3)])
    result = scatter(ground, [ScatterClass("far", [ScatterSize("one", 40, far)], direction=0.3)], **OPTIONS)
    job = ScatterJob(ground, [ScatterClass("far", [ScatterSize("one", 40, far)])], device="cpu")
    on_ground = job.chart.surface_points(result.placement.position).position
    middles = []
    for instance in bpy.context.evaluated_depsgraph_get().object_instances:
        if instance.is_instance and instance.parent.original == result.object:
            corners = np.array([v.co[:] + (1.0,) for v in instance.object.data.vertices])
            middles.append((corners @ np.array(instance.matrix_world).T)[:, :3].mean(axis=0))
    np.testing.assert_allclose(middles, on_ground, atol=1e-3)


def test_shares_and_cover_count_the_surface_and_not_its_plan():
    """A roof of 60 degrees has twice the surface; a density of 0.8 per area is 1.6 seen from above."""
    roof = new_object("Roof", [(0, 0, 0), (10, 0, 10 * 3**0.5), (10, 10, 10 * 3**0.5), (0, 10, 0)], [(0, 1, 2, 3)])
    tree = quad("Tree", 0.5)
    sizes = [
        ScatterSize("large", None, tree, area=1.0, share=0.5),
        ScatterSize("small", None, tree, area=0.5, share=0.5),
    ]
    for correction in (False, True):
        made = [ScatterClass("tree", sizes, density=0.8, count="cover", density_correction=correction)]
        report = scatter(roof, made, avoid_overlap=False, **OPTIONS).report
        assert [size.placed for size in report.classes[0].sizes] == [80, 160]
    made = [
        ScatterClass(
            "tree", [ScatterSize("one", None, tree, area=1.0)], density=1.0, count="cover", density_correction=True
        )
    ]
    report = scatter(roof, made, avoid_overlap=False, **OPTIONS).report
    # 1 - T(0), the paper's equation 5: c = sqrt(3) / 2.
    assert report.classes[0].sizes[0].placed == round(200 * 2 * math.pi / (3 * 3**0.5))
    with pytest.raises(EshError, match=r"`density` of class .* between 0 and 1"):
        scatter(roof, [ScatterClass("tree", sizes, density=1.2, count="cover")], **OPTIONS)


def test_what_is_to_cover_the_ground_leaves_room_for_counts_beside_it():
    ground, tree, stone = quad("Ground", 10.0), quad("Tree", 1.0), quad("Stone", 1.0)

    def placed(stones):
        trees = ScatterClass("tree", [ScatterSize("one", None, tree)], density=1.0, count="cover")
        classes = [trees]
        if stones:
            classes.append(ScatterClass("stone", [ScatterSize("one", stones, stone)]))
        report = scatter(ground, classes, avoid_overlap=True, **OPTIONS).report
        assert report.overlaps == 0
        return report.classes[0].sizes[0].placed

    alone = placed(0)
    assert [alone - placed(stones) for stones in (20, 40)] == [20, 40]
    with pytest.raises(
        EshError, match='"Ground" has no room for class "tree" beside the counts of the others; lower these'
    ):
        placed(alone)


def test_long_bodies_follow_the_density_and_not_the_target_s_border():
    """On a disc whose density grows along y, edges run along x everywhere, also where the border does not."""
    bpy.ops.mesh.primitive_circle_add(vertices=128, radius=10.0, fill_type="NGON")
    ground = bpy.context.object
    y = np.array([vertex.co.y for vertex in ground.data.vertices])
    ground.data.attributes.new("up", "FLOAT", "POINT").data.foreach_set("value", ((y + 10.0) / 20.0).astype(np.float32))
    stick = new_object("Stick", [(-0.6, -0.1, 0), (0.6, -0.1, 0), (0.6, 0.1, 0), (-0.6, 0.1, 0)], [(0, 1, 2, 3)])
    sizes = [ScatterSize("one", 80, stick)]
    placement = scatter(ground, [ScatterClass("s", sizes, AttributeDensity("up"))], device="cpu").placement
    # Without directions, the mean would be 2 / pi.
    assert np.abs(np.sin(placement.angle)).mean() < 0.15
    job = ScatterJob(ground, [ScatterClass("s", sizes)], device="cpu")
    assert job.problem.classes[0].sizes[0].line.direction == "none", "an even density has no edges"


def test_what_sharpening_clipped_is_in_the_report():
    half = np.full((64, 64), 0.1, np.float32)
    half[:, 32:] = 1.0
    sharpened = one_class(quad("Tree"), density=half, unsharp=Unsharp(3.0, 20.0, 1.0))
    assert any("unsharp" in note for note in scatter(quad(), sharpened, **OPTIONS).report.notes)


def test_what_many_classes_share_is_read_once(monkeypatch):
    from esh.esh_scatter.classes import survey
    from esh.esh_scatter.densities.density_source import DensityReader

    read = {"density": 0, "outline": 0}
    honest_density, honest_outline = DensityReader.class_density, survey.outline_of

    def class_density(*arguments):
        read["density"] += 1
        return honest_density(*arguments)

    def outline_of(*arguments):
        read["outline"] += 1
        return honest_outline(*arguments)

    monkeypatch.setattr(DensityReader, "class_density", class_density)
    monkeypatch.setattr(survey, "outline_of", outline_of)
    source = quad("shared", 1.0)
    image = np.linspace(0.1, 1.0, 64).reshape(8, 8)
    classes = [ScatterClass(f"class {k}", [ScatterSize("s", 2, source)], density=image) for k in range(6)]
    job = ScatterJob(quad(), classes, device="cpu")
    assert read == {"density": 1, "outline": 1}
    assert len({id(c.density_image) for c in job.problem.classes}) == 1


def test_instances_say_where_blender_shows_the_objects():
    ground = hills()
    ground.location, ground.rotation_euler = (30, -7, 4), (0.2, -0.3, 1.1)
    stick = quad("Stick", 0.5)
    stick.rotation_euler = (0.0, 0.4, 0.0)
    sizes = [ScatterSize("stick", 30, stick, (0.05, 0.4)), ScatterSize("stone", 20, quad("Stone", 0.3), line=False)]
    result = scatter(ground, [ScatterClass("mixed", sizes)], scale_jitter=0.2, **OPTIONS)
    placed, graph = result.instances, bpy.context.evaluated_depsgraph_get()
    assert {values.dtype for values in (placed.position, placed.rotation, placed.scale)} == {np.dtype(np.float32)}
    shown = [
        (instance.object.original, np.array(instance.matrix_world))
        for instance in graph.object_instances
        if instance.is_instance and instance.parent.original == result.object
    ]
    assert len(shown) == len(placed.position) == 50
    for source, matrix in shown:
        # Blender shows them source by source.
        (found,) = np.flatnonzero(np.abs(placed.position - matrix[:3, 3]).max(axis=1) < 1e-4)
        assert result.sources[placed.source[found]] == source
        turned = Quaternion(placed.rotation[found]).to_matrix() @ source.rotation_euler.to_matrix()
        np.testing.assert_allclose(matrix[:3, :3], placed.scale[found] * np.array(turned), atol=1e-5)


def test_an_unsolved_job_has_no_instances():
    with pytest.raises(EshError, match="must be solved"):
        ScatterJob(quad(), one_class(quad("Tree")), device="cpu").instances()


@pytest.mark.parametrize(("away", "told"), [((100.0, -3000.0), False), ((500_000.0, 5_000_000.0), True)])
def test_what_blender_rounds_far_from_the_origin_is_said(away, told):
    """At the coordinates of a map planks lay in each other by half a meter, and the report said nothing."""
    ground = quad()
    ground.location.xy = away
    bpy.context.view_layer.update()
    tree = new_object("Tree", [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2, 3)])
    result = scatter(ground, [ScatterClass("tree", [ScatterSize("all", 30, tree)])], **OPTIONS)
    assert any("rounds positions to 0.5 m" in note for note in result.report.notes) == told
    assert len(result.report.notes) == told


def test_a_result_in_edit_mode_is_not_replaced_and_nothing_is_lost():
    ground, tree = quad(), quad("Tree", 0.5)
    trees = [ScatterClass("tree", [ScatterSize("any", 30, tree)])]
    first = scatter(ground, trees, **OPTIONS).object
    fewer = [ScatterClass("tree", [ScatterSize("any", 10, tree)])]
    job = ScatterJob(ground, fewer, **OPTIONS)
    job.solve()
    bpy.context.view_layer.objects.active = first
    bpy.ops.object.mode_set(mode="EDIT")
    meshes = len(bpy.data.meshes)
    for run in (lambda: scatter(ground, fewer, **OPTIONS), job.write):
        with pytest.raises(EshError, match="is in Edit Mode"):
            run()
    bpy.ops.object.mode_set(mode="OBJECT")
    assert len(first.data.vertices) == 30 and len(bpy.data.meshes) == meshes
    job.write()
    assert len(first.data.vertices) == 10
