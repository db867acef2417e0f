"""ESH Scatter: place objects by electrostatic sampling, for Blender, for scripts and for pipelines.

Blender loads this package as an extension (:func:`register`, :func:`unregister`); pip installs it as ``esh``. Importing it
imports neither Blender nor Warp: every public name is fetched where it is used first.
"""

from __future__ import annotations

import importlib

from .engine.version import __version__

# Public name -> module that holds it.
_PUBLIC = {
    "Balance": ".engine.problem.problem",
    "BodyClass": ".engine.problem.problem",
    "DeviceError": ".engine.errors",
    "Domain": ".engine.problem.problem",
    "EshError": ".engine.errors",
    "InputFileError": ".engine.errors",
    "Line": ".engine.problem.problem",
    "Placement": ".engine.problem.placement",
    "Problem": ".engine.problem.problem",
    "ProblemError": ".engine.errors",
    "Progress": ".engine.solver.solver",
    "Report": ".engine.problem.report",
    "Size": ".engine.problem.problem",
    "Unsharp": ".engine.problem.problem",
    "read_recipe": ".engine.files.recipe",
    "scatter": ".esh_scatter.api",
    "solve": ".engine.solve",
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
