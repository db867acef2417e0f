"""Lists of the sidebar: classes, sizes."""

from bisect import bisect_right

import bpy

from ..properties.body_class import ESH_PG_class
from ..properties.layer import ESH_PG_layer
from ..properties.obstacle import ESH_PG_obstacle
from ..properties.scatter import ESH_PG_scatter
from ..properties.size import ESH_PG_size
from .panel_parts import AROUND, UNIT, cut_in_middle, is_narrow, text_width, units_of, width_of

__all__ = ["CLASSES"]

# Width of the sidebar from which on rows show more [pixels at an interface scale of 1].
WIDE = 330
# What is beside a list and around its rows, with the bar by which longer ones are scrolled, and from how many rows on there is one;
# a row's swatch [pixels at an interface scale of 1].
BESIDE_LIST, SCROLL_BAR, ROWS, SWATCH = 102, 18, 5, 18


class ESH_UL_classes(bpy.types.UIList):
    """The classes of a scatter: color swatch, name, what is placed, how many, mute, eye, camera."""

    def draw_item(
        self,
        context: bpy.types.Context,
        layout: bpy.types.UILayout,
        data: ESH_PG_scatter,
        item: ESH_PG_class,
        _icon: int,
        _active_data: object,
        _active_property: str,
        _index: int = 0,
    ) -> None:
        """Draw one class."""
        row = layout.row(align=True)
        swatch = row.row()
        swatch.ui_units_x = 0.9
        swatch.prop(item, "color", text="")
        text = row.row(align=True)
        text.active = not item.mute
        name = text.row(align=True)
        _draw_name(context, name, data, item)
        if width_of(context) > WIDE:
            source = text.row(align=True)
            source.active = False
            source.label(text=_sources(item), translate=False)
        count = text.row(align=True)
        count.alignment = "RIGHT"
        if not item.mute and data.obstacle_of(item):
            count.label(text="", icon="ERROR")
        else:
            amount = item.amount
            # As wide as it is, so that the name has the rest.
            count.ui_units_x = units_of(context, amount)
            count.label(text=amount, translate=False)
        switches = row.row(align=True)
        icon = "CHECKBOX_DEHLT" if item.mute else "CHECKBOX_HLT"
        switches.prop(item, "mute", text="", icon=icon, emboss=False, invert_checkbox=True)
        if is_narrow(context):
            return
        for switch, on, off in (
            ("show_viewport", "HIDE_OFF", "HIDE_ON"),
            ("show_render", "RESTRICT_RENDER_OFF", "RESTRICT_RENDER_ON"),
        ):
            switches.prop(item, switch, text="", icon=on if getattr(item, switch) else off, emboss=False)


def _draw_name(
    context: bpy.types.Context, layout: bpy.types.UILayout, scatter: ESH_PG_scatter, item: ESH_PG_class
) -> None:
    """Draw the name of a class as a field that a double click opens, or cut in its middle where others would look alike.

    Of the selected class the header of the panel below has all of the name.
    """
    beside = BESIDE_LIST + SWATCH + text_width(context, item.amount) + 2 * AROUND
    beside += UNIT * (1 if is_narrow(context) else 3) + (SCROLL_BAR if len(scatter.classes) > ROWS else 0)
    room = max(width_of(context) - beside, 2 * UNIT)
    if width_of(context) > WIDE or item == scatter.active_class or not _looks_alike(context, scatter, item, room):
        layout.prop(item, "name", text="", emboss=False)
    else:
        layout.label(text=cut_in_middle(context, item.name, room), translate=False)


def _looks_alike(context: bpy.types.Context, scatter: ESH_PG_scatter, item: ESH_PG_class, room: float) -> bool:
    """Tell whether the name of a class has to be cut, and what is left of its beginning is that of another one, too."""
    name: str = item.name
    if text_width(context, name) <= room:
        return False
    seen = name[: bisect_right(range(1, len(name)), room, key=lambda end: text_width(context, name[:end]))]
    return any(other != item and other.name.startswith(seen) for other in scatter.classes)


def _sources(item: ESH_PG_class) -> str:
    """Return what a class places, in a few words; nothing where that is its name."""
    names = {size.source.name for size in item.sizes if size.source}
    text = next(iter(names)) if len(names) == 1 else f"{len(names)} sources" if names else "nothing yet"
    return "" if text == item.name else text


class ESH_UL_sizes(bpy.types.UIList):
    """The sizes of a class: name, what is placed, how many."""

    def draw_item(
        self,
        context: bpy.types.Context,
        layout: bpy.types.UILayout,
        data: ESH_PG_class,
        item: ESH_PG_size,
        _icon: int,
        _active_data: object,
        _active_property: str,
        _index: int = 0,
    ) -> None:
        """Draw one size."""
        narrow = is_narrow(context)
        split = layout.split(factor=0.45 if narrow else 0.36, align=True)
        split.prop(item, "name", text="", emboss=False)
        source = item.source
        icon = "OBJECT_DATA" if item.source_kind == "OBJECT" else "OUTLINER_COLLECTION"
        row = split.row(align=True)
        # What is placed is named below the list, too.
        text = "" if narrow else source.name if source else "none yet"
        row.label(text=text, icon=icon if source else "ERROR", translate=False)
        count = row.row()
        count.alignment = "RIGHT"
        count.label(text=f"{item.count:,}" if data.count_kind == "SIZES" else f"share {item.share:g}", translate=False)


# How a layer acts on those above it.
_SIGNS = {"MULTIPLY": "\u00d7", "ADD": "+", "SUBTRACT": "\u2212", "MINIMUM": "min"}


class ESH_UL_layers(bpy.types.UIList):
    """The layers of a density: whether each counts, what it reads, how it acts, and how strongly."""

    def draw_item(
        self,
        context: bpy.types.Context,
        layout: bpy.types.UILayout,
        data: ESH_PG_class,
        item: ESH_PG_layer,
        _icon: int,
        _active_data: object,
        _active_property: str,
        index: int = 0,
    ) -> None:
        """Draw one layer."""
        row = layout.row(align=True)
        row.use_property_split = False
        row.prop(item, "use", text="")
        text = row.row(align=True)
        text.active = item.use
        text.label(text="", icon=item.told.icon)
        # A placeholder would be too pale on a selected row.
        text.label(text=item.label, translate=False)
        acts = row.row(align=True)
        acts.active = item.use
        if index or item.blend == "SUBTRACT":
            acts.label(text=_SIGNS[item.blend], translate=False)
        if is_narrow(context):
            return
        strength = acts.row(align=True)
        strength.ui_units_x = 2.4
        strength.prop(item, "strength", text="", emboss=False)


class ESH_UL_obstacles(bpy.types.UIList):
    """What the objects of a scatter keep off: its name, and whether they do."""

    def draw_item(
        self,
        _context: bpy.types.Context,
        layout: bpy.types.UILayout,
        _data: ESH_PG_scatter,
        item: ESH_PG_obstacle,
        _icon: int,
        _active_data: object,
        _active_property: str,
        _index: int = 0,
    ) -> None:
        """Draw one obstacle."""
        row = layout.row(align=True)
        text = row.row(align=True)
        text.active = item.use
        source = item.item if item.kind == "OBJECT" else item.collection
        icon = "OUTLINER_COLLECTION" if item.kind == "COLLECTION" else "OBJECT_DATA"
        text.label(
            text=source.name if source else "nothing yet",
            icon=icon if source and not item.gone else "ERROR",
            translate=False,
        )
        row.prop(item, "use", text="")


CLASSES = (ESH_UL_classes, ESH_UL_sizes, ESH_UL_layers, ESH_UL_obstacles)
