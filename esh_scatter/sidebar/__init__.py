"""The tab of the viewport's sidebar: panels, menus, lists, previews, presets."""
