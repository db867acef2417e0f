"""Blender's side (panel, operators, node group, targets, headless API) and the command line."""
