"""Triangle meshes, used in two ways.

A mesh seen from above gets a *chart*, which ties the rectangular domain to it (``chart.py``). A whole surface that bodies are
placed on is cut into *facets* (``facets.py``); other files find which of its parts touch or stand on one another.

May import ``device``, ``geometry`` and ``problem``.
"""
