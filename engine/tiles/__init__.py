"""Solves a domain that is larger than memory, tile by tile and without seams.

No process holds more of the domain than one window: a tile and its surroundings. Begin with ``tiles.py``.

May import ``descent``, ``device``, ``edits``, ``field``, ``files``, ``model``, ``motion``, ``problem``, ``quality``, ``scenes`` and
``space``.
"""
