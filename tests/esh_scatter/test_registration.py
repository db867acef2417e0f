"""Registering adds the sidebar and nothing heavy; unregistering leaves nothing behind."""

import subprocess
import sys

import pytest

bpy = pytest.importorskip("bpy")

from esh.esh_scatter import operators, registration  # noqa: E402
from esh.esh_scatter.operators import classes, classes_from, keys, layers, overlaps, presets, run, scatters, sizes  # noqa: E402
from esh.esh_scatter.operators import exchange as exchange_operators  # noqa: E402
from esh.esh_scatter.properties import body_class, layer, scatter, scene, size  # noqa: E402
from esh.esh_scatter.properties.in_english import CONTEXT  # noqa: E402
from esh.esh_scatter.sidebar import asset_shelf, class_panels, lists, menus, panels, report_panel  # noqa: E402

PROPERTIES = (size, layer, body_class, scatter, scene)
OPERATORS = (run, overlaps, scatters, presets, classes_from, classes, sizes, layers)
MODULES = (*PROPERTIES, lists, *OPERATORS, keys, asset_shelf, menus, panels, exchange_operators)
# What the names of Blender's classes have in them.
INFIXES = (*["_PG_"] * len(PROPERTIES), "_UL_", *["_OT_"] * len(OPERATORS), "_OT_", "_AST_", "_MT_", "_PT_", "_OT_")
PREFIX = "ESH_"


def everything_registered() -> set[str]:
    """Return what the add-on can leave in Blender: types, properties, operators, timers and handlers."""
    types = bpy.types
    kinds = (types.PropertyGroup, types.UIList, types.Operator, types.AssetShelf, types.Panel, types.Menu)
    found = {
        cls.__name__
        for kind in kinds
        for cls in kind.__subclasses__()
        if cls.__name__.startswith(PREFIX) and cls.is_registered
    }
    found |= {name for name in dir(bpy.types) if name.startswith(PREFIX)}
    found |= {f"{name}.esh" for name in ("Scene", "Object", "Mesh") if hasattr(getattr(bpy.types, name), "esh_scatter")}
    found |= {f"esh.{name}" for name in dir(bpy.ops.esh)}
    for menu in (bpy.types.TOPBAR_MT_file_export, bpy.types.TOPBAR_MT_file_import):
        drawn = getattr(menu.draw, "_draw_funcs", [])
        found |= {f"{menu.__name__}.{f.__name__}" for f in drawn if "esh_scatter" in f.__module__}
    for name in ("object", "edit_mesh", "paint_weight", "paint_vertex", "sculpt"):
        drawn = getattr(bpy.types, f"VIEW3D_MT_{name}")._dyn_ui_initialize()
        found |= {f"menu of {name}" for draw in drawn if "esh_scatter" in draw.__module__}
    addon = bpy.context.window_manager.keyconfigs.addon
    found |= {
        f"key {item.type}" for keymap in addon.keymaps for item in keymap.keymap_items if item.idname.startswith("esh.")
    }
    for name in dir(bpy.app.handlers):
        handlers = getattr(bpy.app.handlers, name)
        if isinstance(handlers, list):
            found |= {f"{name}:{h.__name__}" for h in handlers if "esh_scatter" in getattr(h, "__module__", "")}
    return found


def test_unregistering_removes_everything_however_often_it_is_done():
    assert everything_registered() == set()
    for _ in range(3):
        registration.register()
        registered = everything_registered()
        assert {cls.__name__ for module in MODULES for cls in module.CLASSES} <= registered
        assert {"Scene.esh", "esh.scatter", "menu of object", "menu of edit_mesh", "menu of sculpt"} <= registered
        assert {"menu of paint_weight", "menu of paint_vertex", "key X", "key DEL"} <= registered
        assert {"TOPBAR_MT_file_export._draw_export", "TOPBAR_MT_file_import._draw_import"} <= registered
        handlers = {name.partition(":")[2] for name in registered if ":" in name}
        assert handlers == {"bring_up_to_date", "notice_dropped_presets", "pack_painted_images"}, (
            "no other handler may be installed while nothing runs"
        )
        registration.unregister()
        assert everything_registered() == set()
        registration.unregister()  # on leaving, Python and Blender both ask for it


