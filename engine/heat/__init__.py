"""Heat that spreads over a surface: what numbers on it are, smoothed along it.

May import ``device``, ``problem`` and ``space``.
"""
