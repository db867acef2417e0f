"""Large results begin as points, and larger ones ask first."""

import pytest

bpy = pytest.importorskip("bpy")

from esh.esh_scatter.operators.run import ESH_OT_scatter  # noqa: E402
from esh.esh_scatter.properties.amount_ahead import bodies_ahead, question  # noqa: E402
from esh.esh_scatter.result.display import get_inputs, our_modifier, set_inputs  # noqa: E402


def new_object(name, width):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(0, 0, 0), (width, 0, 0), (width, width, 0), (0, width, 0)], [], [(0, 1, 2, 3)])
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


@pytest.fixture
def scatter(empty_file):
    made = bpy.context.scene.esh_scatter.add_scatter(new_object("Ground", 20.0))
    made.device, made.max_steps = "CPU", 2
    size = made.add_class().sizes[0]
    size.source_object, size.count = new_object("Tree", 0.1), 50
    bpy.context.view_layer.update()
    return made


def shown_as(scatter):
    return get_inputs(our_modifier(scatter.result))["Display"]


def test_a_result_above_a_number_begins_as_points_and_then_stays_as_it_was_set(scatter):
    bpy.ops.esh.scatter()
    assert shown_as(scatter) == "Objects"
    scatter.points_above = 60
    assert not scatter.outdated
    scatter.classes[0].sizes[0].count = 70
    bpy.ops.esh.scatter()
    assert shown_as(scatter) == "Points"
    set_inputs(our_modifier(scatter.result), {"Display": "Bounds"})
    scatter.classes[0].sizes[0].count = 80
    bpy.ops.esh.scatter()
    assert shown_as(scatter) == "Bounds", "who has chosen knows it better"


def test_how_many_there_will_be_is_told_before_they_are_there(scatter):
    body_class = scatter.classes[0]
    assert bodies_ahead(scatter) == 50
    scatter.target.scale = (2.0, 1.0, 1.0)
    bpy.context.view_layer.update()
    for kind, name, value, expected in (
        ("TOTAL", "total", 77, 77),
        ("PER_AREA", "per_area", 0.5, 400),
        ("DISTANCE", "distance", 2.0, 231),
    ):
        body_class.count_kind = kind
        setattr(body_class, name, value)
        assert bodies_ahead(scatter) == expected, kind
    body_class.count_kind, body_class.sizes[0].area_kind, body_class.sizes[0].area = "SHARE", "VALUE", 2.0
    body_class.cover_share = 0.25
    assert bodies_ahead(scatter) == 100
    assert question(scatter, 2_000_000) == "2,000,000 objects will take about 3 s and 2.4 GB of memory"
    scatter.max_steps = 100
    assert "about 3 min" in question(scatter, 2_000_000)
    scatter.target.data = bpy.data.meshes.new("Empty")
    assert bodies_ahead(scatter) == 0
    sizes = [{"name": "s", "asked": 20_000, "placed": 20_000}]
    report = {"steps": 10, "seconds": 4.0, "classes": [{"name": "c", "sizes": sizes}]}
    scatter.remember(scatter.target, report)
    assert "200,000 objects will take about 400 s" in question(scatter, 200_000).replace("7 min", "400 s")


def test_from_the_cap_on_the_button_asks_first(scatter):
    """Without a window nothing is asked; with one, the answer is another press of the same button."""
    asked = []
    operator = type("Pressed", (), {})()
    operator.bl_idname, operator.asked = "esh.scatter", False
    operator._settings = lambda _context: scatter
    operator._undo = lambda _context: None
    operator._ask = lambda _context, _title, text: asked.append(text) or {"CANCELLED"}
    context = type("Context", (), {"window": object(), "scene": bpy.context.scene})()
    scatter.cap = 50
    assert ESH_OT_scatter._start(operator, context) is False
    # Of few, nobody is told that they take no time.
    assert asked == ["50 objects will take about 1 s and 0.1 GB of memory"]
    assert scatter.result is None
    assert bpy.ops.esh.scatter() == {"FINISHED"}, "scripts are not asked"
