"""What a problem compiles to, once, for the solver.

Tables of bodies, charges and groups; and the states they can be in. May import ``cascade``, ``device``, ``field``,
``problem``, ``space`` and ``surface``.
"""
