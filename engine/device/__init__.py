"""Runs kernels on the CPU's threads or on a GPU, and measures how long they take.

Begin with ``launcher.py``.

Imports no other room.
"""
