"""When a mesh has an upper side: how much of it must be visible from above."""

from __future__ import annotations

__all__ = ["NARROWEST", "SMALLEST_COVER"]

# Share of the bounding rectangle that must be covered by faces seen from above.
SMALLEST_COVER = 1e-6
# And the shorter side of what is seen from above is at least this share of the longest.
NARROWEST = 1e-6
