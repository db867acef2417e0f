"""Registering and unregistering every class of the add-on, in order."""

import atexit

import bpy

from . import lists, menus, operators, panels, properties, running, versions

__all__ = ["register", "unregister"]

_MODULES = (properties, lists, operators, menus, panels)


def register() -> None:
    """Make the sidebar, its operators and the scene's settings known to Blender."""
    for module in _MODULES:
        for cls in module.CLASSES:
            bpy.utils.register_class(cls)
    properties.attach()
    versions.attach()
    menus.attach()
    # Python that imported Blender as a module hangs on leaving while classes of an add-on are registered.
    atexit.register(unregister)


def unregister() -> None:
    """Stop a run that is under way and take everything away again."""
    atexit.unregister(unregister)
    running.end(wait=True)
    menus.detach()
    versions.detach()
    properties.detach()
    for module in reversed(_MODULES):
        for cls in reversed(module.CLASSES):
            bpy.utils.unregister_class(cls)
