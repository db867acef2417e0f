"""The grid on which charges are compared with their targets."""

from __future__ import annotations

import math

from ..problem.domain import Domain

__all__ = ["comparison_cells"]

# Cells along the longer side of the domain: so many, or so many for each mean spacing, below which what is left is the pattern of the
# cells, but never more than at most.
FEWEST_CELLS = 512
CELLS_PER_SPACING = 4.0
MOST_CELLS = 4096


def comparison_cells(domain: Domain, body_count: int) -> int:
    """Cells along the longer side of ``domain`` for so many bodies."""
    wanted = CELLS_PER_SPACING * max(domain.size) / math.sqrt(domain.area / max(body_count, 1))
    return min(max(FEWEST_CELLS, math.ceil(wanted)), MOST_CELLS)
