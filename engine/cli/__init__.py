"""The command line: recipes and images in, placements and pictures out. Needs no Blender.

May import ``device``, ``drawing``, ``files``, ``problem``, ``scenes``, ``solve.py``, ``solver`` and ``tiles``.
"""
