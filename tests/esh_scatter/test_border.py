"""Borders: how objects stand along the edges of the ground, in runs, with what stays, and while a result is followed."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh import EshError, ScatterClass, ScatterJob, ScatterSize, scatter  # noqa: E402

pytestmark = pytest.mark.usefixtures("empty_file")

SIDE = 20.0
OPTIONS = {"device": "cpu", "max_steps": 40}


def cone(name="Pine", radius=0.15):
    bpy.ops.mesh.primitive_cone_add(vertices=12, radius1=radius, depth=1.0, location=(80, 0, 0))
    bpy.context.object.name = name
    return bpy.context.object


def plane():
    bpy.ops.mesh.primitive_plane_add(size=SIDE)
    return bpy.context.object


def island():
    bpy.ops.mesh.primitive_circle_add(radius=0.5 * SIDE, vertices=96, fill_type="NGON")
    return bpy.context.object


def crowding(depth, area_within, count, ground):
    """The largest number at any distance from the edge, in tenths of a spacing up to two of them, over even."""
    spacing = np.sqrt(ground / count)
    edges = 0.2 * spacing * np.arange(11)
    return (np.histogram(depth, edges)[0] / (np.diff(area_within(edges)) / spacing**2)).max()


@pytest.mark.parametrize("made", [plane, island])
def test_a_natural_border_has_no_hedge(made):
    ground, half = made(), 0.5 * SIDE
    classes = [ScatterClass("pine", [ScatterSize("s", 900, cone())])]
    found = {}
    for boundary in ("open", "natural"):
        result = scatter(ground, classes, boundary=boundary, **OPTIONS)
        assert result.placement.problem.domain.boundary == boundary
        assert result.report.overlaps == 0 and len(result.placement.position) == 900
        place = result.instances.position[:, :2]
        if made is plane:
            found[boundary] = crowding(
                half - np.abs(place).max(axis=1), lambda d: SIDE**2 - (SIDE - 2 * d) ** 2, 900, SIDE**2
            )
        else:
            found[boundary] = crowding(
                half - np.hypot(*place.T), lambda d: np.pi * (half**2 - (half - d) ** 2), 900, np.pi * half**2
            )
    assert found["natural"] < 2.0 < found["open"]


def test_mirrors_and_whole_surfaces():
    ground, classes = plane(), [ScatterClass("pine", [ScatterSize("s", 50, cone())])]
    assert ScatterJob(ground, classes, boundary="mirror", **OPTIONS).problem.domain.mirrored
    assert ScatterJob(ground, classes, **OPTIONS).problem.domain.boundary == "open"
    whole = scatter(ground, classes, boundary="natural", surface="whole", **OPTIONS)
    assert len(whole.placement.position) == 50
    with pytest.raises(EshError, match='`boundary` must be "open", "natural" or "mirror"; got "periodic"'):
        scatter(ground, classes, boundary="periodic", **OPTIONS)


def settings_with(count=300, boundary="NATURAL"):
    ground = plane()
    made = bpy.context.scene.esh_scatter.add_scatter(ground)
    size = made.add_class().sizes[0]
    size.source_object, size.count = cone(), count
    made.device, made.max_steps, made.boundary = "CPU", 40, boundary
    return made


def places():
    mesh = bpy.context.scene.esh_scatter.active.result.data
    at = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.attributes["position"].data.foreach_get("vector", at)
    number = np.empty(len(mesh.vertices), np.int32)
    mesh.attributes["id"].data.foreach_get("value", number)
    return dict(zip(number.tolist(), at.reshape(-1, 3), strict=True))


def test_what_is_pinned_stays():
    settings_with()
    bpy.ops.esh.scatter()
    before = places()
    result = bpy.context.scene.esh_scatter.active.result
    bpy.context.view_layer.objects.active = result
    bpy.ops.esh.instances_edit()
    chosen = np.zeros(300, bool)
    chosen[:30] = True
    bpy.ops.object.mode_set(mode="OBJECT")
    result.data.vertices.foreach_set("select", chosen)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.esh.instances_pin()
    bpy.ops.esh.instances_edit()
    pinned = list(before)[:30]
    scatter_of_file = bpy.context.scene.esh_scatter.active
    scatter_of_file.classes[0].sizes[0].count, scatter_of_file.seed = 320, 4
    bpy.ops.esh.scatter()
    after = places()
    assert len(after) == 320
    for number in pinned:
        np.testing.assert_allclose(after[number], before[number], atol=1e-5)


def depth_of(place):
    return 0.5 * SIDE - np.abs(np.array(place)[..., :2]).max(axis=-1)


def test_live_leaves_who_stands_at_the_border_where_they_are(follow):
    made = settings_with(boundary="NATURAL")
    bpy.ops.esh.scatter()
    made = bpy.context.scene.esh_scatter.active
    made.live = True
    follow()
    before = places()
    spacing = SIDE / np.sqrt(300)
    for count in (301, 302, 303):
        made.classes[0].sizes[0].count = count
        follow()
    after = places()
    assert len(after) == 303
    both = [number for number in before if number in after and depth_of(before[number]) < 0.8 * spacing]
    moved = np.array([np.linalg.norm(after[number] - before[number]) for number in both])
    assert len(both) > 40 and (moved < 0.1 * spacing).mean() > 0.85


@pytest.mark.parametrize("when", ["while it lives", "before"])
def test_live_begins_anew_for_another_border(when, follow):
    made = settings_with(900, boundary="OPEN")
    bpy.ops.esh.scatter()
    made = bpy.context.scene.esh_scatter.active
    if when == "before":
        made.boundary = "NATURAL"
    made.live = True
    follow()
    made.boundary = "NATURAL"
    follow()
    place = np.array(list(places().values()))
    assert crowding(depth_of(place), lambda d: SIDE**2 - (SIDE - 2 * d) ** 2, 900, SIDE**2) < 2.0
    assert not made.outdated
