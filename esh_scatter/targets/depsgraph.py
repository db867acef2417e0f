"""The dependency graph as evaluated, beside threads."""

from __future__ import annotations

import bpy

__all__ = ["evaluated_depsgraph"]


def evaluated_depsgraph(context: bpy.types.Context) -> bpy.types.Depsgraph:
    """Return the dependency graph of a context's view layer, evaluated.

    The context has a method for that, which crashes Blender where a script has overridden the context and another thread works in
    Python: it lets go of Python's lock, then looks into the dictionary of what was overridden, and takes the lock for that only if
    no thread has it, even another one.
    """
    layer = context.view_layer
    if layer.depsgraph is None:
        # Nothing of this layer was evaluated yet.
        layer.update()
    layer.depsgraph.update()
    return layer.depsgraph
