"""Solves many variations of a recipe into a folder.

Works in warm processes on this machine or on others; an interrupted batch can be continued.

May import ``device``, ``files``, ``problem`` and ``solve.py``.
"""
