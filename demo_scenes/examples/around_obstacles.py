"""Old trees stay, a pond and a house are kept clear; then the pond moves, and the rest of the orchard stays where it is."""

from pathlib import Path

import esh
import numpy as np


def orchard(pond: tuple[float, float]) -> esh.Problem:
    trees = esh.BodyClass("tree", [esh.Size("young", 0.7, 420), esh.Size("old", 5.0, 0)])
    old = esh.FixedBodies([[6, 22], [8.5, 5], [20, 24], [22, 6.5], [37, 20]], "tree", "old")
    house = esh.Obstacle(polygon=[[26, 4], [36, 4], [36, 10], [31, 10], [31, 15], [26, 15]], margin=0.5)
    obstacles = [esh.Obstacle(disc=(*pond, 5.0), margin=0.5), house]
    return esh.Problem(esh.Domain((40, 28)), [trees], avoid_overlap=True, fixed=old, obstacles=obstacles)


def main(folder: Path) -> tuple[esh.Placement, esh.Placement]:
    with esh.Solver(orchard((12.0, 14.0))) as solver:
        solver.run(100)
        before = solver.placement()
        solver.edit(orchard((14.0, 13.0)))
        after = solver.placement()
    esh.draw_plan(after, folder / "around_obstacles.png", colors=["#4c8a3f"])
    return before, after


def test_final(placements: tuple[esh.Placement, esh.Placement]) -> None:
    before, after = placements
    away = np.linalg.norm(after.position - [14.0, 13.0], axis=1) - np.sqrt(after.area / np.pi)
    assert (away > 5.5)[~after.fixed].all()
    assert np.array_equal(after.position[after.fixed], before.position[before.fixed])
    _, i, j = np.intersect1d(before.id, after.id, return_indices=True)
    moved = np.linalg.norm(after.position[j] - before.position[i], axis=1)
    assert np.median(moved[before.position[i, 0] > 26.0]) < 0.1


if __name__ == "__main__":
    test_final(main(Path()))
