"""Where the paper's experiments run, and the table of what they have found.

The paper is Schmaltz, Gwosdek and Weickert 2012.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from esh.engine.device.launcher import Launcher
from esh.engine.problem.placement import Placement
from esh.engine.problem.problem import Problem
from esh.engine.solve import solve

__all__ = ["Run"]


@dataclass
class Run:
    """Where experiments run, and what they have found."""

    output: Path
    device: str
    launcher: Launcher
    rows: list[tuple[str, str, str, str, str]] = field(default_factory=list)

    def solve(self, problem: Problem, **options: int) -> Placement:
        """Solve on the chosen device."""
        return solve(problem, device=self.device, **options)

    def row(self, figure: str, what: str, measured: str, goal: str = "", met: bool | None = None) -> None:
        """Add a row to the table, and print it."""
        verdict = "" if met is None else "yes" if met else "NO"
        self.rows.append((figure, what, measured, goal, verdict))
        print(" | ".join(self.rows[-1]), flush=True)
