"""When two places on a surface see each other along it."""

from __future__ import annotations

import math

__all__ = ["LEAST_COSINE", "SHARPEST_COSINE", "STEEPER"]

# Where the way between two places leaves their two planes by this much more [rad] than these are turned, they lie on two sheets, one
# above the other.
STEEPER = math.pi / 3.0
# Nor do they see each other where the surface turns by much more than a right angle between them: below this cosine. Across a
# right-angled edge they do, whatever rounding makes of its cosine of 0.
LEAST_COSINE = -0.1
# Outlines do across sharper creases, too, up to this cosine, where they lie in both planes: as far apart as along these.
SHARPEST_COSINE = -0.95
