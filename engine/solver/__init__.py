"""Carries out whole runs.

``solver.py`` has :class:`~esh.Solver`: it compiles a problem, takes steps and edits, saves bookmarks, and reads the placement. The
other files choose a good start and finish drawings.

May import ``descent``, ``device``, ``edits``, ``heat``, ``model``, ``motion``, ``problem`` and ``space``.
"""
