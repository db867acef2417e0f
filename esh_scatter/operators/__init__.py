"""Operators: the buttons of the sidebar. They translate between Blender and the API, and report its errors as sentences."""

from . import (
    assets,
    classes,
    classes_from,
    end_run,
    example,
    instances,
    layers,
    obstacles,
    overlaps,
    presets,
    run,
    scatter_objects,
    scatters,
    sizes,
    update_all,
)

__all__ = ["CLASSES"]

# In the order of the viewport's Object menu.
CLASSES = tuple(
    cls
    for module in (
        run,
        scatter_objects,
        example,
        end_run,
        update_all,
        overlaps,
        scatters,
        presets,
        assets,
        classes_from,
        classes,
        sizes,
        layers,
        obstacles,
        instances,
    )
    for cls in module.CLASSES
)
