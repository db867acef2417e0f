"""Fourier transforms of real meshes, and convolution through them. May import ``device``."""
