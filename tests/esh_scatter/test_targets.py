"""Targets as a whole: closed meshes, several at once, collections, parts of their faces, and what cannot be one."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import bmesh  # noqa: E402
import esh  # noqa: E402
import trimesh  # noqa: E402
from esh.esh_scatter.api import ImageDensity, ScatterClass, ScatterJob, ScatterSize, scatter  # noqa: E402
from mathutils import Quaternion, Vector  # noqa: E402

pytestmark = pytest.mark.usefixtures("bare_file")

OPTIONS = {"device": "cpu", "max_steps": 20}


def mesh_object(name, corners, faces):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], faces)
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


def chip():
    """A small thing to place, whose own axis is z."""
    return mesh_object("Chip", [(-0.02, -0.02, 0), (0.02, -0.02, 0), (0.02, 0.02, 0), (-0.02, 0.02, 0)], [(0, 1, 2, 3)])


def added(kind, **named):
    getattr(bpy.ops.mesh, f"primitive_{kind}_add")(**named)
    return bpy.context.object


def classes(count=300, source=None, **named):
    return [ScatterClass("chip", [ScatterSize("one", count, source or chip())], **named)]


def points(item):
    values = np.empty(3 * len(item.data.vertices), np.float32)
    item.data.vertices.foreach_get("co", values)
    return values.reshape(-1, 3)


def values(item, name):
    attribute = item.data.attributes[name]
    field, width = {"INT": ("value", 1), "FLOAT_VECTOR": ("vector", 3), "QUATERNION": ("value", 4)}[attribute.data_type]
    found = np.empty(width * len(attribute.data), np.int32 if attribute.data_type == "INT" else np.float32)
    attribute.data.foreach_get(field, found)
    return found.reshape(-1, width) if width > 1 else found


def in_the_world(*items):
    """What Blender shows of mesh objects, as one trimesh that looks outward."""
    bpy.context.view_layer.update()
    parts = []
    for item in items:
        item.data.calc_loop_triangles()
        faces = np.array([t.vertices[:] for t in item.data.loop_triangles])
        corners = np.array([item.matrix_world @ v.co for v in item.data.vertices])
        mirrored = item.matrix_world.determinant() < 0
        parts.append(trimesh.Trimesh(corners, faces[:, ::-1] if mirrored else faces, process=False))
    return trimesh.util.concatenate(parts)


def assert_stands_on(result, surface):
    """Points are on the surface, and the objects' own axes point out of it."""
    place = points(result.object)
    _, distance, face = trimesh.proximity.closest_point_naive(surface, place)
    assert distance.max() < 1e-4 * np.ptp(surface.vertices, axis=0).max()
    up = np.array([Quaternion(q) @ Vector((0, 0, 1)) for q in values(result.object, "rotation")])
    outward = (up * surface.face_normals[face]).sum(axis=1)
    # At an edge the nearest face need not be that of the point.
    assert np.mean(outward > 0.3) > 0.95
    return place, up


def test_a_ball_is_covered_all_round():
    ball = added("ico_sphere", subdivisions=4, radius=2.0)
    ball.location = (5, -3, 1)
    result = scatter(ball, classes(400), surface="whole", **OPTIONS)
    place, up = assert_stands_on(result, in_the_world(ball))
    out = (place - (5, -3, 1)) / 2.0
    assert np.abs(out.mean(axis=0)).max() < 0.01
    assert (up * out).sum(axis=1).min() > 0.99
    report = result.report.to_dict()
    assert report["coverage_error"] < 0.04 and report["overlaps"] == 0 and report["smallest_spacing"] > 0.7
    assert report["classes"][0]["sizes"][0]["placed"] == 400


