"""Fast forces on a surface: an octave cascade of Gaussians between nodes that lie on it, and near pairs.

May import ``device``, ``space`` and ``surface``.
"""
