"""How densely a class is placed: images, layers, the ground, what stands nearby."""
