"""When two places on a surface see each other along it."""

from __future__ import annotations

import math

__all__ = ["CREASED_COSINE", "LEAST_COSINE", "SHARPEST_COSINE", "STEEPER"]

# Where the way between two places leaves their two planes by this much more [rad] than these are turned, they lie on two sheets, one
# above the other.
STEEPER = math.pi / 3.0
# Nor do they see each other where the surface turns by much more than a right angle between them: below this cosine. Across a
# right-angled edge they do, whatever rounding makes of its cosine of 0.
LEAST_COSINE = -0.1
# Where both places lie in flat triangles, and these bend by more than so much, there is a crease between them, across which outlines
# that are no discs are as far apart as along both planes; so all are across creases sharper than the least cosine, up to the sharpest.
CREASED_COSINE, SHARPEST_COSINE = 0.94, -0.99
