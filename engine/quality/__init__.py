"""Measures how good a placement is: coverage, spacing, overlaps and lines.

Everything is measured on the placement alone, independently of the solver, so that a mistake of the solver shows.

May import ``device``, ``field``, ``geometry``, ``heat``, ``problem``, ``space``, ``surface`` and ``transforms``.
"""
