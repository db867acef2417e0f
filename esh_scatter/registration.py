"""Registering and unregistering every class of the add-on, in order."""

import atexit

import bpy

from . import operators, versions
from .classes import lent_survey
from .editing import dropped_presets, forecast, painting
from .operators import exchange as exchange_operators
from .operators import keys
from .properties import body_class, layer, obstacle, placed, scatter, scene, size
from .properties.held_in_steps import hold_in_steps
from .properties.in_english import keep_in_english
from .sidebar import asset_shelf, density_preview, export_notes, followed_names, lists, menus, panels
from .solving import counted_again, live, loading, running

__all__ = ["register", "unregister"]

_MODULES = (
    size,
    layer,
    body_class,
    placed,
    obstacle,
    scatter,
    scene,
    lists,
    operators,
    keys,
    asset_shelf,
    menus,
    panels,
    export_notes,
    exchange_operators,
)


def register() -> None:
    """Make the sidebar, its operators and the scene's settings known to Blender."""
    for module in _MODULES:
        for cls in module.CLASSES:
            keep_in_english(cls)
            hold_in_steps(cls)
            bpy.utils.register_class(cls)
    scene.attach()
    versions.attach()
    density_preview.attach()
    painting.attach()
    dropped_presets.attach()
    exchange_operators.attach()
    export_notes.attach()
    menus.attach()
    keys.attach()
    # Python that imported Blender as a module hangs on leaving while classes of an add-on are registered.
    atexit.register(unregister)


def unregister() -> None:
    """Stop a run that is under way and take everything away again; nothing where that has been done."""
    atexit.unregister(unregister)
    # Blender as a module disables its add-ons on leaving, after Python has called us.
    if not _MODULES[0].CLASSES[0].is_registered:
        return
    live.end(wait=True)
    running.end(wait=True)
    loading.end()
    forecast.detach()
    counted_again.detach()
    followed_names.detach()
    lent_survey.detach()
    keys.detach()
    menus.detach()
    export_notes.detach()
    exchange_operators.detach()
    dropped_presets.detach()
    painting.detach()
    density_preview.detach()
    versions.detach()
    scene.detach()
    for module in reversed(_MODULES):
        for cls in reversed(module.CLASSES):
            bpy.utils.unregister_class(cls)
