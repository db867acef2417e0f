"""The panels draw in every state a file can be in."""

import importlib
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import bmesh  # noqa: E402
from esh.engine.errors import ProblemError  # noqa: E402
from esh.engine.problem.body_class import ClassSettings  # noqa: E402
from esh.engine.problem.cover import Cover  # noqa: E402
from esh.engine.problem.scatter_settings import ScatterSettings  # noqa: E402
from esh.esh_scatter import operators, registration  # noqa: E402
from esh.esh_scatter.api import ScatterJob  # noqa: E402
from esh.esh_scatter.editing import forecast  # noqa: E402
from esh.esh_scatter.editing.painting import PAINTED_IN  # noqa: E402
from esh.esh_scatter.editing.preset_files import built_in_presets  # noqa: E402
from esh.esh_scatter.properties import settings_record  # noqa: E402
from esh.esh_scatter.properties.asked_once import asked_once  # noqa: E402
from esh.esh_scatter.properties.body_class import ESH_PG_class  # noqa: E402
from esh.esh_scatter.properties.described import shown_settings  # noqa: E402
from esh.esh_scatter.properties.layer import KINDS  # noqa: E402
from esh.esh_scatter.properties.scatter import BY_HAND  # noqa: E402
from esh.esh_scatter.result import words  # noqa: E402
from esh.esh_scatter.result.display import our_modifier, set_inputs  # noqa: E402
from esh.esh_scatter.result.refused import as_sentence  # noqa: E402
from esh.esh_scatter.result.result import NAME, write_result  # noqa: E402
from esh.esh_scatter.sidebar import class_panels, density_panel, menus, panel_parts, panels, preset_pictures, status  # noqa: E402
from esh.esh_scatter.solving import running  # noqa: E402

with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(Path(__file__).parent)
    drawn_panels = importlib.import_module("drawn_panels")
Layout, draw_all, shown_context = drawn_panels.Layout, drawn_panels.draw_all, drawn_panels.shown_context


@pytest.fixture(autouse=True)
def empty_file():
    bpy.ops.wm.read_homefile(use_empty=True)
    registration.register()
    yield
    running.session = None
    registration.unregister()


def new_object(name: str) -> bpy.types.Object:
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(0, 0, 0), (20, 0, 0), (20, 20, 0), (0, 20, 0)], [], [(0, 1, 2, 3)])
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


def report(**changes) -> dict:
    sizes = [{"name": "Large", "area": 1.0, "asked": 1234, "placed": 1234}]
    made = {
        "steps": 150, "converged": True, "seconds": 1.25, "device": "cpu", "coverage_error": 0.0123,
        "smallest_spacing": 0.7, "overlaps": 0, "covered": 0.5, "closest": 0.342, "usual": 0.71,
        "classes": [{"name": "Pine", "coverage_error": 0.02, "sizes": sizes}], "notes": [],
    }  # fmt: skip
    return made | changes


def test_a_new_file_says_what_to_click():
    assert {"esh.scatter_selection", "esh.scatter_add"} <= set(draw_all())
    assert "esh.scatter" not in draw_all()


def test_an_empty_list_of_classes_says_what_to_click():
    bpy.context.scene.esh_scatter.add_scatter(new_object("Ground"))
    drawn = draw_all()
    assert "esh.class_add" in drawn and any("Add a class" in text for text in drawn)
    bpy.context.scene.esh_scatter.active.add_class().sizes.clear()
    assert "esh.size_add" in draw_all()


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_every_density_draws_its_own_fields_with_and_without_a_target(kind):
    scatter = bpy.context.scene.esh_scatter.add_scatter(new_object("Ground"))
    body_class = scatter.add_class()
    assert "Even, the same everywhere" in draw_all()
    layer = body_class.add_layer(kind, image_mapping="UV", use_curve=True)
    fields = {"IMAGE": "uv_map", "VERTEX_GROUP": "vertex_group", "ATTRIBUTE": "attribute", "CLASS": "class_name"}
    fields |= {"DISTANCE": "source_object", "INSIDE": "source_object", "CAMERA": "camera", "SLOPE": "slope_low"}
    fields |= {"ALTITUDE": "altitude_low", "FACING": "facing_width", "NOISE": "noise_seed"}
    drawn = draw_all()
    assert {fields[kind], "invert", "blend", "strength", "use_curve", "mapping", "layers"} <= set(drawn)
    assert ("esh.layer_paint" in drawn) == (kind in ("IMAGE", "VERTEX_GROUP", "ATTRIBUTE"))
    bpy.data.node_groups.remove(layer.curve)
    assert "mapping" not in draw_all()
    bpy.data.objects.remove(scatter.target)
    assert any("Choose a target" in text for text in draw_all())


def test_directions_ranges_and_sharpening_draw_their_own_fields():
    scatter = bpy.context.scene.esh_scatter.add_scatter(new_object("Ground"))
    body_class = scatter.add_class()
    size = body_class.sizes[0]
    extra = {
        "direction_angle",
        "direction_image",
        "unsharp_amount",
        "unsharp_radius",
        "unsharp_overshoot",
        "area_largest",
        "area",
    }
    shown = extra & set(draw_all())
    assert not shown and {"shape", "avoid_overlap", "density_correction", "use_unsharp"} <= set(draw_all())
    for group, name, value, fields in (
        (body_class, "direction_kind", "ANGLE", {"direction_angle"}),
        (body_class, "direction_kind", "IMAGE", {"direction_image"}),
        (body_class, "use_unsharp", True, {"unsharp_amount", "unsharp_radius", "unsharp_overshoot"}),
        (size, "area_kind", "VALUE", {"area"}),
        (size, "area_kind", "RANGE", {"area", "area_largest"}),
    ):
        before = getattr(group, name)
        setattr(group, name, value)
        assert extra & set(draw_all()) == fields, (name, value)
        setattr(group, name, before)
    assert "esh.class_overlap" not in draw_all()
    scatter.add_class()
    assert "esh.class_overlap" in draw_all(), "with two classes there is something to overlap"


