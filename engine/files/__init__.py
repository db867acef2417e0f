"""Reads and writes files: recipes, images, meshes, placements and reports.

May import ``problem``.
"""
