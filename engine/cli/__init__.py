"""The command line: recipes and images in, placements and pictures out. Needs no Blender."""