def test_the_button_says_why_nothing_can_be_done():
    scatter = bpy.context.scene.esh_scatter.add_scatter(None)
    scatter.add_class()
    words = " ".join(draw_all())
    assert "Choose a target: the mesh to scatter on" in words


def new_result(target) -> bpy.types.Object:
    """A result of one point."""
    one = {"instance_index": ("INT", np.zeros(1)), "rotation": ("QUATERNION", np.ones((1, 4)))}
    one["scale"] = ("FLOAT_VECTOR", np.ones((1, 3)))
    return write_result(bpy.context.scene, None, target, "Result", [], np.zeros((1, 3)), one)


def ready_scatter():
    """A scatter with one class to which nothing is missing, and its result."""
    scatter = bpy.context.scene.esh_scatter.add_scatter(new_object("Ground"))
    scatter.add_class().name = "Pine"
    scatter.classes[0].sizes[0].source_object = new_object("Tree")
    scatter.remember(new_result(scatter.target), report())
    return scatter


def test_the_status_is_one_line_under_the_button():
    scatter = ready_scatter()
    drawn = draw_all(400)
    button = drawn.index("esh.scatter")
    assert drawn[button + 1] == "live", "it lies beside the button"
    assert drawn[button + 2] == "1,234 placed · no overlap · very even · 1.2 s"
    assert button < drawn.index("classes"), "the button comes before the classes"
    first = draw_all(280)
    assert first[first.index("live") + 1] == "1,234 placed · no overlap · very even", (
        "as wide as Blender has it at first"
    )
    assert "1.2 s, 150 steps" in first, "the seconds are in the report all the same"
    narrow = draw_all(235)
    lines = narrow[narrow.index("live") + 1 :][:2]
    assert lines == ["1,234 placed · no overlap", "very even"], "no part is torn in two, and no line begins with a dot"
    scatter.remember(scatter.result, report(held="Held at 1,234 by Max Objects: 25% cover would take 9,000"))
    assert "Held at 1,234 by Max Objects: 25% cover would take 9,000" in draw_all(600)
    scatter.classes[0].sizes[0].count += 1
    scatter.seed += 1
    drawn = draw_all(500)
    assert not any("Held at" in text for text in drawn)
    assert drawn[drawn.index("live") + 1] == "Changed: seed, count of Pine"
    scatter.classes[0].add_layer("IMAGE")
    other = scatter.add_class()
    other.sizes[0].source_object = new_object("Bush")
    assert "Pine is left out: choose its density image" in draw_all(500)
    other.mute = True
    drawn = draw_all(500)
    assert drawn[drawn.index("live") + 1] == 'Class "Pine": choose its density image'
    scatter.classes[0].layers.clear()
    drawn = draw_all(500)
    assert f"{other.name} is muted" in drawn
    other.mute = False
    assert not any("muted" in text for text in draw_all(500))


def test_overlap_is_said_before_a_run_and_shown_after_it(monkeypatch):
    scatter = ready_scatter()
    scatter.classes[0].sizes[0].count = 3
    forecast.look(bpy.context.scene, 0)
    drawn = draw_all(800)
    text = "Overlap is unavoidable: it covers 300% of the ground, about"
    assert any(line.startswith(text) for line in drawn) and "esh.counts_to_fit" in drawn
    assert {"room", "gap"} <= set(drawn) and "esh.frame_overlap" not in drawn
    with monkeypatch.context() as patched:
        patched.setattr(panels.live, "is_busy", lambda *_: True)
        assert "Following …" in (followed := draw_all(800)) and "esh.counts_to_fit" not in followed, (
            "its report says it"
        )
    scatter.remember(new_result(scatter.target), report(overlaps=2, deepest_pair=[0, 1], deepest_overlap=0.1))
    assert {"esh.select_overlapping", "esh.frame_overlap"} <= set(draw_all())
    told = report(overlaps=2, notes=[Cover(3.0, 0.8, 0.0).warning])
    scatter.remember(scatter.result, told)
    assert not any("cover 300%" in line for line in draw_all(800)[1:] if not line.startswith("Overlap is")), (
        "once is enough"
    )
    scatter.avoid_overlap = False
    assert any("Footprints would cover 300%" in line for line in draw_all(800))
    assert not {"esh.counts_to_fit", "room", "gap"} & set(draw_all())


def test_what_leans_into_each_other_is_in_the_status_and_the_report():
    scatter = ready_scatter()
    told = report(leaning=7, leaning_pair=[0, 1], deepest_leaning=0.25)
    scatter.remember(new_result(scatter.target), told)
    drawn = draw_all(800)
    assert any("no overlap on the ground" in line and "7 pairs lean" in line for line in map(plain, drawn))
    assert {"Lean Together", "7 pairs", "0.25 m", "esh.select_overlapping", "esh.frame_overlap"} <= set(drawn)
    scatter.remember(scatter.result, report(leaning=0))
    drawn = draw_all(800)
    assert "Lean Together" in drawn and not any("on the ground" in line for line in map(plain, drawn))
    scatter.remember(scatter.result, report())
    assert "Lean Together" not in draw_all(800)


def plain(text):
    return text.replace(words.UNBROKEN, " ")


