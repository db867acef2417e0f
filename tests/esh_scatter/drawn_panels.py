"""The sidebar drawn without a window: what it shows, and whether Blender would refuse anything of it."""

from __future__ import annotations

from types import SimpleNamespace

import bpy
from esh.esh_scatter.properties.in_english import CONTEXT
from esh.esh_scatter.sidebar import panel_parts, panels

__all__ = ["Layout", "draw_all", "shown_context"]


class Layout:
    """Stands in for a UILayout: remembers what is drawn, and fails where Blender would."""

    width = 300

    def __init__(self, drawn: list) -> None:
        self.__dict__["drawn"] = drawn

    def __setattr__(self, name, value):
        assert name in bpy.types.UILayout.bl_rna.properties, name
        self.__dict__[name] = value

    def _nested(self, **_options):
        return type(self)(self.drawn)

    row = column = split = box = _nested

    def template_icon_view(self, data, name, *, show_labels, scale, scale_popup):
        assert show_labels and scale > 0.0 and scale_popup > 0.0
        self.prop(data, name)

    def separator(self, **_options):
        pass

    def label(self, *, text="", icon="NONE", translate=True):
        self._check_icon(icon)
        assert not (text and translate), f"Blender would translate {text}"
        self.drawn.append(text)

    def prop(self, data, name, *, text=None, icon="NONE", translate=True, **_options):
        # Up to Blender 5.1, a modifier's inputs are custom properties.
        assert name in data.bl_rna.properties or name[2:-2] in data.keys(), name  # noqa: SIM118
        told = data.bl_rna.properties.get(name)
        in_english = told is not None and told.translation_context == CONTEXT
        assert text == "" or in_english or not translate, f"Blender would translate the name of {name}"
        self._check_icon(icon)
        self.drawn.append(text if name.startswith('["') else name)

    def prop_enum(self, data, name, value):
        assert value in data.bl_rna.properties[name].enum_items
        self.drawn.append(f"{name} {value}")

    def prop_search(self, data, name, search_data, search_name, *, text=None, icon="NONE", **_options):
        assert hasattr(search_data, search_name)
        self.prop(data, name, icon=icon)

    def template_curve_mapping(self, data, name):
        assert name in data.bl_rna.properties
        self.drawn.append(name)

    def operator_menu_enum(self, identifier, name, **options):
        self.operator(identifier, **options)

    def template_ID(self, data, name, **_options):
        self.prop(data, name)

    def template_list(self, list_class, _identifier, data, items, index_data, index, **_options):
        assert hasattr(bpy.types, list_class)
        self.prop(data, items)
        self.prop(index_data, index)
        for number, item in enumerate(getattr(data, items)):
            row = getattr(bpy.types, list_class).draw_item
            row(None, shown_context(Layout.width), self, data, item, 0, index_data, index, number)

    def menu(self, identifier, *, text="", icon="NONE", translate=True):
        self._check_icon(icon)
        assert not (text and translate), f"Blender would translate {text}"
        menu = getattr(bpy.types, identifier)
        menu.draw(SimpleNamespace(layout=self), shown_context())

    def operator(self, identifier, *, text="", icon="NONE", icon_value=0, translate=True, **_options):
        group, name = identifier.split(".")
        told = getattr(getattr(bpy.ops, group), name).get_rna_type()
        assert told.translation_context == CONTEXT or not translate, f"Blender would translate {identifier}"
        self._check_icon(icon)
        if icon_value:
            self.drawn.append(f"icon {icon_value}")
        self.drawn.append(identifier)
        return SimpleNamespace()

    def progress(self, *, factor, text, translate):
        assert 0.0 <= factor <= 1.0 and not translate
        self.drawn.append(text)

    @staticmethod
    def _check_icon(icon):
        assert icon in bpy.types.UILayout.bl_rna.functions["label"].parameters["icon"].enum_items, icon


def shown_context(width: int = 300) -> SimpleNamespace:
    """Return what drawing asks of a context; without a window Blender knows no scale of its interface."""
    preferences = SimpleNamespace(system=SimpleNamespace(ui_scale=1.0), ui_styles=bpy.context.preferences.ui_styles)
    region = SimpleNamespace(width=width)
    context = bpy.context
    names = ("scene", "view_layer", "mode", "objects_in_mode")
    shown = {name: getattr(context, name) for name in names}
    return SimpleNamespace(**shown, space_data=None, preferences=preferences, region=region)


def draw_all(width: int = 300) -> list[str]:
    """Draw every panel that shows now, and return what it shows."""
    Layout.width = width
    context = shown_context(width)
    drawn: list[str] = []
    for cls in panels.CLASSES:
        if not hasattr(cls, "poll") or cls.poll(context):
            panel = SimpleNamespace(layout=Layout(drawn))
            panel._column = lambda panel=panel: panel_parts.SubPanel._column(panel)
            if hasattr(cls, "draw_header"):
                cls.draw_header(panel, context)
            cls.draw(panel, context)
    return drawn
