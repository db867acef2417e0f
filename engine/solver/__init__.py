"""Carries out whole runs.

``solver.py`` has :class:`~esh.Solver`: it compiles a problem, takes steps and edits, saves bookmarks, and reads the placement.
``placing.py`` says what differs between the plane (``placing_in_plane.py``) and a surface (``placing_on_surface.py``). The other files
choose a good start and finish drawings, and record what the report says of a run.

May import ``descent``, ``device``, ``edits``, ``heat``, ``model``, ``motion``, ``problem``, ``quality`` and ``space``.
"""