def test_what_classes_lack_is_worked_out_once_for_all_that_follow_them(monkeypatch):
    """With two layers each, twenty classes would ask each other a million times."""
    scatter = ready_scatter()
    for number in range(1, 20):
        body_class = scatter.add_class()
        body_class.sizes[0].source_object = scatter.classes[0].sizes[0].source_object
        for other in scatter.classes[max(0, number - 2) : number]:
            body_class.add_layer("CLASS").class_name = other.name
    asked = []
    lacks = ESH_PG_class.obstacle
    monkeypatch.setattr(ESH_PG_class, "obstacle", lambda *given: asked.append(given[0].name) or lacks(*given))
    assert len(scatter.ready_classes()) == 20 and len(asked) <= 2 * 20
    asked.clear()
    with asked_once():
        assert not any(scatter.obstacle_of(one) for one in scatter.classes) and not scatter.left_out()
    assert len(asked) <= 2 * 20
    asked.clear()
    draw_all()
    # What is below the button, its forecast and the list; not once for each row.
    assert len(asked) <= 8 * 20
    scatter.classes[0].sizes[0].source_object = None
    assert len(scatter.left_out()) == 20, "nothing of it is kept"


def test_a_deleted_result_leaves_no_report():
    scatter = ready_scatter()
    assert "Closest Pair" in draw_all()
    bpy.context.scene.collection.objects.unlink(scatter.result)
    drawn = draw_all()
    assert "The result is no longer there" in drawn and "Closest Pair" not in drawn


def test_the_report_shows_counts_meters_and_every_note_once():
    scatter = ready_scatter()
    scatter.add_class().name = "Beech"
    entries = [
        {"name": "Pine", "coverage_error": 0.02, "sizes": [{"name": "Large", "area": 1.0, "asked": 1234, "placed": 1234}]},
        {"name": "Beech", "coverage_error": 0.3, "sizes": [
            {"name": "Large", "area": 1.0, "asked": 20, "placed": 12}, {"name": "Small", "area": 1.0, "asked": 8, "placed": 8},
        ]},
    ]  # fmt: skip
    told = report(overlaps=1, classes=entries, coverage_error=0.2, converged=False, notes=["`area`: too large"])
    scatter.remember(scatter.result, told)
    drawn = draw_all(400)
    words = " ".join(drawn)
    assert "Pine 1,234 very even" in words and "Beech 20 uneven" in words and "12 of 20" in words
    assert "0.34 m" in words and "Typical Spacing 0.71 m" in words and "lattice" not in words
    assert words.count("Area: too large") == 1 and "1 overlap ·" in words
    assert "uneven: Beech" in words and "More steps would make it more even" in words and "not converged" not in words
    scatter.remember(scatter.result, report(converged=False))
    assert "More steps" not in " ".join(draw_all(400)), "nothing is wrong that more steps would mend"


@pytest.mark.parametrize(
    ("system", "scale", "told"),
    [
        ("METRIC", 1.0, "0.34 m"),
        ("METRIC", 0.01, "3.42 mm"),
        ("METRIC", 1e4, "3.42 km"),
        ("IMPERIAL", 1.0, "1.12 ft"),
        ("NONE", 0.01, "0.34"),
    ],
)
def test_lengths_in_the_report_are_in_the_units_of_the_scene(system, scale, told):
    units = bpy.context.scene.unit_settings
    units.system, units.scale_length = system, scale
    ready_scatter()
    drawn = draw_all(400)
    assert drawn[drawn.index("Closest Pair") + 1] == told


def test_classes_have_their_current_names_in_the_report():
    scatter = ready_scatter()
    scatter.classes[0].name = "Fir"
    drawn = draw_all()
    assert "Fir" in drawn and "Pine" not in drawn


def test_every_operator_is_in_the_object_menu():
    ready_scatter()
    drawn: list[str] = []
    Layout(drawn).menu("ESH_MT_object")
    # A checkbox for each pair of classes.
    by_hand = {"esh.class_overlap"}
    of_assets: list[str] = []
    Layout(of_assets).menu("ESH_MT_assets")
    by_hand |= set(of_assets)
    assert len(of_assets) == 4
    assert {cls.bl_idname for cls in operators.CLASSES} - by_hand == set(drawn) - {"esh_scatter_preset"}
    assert all("INTERNAL" not in getattr(cls, "bl_options", ()) for cls in operators.CLASSES), "F3 would not find them"


def test_rows_show_what_is_placed_where_there_is_room():
    scatter = ready_scatter()
    scatter.classes[0].count_kind, scatter.classes[0].distance = "DISTANCE", 1.5
    assert {"Tree", "1.5 m apart", "mute", "show_viewport", "show_render"} <= set(draw_all(400))
    assert "Tree" not in draw_all(300) and {"1.5 m apart", "show_viewport"} <= set(draw_all(300))
    narrow = draw_all(250)
    assert {"1.5 m apart", "mute"} <= set(narrow) and "show_viewport" not in narrow, "the name has that room"


def test_flat_objects_in_the_ground_and_those_half_in_it_are_told_of():
    scatter = ready_scatter()
    assert "esh.class_lift" in draw_all(), "what is placed there is a square"
    scatter.classes[0].offset = 0.1
    assert "esh.class_lift" not in draw_all()
    tree = bpy.data.objects["Tree"].data
    tree.vertices[0].co.z, tree.vertices[2].co.z, scatter.classes[0].offset = -1.0, 1.0, 0.0
    tree.update()
    bpy.context.view_layer.update()
    assert {"esh.class_raise", "50% of their height is in the ground"} <= set(draw_all(400))
    size = scatter.classes[0].sizes[0]
    size.source_collection = bpy.data.collections.new("As One")
    size.source_collection.objects.link(bpy.data.objects["Tree"])
    size.source_kind = "ASSET"
    assert "50% of their height is in the ground" in draw_all(400), "all that are placed are alike"
    size.source_kind = "COLLECTION"
    assert "Up to 50% of their height is in the ground" in draw_all(400)
    size.source_kind = "OBJECT"
    scatter.classes[0].add_size()
    assert "Up to 50% of their height is in the ground" in draw_all(400)


