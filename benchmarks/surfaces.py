"""How even bodies on surfaces are, and how long it takes, as Markdown tables; measured by SciPy on the meshes themselves.

python benchmarks/surfaces.py
python benchmarks/surfaces.py --only torus rock --seeds 4
python benchmarks/surfaces.py --times 100000 1000000
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import esh
import numpy as np
import surface_meshes as meshes
from surface_metric import SurfaceMetric, parts_of, spacing

COUNT = 4096
KS = (0.5, 1.0, 2.0, 4.0)
Density = Callable[[np.ndarray], np.ndarray]


def uniform(place: np.ndarray) -> np.ndarray:
    return np.ones(len(place))


def suzanne(levels: int) -> tuple[np.ndarray, np.ndarray] | None:
    """Blender's monkey, smoothed so many times; None without Blender as a Python module."""
    try:
        import bpy
    except ImportError:
        return None
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_monkey_add(size=2)
    thing = bpy.context.object
    thing.modifiers.new("smooth", "SUBSURF").levels = levels
    mesh = thing.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    mesh.calc_loop_triangles()
    vertices = np.array([vertex.co[:] for vertex in mesh.vertices])
    return vertices, np.array([triangle.vertices[:] for triangle in mesh.loop_triangles])


# Coverage errors, spacings (smallest and mean) where they are of interest, and the placement that has them.
Measured = tuple[np.ndarray, tuple[float, float] | None, esh.Placement]


def placed(parts: list, classes: list, device: str, **settings: object) -> esh.Placement:
    surface = esh.Surface([esh.SurfaceMesh(*part) for part in parts])
    return esh.solve(esh.Problem(surface, classes, **settings), device=device)


def row(name: str, measured: list[Measured]) -> None:
    """Print the means of what was measured with several seeds."""
    reports = [placement.report for _, _, placement in measured]
    shown = " / ".join(f"{error:.4f}" for error in np.mean([errors for errors, _, _ in measured], axis=0))
    spacings = [apart for _, apart, _ in measured if apart is not None]
    apart = "{:.2f} / {:.2f}".format(*np.mean(spacings, axis=0)) if spacings else "-"
    seconds = np.mean([report.seconds for report in reports])
    print(f"| {name} | {shown} | {apart} | {max(report.steps for report in reports)} | {seconds:.1f} |", flush=True)


def one_class(
    name: str, parts: list, whole: tuple, density: Density, device: str, seeds: int, **settings: object
) -> None:
    """A class of one size, on a mesh or on several that are measured as one."""
    varied = 1.0 if density is uniform else lambda points: density(points.position)
    metric = SurfaceMetric(*whole, COUNT)
    mean = (metric.areas @ density(metric.vertices[metric.faces].mean(axis=1))) / metric.area
    measured: list[Measured] = []
    for seed in range(seeds):
        classes = [esh.BodyClass("a", [esh.Size("s", 1e-6, COUNT)], varied)]
        placement = placed(parts, classes, device, seed=seed, **settings)
        number = COUNT / metric.area * density(placement.position) / mean
        part = parts_of(parts[0][1])[placement.triangle] if len(parts) == 1 else None
        apart = None
        if density is not meshes.checker:
            apart = spacing(placement.position, placement.normal, number, part)
        measured.append((metric.coverage(placement.position, density, KS), apart, placement))
    row(name, measured)


def on_the_plane(device: str, seeds: int) -> None:
    """The square once more, by the plane's solver, measured alike."""
    metric = SurfaceMetric(*meshes.square(), COUNT)
    up = np.broadcast_to([0.0, 0.0, 1.0], (COUNT, 3))
    measured: list[Measured] = []
    for seed in range(seeds):
        classes = [esh.BodyClass("a", [esh.Size("s", 1e-6, COUNT)])]
        placement = esh.solve(esh.Problem(esh.Domain((1.0, 1.0)), classes, seed=seed), device=device)
        place = np.pad(placement.position, ((0, 0), (0, 1)))
        measured.append((metric.coverage(place, uniform, KS), spacing(place, up, COUNT / metric.area), placement))
    row("square, uniform: by the plane's solver", measured)


