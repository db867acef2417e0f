"""What the panels of the sidebar are made of: lists with their buttons, settings, images, sentences over several lines."""

import textwrap
from collections.abc import Collection
from typing import Any

import bpy

from ..properties.described import shown_settings
from ..properties.scene import active_scatter
from ..result import words
from ..solving import running

__all__ = [
    "Panel",
    "SubPanel",
    "draw_image",
    "draw_list",
    "draw_property",
    "draw_settings",
    "is_narrow",
    "width_of",
    "write_text",
]

# Up to which width of the sidebar names leave room for nothing beside them [pixels at an interface scale of 1].
NARROW = 270
# Characters of a property's name, and of its choice beside an icon, that fit into such a sidebar.
LONGEST_NAME, LONGEST_CHOICE = 12, 11
# In one as wide as Blender has it at first, names of so many characters do not fit either.
WIDTH_AT_FIRST, LONGER_NAME = 300, 15


class Panel:
    """Base of what is in the sidebar's tab."""

    layout: bpy.types.UILayout
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = running.SIDEBAR_TAB


class SubPanel(Panel):
    """Base of the panels below the first, which are there as soon as there is a scatter."""

    bl_parent_id = "ESH_PT_scatter"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only where there is a scatter."""
        return active_scatter(context) is not None

    def _column(self) -> bpy.types.UILayout:
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.enabled = running.session is None
        return layout.column()


def width_of(context: bpy.types.Context) -> float:
    """Return the width of the sidebar [pixels at an interface scale of 1]."""
    return context.region.width / context.preferences.system.ui_scale


def is_narrow(context: bpy.types.Context) -> bool:
    """Tell whether the sidebar is so narrow that names need the room of what may be missing."""
    return width_of(context) <= NARROW


def draw_property(
    context: bpy.types.Context,
    layout: bpy.types.UILayout,
    group: bpy.types.PropertyGroup,
    name: str,
    *,
    slider: bool = False,
) -> None:
    """Draw a property; in a narrow sidebar over the whole width, where its name or its choice would be cut."""
    told = group.bl_rna.properties[name]
    if not is_narrow(context):
        cut = width_of(context) <= WIDTH_AT_FIRST and len(told.name) >= LONGER_NAME and told.type in ("INT", "FLOAT")
        _draw_over_width(layout, group, name, slider, split=not cut)
    elif told.type == "ENUM":
        chosen = told.enum_items[getattr(group, name)].name
        layout.prop(group, name, **({"text": ""} if len(chosen) > LONGEST_CHOICE else {}))
    else:
        _draw_over_width(layout, group, name, slider, split=len(told.name) < LONGEST_NAME)


def _draw_over_width(
    layout: bpy.types.UILayout, group: bpy.types.PropertyGroup, name: str, slider: bool, *, split: bool
) -> None:
    """Draw a property with its name in a column of names, or within its field, which then takes the whole width."""
    row = layout.row()
    row.use_property_split = split
    row.prop(group, name, slider=slider)


def draw_image(column: bpy.types.UILayout, group: bpy.types.PropertyGroup, name: str) -> None:
    """Draw an image over the whole width, so that its name can be read."""
    row = column.row()
    row.use_property_split = False
    row.template_ID(group, name, new="image.new", open="image.open")


def draw_settings(
    context: bpy.types.Context,
    layout: bpy.types.UILayout,
    group: bpy.types.PropertyGroup,
    cls: Any,
    by_hand: Collection[str] = (),
) -> None:
    """Draw the properties that stand for the settings of a class; a group of settings only where it is switched on."""
    for shown in shown_settings(cls, by_hand):
        if not shown.switch or getattr(group, shown.switch):
            draw_property(context, layout, group, shown.name, slider=shown.slider)


def draw_list(
    layout: bpy.types.UILayout,
    list_class: str,
    owner: bpy.types.PropertyGroup,
    items: str,
    index: str,
    noun: str,
    *,
    rows: int,
    move: bool = False,
    menu: str = "",
) -> None:
    """Draw a list and the buttons beside it.

    Args:
        layout: Where.
        list_class: Which of our lists draws its rows.
        owner: Whose list.
        items: Name of its property.
        index: Name of the property that says which entry is selected.
        noun: What the operators of its entries are named after: ``layer``, ``size``.
        rows: How many rows it shows at least.
        move: Whether entries can be moved.
        menu: What else can be done with them.
    """
    movable = move and len(getattr(owner, items)) > 1
    row = layout.row()
    # The buttons beside a list that can be reordered are four rows high.
    row.template_list(list_class, "", owner, items, owner, index, rows=max(rows, 4) if movable else rows)
    side = row.column(align=True)
    side.operator(f"esh.{noun}_add", text="", icon="ADD")
    side.operator(f"esh.{noun}_remove", text="", icon="REMOVE")
    if menu:
        side.menu(menu, text="", icon="DOWNARROW_HLT")
    if movable:
        side.separator(factor=0.5)
        side.operator(f"esh.{noun}_move", text="", icon="TRIA_UP").direction = "UP"
        side.operator(f"esh.{noun}_move", text="", icon="TRIA_DOWN").direction = "DOWN"


def write_text(context: bpy.types.Context, layout: bpy.types.UILayout, text: str, icon: str = "NONE") -> None:
    """Draw ``text`` on as many lines as the sidebar's width asks for."""
    # Margins and the icon take about 60 pixels, and a character of the interface's font where there are many wide ones 6.8.
    characters = max(20, int((width_of(context) - 60) / 6.8))
    # What is longer than a line is broken after all, between its words.
    parts = (part if len(part) <= characters else part.replace(words.UNBROKEN, " ") for part in text.split(" "))
    text = " ".join(parts)
    column = layout.column(align=True)
    for number, line in enumerate(textwrap.wrap(text, characters, break_on_hyphens=False)):
        column.label(
            # A dot between two parts stands in no line's beginning or end.
            text=line.strip(" ·").replace(words.UNBROKEN, " "),
            icon=icon if number == 0 else ("BLANK1" if icon != "NONE" else "NONE"),
        )