def test_two_halves_of_a_ball_are_covered_like_a_ball():
    """Each has an origin of its own, so that their borders are one but for rounding."""
    halves = []
    for upper in (True, False):
        half = added("ico_sphere", subdivisions=4, radius=2.0)
        mesh = bmesh.new()
        mesh.from_mesh(half.data)
        elsewhere = [face for face in mesh.faces if (face.calc_center_median().z > 0.0) is not upper]
        bmesh.ops.delete(mesh, geom=elsewhere, context="FACES")
        shift = Vector((0.1, 0.2, 0.3)) * (1 if upper else -7)
        bmesh.ops.translate(mesh, vec=shift, verts=mesh.verts)
        mesh.to_mesh(half.data)
        half.location = Vector((5, -3, 1)) - shift
        halves.append(half)
    result = scatter(halves, classes(400), surface="whole", **OPTIONS)
    place, _ = assert_stands_on(result, in_the_world(*halves))
    assert np.abs((place - (5, -3, 1)).mean(axis=0) / 2.0).max() < 0.01
    report = result.report.to_dict()
    assert report["coverage_error"] < 0.04 and report["smallest_spacing"] > 0.7


def test_objects_stand_upright_or_along_the_normal_or_between():
    ball, one = added("ico_sphere", subdivisions=3), chip()
    angles = {}
    for align in (0.0, 0.5, 1.0):
        result = scatter(ball, classes(200, one), surface="whole", align_to_normal=align, **OPTIONS)
        up = np.array([Quaternion(q) @ Vector((0, 0, 1)) for q in values(result.object, "rotation")])
        normal = values(result.object, "ground_normal")
        angles[align] = np.arccos(np.clip((up * normal).sum(axis=1), -1, 1)), np.arccos(np.clip(normal[:, 2], -1, 1))
        np.testing.assert_allclose(np.linalg.norm(values(result.object, "rotation"), axis=1), 1.0, atol=1e-5)
    for align, (leaning, slope) in angles.items():
        np.testing.assert_allclose(leaning, (1.0 - align) * slope, atol=2e-3)


def test_what_stands_upright_on_walls_is_told_since_it_may_reach_into_others():
    ball, plane, one = added("ico_sphere", subdivisions=3), added("plane", size=4.0), chip()

    def told(target, **options):
        report = scatter(target, classes(200, one), surface="whole", **{**OPTIONS, **options}).report
        return [note for note in report.notes if "upright on walls" in note]

    (note,) = told(ball, align_to_normal=0.0)
    assert note.startswith('"chip" ')
    assert not told(ball, align_to_normal=1.0) and not told(plane, align_to_normal=0.0)
    assert not told(ball, align_to_normal=0.0, avoid_overlap=False)


def test_what_looks_straight_down_is_turned_over():
    box, one = added("cube", size=2.0), chip()
    result = scatter(box, classes(120, one), surface="whole", random_turn=0.0, **OPTIONS)
    below = values(result.object, "ground_normal")[:, 2] < -0.9
    assert 5 <= below.sum() <= 40
    for quaternion in values(result.object, "rotation")[below]:
        assert np.linalg.norm(quaternion) == pytest.approx(1.0, abs=1e-5)
        assert (Quaternion(quaternion) @ Vector((0, 0, 1))).z < -0.99


def test_a_closed_box_has_as_many_on_every_side():
    box = added("cube", size=2.0)
    box.scale = (1.0, 2.0, 0.5)
    result = scatter(box, classes(700), surface="whole", align_to_normal=1.0, **OPTIONS)
    side = np.rint(values(result.object, "ground_normal")).astype(int)
    area = {0: 2.0, 1: 1.0, 2: 4.0}
    whole = 2 * sum(area.values()) * 2
    for axis, of_side in area.items():
        for sign in (-1, 1):
            number = (side[:, axis] == sign).sum()
            assert number == pytest.approx(700 * 2 * of_side / whole, abs=12)


def board(name, length, width):
    """A flat thing to place, twice as far from its origin on one side as on the other."""
    low, high = -length / 3.0, 2.0 * length / 3.0
    return mesh_object(
        name,
        [(low, -width / 2, 0), (high, -width / 2, 0), (high, width / 2, 0), (low, width / 2, 0)],
        [(0, 1, 2, 3)],
    )


