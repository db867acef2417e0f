"""Target meshes, on which objects are placed: reading them from Blender, and noticing when they have changed."""
