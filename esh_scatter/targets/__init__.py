"""Meshes of Blender that something is placed on: read, known again, and whether they have changed."""
