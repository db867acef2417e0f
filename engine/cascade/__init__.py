"""Fast forces on a surface.

The kernel -log r is a sum of Gaussians, one per octave of width. Wide octaves are summed over nodes on the surface, narrow ones
directly over pairs of neighboring charges: see ``cascade.py``.

May import ``device``, ``space`` and ``surface``.
"""
