"""From a problem to the poses of its bodies.

Their start, their descent, what lines do, and footprints that push each other apart. May import ``cascade``,
``device``, ``field``, ``heat``, ``problem``, ``space`` and ``surface``.
"""
