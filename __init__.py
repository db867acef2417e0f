"""ESH Scatter: place objects by electrostatic sampling, for Blender, for scripts and for pipelines.

Blender loads this package as an extension (:func:`register`, :func:`unregister`); pip installs it as ``esh``. Importing it
imports neither Blender, Warp nor NumPy: every public name is fetched where it is used first. What a script needs is here, under
``esh`` itself; nothing below it is part of the interface.
"""

from __future__ import annotations

from .engine.version import __version__

# What `typing` calls so, which takes longer to load than all that the command needs before it answers Ctrl-C.
TYPE_CHECKING = False

# For type checkers and editors, which cannot follow the table below; a test holds the two and `__all__` together.
if TYPE_CHECKING:
    from .engine.device.profile import Profile
    from .engine.drawing.halftone import render_halftone, write_halftone_png, write_halftone_svg
    from .engine.drawing.plan import draw_plan
    from .engine.errors import DeviceError, EshError, InputFileError, ProblemError
    from .engine.files.bodies import Bodies, Prototype
    from .engine.files.fixed_files import read_fixed_bodies
    from .engine.files.image_files import read_color, read_density
    from .engine.files.placement_files import write_bodies, write_placement
    from .engine.files.placement_reader import load_placement
    from .engine.files.recipe import read_recipe
    from .engine.files.recipe_writer import write_recipe
    from .engine.model.body_flags import BodyFlags
    from .engine.model.state import State, SurfaceState
    from .engine.problem.balance import Balance
    from .engine.problem.body_class import BodyClass, Unsharp
    from .engine.problem.color_separation import Ink, InkModel, halftone_problem, ink_colors, separate
    from .engine.problem.cover import Cover, cover_of
    from .engine.problem.domain import Domain
    from .engine.problem.fixed_bodies import FixedBodies, FixedBody
    from .engine.problem.footprint import Footprint
    from .engine.problem.footprints import Footprints
    from .engine.problem.line import Line
    from .engine.problem.look_at import LookAt
    from .engine.problem.obstacles import Obstacle
    from .engine.problem.placement import Placement
    from .engine.problem.prepared_class import PreparedClass
    from .engine.problem.problem import Problem
    from .engine.problem.report import ClassReport, Report, SizeReport
    from .engine.problem.scatter_settings import ScatterSettings, Standing
    from .engine.problem.size import Size
    from .engine.problem.surface import PointsOnSurface, Surface, SurfaceMesh
    from .engine.problem.surface_density import SurfaceAttribute, SurfaceImage, SurfaceTriplanar
    from .engine.problem.surface_directions import AlongCurves, SurfaceVectors
    from .engine.scenes.solve_many import solve_many
    from .engine.solve import solve
    from .engine.solver.bookmarks import Bookmark
    from .engine.solver.progress import Progress
    from .engine.solver.solver import Edit, Solver
    from .engine.surface.instances import Instances
    from .engine.surface.mesh_outline import Outline
    from .engine.tiles.tiles import TileState, solve_tiles
    from .esh_scatter.api import ScatterClass, ScatterJob, ScatterResult, ScatterSize, scatter
    from .esh_scatter.classes.amount import Amount
    from .esh_scatter.classes.directions import AttributeDirection, CurveDirection
    from .esh_scatter.classes.object_outline import measure_footprint
    from .esh_scatter.densities.kinds import (
        AltitudeDensity,
        AttributeDensity,
        CameraDensity,
        ClassDensity,
        Density,
        DensityLayer,
        DensityStack,
        DistanceDensity,
        FacingDensity,
        ImageDensity,
        InsideDensity,
        NoiseDensity,
        SlopeDensity,
        VertexGroupDensity,
    )
    from .esh_scatter.result.exchange import export_result, import_placement
    from .esh_scatter.solving.obstacles import ScatterObstacle