class Named(Layout):
    """Remembers of every property whether its name stands in a column of names, in its field, or nowhere."""

    def prop(self, _data, name, *, text=None, **_options):
        whole = self.__dict__.get("use_property_split") is False
        self.drawn.append((name, "nowhere" if text == "" else "in its field" if whole else "beside"))


def test_a_narrow_sidebar_cuts_no_names():
    body_class = ready_scatter().classes[0]
    body_class.count_kind = "SHARE"
    drawn = {}
    for width in (250, 280, 320):
        Layout.width = width
        rows = []
        for name in ("random_turn", "align_to_normal", "tilt", "count_kind", "direction_kind"):
            panel_parts.draw_property(shown_context(width), Named(rows), body_class, name)
        drawn[width] = dict(rows)
    assert set(drawn[320].values()) == {"beside"}
    assert drawn[280] == drawn[320] | {"random_turn": "in its field"}, "as wide as Blender has it at first"
    assert drawn[250] == {
        "random_turn": "in its field",
        "align_to_normal": "in its field",
        "tilt": "beside",
        "count_kind": "nowhere",
        "direction_kind": "beside",
    }


@pytest.mark.parametrize(
    ("name", "width", "where"), [("Fir", 250, "beside"), ("Oak leaf", 250, "nowhere"), ("Oak leaf", 320, "beside")]
)
def test_the_name_of_what_is_placed_has_the_whole_line_where_it_would_be_cut(name, width, where):
    size = ready_scatter().classes[0].sizes[0]
    size.source_object.name = name
    rows = []
    Named.width = width
    class_panels._draw_source(shown_context(width), Named(rows), size)
    assert ("source_object", where) in rows


def test_the_name_of_a_target_has_the_whole_line_where_it_would_be_cut(monkeypatch):
    scatter = ready_scatter()
    drawn = {}
    for name in ("Ground", "Example Ground"):
        scatter.target.name = name
        drawn[name] = []
        monkeypatch.setattr(Layout, "prop", Named.prop)
        panels.ESH_PT_scatter.draw(SimpleNamespace(layout=Layout(drawn[name])), shown_context(280))
    assert ("target", "beside") in drawn["Ground"] and ("target", "nowhere") in drawn["Example Ground"]


def test_of_the_objects_of_a_collection_it_is_said_that_their_numbers_are_how_often_each_is_placed():
    size = ready_scatter().classes[0].sizes[0]
    stones = bpy.data.collections.new("Stones")
    for name in ("Boulder", "Chip"):
        stones.objects.link(bpy.data.objects.new(name, size.source_object.data))
    size.source_kind, size.source_collection = "COLLECTION", stones
    drawn = draw_all()
    begin = drawn.index("How Often Each Is Placed")
    assert drawn[begin + 1 : begin + 3] == ["weight", "weight"]


def test_names_that_begin_alike_are_cut_where_they_do_not_differ():
    """Blender would cut off their ends; the selected one can be renamed in its row, and the panel below has all of its name."""
    scatter = ready_scatter()
    names = [
        "Norway Spruce Old Large",
        "Norway Spruce Old Small",
        "Norway Spruce Old Broken",
        "A long name of its own kind",
    ]
    for number, name in enumerate(names):
        (scatter.classes[0] if number == 0 else scatter.add_class()).name = name
    scatter.class_index = 2
    for width in (250, 292):
        drawn = draw_all(width)
        cut = [text for text in drawn if text and "…" in text]
        assert [one[-3:] for one in cut] == ["rge", "all"] and all(one[0] == "N" for one in cut)
        assert drawn.count("name") == 2 + 1, (
            "of the selected class, of the one that looks like no other, and of the scatter"
        )
    assert not any(text and "…" in text for text in draw_all(400)), "it is wide enough"


def test_a_name_is_cut_to_its_room():
    name = "Norway Spruce Old Broken"
    for room in (30, 60, 90, 120):
        cut = panel_parts.cut_in_middle(shown_context(), name, room)
        start, _, end = cut.partition("…")
        assert panel_parts.text_width(shown_context(), cut) <= room and name.startswith(start) and name.endswith(end)
        assert 0 < len(start) <= len(end)
    assert panel_parts.cut_in_middle(shown_context(), name, 500) == name


@pytest.mark.parametrize("width", [200, 250, 400])
def test_a_long_name_in_a_header_is_as_wide_as_the_sidebar(width):
    """Blender cuts what has a width, and lets all else run out of a header, or leaves it out."""
    names = ("Pine", "Very long name of a class that has many words 2")
    widths = {}
    for name in names:
        rows = []
        header = Layout(rows)
        panel_parts.write_header(shown_context(width), header, name)
        assert rows == [name]
        widths[name] = header.__dict__.get("ui_units_x")
    assert widths[names[0]] is None
    fits = panel_parts.text_width(shown_context(), names[1]) < width - 100
    assert fits if widths[names[1]] is None else 5.0 < widths[names[1]] <= (width - 80) / 20


@pytest.mark.parametrize("width", [200, 250, 283, 400])
def test_lines_are_as_full_as_they_can_be(width):
    context, drawn = shown_context(width), []
    text = "Illicit millimeters fill little; wide MMMM and WWWW do not; anunbrokenwordthatislongerthananysidebarhasroomfor."
    panel_parts.write_text(context, Layout(drawn), text, icon="INFO")
    room = width - panel_parts.MARGINS - panel_parts.ICON
    words = text.split()
    assert " ".join(drawn).split() == words
    for line, following in pairwise(drawn):
        assert panel_parts.text_width(context, line) <= room or " " not in line
        assert panel_parts.text_width(context, f"{line} {following.split()[0]}") > room, "the next word had room there"


