"""How bodies move.

The forces on their charges, the steps that follow from these, and the rules that lines keep. May import ``cascade``,
``device``, ``field``, ``model``, ``problem``, ``space`` and ``surface``.
"""
