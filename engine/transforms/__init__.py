"""Fourier transforms of real meshes, and convolution through them, on the CPU and on GPUs.

May import ``device``.
"""
