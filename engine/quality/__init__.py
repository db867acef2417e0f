"""How good a placement is.

Coverage, spacing, overlaps and lines, measured on the placement alone, independent of the solver. May import
``device``, ``field``, ``heat``, ``problem``, ``space``, ``surface`` and ``transforms``.
"""
