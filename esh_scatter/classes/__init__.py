"""Classes of objects: what is asked for, and what their objects are."""
