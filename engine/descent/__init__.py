"""The relaxation, in the plane and on surfaces.

Where bodies start, what one step launches, and where they end. May import ``cascade``, ``contact``, ``device``,
``field``, ``heat``, ``model``, ``motion``, ``problem``, ``space`` and ``surface``.
"""