__all__ = [
    "__version__",
    "AlongCurves",
    "AltitudeDensity",
    "Amount",
    "AttributeDensity",
    "AttributeDirection",
    "Balance",
    "Bodies",
    "BodyClass",
    "BodyFlags",
    "Bookmark",
    "CameraDensity",
    "ClassDensity",
    "ClassReport",
    "Cover",
    "CurveDirection",
    "Density",
    "DensityLayer",
    "DensityStack",
    "DeviceError",
    "DistanceDensity",
    "Domain",
    "Edit",
    "EshError",
    "FacingDensity",
    "FixedBodies",
    "FixedBody",
    "Footprint",
    "Footprints",
    "ImageDensity",
    "Ink",
    "InkModel",
    "InputFileError",
    "InsideDensity",
    "Instances",
    "Line",
    "LookAt",
    "NoiseDensity",
    "Outline",
    "Obstacle",
    "Placement",
    "PointsOnSurface",
    "PreparedClass",
    "Problem",
    "ProblemError",
    "Profile",
    "Progress",
    "Prototype",
    "Report",
    "ScatterClass",
    "ScatterJob",
    "ScatterObstacle",
    "ScatterResult",
    "ScatterSettings",
    "ScatterSize",
    "Size",
    "SizeReport",
    "SlopeDensity",
    "Solver",
    "Standing",
    "State",
    "Surface",
    "SurfaceAttribute",
    "SurfaceImage",
    "SurfaceMesh",
    "SurfaceState",
    "SurfaceTriplanar",
    "SurfaceVectors",
    "TileState",
    "Unsharp",
    "VertexGroupDensity",
    "cover_of",
    "draw_plan",
    "export_result",
    "halftone_problem",
    "import_placement",
    "ink_colors",
    "load_placement",
    "measure_footprint",
    "read_color",
    "read_density",
    "read_fixed_bodies",
    "read_recipe",
    "render_halftone",
    "scatter",
    "separate",
    "solve",
    "solve_many",
    "solve_tiles",
    "write_bodies",
    "write_halftone_png",
    "write_halftone_svg",
    "write_placement",
    "write_recipe",
    "register",
    "unregister",
]

