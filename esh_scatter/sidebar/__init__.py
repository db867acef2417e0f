"""The tab of the viewport's sidebar: panels, menus, lists, and the preview of a density."""
