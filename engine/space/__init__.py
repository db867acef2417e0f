"""What lies over the domain, for whoever needs it.

Density images, meshes of nodes, cells, and who is whose neighbor. May import ``device``, ``problem`` and
``transforms``.
"""
