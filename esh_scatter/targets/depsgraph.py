"""The dependency graph as evaluated, beside threads."""

from __future__ import annotations

import bpy

__all__ = ["evaluated_depsgraph"]


def evaluated_depsgraph(context: bpy.types.Context) -> bpy.types.Depsgraph:
    """Return the dependency graph of a context's view layer, evaluated.

    The same as ``evaluated_depsgraph_get``, which crashes Blender where the context was overridden by a script and another thread
    works in Python: it lets go of Python's lock and then looks into the dictionary of what was overridden, without the lock if it
    takes another thread's for its own.
    """
    depsgraph = context.view_layer.depsgraph
    if depsgraph is None:
        # Nothing of this layer was evaluated yet.
        return context.evaluated_depsgraph_get()
    depsgraph.update()
    return depsgraph
