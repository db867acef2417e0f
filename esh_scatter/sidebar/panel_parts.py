"""What the panels of the sidebar are made of: lists with their buttons, settings, images, sentences over several lines."""

from bisect import bisect_right
from collections.abc import Collection
from typing import Any

import blf
import bpy

from ..properties.described import shown_settings
from ..properties.scene import active_scatter
from ..result import words
from ..result.display import input_property
from ..result.scene_units import in_scene_units
from ..solving import running

__all__ = [
    "Panel",
    "SubPanel",
    "cut_in_middle",
    "draw_image",
    "draw_inputs",
    "draw_list",
    "draw_property",
    "draw_settings",
    "field_width",
    "fits_line",
    "is_narrow",
    "text_of_field",
    "text_width",
    "units_of",
    "width_of",
    "write_header",
    "write_text",
]

# All lengths are in pixels at an interface scale of 1.

# Up to which width of the sidebar names leave room for nothing beside them.
NARROW = 270
# What the tabs and the margins of a panel take of the sidebar's width, and an icon of a line.
MARGINS, ICON = 56, 26
# Where Blender parts a line into a name and its field, and what a field has beside the text of a checkbox, and of a choice.
PARTED, CHECKBOX, CHOICE = 0.42, 28, 42
# What the buttons beside the name of an image take.
IMAGE_BUTTONS = 150
# What the icon and the buttons of a field that holds an object or a collection take of it.
ITEM_BUTTONS = 74
# What a label leaves free around its text, and how wide a unit of a layout is.
AROUND, UNIT = 12, 20
# One of so many letters that are left of a name that is cut in its middle is before the dots.
BEGINNING = 4


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


def field_width(context: bpy.types.Context) -> float:
    """Return how wide a field beside its name is [pixels at an interface scale of 1]."""
    return (1.0 - PARTED) * (width_of(context) - MARGINS)


def text_width(context: bpy.types.Context, text: str) -> float:
    """Return how wide a text is in the interface's font [pixels at an interface scale of 1]."""
    blf.size(0, context.preferences.ui_styles[0].widget.points)
    width: float = blf.dimensions(0, text)[0]
    return width


def units_of(context: bpy.types.Context, text: str) -> float:
    """Return the width of a label, in units of a layout."""
    return (text_width(context, text) + AROUND) / UNIT


def cut_in_middle(context: bpy.types.Context, text: str, room: float) -> str:
    """Return a text that is no wider than ``room`` [pixels at an interface scale of 1]: of a longer one a little of its beginning.

    Names of one kind begin alike, and Blender would cut off where they differ.
    """
    if text_width(context, text) <= room:
        return text

    def shorter(left: int) -> str:
        start = max(1, left // BEGINNING)
        return f"{text[:start].rstrip()}\u2026{text[start - left :].lstrip()}"

    # Two letters are left in any case.
    more = bisect_right(range(3, len(text)), room, key=lambda left: text_width(context, shorter(left)))
    return shorter(2 + more)


def is_narrow(context: bpy.types.Context) -> bool:
    """Tell whether the sidebar is so narrow that names need the room of what may be missing."""
    return width_of(context) <= NARROW


def write_header(context: bpy.types.Context, header: bpy.types.UILayout, text: str) -> None:
    """Draw the header of a panel within another; what is too long has dots in its middle, where Blender would let it run out."""
    room = width_of(context) - MARGINS - ICON
    if text_width(context, text) + AROUND > room:
        header.ui_units_x = room / UNIT
    header.label(text=text, translate=False)


def draw_property(
    context: bpy.types.Context,
    layout: bpy.types.UILayout,
    group: bpy.types.PropertyGroup,
    name: str,
    *,
    slider: bool = False,
) -> None:
    """Draw a property; over the whole width where its name or its choice would be cut beside each other."""
    told = group.bl_rna.properties[name]
    line = width_of(context) - MARGINS
    if told.type == "ENUM":
        chosen = told.enum_items[getattr(group, name)].name
        is_cut = is_narrow(context) and text_width(context, chosen) > field_width(context) - CHOICE
        layout.prop(group, name, **({"text": ""} if is_cut else {}))
        return
    # The name of a checkbox stands in the field, others in the column of names.
    room = field_width(context) - CHECKBOX if told.type == "BOOLEAN" else PARTED * line - AROUND / 2
    row = layout.row()
    row.use_property_split = text_width(context, told.name) <= room
    row.prop(group, name, slider=slider)


def text_of_field(context: bpy.types.Context, item: bpy.types.ID | None) -> dict[str, str]:
    """Return the text of a field: none, so that it has the whole line, where the name of what it holds would be cut."""
    is_cut = item is not None and text_width(context, item.name) > field_width(context) - ITEM_BUTTONS
    return {"text": ""} if is_cut else {}


def draw_image(
    context: bpy.types.Context, column: bpy.types.UILayout, group: bpy.types.PropertyGroup, name: str
) -> None:
    """Draw an image over the whole width, and its name in a line of its own where the buttons leave no room for it."""
    row = column.row()
    row.use_property_split = False
    row.template_ID(group, name, new="image.new", open="image.open")
    image = getattr(group, name)
    if image is not None and text_width(context, image.name) > width_of(context) - MARGINS - IMAGE_BUTTONS:
        column.label(text=image.name, translate=False)


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


def draw_inputs(column: bpy.types.UILayout, modifier: bpy.types.Modifier, names: Collection[str]) -> None:
    """Draw inputs of a result's modifier, as far as it has them."""
    for name in names:
        found = input_property(modifier, name)
        if found is not None:
            column.prop(*found, text=name, translate=False)


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


def fits_line(context: bpy.types.Context, text: str) -> bool:
    """Tell whether :func:`write_text` would draw a text beside an icon on one line."""
    return text_width(context, text) <= width_of(context) - MARGINS - ICON


def write_text(context: bpy.types.Context, layout: bpy.types.UILayout, text: str, icon: str = "NONE") -> None:
    """Draw ``text``, in the scene's units, on as many lines as the sidebar's width asks for."""
    text = in_scene_units(context.scene, text)
    room = width_of(context) - MARGINS - (ICON if icon != "NONE" else 0)
    column = layout.column(align=True)
    for number, line in enumerate(_wrapped(context, text, room)):
        column.label(text=line, icon=icon if number == 0 else ("BLANK1" if icon != "NONE" else "NONE"), translate=False)


def _wrapped(context: bpy.types.Context, text: str, room: float) -> list[str]:
    """Return the lines of a text that are no wider than ``room``; a word that is wider has a line of its own."""
    # What is to stay together but is longer than a line is broken after all, between its words.
    parts = (
        part if text_width(context, part) <= room else part.replace(words.UNBROKEN, " ") for part in text.split(" ")
    )
    lines: list[str] = []
    for part in " ".join(parts).split(" "):
        longer = f"{lines[-1]} {part}" if lines else ""
        if lines and text_width(context, longer) <= room:
            lines[-1] = longer
        else:
            lines.append(part)
    # A dot between two parts stands in no line's beginning or end.
    return [line.strip(" ·").replace(words.UNBROKEN, " ") for line in lines]
