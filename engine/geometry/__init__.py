"""Points, polygons and triangles as arrays: hulls, pieces, distances, nearest points, and what of a mesh hangs together.

Knows nothing of problems and bodies. Uses NumPy only.

Imports no other room.
"""
