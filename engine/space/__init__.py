"""What all parts of the solver know of the rectangular domain.

The space itself, which says what happens at the edges (``space.py``), density images, layouts of meshes, sorting into cells, and
the search for neighbors.

May import ``device``, ``geometry``, ``problem`` and ``transforms``.
"""
