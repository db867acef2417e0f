"""Compiles a problem, once, into the flat tables that the solver reads.

``model.py`` has the tables of bodies, charges and groups. ``attraction.py`` says what attracts the groups, ``supports.py`` where
bodies may be. ``state.py`` holds what changes from step to step, in the plane and on a surface.

May import ``cascade``, ``device``, ``field``, ``geometry``, ``problem``, ``space`` and ``surface``.
"""