def lying_in_each_other(result, tolerance):
    """Pairs of flat objects that overlap by more than a share of their width in the plane between those that they lie in."""
    import shapely

    instances = result.instances
    objects = [result.sources[k] for k in instances.source]
    turn = [Quaternion(q) for q in instances.rotation]
    corner = [
        np.array([r @ (Vector(v.co) * float(s)) for v in item.data.vertices])
        for item, r, s in zip(objects, turn, instances.scale, strict=True)
    ]
    place = [c + p for c, p in zip(corner, instances.position.astype(float), strict=True)]
    up = np.array([r @ Vector((0, 0, 1)) for r in turn])
    found = []
    for i in range(len(place)):
        for j in range(i):
            way = instances.position[j].astype(float) - instances.position[i]
            reach = sum(np.linalg.norm(corner[k], axis=1).max() for k in (i, j))
            if np.linalg.norm(way) > reach or up[i] @ up[j] <= 0.0:
                continue
            between = Vector(up[i] + up[j]).normalized()
            x = Vector(way).cross(between).normalized()
            flat = []
            for k, offset in ((i, 0.0), (j, np.linalg.norm(way))):
                laid = Vector(up[k]).rotation_difference(between)
                seen = np.array([laid @ Vector(c) for c in corner[k]])
                y = np.array(between.cross(x))
                flat.append(shapely.Polygon(np.stack([seen @ np.array(x), seen @ y + offset], axis=1)))
            width = min(2.0 * np.sqrt(p.area) / max(p.length / np.sqrt(p.area) / 2.0, 1.0) for p in flat)
            inner = [p.buffer(-0.5 * tolerance * width, join_style="mitre") for p in flat]
            if inner[0].intersects(inner[1]):
                found.append((i, j))
    return found


@pytest.mark.once
def test_sources_keep_apart_by_their_outlines_on_a_whole_surface():
    ball = added("ico_sphere", subdivisions=4, radius=2.0)
    # Neither is long enough to be a line; planks that are asked for as outlines are.
    sizes = [
        ScatterSize("slab", 110, board("Slab", 0.5, 0.34)),
        ScatterSize("plank", 90, board("Plank", 0.75, 0.18), line=False),
    ]
    settings = {"surface": "whole", "align_to_normal": 1.0, "random_turn": 2.0 * np.pi, "scale_jitter": 0.3, **OPTIONS}
    asked = [ScatterClass("wood", sizes)]
    result = scatter(ball, asked, **settings)
    # Areas grow on average where scales vary by 30 %.
    assert result.report.covered == pytest.approx(1.03 * (110 * 0.17 + 90 * 0.135) / 50.0, abs=0.02)
    assert result.report.overlaps == 0
    assert len(set(np.round(result.instances.scale, 4))) > 100
    # Objects stand along shading normals, outlines lie on the faces.
    assert lying_in_each_other(result, 0.03) == []
    loose = scatter(ball, asked, **settings, avoid_overlap=False)
    assert len(lying_in_each_other(loose, 0.03)) > 50


@pytest.mark.once
def test_on_a_whole_surface_outlines_of_a_range_and_of_long_objects_cover_as_many_as_fit():
    ball = added("ico_sphere", subdivisions=4, radius=3.0)
    sizes = [
        ScatterSize("slab", source=board("Slab", 0.5, 0.34), area=(0.1, 0.3), share=0.7),
        ScatterSize("stick", source=board("Stick", 0.9, 0.12), share=0.3),
    ]
    result = scatter(ball, [ScatterClass("wood", sizes, count="cover")], surface="whole", **OPTIONS)
    assert result.report.overlaps == 0
    assert 0.6 < result.report.covered < 0.85
    assert result.placement.scale.min() < 0.9 and (result.placement.length > 0.0).any()


def test_suzanne_is_covered_with_her_modifiers():
    monkey = added("monkey")
    monkey.modifiers.new("Subdivision", "SUBSURF").levels = 1
    result = scatter(monkey, classes(600), surface="whole", device="cpu", max_steps=100)
    evaluated = monkey.evaluated_get(bpy.context.evaluated_depsgraph_get())
    assert_stands_on(result, in_the_world(evaluated))
    assert result.report.coverage_error < 0.1 and result.report.overlaps == 0