def test_a_checkbox_stands_below_the_other_fields_where_its_name_fits():
    scatter = ready_scatter()
    rows = []
    for width in (250, 320):
        panel_parts.draw_property(shown_context(width), Named(rows), scatter, "avoid_overlap")
    panel_parts.draw_property(shown_context(150), Named(rows), scatter, "avoid_overlap")
    assert rows == [("avoid_overlap", "beside")] * 2 + [("avoid_overlap", "in its field")]


def test_painting_ends_where_it_began():
    scatter = ready_scatter()
    body_class = scatter.classes[0]
    for kind, mode in PAINTED_IN.items():
        body_class.layers.clear()
        body_class.add_layer(kind)
        drawn: dict[str, list[str]] = {}
        for now in ("OBJECT", mode, "SCULPT"):
            context = shown_context()
            context.mode, drawn[now] = now, []
            density_panel.draw_density(context, Layout(drawn[now]), scatter, body_class)
        assert "object.mode_set" in drawn[mode] and "esh.layer_paint" not in drawn[mode]
        for other in ("OBJECT", "SCULPT"):
            assert "esh.layer_paint" in drawn[other] and "object.mode_set" not in drawn[other]


def test_painting_can_be_ended_near_the_top_of_the_sidebar():
    """A shelf of brushes hides the lower half."""
    scatter = ready_scatter()
    assert "object.mode_set" not in draw_all()
    scatter.classes[0].add_layer("VERTEX_GROUP")
    scatter.classes[0].add_layer("SLOPE")
    bpy.context.view_layer.objects.active = scatter.target
    bpy.ops.object.mode_set(mode="WEIGHT_PAINT")
    drawn = draw_all()
    assert drawn.index("esh.scatter") < drawn.index("object.mode_set") < drawn.index("classes")
    scatter.classes[0].layers[0].kind = "IMAGE"
    assert "object.mode_set" not in draw_all(), "what is painted is none of its layers"
    bpy.ops.object.mode_set(mode="VERTEX_PAINT")
    assert "object.mode_set" not in draw_all()
    scatter.classes[0].layers[0].kind = "ATTRIBUTE"
    assert "object.mode_set" in draw_all(), "colors are attributes"
    bpy.ops.object.mode_set(mode="OBJECT")


def test_where_live_waits_for_edit_mode_to_be_left_the_status_says_so(monkeypatch):
    scatter = ready_scatter()
    monkeypatch.setattr(panels.live, "wake", lambda: None)
    placed = scatter.classes[0].sizes[0].source_object
    for item in (scatter.target, placed):
        waits = f'Live goes on when you leave Edit Mode of "{item.name}"'
        scatter.live = True
        assert waits not in draw_all(900)
        bpy.context.view_layer.objects.active = item
        bpy.ops.object.mode_set(mode="EDIT")
        drawn = draw_all(900)
        assert waits in drawn and drawn.index(waits) < drawn.index("classes")
        scatter.live = False
        assert waits not in draw_all(900)
        bpy.ops.object.mode_set(mode="OBJECT")


def test_while_instances_are_edited_or_real_the_top_says_so_and_leads_back():
    scatter = ready_scatter()
    bpy.context.view_layer.objects.active = scatter.result
    bpy.ops.object.mode_set(mode="EDIT")
    drawn = draw_all(900)
    assert "esh.scatter" not in drawn and drawn.index("esh.instances_edit") < drawn.index("classes")
    assert drawn[drawn.index("live") + 1].startswith("Select points; move (G) or remove (X) them")
    assert drawn.count("esh.instances_edit") == 2, "and in the panel of instances"
    bpy.ops.object.mode_set(mode="OBJECT")
    assert "esh.scatter" in draw_all()
    bpy.data.collections.new("Objects")["esh_real_of"] = scatter.result
    drawn = draw_all(900)
    assert (
        drawn.index("The instances are real objects now")
        < drawn.index("esh.instances_from_real")
        < drawn.index("classes")
    )


def test_of_a_result_without_a_scatter_it_is_said_where_its_settings_are(tmp_path):
    result = ready_scatter().result
    bpy.context.view_layer.objects.active = result

    def told():
        return [text for text in draw_all(2000) if "belongs to no scatter of this scene" in text]

    assert not told()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "other.blend"))
    bpy.ops.wm.read_homefile(use_empty=True)
    for link in (False, True):
        with bpy.data.libraries.load(str(tmp_path / "other.blend"), link=link) as (_, wanted):
            wanted.objects = ["Result"]
        bpy.context.scene.collection.objects.link(wanted.objects[0])
        assert not told()
        bpy.context.view_layer.objects.active = wanted.objects[0]
        assert told() and "esh.scatter_selection" in draw_all()
        bpy.context.view_layer.objects.active = None


def test_below_automatic_it_is_said_what_that_takes():
    scatter = ready_scatter()
    scatter.device, scatter.max_steps, scatter.avoid_overlap = "CPU", 5, False
    assert not [text for text in draw_all(2000) if text.startswith("Automatic:")]
    scatter.surface = "AUTO"
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    drawn = draw_all(2000)
    assert drawn[drawn.index("surface") + 1] == "Automatic: from above" and drawn.count("surface") == 1


def test_of_a_later_scatter_that_stands_where_this_one_does_now_it_is_said(monkeypatch):
    first = ready_scatter()
    first.device, first.max_steps, first.avoid_overlap = "CPU", 5, False
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    later = bpy.context.scene.esh_scatter.add_scatter(first.target)
    later.name = "Grass"
    bpy.context.scene.esh_scatter.scatter_index = 0
    assert not [text for text in draw_all(2000) if "make room" in text]
    monkeypatch.setattr(type(later), "later_in_the_way", lambda self: [bpy.context.scene.esh_scatter.scatters[1]])
    drawn = draw_all(2000)
    assert drawn[drawn.index('"Grass" does not make room for this yet: update it, too') + 1] == "esh.scatter_all"


