"""One huge domain, solved in tiles: no process ever holds more of it than a window, and what comes of it has no seams.

May import ``device``, ``field``, ``files``, ``problem``, ``scenes``, ``solver`` and ``space``.
"""