def test_a_scaled_and_parented_pair_and_a_mirrored_one():
    torus, ball = added("torus", location=(4, 0, 0)), added("uv_sphere", location=(0, 0, 3))
    ball.parent, torus.scale, ball.scale = torus, (-1.5, 1.0, 1.0), (1, 2, 0.7)
    torus.rotation_euler = (0.3, 0.2, 0.1)
    result = scatter([torus, ball], classes(500), surface="whole", **OPTIONS)
    assert_stands_on(result, in_the_world(torus, ball))
    target = values(result.object, "esh_target")
    surfaces = [in_the_world(item).area for item in (torus, ball)]
    assert (target == 0).sum() == pytest.approx(500 * surfaces[0] / sum(surfaces), abs=10)


@pytest.mark.parametrize("scale", [(-1.0, 1.2, 1.0), (1.0, -0.8, 1.0), (-1.0, -1.0, 1.0)])
def test_normals_of_a_mirrored_terrain_look_up(scale):
    from esh.esh_scatter.result.attributes import NORMAL

    terrain = added("grid", size=10.0, x_subdivisions=12, y_subdivisions=12)
    for vertex in terrain.data.vertices:
        vertex.co.z = 0.6 * np.sin(0.7 * vertex.co.x) + 0.2 * vertex.co.y
    terrain.data.update()
    terrain.scale = scale
    item = scatter(terrain, classes(60, chip()), **OPTIONS).object
    x, _, _ = points(item).T
    # Mirrored along x, the sine goes the other way.
    steep = np.stack([np.sign(scale[0]) * 0.42 * np.cos(0.7 * x), np.full(len(x), 0.2 / scale[1])], axis=1)
    expected = np.column_stack([-steep, np.ones(len(x))]) / np.sqrt(1.0 + (steep**2).sum(axis=1))[:, None]
    np.testing.assert_allclose(values(item, NORMAL), expected, atol=0.15)


def test_points_are_known_by_face_and_weights_so_that_they_follow_a_mesh_that_bends():
    torus, ball = added("torus", location=(4, 0, 0)), added("uv_sphere", location=(0, 0, 3))
    torus.scale = (1, -1, 1)
    bpy.context.view_layer.update()
    for options in ({"surface": "whole"}, {"surface": "whole", "both_sides": True}, {"surface": "above"}):
        item = scatter([torus, ball], classes(200, bpy.data.objects.get("Chip")), **options, **OPTIONS).object
        corner = np.stack([values(item, f"esh_vertex_{k}") for k in range(3)], axis=1)
        weight, target, face = values(item, "esh_barycentric"), values(item, "esh_target"), values(item, "esh_face")
        for number, one in enumerate((torus, ball)):
            own = target == number
            place = np.array([one.matrix_world @ v.co for v in one.data.vertices])
            np.testing.assert_allclose(
                np.einsum("nk,nkd->nd", weight[own], place[corner[own]]), points(item)[own], atol=1e-4
            )
            for number_of_face, corners in zip(face[own], corner[own], strict=True):
                assert set(corners) <= set(one.data.polygons[number_of_face].vertices)
    assert "esh_target" not in scatter(torus, classes(20, bpy.data.objects["Chip"]), **OPTIONS).object.data.attributes


