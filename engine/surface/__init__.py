"""A triangle mesh seen from above.

The chart that ties the domain to it, what it says at its points, how much ground it takes. May import ``device`` and
``problem``.
"""
