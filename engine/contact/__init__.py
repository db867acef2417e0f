"""Keeps footprints apart.

Contact pushes discs and capsules apart in every step, separation parts outlines at the end. May import ``cascade``,
``device``, ``model``, ``motion``, ``problem``, ``space`` and ``surface``.
"""
