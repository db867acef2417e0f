"""Settings of the documentation: Sphinx reads the Markdown files of this folder, and docstrings for the API pages."""

import sys
import tomllib
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]

project = "ESH Scatter"
author = "ESH Scatter contributors"
project_copyright = "ESH Scatter contributors, GPL-3.0-or-later"
version = release = PROJECT["version"]

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
# Anchors for headings as GitHub makes them, so that one link works there and here.
myst_heading_anchors = 3
exclude_patterns = ["_build"]


class BlenderStandIn(ModuleType):
    """Stands in for Blender, which docstrings do not need: every name in it is a class or a module.

    Sphinx's own mock objects cannot be parts of a union of types.
    """

    def __getattr__(self, name: str) -> object:
        if name.startswith("__"):
            raise AttributeError(name)
        path = f"{self.__name__}.{name}"
        made = BlenderStandIn(path) if name.islower() else type(name, (), {"__module__": self.__name__})
        setattr(self, name, made)
        if isinstance(made, ModuleType):
            sys.modules[path] = made
        return made


for module_name in ("bmesh", "bpy", "mathutils"):
    sys.modules[module_name] = BlenderStandIn(module_name)

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_class_signature = "mixed"
python_display_short_literal_types = True
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False

html_theme = "furo"
html_title = f"{project} {version}"
html_show_sourcelink = False
html_copy_source = False
