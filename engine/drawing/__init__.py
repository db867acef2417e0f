"""Placements as pictures, which are ink on paper or plans. May import ``files`` and ``problem``."""
