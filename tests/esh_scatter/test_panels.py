"""The panels draw in every state a file can be in."""

from types import SimpleNamespace

import pytest

bpy = pytest.importorskip("bpy")

from esh.engine.problem.problem import ClassSettings  # noqa: E402
from esh.engine.problem.scatter_settings import ScatterSettings  # noqa: E402
from esh.esh_scatter import panels, properties, registration, running  # noqa: E402
from esh.esh_scatter.described_properties import shown_settings  # noqa: E402


class Layout:
    """Stands in for a UILayout: remembers what is drawn, and fails where Blender would."""

    def __init__(self, drawn: list) -> None:
        self.__dict__["drawn"] = drawn

    def __setattr__(self, name, value):
        assert name in bpy.types.UILayout.bl_rna.properties, name
        self.__dict__[name] = value

    def _nested(self, **_options):
        return Layout(self.drawn)

    row = column = split = box = _nested

    def separator(self, **_options):
        pass

    def label(self, *, text="", icon="NONE"):
        self._check_icon(icon)
        self.drawn.append(text)

    def prop(self, data, name, *, text=None, icon="NONE", **_options):
        assert name in data.bl_rna.properties, name
        self._check_icon(icon)
        self.drawn.append(name)

    def prop_search(self, data, name, search_data, search_name, *, icon="NONE", **_options):
        assert hasattr(search_data, search_name)
        self.prop(data, name, icon=icon)

    def template_ID(self, data, name, **_options):
        self.prop(data, name)

    def template_list(self, list_class, _identifier, data, items, index_data, index, **_options):
        assert hasattr(bpy.types, list_class)
        self.prop(data, items)
        self.prop(index_data, index)
        for number, item in enumerate(getattr(data, items)):
            row = getattr(bpy.types, list_class).draw_item
            row(None, bpy.context, self, data, item, 0, index_data, index, number)

    def operator(self, identifier, *, text="", icon="NONE", **_options):
        group, name = identifier.split(".")
        getattr(getattr(bpy.ops, group), name).get_rna_type()
        self._check_icon(icon)
        self.drawn.append(identifier)
        return SimpleNamespace()

    def progress(self, *, factor, text):
        assert 0.0 <= factor <= 1.0
        self.drawn.append(text)

    @staticmethod
    def _check_icon(icon):
        assert icon in bpy.types.UILayout.bl_rna.functions["label"].parameters["icon"].enum_items, icon


@pytest.fixture(autouse=True)
def empty_file():
    bpy.ops.wm.read_homefile(use_empty=True)
    registration.register()
    yield
    running.session = None
    registration.unregister()


def draw_all() -> list[str]:
    """Draw every panel that shows now, and return what it shows."""
    # Without a window Blender knows no scale of its interface.
    preferences = SimpleNamespace(system=SimpleNamespace(ui_scale=1.0))
    context = SimpleNamespace(scene=bpy.context.scene, preferences=preferences, region=SimpleNamespace(width=300))
    drawn: list[str] = []
    for cls in panels.CLASSES:
        if not hasattr(cls, "poll") or cls.poll(context):
            panel = SimpleNamespace(layout=Layout(drawn))
            panel._column = lambda panel=panel: panels._SubPanel._column(panel)
            if hasattr(cls, "draw_header_preset"):
                cls.draw_header_preset(panel, context)
            cls.draw(panel, context)
    return drawn


def new_object(name: str) -> bpy.types.Object:
    item = bpy.data.objects.new(name, bpy.data.meshes.new(name))
    bpy.context.scene.collection.objects.link(item)
    return item


def report(**changes) -> dict:
    sizes = [{"name": "Large", "area": 1.0, "asked": 1234, "placed": 1234}]
    made = {
        "steps": 150, "converged": True, "seconds": 1.25, "device": "cpu", "coverage_error": 0.0123,
        "smallest_spacing": 0.7, "overlaps": 0, "covered": 0.5,
        "classes": [{"name": "Pine", "coverage_error": 0.02, "sizes": sizes}], "notes": [],
    }  # fmt: skip
    return made | changes


def test_a_new_file_says_what_to_click():
    assert "esh.scatter_add" in draw_all()
    assert "esh.scatter" not in draw_all()