def test_tiles_of_a_terrain_are_one_ground_seen_from_above():
    tiles = [added("grid", size=2.0, location=(2.0 * x, 0, 0)) for x in range(3)]
    one = chip()
    result = scatter(tiles, classes(600, one), **OPTIONS)
    place = points(result.object)
    assert np.ptp(place[:, 0]) > 5.8 and result.report.coverage_error < 0.05
    holder = bpy.data.collections.new("Tiles")
    bpy.context.scene.collection.children.link(holder)
    for tile in tiles:
        holder.objects.link(tile)
    holder.objects.link(bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT")))
    as_collection = scatter(holder, classes(600, one), **OPTIONS)
    assert points(as_collection.object).tobytes() == place.tobytes()
    # The result is known by the collection, and replaced.
    again = scatter(holder, classes(50, one), **OPTIONS)
    assert again.object == as_collection.object and len(points(again.object)) == 50
    # A mesh without faces is passed over, whatever its name, until there is nothing else.
    holder.objects.link(mesh_object("A Guide", [(0, 0, 0), (1, 0, 0)], []))
    assert points(scatter(holder, classes(600, one), **OPTIONS).object).tobytes() == place.tobytes()
    for item in list(holder.objects)[:-1]:
        holder.objects.unlink(item)
    with pytest.raises(esh.ProblemError, match='target "A Guide" must have faces; its mesh has none'):
        scatter(holder, classes(600, one), **OPTIONS)


def test_automatic_is_decided_by_what_is_covered():
    one = chip()
    hills = added("grid", x_subdivisions=30, y_subdivisions=30, size=4.0)
    for v in hills.data.vertices:
        v.co.z = 0.3 * np.sin(2 * v.co.x)
    ball = added("ico_sphere", location=(9, 0, 0))
    wall = mesh_object("Wall", [(0, 20, 0), (2, 20, 0), (2, 20, 2), (0, 20, 2)], [(0, 1, 2, 3)])
    for item, whole in ((hills, False), (ball, True), (wall, True)):
        job = ScatterJob(item, classes(20, one), surface="auto", **OPTIONS)
        assert isinstance(job.problem.domain, esh.Surface) == whole, item.name
    assert isinstance(ScatterJob(hills, classes(20, one), both_sides=True, **OPTIONS).problem.domain, esh.Surface)


def test_both_sides_of_a_sheet():
    sheet = added("grid", size=2.0)
    result = scatter(sheet, classes(400), both_sides=True, **OPTIONS)
    assert (values(result.object, "ground_normal")[:, 2] > 0).sum() == pytest.approx(200, abs=4)
    outward = scatter(sheet, classes(400, bpy.data.objects["Chip"]), surface="whole", **OPTIONS)
    assert (values(outward.object, "ground_normal")[:, 2] > 0).all()


def test_what_is_near_is_so_in_space_on_a_whole_surface():
    """A post beside a box: near its middle only, not all along the column above and below it."""
    box, one = added("cube", size=4.0), chip()
    post = bpy.data.objects.new("Post", None)
    bpy.context.scene.collection.objects.link(post)
    post.location = (2.0, 0.0, 1.5)
    bpy.context.view_layer.update()
    made = scatter(box, classes(60, one, density=esh.DistanceDensity(post, 0.5, 1.0)), surface="whole", **OPTIONS)
    away = np.linalg.norm(points(made.object) - np.array(post.location), axis=1)
    assert away.max() < 1.2
    # What is seen from above is as near as it looks from there.
    post.location.z = -5.0
    bpy.context.view_layer.update()
    made = scatter(box, classes(20, one, density=esh.DistanceDensity(post, 0.5, 1.0)), surface="above", **OPTIONS)
    assert np.linalg.norm(points(made.object)[:, :2] - [2.0, 0.0], axis=1).max() < 1.2
    with pytest.raises(esh.ProblemError, match="0 everywhere"):
        scatter(box, classes(20, one, density=esh.DistanceDensity(post, 0.5, 1.0)), surface="whole", **OPTIONS)


def test_densities_are_read_everywhere_on_the_surface():
    """Within the large faces of a box: through its UV map, from a vertex group, from an attribute, and as a count."""
    box, one = added("cube", size=2.0), chip()
    box.data.uv_layers.new(name="Sides")
    # The faces one beside the other; of each, the left half is white.
    for polygon in box.data.polygons:
        for loop, uv in zip(polygon.loop_indices, ((0, 0), (1, 0), (1, 1), (0, 1)), strict=True):
            box.data.uv_layers["Sides"].uv[loop].vector = uv
    picture = bpy.data.images.new("half", 64, 64, float_buffer=True)
    pixels = np.zeros((64, 64, 4), np.float32)
    pixels[:, :32, :3], pixels[..., 3] = 1.0, 1.0
    picture.pixels.foreach_set(pixels.ravel())
    by_uv = ImageDensity(picture, "UV", uv_map="Sides")
    for settings in ({}, {"count": esh.Amount(per_area=10.0)}):
        sizes = [ScatterSize("one", None if settings else 240, one, share=1.0 if settings else None)]
        job = ScatterJob(box, [ScatterClass("a", sizes, by_uv, **settings)], surface="whole", **OPTIONS)
        assert job.problem.body_count == pytest.approx(240 if not settings else 120, rel=0.02)
        job.solve()
        result = job.write()
        corner = np.stack([values(result.object, f"esh_vertex_{k}") for k in range(3)], axis=1)
        u = np.array(
            [
                sum(
                    w * box.data.uv_layers["Sides"].uv[loop].vector.x
                    for w, c in zip(weight, corners, strict=True)
                    for loop in box.data.polygons[face].loop_indices
                    if box.data.loops[loop].vertex_index == c
                )
                for face, weight, corners in zip(
                    values(result.object, "esh_face"), values(result.object, "esh_barycentric"), corner, strict=True
                )
            ]
        )
        assert u.max() < 0.53
    group = box.vertex_groups.new(name="top")
    group.add([v.index for v in box.data.vertices if v.co.z > 0], 1.0, "REPLACE")
    upper = scatter(box, classes(300, one, density=esh.VertexGroupDensity("top")), surface="whole", **OPTIONS)
    assert points(upper.object)[:, 2].min() > -1.0 and (points(upper.object)[:, 2] > 0).mean() > 0.8
    side = box.data.attributes.new("side", "BOOLEAN", "FACE")
    side.data[2].value = True
    only = scatter(box, classes(50, one, density=esh.AttributeDensity("side")), surface="whole", **OPTIONS)
    assert set(values(only.object, "esh_face")) == {2}


@pytest.mark.parametrize("surface", ["whole", "above"])
def test_faces_are_limited_by_material_vertex_group_and_selection(surface):
    grid, one = added("grid", x_subdivisions=10, y_subdivisions=10, size=10.0), chip()
    for name in ("Stone", "Grass"):
        grid.data.materials.append(bpy.data.materials.new(name))
    right = np.array([polygon.center.x > 0 for polygon in grid.data.polygons])
    grid.data.polygons.foreach_set("material_index", right.astype(np.int32))
    grid.vertex_groups.new(name="up").add([v.index for v in grid.data.vertices if v.co.y > 0.5], 1.0, "REPLACE")
    chosen = grid.data.attributes.new("chosen", "BOOLEAN", "FACE")
    chosen.data.foreach_set("value", np.array([p.center.x > 0 and p.center.y > 0 for p in grid.data.polygons]))

    def extent(**limits):
        found = points(scatter(grid, classes(150, one), surface=surface, **limits, **OPTIONS).object)
        return found.min(axis=0), found.max(axis=0)

    low, high = extent(face_material="Grass")
    assert low[0] >= 0.0 and high[0] > 4.5 and low[1] < -4.5
    low, high = extent(face_group="up")
    assert low[1] >= 0.0 and low[0] < -4.5
    low, high = extent(face_attribute="chosen")
    assert low[0] >= 0.0 and low[1] >= 0.0
    low, high = extent(face_material="Stone", face_group="up")
    assert high[0] <= 0.0 and low[1] >= 0.0
    for limits, message in (
        ({"face_material": "Moss"}, '`face_material`: target "Grid" has no material "Moss"; it has "Stone", "Grass"'),
        ({"face_group": "down"}, '`face_group`: target "Grid" has no vertex group "down"; it has "up"'),
        ({"face_attribute": "nothing"}, '`face_attribute`: target "Grid" has no attribute "nothing"; it has '),
        ({"face_group": 3}, "`face_group` must be text; got 3"),
    ):
        with pytest.raises(esh.EshError) as raised:
            scatter(grid, classes(10, one), surface=surface, **limits, **OPTIONS)
        assert str(raised.value).startswith(message)
    chosen.data.foreach_set("value", np.zeros(len(grid.data.polygons), bool))
    with pytest.raises(esh.EshError, match='`face_attribute` must leave faces of target "Grid"; "chosen" is above'):
        scatter(grid, classes(10, one), surface=surface, face_attribute="chosen", **OPTIONS)


def test_an_image_from_above_lies_over_all_of_the_target_also_where_faces_are_left_out():
    grid, one = added("grid", x_subdivisions=10, y_subdivisions=10, size=10.0), chip()
    chosen = grid.data.attributes.new("chosen", "BOOLEAN", "FACE")
    chosen.data.foreach_set("value", np.array([p.center.x > 0 for p in grid.data.polygons]))
    image = np.zeros((8, 8), np.float32)
    image[:, 4:6] = 1.0
    for surface in ("above", "whole"):
        options = {"surface": surface, "face_attribute": "chosen", **OPTIONS}
        place = points(scatter(grid, classes(100, one, density=image), **options).object)
        assert place[:, 0].min() >= 0.0 and 2.0 < place[:, 0].max() < 3.7


def test_the_mesh_of_edit_mode_counts():
    ball, one = added("ico_sphere", subdivisions=3), chip()
    bpy.context.view_layer.objects.active = ball
    bpy.ops.object.mode_set(mode="EDIT")
    edited = bmesh.from_edit_mesh(ball.data)
    for vertex in edited.verts:
        vertex.co.z += 7.0
    bmesh.update_edit_mesh(ball.data)
    place = points(scatter(ball, classes(60, one), surface="whole", **OPTIONS).object)
    bpy.ops.object.mode_set(mode="OBJECT")
    assert place[:, 2].min() > 5.9 and place[:, 2].max() < 8.1


def test_what_cannot_be_a_target_is_refused_with_a_sentence():
    one, ball = chip(), added("ico_sphere")
    holder = bpy.data.collections.new("Rocks")
    empty = bpy.data.objects.new("Instance", None)
    bpy.context.scene.collection.objects.link(empty)
    empty.instance_type, empty.instance_collection = "COLLECTION", holder
    copies = mesh_object("Copies", [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    nodes = bpy.data.node_groups.new("Instances", "GeometryNodeTree")
    nodes.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    info, put = nodes.nodes.new("GeometryNodeObjectInfo"), nodes.nodes.new("NodeGroupOutput")
    info.inputs["Object"].default_value, info.inputs["As Instance"].default_value = ball, True
    nodes.links.new(info.outputs["Geometry"], put.inputs["Geometry"])
    copies.modifiers.new("Instances", "NODES").node_group = nodes
    painter = added("plane")
    painter.instance_type, painter.show_instancer_for_viewport = "FACES", False
    instancer = "must have faces of its own; it is an instancer, which shows copies"
    for target, message in (
        (empty, f'target "Instance" {instancer} of collection "Rocks": make them real first'),
        (painter, f'target "Plane" {instancer}: make them real first'),
        ([ball, empty], f'target "Instance" {instancer}'),
        (copies, 'target "Copies" must have faces; it has instances only'),
        (holder, 'target collection "Rocks" must hold mesh objects that are visible; it has none'),
        ([], "`target` must be a mesh object, several or a collection; got an empty list"),
        ([ball, ball], '`target` must not hold an object twice; it holds "Icosphere" twice'),
        ("Icosphere", "`target` must be a mesh object, several or a collection; got"),
        ([ball, one], '`source` of size "one" of class "chip" must not hold the target "Chip"'),
    ):
        with pytest.raises(esh.EshError) as raised:
            scatter(target, classes(10, one), surface="whole", **OPTIONS)
        assert str(raised.value).startswith(message)
    with pytest.raises(esh.EshError, match='`surface` must be "above", "whole" or "auto"; got "below"'):
        scatter(ball, classes(10, one), surface="below", **OPTIONS)
    with pytest.raises(esh.EshError, match='`unsharp` of class "chip" must be None on a whole surface'):
        scatter(ball, classes(10, one, unsharp=esh.Unsharp(1.0, 5.0)), surface="whole", **OPTIONS)


def test_several_classes_of_several_sizes_do_not_overlap_on_a_torus():
    torus, one = added("torus", major_segments=96, minor_segments=32), chip()
    asked = [
        ScatterClass("large", [ScatterSize("large", 40, one, area=0.02), ScatterSize("small", 200, one, area=0.005)]),
        ScatterClass("other", [ScatterSize("range", 150, one, area=(0.002, 0.01))]),
    ]
    result = scatter(torus, asked, surface="whole", device="cpu", max_steps=100)
    assert result.report.overlaps == 0
    assert np.bincount(values(result.object, "class_index")).tolist() == [240, 150]
    # A range scales its instances to their footprints.
    scale = np.empty(3 * 390, np.float32)
    result.object.data.attributes["scale"].data.foreach_get("vector", scale)
    scale = scale.reshape(-1, 3)[values(result.object, "class_index") == 1, 0]
    assert scale.max() / scale.min() > 2.0


def test_the_sidebar_scatters_on_a_whole_surface_and_shows_its_report():
    from esh.esh_scatter import registration
    from esh.esh_scatter.result import words

    registration.register()
    try:
        settings = bpy.context.scene.esh_scatter.add_scatter(added("torus"))
        settings.add_class().sizes[0].source_object = chip()
        settings.classes[0].sizes[0].count, settings.device = 150, "CPU"
        settings.surface, settings.max_steps = "AUTO", 30
        assert bpy.ops.esh.scatter() == {"FINISHED"}
        below = points(settings.result)[:, 2] < -0.05
        assert 40 < below.sum() < 110
        assert "150 placed · no overlap · very even" in words.summary(settings.report)
        assert not settings.outdated
        settings.both_sides = True
        assert settings.changes() == ["both sides"]
    finally:
        registration.unregister()


def stick():
    """Long along x."""
    return mesh_object("Stick", [(-0.1, -0.01, 0), (0.1, -0.01, 0), (0.1, 0.01, 0), (-0.1, 0.01, 0)], [(0, 1, 2, 3)])


@pytest.mark.parametrize("surface", ["whole", "above"])
def test_long_objects_run_down_the_slope(surface):
    ball, long = added("ico_sphere", subdivisions=4), stick()
    ball.location = (2, 0, 0)
    result = scatter(ball, classes(120, long, direction="slope"), surface=surface, device="cpu", max_steps=60)
    assert result.report.overlaps == 0
    place = points(result.object) - (2, 0, 0)
    along = np.array([Quaternion(q) @ Vector((1, 0, 0)) for q in values(result.object, "rotation")])
    assert np.abs((along * place).sum(axis=1)).max() < 0.12  # along the surface
    down = np.array([0, 0, -1.0]) + place * place[:, 2:]
    steep = np.linalg.norm(down, axis=1)
    turned = np.abs((along * down).sum(axis=1)) / np.maximum(steep, 1e-9)
    assert np.median(turned[steep > 0.5]) > 0.97
    if surface == "whole":
        assert (place[:, 2] < -0.5).sum() > 20
        # Standing anew, as a change of the sidebar does, leaves them as they lie.
        from esh.esh_scatter.result.kept_ground import stand_anew

        before = values(result.object, "rotation").copy()
        stand_anew(result.object, 0, esh.Standing())
        np.testing.assert_allclose(values(result.object, "rotation"), before, atol=1e-5)


def test_an_angle_is_laid_onto_a_whole_surface():
    ball, long = added("ico_sphere", subdivisions=4), stick()
    result = scatter(ball, classes(120, long, direction=0.0), surface="whole", device="cpu", max_steps=100)
    along = np.array([Quaternion(q) @ Vector((1, 0, 0)) for q in values(result.object, "rotation")])
    place = points(result.object)
    wanted = np.array([1.0, 0, 0]) - place * place[:, :1]
    length = np.linalg.norm(wanted, axis=1)
    assert np.median((np.abs((along * wanted).sum(axis=1)) / length)[length > 0.4]) > 0.97


@pytest.mark.parametrize(
    ("kind", "named", "share"),
    [
        ("plane", {"size": 8, "rotation": (np.radians(80.0), 0.0, 0.0)}, "17%"),
        ("uv_sphere", {"radius": 3, "segments": 64, "ring_count": 32}, "25%"),
        ("plane", {"size": 8, "rotation": (np.radians(40.0), 0.0, 0.0)}, ""),
        ("plane", {"size": 8, "rotation": (np.pi, 0.0, 0.0)}, ""),
        ("cube", {"size": 8}, ""),
    ],
)
def test_a_target_that_hides_most_of_itself_from_above_says_so(kind, named, share):
    target = added(kind, **named)
    thing = ScatterClass("thing", [ScatterSize("one", 20, chip())])
    notes = scatter(target, [thing], **OPTIONS).report.notes
    assert [f"{share} as large as its surface" in note for note in notes] == ([True] if share else [])
    if share:
        assert not scatter(target, [thing], surface="whole", **OPTIONS).report.notes
