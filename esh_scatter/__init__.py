"""Blender's side: panel, operators, node group, targets, headless API."""