def test_an_empty_list_of_classes_says_what_to_click():
    bpy.context.scene.esh_scatter.add_scatter(new_object("Ground"))
    drawn = draw_all()
    assert "esh.class_add" in drawn and any("Add a class" in text for text in drawn)
    bpy.context.scene.esh_scatter.active.add_class().sizes.clear()
    assert "esh.size_add" in draw_all()


@pytest.mark.parametrize("kind", ["UNIFORM", "IMAGE", "VERTEX_GROUP", "ATTRIBUTE"])
def test_every_density_draws_its_own_fields_with_and_without_a_target(kind):
    scatter = bpy.context.scene.esh_scatter.add_scatter(new_object("Ground"))
    body_class = scatter.add_class()
    body_class.density_kind, body_class.mapping = kind, "UV"
    field = {"UNIFORM": "density_kind", "IMAGE": "uv_map", "VERTEX_GROUP": "vertex_group", "ATTRIBUTE": "attribute"}[
        kind
    ]
    drawn = draw_all()
    assert field in drawn
    assert ("invert" in drawn) == (kind != "UNIFORM")
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
        "area_largest",
        "area",
        "may_overlap",
    }
    shown = extra & set(draw_all())
    assert not shown and {"shape", "avoid_overlap", "density_correction", "use_unsharp"} <= set(draw_all())
    for group, name, value, fields in (
        (body_class, "direction_kind", "ANGLE", {"direction_angle"}),
        (body_class, "direction_kind", "IMAGE", {"direction_image"}),
        (body_class, "use_unsharp", True, {"unsharp_amount", "unsharp_radius"}),
        (size, "area_kind", "VALUE", {"area"}),
        (size, "area_kind", "RANGE", {"area", "area_largest"}),
    ):
        before = getattr(group, name)
        setattr(group, name, value)
        assert extra & set(draw_all()) == fields, (name, value)
        setattr(group, name, before)
    scatter.add_class()
    assert "may_overlap" in draw_all(), "with two classes there is something to overlap"


def test_the_button_says_why_nothing_can_be_done():
    scatter = bpy.context.scene.esh_scatter.add_scatter(None)
    scatter.add_class()
    words = " ".join(draw_all())
    assert "Choose a target: the mesh to scatter on" in words


def test_the_report_shows_counts_notes_and_that_it_is_out_of_date():
    scatter = bpy.context.scene.esh_scatter.add_scatter(new_object("Ground"))
    scatter.add_class()
    scatter.remember(new_object("Result"), report(overlaps=1500, converged=False, notes=["The `area` cannot fit"]))
    words = " ".join(draw_all())
    assert "1,234 1,234" in words and "1,500" in words and "not converged" in words
    assert "The area cannot fit" in words and "Settings have changed" not in words
    scatter.seed += 1
    assert "Settings have changed" in " ".join(draw_all())


def test_removed_data_never_stops_the_drawing():
    scatter = bpy.context.scene.esh_scatter.add_scatter(new_object("Ground"))
    body_class = scatter.add_class()
    body_class.density_kind, body_class.image = "IMAGE", bpy.data.images.new("where", 4, 4)
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
    scatter = bpy.context.scene.esh_scatter.add_scatter(new_object("Ground"))
    scatter.add_class()
    running.session = SimpleNamespace(factor=0.25, text="Step 5 of 20")
    drawn = draw_all()
    assert "Step 5 of 20" in drawn and "esh.stop" in drawn and "esh.scatter" not in drawn


def test_every_setting_of_the_sidebar_is_drawn():
    scatter = bpy.context.scene.esh_scatter.add_scatter(new_object("Ground"))
    body_class = scatter.add_class()
    scatter.add_class()
    scatter.class_index = 0
    drawn = set()
    names = {
        shown.name
        for cls, by_hand in ((ScatterSettings, properties.BY_HAND), (ClassSettings, ()))
        for shown in shown_settings(cls, by_hand)
    }
    for group in (scatter, body_class, body_class.sizes[0]):
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
    # Which result there is, the button says; the map is a choice of the image's.
    assert names - drawn == {"result", "uv_map"}
