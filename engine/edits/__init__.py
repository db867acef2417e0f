"""Continues from the placement of one problem to that of a changed problem.

Decides which bodies stay, which are removed and where new ones are added (``edit.py``, ``surface_edit.py``), then takes the steps
in which the other bodies make room (``settling.py``).

May import ``descent``, ``device``, ``model``, ``motion``, ``problem``, ``space`` and ``surface``.
"""
