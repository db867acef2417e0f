"""Many scenes: variations of a recipe, solved in warm processes here or on other machines, into a folder that can be continued.

May import ``device``, ``files``, ``problem`` and ``solve.py``.
"""
