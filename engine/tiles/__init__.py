"""One huge domain, solved in tiles: no process ever holds more of it than a window, and what comes of it has no seams.

May import ``descent``, ``device``, ``field``, ``files``, ``model``, ``motion``, ``problem``, ``scenes`` and
``space``.
"""
