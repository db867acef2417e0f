"""Moves bodies: the forces on their charges, the moves that these propose, the direction of the descent, and the rules for lines.

``forces.py`` is for the plane, and ``direction.py`` for the plane and surfaces. Files with ``surface`` in their names hold what
differs on surfaces, whose forces come from the room ``cascade``. The step that puts all this together is in the room ``descent``.

May import ``cascade``, ``device``, ``field``, ``geometry``, ``model``, ``problem``, ``space`` and ``surface``.
"""
