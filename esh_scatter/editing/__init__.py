"""Settings of the sidebar, made and judged: from a selection, a preset or a copy, by painting; what a run will take."""
