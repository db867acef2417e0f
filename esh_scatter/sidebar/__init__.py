"""The tab in the sidebar of the 3D view: panels, menus, lists, and the preview of a density."""
