"""Classes of a scatter: what a caller asks for, and the objects that are placed, with their outlines and how they stand."""
