"""What a user sets in the sidebar: property groups on the scene, so that it is saved, undone and copied with it.

``Scene.esh_scatter`` holds any number of scatters, each with its target, classes, sizes and last report. They live on
the scene rather than on the target because a target is often linked from a library and then cannot be edited. Objects,
collections and images are held as pointers, so renaming them breaks nothing and deleting them leaves an empty field.
"""