def two_classes(device: str, seeds: int, name: str = "torus, two classes", **settings: object) -> None:
    metric = SurfaceMetric(*meshes.torus(), COUNT)
    together: list[Measured] = []
    alone: list[Measured] = []
    for seed in range(seeds):
        classes = [esh.BodyClass(letter, [esh.Size("s", 1e-6, COUNT // 2)]) for letter in "ab"]
        placement = placed([meshes.torus()], classes, device, balance=esh.Balance(0.5), seed=seed, **settings)
        apart = spacing(placement.position, placement.normal, COUNT / metric.area)
        together.append((metric.coverage(placement.position, uniform, KS), apart, placement))
        own = placement.position[placement.class_index == 0]
        alone.append((metric.coverage(own, uniform, KS), None, placement))
    row(f"{name}: union", together)
    row(f"{name}: class", alone)


def regularities(device: str, seeds: int) -> None:
    for value in (1.0, 0.6, 0.3, 0.0):
        mesh, of = meshes.sphere(), f"at regularity {value:g}"
        one_class(f"sphere {of}", [mesh], mesh, uniform, device, seeds, regularity=value)
        two_classes(device, seeds, f"torus, two classes {of}", regularity=value)


def rare_classes(device: str, seeds: int) -> None:
    whole, metric = SurfaceMetric(*meshes.rock(), 4440), SurfaceMetric(*meshes.rock(), 400)
    together: list[Measured] = []
    alone: list[Measured] = []
    for seed in range(seeds):
        classes = [esh.BodyClass(str(count), [esh.Size("s", 1e-6, count)]) for count in (4000, 400, 40)]
        placement = placed([meshes.rock()], classes, device, seed=seed)
        apart = spacing(placement.position, placement.normal, len(placement.position) / whole.area)
        together.append((whole.coverage(placement.position, uniform, KS), apart, placement))
        own = placement.class_index == 2
        apart = spacing(placement.position[own], placement.normal[own], 40 / metric.area)
        alone.append((metric.coverage(placement.position[own], uniform, KS), apart, placement))
    row("rock, 4,000 / 400 / 40: all", together)
    row("rock, 4,000 / 400 / 40: the 40", alone)


def discs(device: str, seeds: int) -> None:
    area, count = 4.0 * np.pi, np.array([800, 400, 200])
    size = np.array([1.0, 2.0, 5.0])
    size *= 0.6 * area / (size * count).sum()
    sizes = [esh.Size(str(k), float(size[k]), int(count[k])) for k in range(3)]
    nearest = np.inf
    for seed in range(seeds):
        placement = placed([meshes.sphere()], [esh.BodyClass("a", sizes)], device, avoid_overlap=True, seed=seed)
        direction = placement.position / np.linalg.norm(placement.position, axis=1, keepdims=True)
        apart = np.arccos(np.clip(direction @ direction.T, -1.0, 1.0)) + 9.0 * np.eye(len(direction))
        nearest = min(nearest, (apart / (placement.radius[:, None] + placement.radius)).min())
    print(f"\nSphere, discs of three sizes, 60 % cover: the nearest two are {nearest:.4f} of touching apart.")


def times(counts: list[int], device: str) -> None:
    print("\n| bodies on a sphere | set-up [s] | step [ms] | steps | with report [s] |\n|---|---|---|---|---|")
    for count in counts:
        problem = esh.Problem(
            esh.Surface(esh.SurfaceMesh(*meshes.sphere(5))), [esh.BodyClass("a", [esh.Size("s", 1e-6, count)])]
        )
        with esh.Solver(problem, device=device) as solver:
            solver.step(2)
        start = time.perf_counter()
        with esh.Solver(problem, device=device) as solver:
            set_up = time.perf_counter() - start
            solver.step(1)
            start = time.perf_counter()
            solver.step(20)
            per_step = (time.perf_counter() - start) / 20
        report = esh.solve(problem, device=device).report
        print(
            f"| {count:,} | {set_up:.2f} | {1e3 * per_step:.1f} | {report.steps} | {report.seconds:.1f} |", flush=True
        )


def times_apart(counts: list[int], device: str) -> None:
    """Of bodies that keep apart: many small ones alone, and among large ones."""
    print("\n| bodies on hills | cover | overlaps | steps | with report [s] |\n|---|---|---|---|---|")
    ground = esh.Surface(esh.SurfaceMesh(*meshes.hills()))
    for count in counts:
        for trees in (0, 20):
            tuft = esh.BodyClass("grass", [esh.Size("tuft", 0.25 * ground.area / count, count)])
            tree = esh.BodyClass("trees", [esh.Size("tree", 0.01 * ground.area, trees)])
            classes = [tuft, tree] if trees else [tuft]
            # Kernels are loaded in a first one.
            for steps in (1, 100):
                problem = esh.Problem(ground, classes, avoid_overlap=True)
                report = esh.solve(problem, device=device, max_steps=steps).report
            name = f"{count:,} small" + (f", {trees} large" if trees else "")
            cover = 0.25 + 0.01 * trees
            print(f"| {name} | {cover:.0%} | {report.overlaps} | {report.steps} | {report.seconds:.1f} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--only", nargs="*", help="words, one of which the names of the cases hold")
    parser.add_argument("--seeds", type=int, default=1, help="of how many runs the means are printed")
    parser.add_argument("--times", nargs="*", type=int, help="measure times for so many bodies instead")
    options = parser.parse_args()
    if options.times is not None:
        for measure in (times, times_apart):
            measure(options.times or [100_000], options.device)
        return
    monkey, coarse = suzanne(2), suzanne(0)
    single: list[tuple[str, Callable[[], tuple], str]] = [
        ("square", meshes.square, "uniform"),
        ("square", meshes.square, "checker"),
        ("sphere", meshes.sphere, "uniform"),
        ("torus", meshes.torus, "uniform"),
        ("rock", meshes.rock, "uniform"),
        ("rock", meshes.rock, "gradient"),
        ("thin box", lambda: meshes.thin_box(COUNT), "uniform"),
        *([("Suzanne", lambda: monkey, "uniform")] if monkey is not None else []),
        *([("Suzanne, 968 triangles", lambda: coarse, "uniform")] if coarse is not None else []),
    ]

    def chosen(name: str) -> bool:
        return not options.only or any(word in name for word in options.only)

    ks = " / ".join(f"{k:g}" for k in KS)
    print(f"| case, {COUNT:,} bodies | coverage error, k = {ks} | spacing, smallest / mean | steps | seconds |")
    print("|---|---|---|---|---|")
    for name, make, kind in single:
        mesh = make() if chosen(f"{name}, {kind}") else None
        if mesh is not None:
            density = {"uniform": uniform, "checker": meshes.checker, "gradient": meshes.gradient(mesh[0])}[kind]
            one_class(f"{name}, {kind}", [mesh], mesh, density, options.device, options.seeds)
    if chosen("square, plane"):
        on_the_plane(options.device, options.seeds)
    if chosen("two meshes"):
        parts = [meshes.square(64, (0.0, 0.5)), meshes.square(37, (0.5, 1.0))]
        one_class("two meshes, other triangles", parts, meshes.square(), uniform, options.device, options.seeds)
    others = {"two classes": two_classes, "regularity": regularities, "rare classes": rare_classes, "discs": discs}
    for name, run in others.items():
        if chosen(name):
            run(options.device, options.seeds)


if __name__ == "__main__":
    main()
