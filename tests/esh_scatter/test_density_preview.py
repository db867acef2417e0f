"""What Show on Target shows, as far as that needs no window."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import esh  # noqa: E402
from esh.esh_scatter import registration  # noqa: E402
from esh.esh_scatter.classes.survey import Survey  # noqa: E402
from esh.esh_scatter.sidebar import density_preview  # noqa: E402
from esh.esh_scatter.sidebar.density_preview import RAMP, density_colors  # noqa: E402


def new_object(name, vertices, faces=()):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


@pytest.fixture
def scatter(empty_file):
    """On ground that steps up by 30 m at x = 10."""
    steps = [(0, 0), (10, 0), (10, 30), (20, 30)]
    corners = [(x, y, z) for y in (0, 20) for x, z in steps]
    ground = new_object("Ground", corners, [(0, 1, 5, 4), (2, 3, 7, 6)])
    made = bpy.context.scene.esh_scatter.add_scatter(ground)
    made.add_class()
    return made


def test_colors_go_from_none_to_many_and_lie_on_the_ground(scatter):
    scatter.active_class.add_layer("ALTITUDE", altitude_low=20.0, altitude_high=40.0, altitude_falloff=40.0)
    content, colors = density_colors(bpy.context, Survey(64))
    assert content is not None and colors.position.shape == (64 * 64, 3)
    assert all(values.flags.c_contiguous for values in colors), "as Blender's buffers take them"
    high = colors.position[:, 0] > 10.0
    np.testing.assert_allclose(colors.position[:, 2], np.where(high, 30.0, 0.0), atol=0.1)
    np.testing.assert_allclose(colors.color[high, :3], np.broadcast_to(RAMP[-1], (high.sum(), 3)), atol=1e-5)
    np.testing.assert_allclose(colors.color[~high, :3], np.broadcast_to(RAMP[2], ((~high).sum(), 3)), atol=1e-5)
    # Two floors, with nothing between them.
    corner = high[colors.triangle]
    assert (corner.all(axis=1) | ~corner.any(axis=1)).all()
    assert len(colors.triangle) == 2 * 63 * 62
    scatter.surface = "WHOLE"
    _, whole = density_colors(bpy.context, Survey(64))
    corner = whole.position[whole.triangle].astype(np.float64)
    area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1).sum() / 2
    assert area == pytest.approx(2 * 10 * 20, rel=1e-3), "every face once"


def test_only_what_says_something_new_is_shown_anew(scatter):
    kept = Survey(32)
    layer = scatter.active_class.add_layer("NOISE")
    content, first = density_colors(bpy.context, kept)
    assert first is not None and density_colors(bpy.context, kept, content) == (content, None)
    layer.noise_seed = 7
    after, second = density_colors(bpy.context, kept, content)
    assert after != content and (second.color != first.color).any()
    scatter.target.data.vertices[0].co.z = 1.0
    scatter.target.data.update()
    moved, third = density_colors(bpy.context, kept, after)
    assert moved != after and third is not None


def test_a_density_of_another_class_is_read_with_it(scatter):
    other = scatter.add_class()
    other.name = "Pine"
    other.add_layer("ALTITUDE", altitude_low=20.0, altitude_high=40.0, altitude_falloff=0.0)
    scatter.class_index = 0
    scatter.active_class.add_layer("CLASS", class_name="Pine", invert=True)
    _, colors = density_colors(bpy.context, Survey(32))
    high = colors.position[:, 0] > 10.0
    np.testing.assert_allclose(colors.color[~high, :3], np.broadcast_to(RAMP[-1], ((~high).sum(), 3)), atol=1e-5)


def test_where_there_is_nothing_to_show(scatter):
    kept = Survey(32)
    layer = scatter.active_class.add_layer("VERTEX_GROUP")
    assert density_colors(bpy.context, kept) == (None, None), "a layer that lacks something"
    layer.kind, layer.noise_cover = "NOISE", 0.0
    with pytest.raises(esh.ProblemError, match="noise is 0 everywhere"):
        density_colors(bpy.context, kept)
    scatter.remove_class(0)
    assert density_colors(bpy.context, kept) == (None, None)


def test_the_switch_says_which_layer_leaves_nothing_and_leaves_no_timer(scatter):
    manager = bpy.context.window_manager
    layer = scatter.active_class.add_layer("NOISE", noise_cover=0.0)
    assert not bpy.app.timers.is_registered(density_preview._look)
    manager.esh_scatter_show_density = True
    try:
        assert density_preview._look() > 0.0
        assert density_preview.message().endswith("noise is 0 everywhere")
        layer.noise_cover = 0.5
        density_preview._look()
        assert density_preview.message() == "" and density_preview._preview.colors is not None
        shown = density_preview._preview.colors
        assert density_preview._look() > 0.0 and density_preview._preview.colors is shown
        layer.noise_seed = 7
        assert density_preview._look() > 0.0 and density_preview._preview.colors is not shown
    finally:
        manager.esh_scatter_show_density = False
    assert density_preview._look() is None and density_preview._preview is None
    manager.esh_scatter_show_density = True
    registration.unregister()
    assert density_preview._preview is None and not bpy.app.timers.is_registered(density_preview._look)
    registration.register()
