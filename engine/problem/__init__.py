"""Describes what is asked for (problems) and what was reached (placements and reports).

Also checks values, separates color images into inks, and derives preferred directions. Uses NumPy only, never Warp.

May import ``geometry``.
"""