def test_names_and_tooltips_stay_as_they_are_written_whatever_language_blender_speaks():
    """German made "Punkt" of "Pin" and "Meldung" of "Report", and left half of the panel in English."""
    types = bpy.types
    kinds = (types.PropertyGroup, types.Operator, types.Panel, types.Menu, types.UIList, types.AssetShelf)
    inherited = {prop.identifier for kind in kinds for prop in kind.bl_rna.properties}
    registration.register()
    try:
        classes = [cls for module in registration._MODULES for cls in module.CLASSES]
        drawn = [cls for cls in classes if issubclass(cls, types.Operator | types.Panel | types.Menu)]
        assert {cls.bl_translation_context for cls in drawn} == {CONTEXT}
        own = [prop for cls in classes for prop in cls.bl_rna.properties if prop.identifier not in inherited]
        own += [prop for prop in types.WindowManager.bl_rna.properties if prop.identifier.startswith("esh_scatter")]
        assert len(own) > 100
        assert not [prop.identifier for prop in own if prop.translation_context != CONTEXT]
    finally:
        registration.unregister()


def test_every_class_is_listed_once_and_named_as_blender_wants():
    listed = [cls for module in MODULES for cls in module.CLASSES]
    assert len(listed) == len(set(listed))
    for module, infix in zip(MODULES, INFIXES, strict=True):
        assert module.CLASSES
        # The panels are registered in the order that they are drawn in, whichever module they are from.
        parts = (panels, class_panels, report_panel) if module is panels else (module,)
        defined = {
            c
            for part in parts
            for c in vars(part).values()
            if isinstance(c, type) and c.__name__.startswith(PREFIX) and c.__module__ == part.__name__
        }
        assert set(module.CLASSES) == defined
        assert all(cls.__name__.startswith(f"ESH{infix}") for cls in module.CLASSES)


def test_everything_a_user_sees_has_a_tooltip():
    registration.register()
    try:
        for cls in (cls for module in PROPERTIES for cls in module.CLASSES):
            for prop in cls.bl_rna.properties:
                if prop.identifier in {"rna_type", "name"} or prop.is_hidden or prop.type == "COLLECTION":
                    continue
                assert prop.description, f"{cls.__name__}.{prop.identifier}"
                assert not prop.description.endswith("."), f"{cls.__name__}.{prop.identifier}: Blender adds the period"
                for item in getattr(prop, "enum_items", ()):
                    assert item.description, f"{cls.__name__}.{prop.identifier}: {item.identifier}"
        for cls in (*operators.CLASSES, *keys.CLASSES):
            assert cls.bl_idname.startswith("esh.")
            assert cls.__doc__ and not cls.__doc__.endswith("."), cls.__name__
    finally:
        registration.unregister()


def test_registering_imports_neither_warp_nor_trimesh_nor_scipy():
    code = (
        "import sys, bpy, esh\n"
        "esh.register()\n"
        "bpy.ops.esh.scatter_add(); bpy.ops.esh.class_add(); bpy.ops.esh.scatter.poll()\n"
        "print([name for name in ('warp', 'trimesh', 'scipy') if name in sys.modules])"
    )
    outcome = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert outcome.returncode == 0, outcome.stderr
    assert outcome.stdout.splitlines()[-1] == "[]"


def test_leaving_python_while_a_solve_is_under_way_does_not_hang():
    code = (
        "import time\n"
        "from esh.esh_scatter.solving.background_run import BackgroundRun\n"
        "run = BackgroundRun(lambda progress: time.sleep(300))\n"
        "print(run.running)"
    )
    outcome = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert (outcome.returncode, outcome.stdout.strip()) == (0, "True")
