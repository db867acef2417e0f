"""Triangle meshes: one seen from above, and surfaces that bodies are placed on.

Of the first, the chart that ties the domain to it, what it says at its points, how much ground it takes; of the second, the
facets that it is cut into, and which of its parts see each other. May import ``device`` and ``problem``.
"""
