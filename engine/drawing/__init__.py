"""Draws placements: halftones as ink on paper, and plans seen from above.

May import ``files`` and ``problem``.
"""
