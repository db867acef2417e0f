"""Fast forces in the plane, by particle-particle particle-mesh (P3M).

A smooth far part is computed on a mesh with FFTs, a near part between neighbors. Begin with ``field.py``; ``direct_sum.py`` is the
slow float64 reference.

May import ``device``, ``space`` and ``transforms``.
"""
