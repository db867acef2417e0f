"""Fast forces.

Particle-particle-particle-mesh (P3M) is a smooth far part on a mesh, and a near part between neighbors. May import
``device``, ``space`` and ``transforms``.
"""
