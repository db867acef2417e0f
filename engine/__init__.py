"""The sampler: numbers in, numbers out. Never imports bpy or esh_scatter, and works without Blender.

Every public name has one import path, its module; the package ``esh`` offers the ones that users need.
"""
