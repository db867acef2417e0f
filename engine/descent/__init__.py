"""Minimizes the energy: where bodies start, what one step launches, when a run has converged, and where bodies end.

Begin with ``descent.py`` for the plane and ``surface_descent.py`` for surfaces.

May import ``cascade``, ``contact``, ``device``, ``geometry``, ``heat``, ``model``, ``motion``, ``problem``, ``space`` and
``surface``.
"""
