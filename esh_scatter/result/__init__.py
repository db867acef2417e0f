"""The result of a scatter in the .blend file.

Its points, the node group that shows objects on them, pinned objects, and exchange with other programs' files.
"""
