"""Smooths quantities along a surface with the heat kernel.

Blurred charges and targets on a surface are compared this way: see ``heat_mesh.py``.

May import ``device``, ``geometry``, ``problem`` and ``space``.
"""
