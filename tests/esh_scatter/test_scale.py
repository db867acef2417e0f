"""A class's scale: its objects are larger, and so is the ground that they take."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import esh  # noqa: E402
from esh.esh_scatter.properties.amount_ahead import bodies_ahead  # noqa: E402
from esh.esh_scatter.targets.mesh_attributes import read_attribute  # noqa: E402


def box(name, width, depth, height):
    """One that does not stand around its origin."""
    mesh = bpy.data.meshes.new(name)
    corners = [(x, y, z) for z in (0.0, height) for x, y in ((0, 0), (width, 0), (width, depth), (0, depth))]
    faces = [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    mesh.from_pydata(corners, [], faces if height else [(0, 1, 2, 3)])
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


pytestmark = pytest.mark.usefixtures("empty_file")


def places(mesh):
    """Where objects stand with their middles, from which their origins move as they grow."""
    return read_attribute(mesh, "position") - read_attribute(mesh, "lift")


def solved(ground, size, **settings):
    return esh.scatter(ground, [esh.ScatterClass("c", [size])], device="cpu", max_steps=20, **settings)


@pytest.mark.parametrize("sides", [(0.5, 0.5), (2.0, 0.25)], ids=["round", "long"])
@pytest.mark.parametrize("surface", ["above", "whole"])
def test_a_scale_is_as_good_as_larger_objects(sides, surface):
    ground, small = box("Ground", 16.0, 16.0, 0.0), box("Small", *sides, 0.5)
    large = box("Large", *(2.0 * side for side in sides), 1.0)
    settings = {"scale_jitter": 0.25, "surface": surface, "align_to_normal": 0.0}
    one = solved(ground, esh.ScatterSize("s", 20, small), scale=2.0, name="one", **settings)
    other = solved(ground, esh.ScatterSize("s", 20, large), name="other", **settings)
    of_problem = [result.placement.problem.classes[0].sizes[0].mean_area for result in (one, other)]
    assert of_problem[0] == pytest.approx(of_problem[1], rel=1e-6) == pytest.approx(4.0 * np.prod(sides), rel=0.02)
    assert np.allclose(one.instances.position, other.instances.position, atol=1e-3)
    assert np.allclose(one.instances.scale, 2.0 * other.instances.scale, rtol=1e-5)
    assert one.report.overlaps == other.report.overlaps


def test_areas_that_are_given_follow_it_and_so_does_a_share_of_ground():
    ground, thing = box("Ground", 16.0, 16.0, 0.0), box("Thing", 0.5, 0.5, 0.5)
    for area in (None, 0.25, (0.1, 0.4)):
        counts = {}
        for scale in (1.0, 2.0):
            size = esh.ScatterSize("s", None, thing, area=area, share=1.0)
            asked = [esh.ScatterClass("c", [size], count=esh.Amount(cover=0.3))]
            job = esh.ScatterJob(ground, asked, scale=scale, device="cpu", max_steps=3)
            counts[scale] = job.problem.classes[0].sizes[0].count
            job.solve()
            factor = job.instances().scale
            if area is None or isinstance(area, float):
                assert np.allclose(factor, scale)
            else:
                taken = factor**2 * 0.25
                assert scale**2 * 0.1 - 1e-3 <= taken.min() <= taken.max() <= scale**2 * 0.4 + 1e-3
        assert counts[1.0] == pytest.approx(4 * counts[2.0], rel=0.03)


def test_what_has_no_meaning_is_said():
    ground, thing = box("Ground", 16.0, 16.0, 0.0), box("Thing", 0.5, 0.5, 0.5)
    with pytest.raises(esh.ProblemError, match=r"`scale` must be a number between 0\.001 and 1000; got 0"):
        solved(ground, esh.ScatterSize("s", 5, thing), scale=0.0)


@pytest.fixture
def scatter():
    made = bpy.context.scene.esh_scatter.add_scatter(box("Ground", 16.0, 16.0, 0.0))
    made.device, made.max_steps = "CPU", 10
    one = made.add_class()
    one.sizes[0].source_object, one.sizes[0].count = box("Thing", 0.5, 0.5, 0.5), 30
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    return made


def test_in_the_sidebar_it_shows_at_once_and_the_next_run_makes_room(scatter):
    before = places(scatter.result.data)
    one = scatter.classes[0]
    one.scale = 3.0
    assert (read_attribute(scatter.result.data, "scale") == 3.0).all(), "without a run"
    assert scatter.changes() == ["scale of Thing"]
    assert np.allclose(places(scatter.result.data), before, atol=1e-5)
    one.scale = 1.0
    assert not scatter.outdated and (read_attribute(scatter.result.data, "scale") == 1.0).all()
    one.scale = 3.0
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    assert (read_attribute(scatter.result.data, "scale") == 3.0).all()
    assert scatter.report["overlaps"] == 0 and not scatter.outdated
    assert scatter.report["covered"] == pytest.approx(30 * 2.25 / 256.0, rel=0.05)


def test_what_is_pinned_keeps_its_size(scatter):
    mesh = scatter.result.data
    chosen = np.zeros(30, bool)
    chosen[[3, 7]] = True
    mesh.vertices.foreach_set("select", chosen)
    assert bpy.ops.esh.instances_pin() == {"FINISHED"}
    place = places(mesh)[chosen]
    scatter.classes[0].scale = 2.0
    for _ in range(2):
        bpy.ops.esh.scatter()
        mesh = scatter.result.data
        stays = read_attribute(mesh, "pinned")
        assert stays.sum() == 2 and np.allclose(read_attribute(mesh, "scale"), 2.0)
        gaps = np.abs(places(mesh)[stays][:, None] - place[None]).max(axis=2).min(axis=1)
        assert gaps.max() < 1e-3
    assert scatter.report["overlaps"] == 0


def test_the_number_that_a_run_will_place_is_told_from_it(scatter):
    one = scatter.classes[0]
    one.count_kind, one.cover_share = "SHARE", 0.2
    before = bodies_ahead(scatter)
    one.scale = 2.0
    assert bodies_ahead(scatter) == pytest.approx(before / 4.0, abs=1)