def test_of_points_that_were_deleted_it_is_said_that_they_come_back():
    """Blender's own Delete leaves no trace but that they are fewer."""
    scatter = ready_scatter()
    scatter.device, scatter.max_steps, scatter.avoid_overlap = "CPU", 5, False
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    result = scatter.result

    def told():
        return [text for text in draw_all(2000) if "deleted" in text]

    def delete(*points):
        made = bmesh.new()
        made.from_mesh(result.data)
        made.verts.ensure_lookup_table()
        bmesh.ops.delete(made, geom=[made.verts[point] for point in points], context="VERTS")
        made.to_mesh(result.data)
        made.free()

    assert not told()
    delete(3)
    assert told() == ["1 object was deleted: Update puts it back. Remove (Instances) keeps places free"]
    delete(1, 2)
    assert told() == ["3 objects were deleted: Update puts them back. Remove (Instances) keeps places free"]
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    assert not told()


def test_of_points_that_were_added_by_hand_it_is_said_how_many():
    """The status told of as many as the last run had placed, also where another result was joined with this one."""
    scatter = ready_scatter()
    scatter.device, scatter.max_steps, scatter.avoid_overlap = "CPU", 5, False
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    result = scatter.result
    placed = len(result.data.vertices)
    other = result.copy()
    other.data = result.data.copy()
    bpy.context.collection.objects.link(other)
    with bpy.context.temp_override(active_object=result, selected_editable_objects=[result, other]):
        bpy.ops.object.join()
    assert f"{placed:,} objects were added by hand" in draw_all(2000)


def test_of_a_target_that_bends_without_its_objects_in_renders_it_is_said():
    """They stayed in the air in the picture, and followed in the viewport."""
    scatter = ready_scatter()
    scatter.device, scatter.max_steps, scatter.avoid_overlap = "CPU", 5, False
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    ground = scatter.target

    def told():
        return [text for text in draw_all(2000) if "bends without its objects" in text]

    divided = ground.modifiers.new("Subdivision", "SUBSURF")
    assert (divided.levels, divided.render_levels) == (1, 2) and not told(), "what does not bend is where it was"
    ground.shape_key_add(name="Basis")
    assert told() == [
        f'In renders "{ground.name}" bends without its objects, since it is subdivided to another level there. '
        "Give both levels the same number"
    ]
    divided.render_levels = 1
    assert not told()
    divided.show_viewport = False
    assert told()
    set_inputs(our_modifier(scatter.result), {"Follow": False})
    assert not told()
    ground.shape_key_clear()
    ground.modifiers.new("Wave", "WAVE")
    set_inputs(our_modifier(scatter.result), {"Follow": True})
    assert told()


def test_it_is_not_said_of_a_target_that_objects_follow_in_renders_too():
    scatter = ready_scatter()
    scatter.device, scatter.max_steps, scatter.avoid_overlap = "CPU", 5, False
    ground, render = scatter.target, bpy.context.scene.render
    divided = ground.modifiers.new("Subdivision", "SUBSURF")
    ground.shape_key_add(name="Basis")
    assert bpy.ops.esh.scatter() == {"FINISHED"}

    def told():
        return [text for text in draw_all(2000) if "bends without its objects" in text]

    assert (divided.levels, divided.render_levels) == (1, 2) and not told()
    divided.render_levels = 4
    assert not told()
    divided.show_viewport = False
    assert not told(), "what the viewport shows does not matter in renders"
    divided.show_viewport, divided.levels = True, 3
    render.use_simplify, render.simplify_subdivision_render = True, 1
    assert not told(), "coarser than in the viewport, but as it was when they were placed"
    render.simplify_subdivision_render = 0
    assert told()
    render.use_simplify = False
    second = ground.modifiers.new("Second", "SUBSURF")
    assert told() and bpy.ops.esh.scatter() == {"FINISHED"} and told(), "both levels differ"
    divided.levels = divided.render_levels = 1
    assert bpy.ops.esh.scatter() == {"FINISHED"} and not told() and second.levels < second.render_levels
    ground.modifiers.clear()
    assert not told(), "what divided it was removed, or applied"


def test_of_a_copy_of_a_result_it_is_said_whose_it_is_and_it_can_be_moved():
    scatter = ready_scatter()
    scatter.device, scatter.max_steps, scatter.avoid_overlap = "CPU", 5, False
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    scatter.name = "Wood"
    copy = scatter.result.copy()
    bpy.context.scene.collection.objects.link(copy)
    bpy.context.view_layer.objects.active = copy
    own = f'"{copy.name}" is a copy of what "Wood" has placed. Update leaves it as it is'

    def told():
        drawn = draw_all(2000)
        return drawn[: drawn.index("surface")]

    goes_with = scatter.target.name
    for _ in range(2):
        assert told()[-5:] == [
            own,
            "esh.scatter_of_copy",
            f'It goes with "{goes_with}". Switch Follow off to move it by itself',
            "Follow",
            "Target",
        ]
        # With points of its own, and after a run that gives the result others.
        copy.data = copy.data.copy()
        scatter.classes[0].sizes[0].count += 1
        assert bpy.ops.esh.scatter() == {"FINISHED"}
    set_inputs(our_modifier(copy), {"Follow": False})
    assert told()[-4:] == [own, "esh.scatter_of_copy", "Follow", "Target"], "it can be switched on again"
    bpy.context.scene.collection.objects.unlink(scatter.result)
    copy[NAME] = "Wood"
    said = f'"{copy.name}" is a copy of the result that is no longer there. Scatter takes it in its place'
    assert told()[-2:] == ["The result is no longer there", said]
    assert bpy.ops.esh.scatter() == {"FINISHED"} and scatter.result == copy


