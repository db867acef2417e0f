"""Whole runs.

The solver's steps, edits and bookmarks, and the starts that it chooses from. May import ``descent``, ``device``,
``edits``, ``heat``, ``model``, ``motion``, ``problem`` and ``space``.
"""
