"""Densities of a class, as Blender has them: images, layers, the shape of the ground, nearby objects."""
