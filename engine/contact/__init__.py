"""Keeps the footprints of bodies apart.

*Contact* (``contact.py``, ``surface_contact.py``) pushes discs and capsules apart in every step of the descent. *Separation*
(``separation.py``) moves exact convex outlines apart after the last step.

May import ``cascade``, ``device``, ``geometry``, ``model``, ``motion``, ``problem``, ``space`` and ``surface``.
"""