def test_of_a_copy_that_was_made_together_with_its_target_it_is_said_what_it_goes_with():
    scatter = ready_scatter()
    scatter.device, scatter.max_steps, scatter.avoid_overlap = "CPU", 5, False
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    for item in bpy.context.scene.objects:
        item.select_set(item in (scatter.target, scatter.result))
    bpy.context.view_layer.objects.active = scatter.result
    bpy.ops.object.duplicate()
    # The result has another group than its copy from then on.
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    assert bpy.context.object != scatter.result
    said = f'It goes with "{scatter.target.name}.001". Switch Follow off to move it by itself'
    assert said in draw_all(2000)


def test_of_a_result_of_another_scene_it_is_said_which_one():
    result = ready_scatter().result
    first = bpy.context.scene
    other = bpy.data.scenes.new("Other")
    other.collection.objects.link(result)
    bpy.context.window.scene = other
    other.view_layers[0].objects.active = result
    said = f'"{result.name}" belongs to no scatter of this scene. Its settings are in the scene "{first.name}"'
    assert said in draw_all(2000)


def test_where_strokes_go_to_another_image_the_selected_one_can_be_painted():
    """Undo and redo leave nothing that is painted on."""
    scatter = ready_scatter()
    body_class = scatter.classes[0]
    image = bpy.data.images.new("Mask", 4, 4)
    body_class.add_layer("IMAGE", image=image)
    paint = bpy.context.scene.tool_settings.image_paint
    paint.mode = "IMAGE"
    for canvas in (image, None, bpy.data.images.new("Other", 4, 4)):
        paint.canvas = canvas
        drawn: list[str] = []
        context = shown_context()
        context.mode = "PAINT_TEXTURE"
        density_panel.draw_density(context, Layout(drawn), scatter, body_class)
        assert "object.mode_set" in drawn and ("esh.layer_paint" in drawn) == (canvas is not image)


def test_the_name_of_an_image_is_readable_at_any_width():
    body_class = ready_scatter().classes[0]
    long, short = (bpy.data.images.new(name, 4, 4) for name in ("Forest Density Mask", "Mask"))
    layer = body_class.add_layer("IMAGE", image=long)
    body_class.direction_kind, body_class.direction_image = "IMAGE", long

    def lines(width):
        rows = []
        density_panel.draw_density(shown_context(width), Layout(rows), bpy.context.scene.esh_scatter.active, body_class)
        panel_parts.draw_image(shown_context(width), Layout(rows), body_class, "direction_image")
        return rows.count(layer.image.name)

    assert (lines(280), lines(500)) == (3, 1), "the list of layers shows it in any case"
    layer.image = body_class.direction_image = short
    assert lines(280) == 1


def test_only_lines_have_a_width():
    scatter = ready_scatter()
    obstacle = scatter.obstacles.add()
    assert "width" in draw_all(), "nothing is chosen yet"
    obstacle.item = new_object("House")
    assert "width" not in draw_all() and "margin" in draw_all()
    path = bpy.data.objects.new("Path", bpy.data.curves.new("Path", "CURVE"))
    bpy.context.scene.collection.objects.link(path)
    obstacle.item = path
    assert "width" in draw_all()
    holder = bpy.data.collections.new("Holder")
    holder.objects.link(bpy.data.objects["House"])
    obstacle.kind, obstacle.collection = "COLLECTION", holder
    assert "width" not in draw_all()
    holder.objects.link(path)
    assert "width" in draw_all()


def test_only_clumps_have_a_size():
    body_class = ready_scatter().active_class
    assert "clustering" in draw_all() and "clump_size" not in draw_all()
    body_class.clustering = 0.2
    assert "clump_size" in draw_all()


def test_a_result_that_another_scene_shows_too_is_not_said_to_be_gone():
    ready_scatter()
    first = bpy.context.scene
    bpy.ops.scene.new(type="LINK_COPY")
    assert any("Another scene shows this result" in text for text in draw_all(500))
    linked = SimpleNamespace(is_editable=False, objects=first.objects)
    assert "linked from a library" in status._why_no_result(linked, first.esh_scatter.active)
    bpy.context.window.scene = first
    for scene in [one for one in bpy.data.scenes if one != first]:
        bpy.data.scenes.remove(scene)
    assert not any("Another scene" in text or "no longer there" in text for text in draw_all(500))


def test_removed_data_never_stops_the_drawing():
    scatter = bpy.context.scene.esh_scatter.add_scatter(new_object("Ground"))
    body_class = scatter.add_class()
    body_class.add_layer("IMAGE", image=bpy.data.images.new("where", 4, 4))
    body_class.sizes[0].source_object = new_object("Tree")
    scatter.remember(new_object("Result"), report(smallest_spacing=None))
    for item in [*bpy.data.objects, *bpy.data.images]:
        bpy.data.batch_remove([item])
        draw_all()
    scatter.class_index = 9
    body_class.size_index = -3
    draw_all()
    bpy.context.scene.esh_scatter.scatter_index = 5
    draw_all()


def test_a_run_shows_its_progress_and_a_stop_button():
    # Also the first one, whose scatter is added when it ends.
    running.session = SimpleNamespace(factor=0.0, text="Preparing")
    drawn = draw_all()
    assert "Preparing" in drawn and "esh.stop" in drawn and "esh.scatter_selection" not in drawn
    running.session = None
    scatter = bpy.context.scene.esh_scatter.add_scatter(new_object("Ground"))
    scatter.add_class()
    running.session = SimpleNamespace(factor=0.25, text="Step 5 of 20")
    drawn = draw_all()
    assert "Step 5 of 20" in drawn and "esh.stop" in drawn and "esh.scatter" not in drawn


