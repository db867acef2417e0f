"""What lies over the domain, for whoever needs it.

Density images, meshes of nodes, cells, and who is whose neighbour. May import ``device``, ``problem`` and
``transforms``.
"""
