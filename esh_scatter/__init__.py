"""Blender's side: the API for scripts, targets, the result's node group, operators and the sidebar. The engine does the solving."""