def test_every_setting_of_the_sidebar_is_drawn():
    scatter = bpy.context.scene.esh_scatter.add_scatter(new_object("Ground"))
    body_class = scatter.add_class()
    body_class.add_size()
    body_class.size_index = 0
    scatter.add_class()
    scatter.class_index = 0
    scatter.obstacles.add()
    drawn = set()
    names = {
        shown.name
        for cls, by_hand in ((ScatterSettings, BY_HAND), (ClassSettings, ()))
        for shown in shown_settings(cls, by_hand)
    }
    # With both kinds of target, each shows what is chosen from its mesh.
    # And only clumps have a size.
    body_class.clustering = 0.5
    holder = bpy.data.collections.new("Grounds")
    holder.objects.link(scatter.target)
    scatter.target_collection = holder
    layer = body_class.add_layer("IMAGE", image_mapping="UV")
    for group in (scatter, body_class, body_class.sizes[0], layer):
        hidden = {"rna_type", "name", "classes", "sizes", "color", "version"} | {
            told.identifier for told in group.bl_rna.properties if told.is_hidden
        }
        names |= {told.identifier for told in group.bl_rna.properties} - hidden
        for told in group.bl_rna.properties:
            values = [item.identifier for item in told.enum_items] if told.type == "ENUM" else []
            for value in values or ([True] if told.type == "BOOLEAN" else []):
                before = getattr(group, told.identifier)
                setattr(group, told.identifier, value)
                drawn |= set(draw_all())
                setattr(group, told.identifier, before)
    # Which result there is, the button says; what may overlap has buttons.
    assert names - drawn == {"result", "may_overlap", "variants"} and "esh.class_overlap" in drawn


def test_every_preset_is_shown_by_its_picture(monkeypatch):
    shown = []

    def number_of(preset):
        # Without a window Blender gives no icon a number.
        assert preset_pictures.picture_of(preset) >= 0
        shown.append(preset)
        return len(shown)

    monkeypatch.setattr(menus, "picture_of", number_of)
    drawn: list[str] = []
    Layout(drawn).menu("ESH_MT_presets")
    assert "esh_scatter_preset" in drawn, "one picture opens all of them, to be clicked"
    icons = [text for text in drawn if text.startswith("icon ")]
    assert len(icons) == drawn.count("esh.preset_apply") == len(built_in_presets()) and shown == list(
        built_in_presets()
    )
    assert len(preset_pictures._pictures) == len(shown), "every one has a picture"
    preset_pictures.detach()
    assert preset_pictures._pictures is None and preset_pictures.picture_of("nowhere.json") == 0


def test_a_preset_is_chosen_by_its_picture():
    """Its picture is a button of Blender's, which sets what it is asked for; the same preset may be chosen again."""
    manager, settings = bpy.context.window_manager, bpy.context.scene.esh_scatter
    choices = preset_pictures._presets(None, None)
    assert [(path, name) for path, name, *_ in choices] == list(built_in_presets().items())
    manager.esh_scatter_preset = choices[0][0]
    assert not settings.scatters, "there is no ground"
    assert "esh_scatter_preset" in draw_all()
    ground = new_object("Ground")
    bpy.context.view_layer.objects.active = ground
    for number, choice in enumerate((choices[2], choices[2], choices[1]), start=1):
        manager.esh_scatter_preset = choice[0]
        assert len(settings.scatters) == number and settings.active.name.startswith(choice[1])
        assert settings.active.target == ground


def test_settings_are_summed_up_once_while_all_panels_are_drawn(monkeypatch):
    scatter = ready_scatter()
    scatter.remember(scatter.result, report())
    made = []
    record = settings_record.record
    monkeypatch.setattr(settings_record, "record", lambda *arguments: made.append(1) or record(*arguments))
    draw_all()
    assert len(made) == 1


def test_a_target_without_a_top_is_told_of_before_the_run():
    scatter = ready_scatter()
    said = "The target is not visible from above: choose Whole Surface"
    assert not {said, "surface WHOLE"} & set(draw_all())
    wall = scatter.target
    for turn in ((0.5 * np.pi, 0.0, 0.0), (0.0, 0.5 * np.pi, 0.3), (0.5 * np.pi, 0.0, 1.0)):
        wall.rotation_euler = turn
        bpy.context.view_layer.update()
        assert scatter.obstacle(bpy.context.scene) == said
        assert {"surface WHOLE", said.partition(":")[0]} <= set(draw_all(1000))
        with pytest.raises(RuntimeError, match=said):
            bpy.ops.esh.scatter()
    # It is what the run would say.
    with pytest.raises(ProblemError) as refused:
        ScatterJob(*scatter.arguments(bpy.context.scene)[0], device="cpu")
    assert as_sentence(refused.value) == said
    for name, value in (("surface", "WHOLE"), ("surface", "AUTO"), ("both_sides", True)):
        before = getattr(scatter, name)
        setattr(scatter, name, value)
        assert scatter.obstacle(bpy.context.scene) is None, name
        setattr(scatter, name, before)
    # One face that is not upright is a top, among however many that are.
    mesh = wall.data
    mesh.clear_geometry()
    corners = [(x, 0.0, z) for x in range(20) for z in (0.0, 1.0)]
    mesh.from_pydata([*corners, (5.0, 1.0, 1.0)], [], [(2 * k, 2 * k + 2, 2 * k + 3, 2 * k + 1) for k in range(19)])
    wall.rotation_euler = (0.0, 0.0, 0.0)
    bpy.context.view_layer.update()
    assert scatter.obstacle(bpy.context.scene) == said
    mesh.clear_geometry()
    faces = [(2 * k, 2 * k + 2, 2 * k + 3, 2 * k + 1) for k in range(19)]
    mesh.from_pydata([*corners, (5.0, 1.0, 1.0)], [], [*faces[:7], (11, 13, 40), *faces[7:]])
    bpy.context.view_layer.update()
    assert scatter.obstacle(bpy.context.scene) is None