# Public name -> module that holds it. Those of `esh_scatter` need Blender, as an application or as pip's `bpy`.
_MODULES = {
    "AlongCurves": ".engine.problem.surface_directions",
    "AltitudeDensity": ".esh_scatter.densities.kinds",
    "Amount": ".esh_scatter.classes.amount",
    "AttributeDensity": ".esh_scatter.densities.kinds",
    "AttributeDirection": ".esh_scatter.classes.directions",
    "Balance": ".engine.problem.balance",
    "Bodies": ".engine.files.bodies",
    "BodyClass": ".engine.problem.body_class",
    "BodyFlags": ".engine.model.body_flags",
    "Bookmark": ".engine.solver.bookmarks",
    "CameraDensity": ".esh_scatter.densities.kinds",
    "ClassDensity": ".esh_scatter.densities.kinds",
    "ClassReport": ".engine.problem.report",
    "Cover": ".engine.problem.cover",
    "Density": ".esh_scatter.densities.kinds",
    "CurveDirection": ".esh_scatter.classes.directions",
    "DensityLayer": ".esh_scatter.densities.kinds",
    "DensityStack": ".esh_scatter.densities.kinds",
    "DeviceError": ".engine.errors",
    "DistanceDensity": ".esh_scatter.densities.kinds",
    "Domain": ".engine.problem.domain",
    "Edit": ".engine.solver.solver",
    "EshError": ".engine.errors",
    "FacingDensity": ".esh_scatter.densities.kinds",
    "Footprint": ".engine.problem.footprint",
    "Footprints": ".engine.problem.footprints",
    "FixedBodies": ".engine.problem.fixed_bodies",
    "FixedBody": ".engine.problem.fixed_bodies",
    "ImageDensity": ".esh_scatter.densities.kinds",
    "Ink": ".engine.problem.color_separation",
    "InkModel": ".engine.problem.color_separation",
    "InputFileError": ".engine.errors",
    "InsideDensity": ".esh_scatter.densities.kinds",
    "Instances": ".engine.surface.instances",
    "Line": ".engine.problem.line",
    "LookAt": ".engine.problem.look_at",
    "NoiseDensity": ".esh_scatter.densities.kinds",
    "Outline": ".engine.surface.mesh_outline",
    "Obstacle": ".engine.problem.obstacles",
    "Placement": ".engine.problem.placement",
    "PointsOnSurface": ".engine.problem.surface",
    "PreparedClass": ".engine.problem.prepared_class",
    "Problem": ".engine.problem.problem",
    "ProblemError": ".engine.errors",
    "Profile": ".engine.device.profile",
    "Progress": ".engine.solver.progress",
    "Prototype": ".engine.files.bodies",
    "Report": ".engine.problem.report",
    "ScatterClass": ".esh_scatter.api",
    "ScatterJob": ".esh_scatter.api",
    "ScatterObstacle": ".esh_scatter.solving.obstacles",
    "ScatterResult": ".esh_scatter.api",
    "ScatterSettings": ".engine.problem.scatter_settings",
    "ScatterSize": ".esh_scatter.api",
    "Size": ".engine.problem.size",
    "SizeReport": ".engine.problem.report",
    "SlopeDensity": ".esh_scatter.densities.kinds",
    "Solver": ".engine.solver.solver",
    "Standing": ".engine.problem.scatter_settings",
    "State": ".engine.model.state",
    "Surface": ".engine.problem.surface",
    "SurfaceAttribute": ".engine.problem.surface_density",
    "SurfaceImage": ".engine.problem.surface_density",
    "SurfaceMesh": ".engine.problem.surface",
    "SurfaceState": ".engine.model.state",
    "SurfaceTriplanar": ".engine.problem.surface_density",
    "SurfaceVectors": ".engine.problem.surface_directions",
    "TileState": ".engine.tiles.tiles",
    "Unsharp": ".engine.problem.body_class",
    "VertexGroupDensity": ".esh_scatter.densities.kinds",
    "cover_of": ".engine.problem.cover",
    "draw_plan": ".engine.drawing.plan",
    "export_result": ".esh_scatter.result.exchange",
    "halftone_problem": ".engine.problem.color_separation",
    "import_placement": ".esh_scatter.result.exchange",
    "ink_colors": ".engine.problem.color_separation",
    "load_placement": ".engine.files.placement_reader",
    "measure_footprint": ".esh_scatter.classes.object_outline",
    "read_color": ".engine.files.image_files",
    "read_density": ".engine.files.image_files",
    "read_fixed_bodies": ".engine.files.fixed_files",
    "read_recipe": ".engine.files.recipe",
    "render_halftone": ".engine.drawing.halftone",
    "scatter": ".esh_scatter.api",
    "separate": ".engine.problem.color_separation",
    "solve": ".engine.solve",
    "solve_many": ".engine.scenes.solve_many",
    "solve_tiles": ".engine.tiles.tiles",
    "write_bodies": ".engine.files.placement_files",
    "write_halftone_png": ".engine.drawing.halftone",
    "write_halftone_svg": ".engine.drawing.halftone",
    "write_placement": ".engine.files.placement_files",
    "write_recipe": ".engine.files.recipe_writer",
}


# Hidden from type checkers: to them a name that is misspelled is one that does not exist.
if not TYPE_CHECKING:

    def __getattr__(name: str) -> object:
        import importlib

        if name in _MODULES:
            return getattr(importlib.import_module(_MODULES[name], __name__), name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)


def register() -> None:
    """Called by Blender when the extension is enabled."""
    from .esh_scatter import registration

    registration.register()


def unregister() -> None:
    """Called by Blender when the extension is disabled: leaves nothing behind."""
    from .esh_scatter import registration

    registration.unregister()
