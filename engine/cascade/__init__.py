"""Fast forces on a surface.

The kernel -log r is a sum of Gaussians, one per octave of width. Wide octaves (the far field) are summed over nodes on the surface.
Narrow ones (the near field) are summed directly: over pairs of neighboring charges, and, for the target, once at the corners of tiles.
Read ``cascade.py`` first.

May import ``device``, ``space`` and ``surface``.
"""
