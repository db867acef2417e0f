"""ESH Scatter: place objects by electrostatic sampling, for Blender, for scripts and for pipelines.

Blender loads this package as an extension (:func:`register`, :func:`unregister`); pip installs it as ``esh``. Importing it
imports neither Blender nor Warp: every public name is fetched where it is used first.
"""

from __future__ import annotations

import importlib

__version__ = "0.1.0"

# Public name -> module that holds it.
_PUBLIC = {
    "Balance": ".engine.problem",
    "BodyClass": ".engine.problem",
    "DeviceError": ".engine.errors",
    "Domain": ".engine.problem",
    "EshError": ".engine.errors",
    "InputFileError": ".engine.errors",
    "Line": ".engine.problem",
    "Placement": ".engine.placement",
    "Problem": ".engine.problem",
    "ProblemError": ".engine.errors",
    "Progress": ".engine.relaxation",
    "Report": ".engine.report",
    "Size": ".engine.problem",
    "Unsharp": ".engine.problem",
    "read_recipe": ".engine.recipe",
    "scatter": ".esh_scatter.api",
    "solve": ".engine.relaxation",
}

__all__ = ["__version__", "register", "unregister", *_PUBLIC]


def __getattr__(name: str) -> object:
    if name in _PUBLIC:
        return getattr(importlib.import_module(_PUBLIC[name], __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def register() -> None:
    """Called by Blender when the extension is enabled."""
    from .esh_scatter import registration

    registration.register()


def unregister() -> None:
    """Called by Blender when the extension is disabled: leaves nothing behind."""
    from .esh_scatter import registration

    registration.unregister()
