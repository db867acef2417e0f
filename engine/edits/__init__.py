"""From one problem to another.

Which bodies stay, go and come, and the steps in which the others make room for these. May import ``descent``,
``device``, ``model``, ``motion``, ``problem``, ``space`` and ``surface``.
"""
