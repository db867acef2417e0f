"""Logic behind the sidebar's settings, without any buttons.

Makes settings from a selection, a preset, a copy or by painting, and forecasts what a run will cover.
"""
