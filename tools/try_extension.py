"""Install the zip in a Blender without a window, scatter, and look at what came of it.

blender --background --factory-startup --python-exit-code 1 --python tools/try_extension.py -- dist/esh_scatter-….zip
"""

import sys

import bpy


def main(package: str) -> None:
    """Install and scatter; raises where something is not as it should be."""
    bpy.ops.extensions.package_install_files(
        filepath=package, repo="user_default", enable_on_install=True, overwrite=True
    )
    assert "bl_ext.user_default.esh_scatter" in bpy.context.preferences.addons, "the extension is not enabled"
    import bl_ext.user_default.esh_scatter as esh

    bpy.ops.mesh.primitive_grid_add(size=20.0)
    ground = bpy.context.object
    bpy.ops.mesh.primitive_cone_add(location=(30.0, 0.0, 0.0))
    pine = bpy.context.object
    sizes = [esh.ScatterSize("large", 30, pine, area=2.0), esh.ScatterSize("small", 120, pine, area=0.5)]
    result = esh.scatter(ground, [esh.ScatterClass("pine", sizes)], seed=3)
    placed = [size.placed for entry in result.report.classes for size in entry.sizes]
    assert placed == [30, 120], placed
    instances = [
        instance
        for instance in bpy.context.evaluated_depsgraph_get().object_instances
        if instance.is_instance and instance.object.original == pine
    ]
    assert len(instances) == 150, f"{len(instances)} instances"
    print(f"Blender {bpy.app.version_string}: {result.report}")


if __name__ == "__main__":
    main(sys.argv[sys.argv.index("--") + 1])
