"""Recipes, images and placements as files. May import ``problem``."""
