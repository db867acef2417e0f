"""Optimizers for the relaxation, compared by what they reach with so many force evaluations, as one Markdown table.

    python benchmarks/optimizers.py [--bodies 4096] [--seeds 3] [--output output/optimizers.md]

All start from the engine's start, take its forces, its inverse curvature as preconditioner and its limit of a step, and no body enters
an empty pixel. What an evaluation costs is the engine's matter, so all else here is NumPy. Every method is given the best of a
few settings: those with the smallest geometric mean of the coverage errors at k = 0.5 and 1 after 60 evaluations, over
the scenes of dots, with a seed that is not used again.

The scenes: uniform, scikit-image's photograph "camera", three classes of two sizes each, and lines on the photograph. Where there
are several classes the error is the mean of that of all bodies and that of the first class. Lines have as many charges as the
others have bodies; their turns and stretches are preconditioned as the engine does it, preferred directions and lengths included.
The paper is Schmaltz, Gwosdek and Weickert 2012.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import warp as wp
from esh.engine.descent.descent import STEP_LIMIT, Descent
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.model.model import Model
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.domain import Domain
from esh.engine.problem.line import Line
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.quality.coverage import coverage_error
from quality import photograph
from scipy.ndimage import minimum_filter

SQUARE = Domain((64.0, 64.0))
WIDTHS = (0.5, 1.0, 2.0)
# Evaluations after which errors are measured, and those that the table shows.
MARKS = (20, 30, 45, 60, 80, 100, 150, 300)
SHOWN = (30, 60, 100, 150, 300)
TUNING_SEED, TUNING_EVALUATIONS = 99, 60
# Share of an evaluation that is left where the far field is kept: the engine lays its mesh so that both parts cost the same.
NEAR_SHARE = 0.5
# A secant pair whose cosine is below this says nothing about the curvature.
SMALLEST_COSINE = 1e-3
SAFE_STEP = 0.7
NODE_AND_NEIGHBORS = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], dtype=bool)


class Dots:
    """Dots of a problem, in the solver's units.

    Args:
        problem: Open, without lines.
        launcher: Where to run.
        guarded: Steps from the largest density at the nearest node and its four neighbors, not at that node alone: where density
            changes within a mesh spacing the curvature is never taken for less than it is.

    Attributes:
        evaluations: Force evaluations so far.
        start: First state, shape ``[n, 2]``.
    """

    def __init__(self, problem: Problem, launcher: Launcher, guarded: bool = True) -> None:
        self.problem = problem
        self.launcher = launcher
        self.descent = Descent(Model(problem), launcher)
        self.evaluations = 0.0
        self.cost = 1.0
        self.size = np.array(self.descent.model.size)
        self.layout = self.descent.field.layout
        self.charge = self.descent.bodies.charge.numpy().astype(np.float64)
        self.group = self.descent.model.body.group
        step = self.descent.step_length.numpy().reshape(-1, *self.layout.shape).astype(np.float64)
        if guarded:
            step = np.stack([minimum_filter(one, footprint=NODE_AND_NEIGHBORS, mode="nearest") for one in step])
        self.step = step
        self.limit = self.descent.step_limit.numpy().reshape(self.layout.shape).astype(np.float64)
        self.class_index = problem.body_indices()[0]
        self.start = self._first_state()

    def _first_state(self) -> np.ndarray:
        return self.descent.state.pose.numpy()[:, :2].astype(np.float64)

    def _nodes(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        node = np.rint(x[:, :2] / np.array(self.layout.spacing)).astype(int) + self.layout.margin
        return node[:, 1], node[:, 0]

    def pull(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Evaluate the forces: the moves, force times inverse curvature, and the weights of the metric in which they descend."""
        descent = self.descent
        points = wp.array(x.astype(np.float32), dtype=wp.vec2, device=self.launcher.device)
        descent.field.evaluate(points, descent.field_at_charge)
        self.evaluations += self.cost
        force = descent.field_at_charge.numpy().astype(np.float64)
        # What presses a body against the border moves nothing.
        force[((x <= 0.0) & (force < 0.0)) | ((x >= self.size) & (force > 0.0))] = 0.0
        step = self.step[self.group, *self._nodes(x)][:, None]
        return step * force, self.charge[:, None] / step

    def spacing(self, x: np.ndarray) -> np.ndarray:
        """Local spacing of bodies, shape ``[n, 1]``."""
        return self.limit[self._nodes(x)][:, None] / STEP_LIMIT

    def limited(self, x: np.ndarray, move: np.ndarray) -> np.ndarray:
        """``move``, not longer than the engine lets bodies at ``x`` go."""
        length = np.hypot(move[:, 0], move[:, 1])[:, None]
        return move * np.minimum(1.0, STEP_LIMIT * self.spacing(x) / np.maximum(length, 1e-12))

    def inside(self, x: np.ndarray) -> np.ndarray:
        return np.clip(x, 0.0, self.size)

    def shifted(self, x: np.ndarray, move: np.ndarray, ahead: np.ndarray | None = None) -> np.ndarray:
        """Where bodies at ``x`` end that want to go to ``ahead`` (``x`` itself by default) plus ``move``."""
        ahead = x if ahead is None else ahead
        wanted = ahead + self.limited(ahead, move)
        new = self.inside(wanted)
        empty = ~self._in_support(new)
        if empty.any():
            # Along the edge of the empty pixel, if that is possible, else not at all.
            for axis in (1, 0):
                along = wanted.copy()
                along[:, axis] = x[:, axis]
                along = self.inside(along)
                may = empty & self._in_support(along)
                new[may] = along[may]
                empty &= ~may
            new[empty] = x[empty]
        return new

    def _in_support(self, x: np.ndarray) -> np.ndarray:
        inside = np.ones(len(x), dtype=bool)
        for k, body_class in enumerate(self.problem.classes):
            image = body_class.density_image
            own = self.class_index == k
            share = x[own] / self.size
            column = np.minimum((share[:, 0] * image.shape[1]).astype(int), image.shape[1] - 1)
            row = np.clip(((1.0 - share[:, 1]) * image.shape[0]).astype(int), 0, image.shape[0] - 1)
            inside[own] = image[row, column] > 0.0
        return inside

    def errors(self, x: np.ndarray) -> np.ndarray:
        """Coverage error of ``x`` for every blur; with several classes the mean of that of all and of the first class."""
        problem = self.problem
        position = np.clip(x * self.descent.model.unit, 0.0, problem.domain.size)
        parts = [np.full(len(x), True)]
        if len(problem.classes) > 1:
            parts.append(self.class_index == 0)
        area = problem.body_areas()
        found = [
            coverage_errors(position[own], area[own], problem.classes[self.class_index[own][0]].density_image)
            for own in parts
        ]
        return np.mean(found, axis=0)


class Lines(Dots):
    """Lines of a problem of one class: states of shape ``[n, 4]`` are poses, moved by the engine's own rules."""

    def _first_state(self) -> np.ndarray:
        descent = self.descent
        self.body = body = np.repeat(np.arange(descent.model.body_count), np.diff(descent.bodies.first_charge.numpy()))
        self.body_charge = np.bincount(body, weights=self.charge)
        axial = descent.bodies.axial.numpy()
        self.inertia = np.bincount(body, weights=self.charge * axial**2) / self.body_charge
        return descent.state.pose.numpy().astype(np.float64)

    def pull(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        descent = self.descent
        descent.state.pose.assign(x.astype(np.float32))
        descent.place_charges()
        descent.field.evaluate(descent.charge_position, descent.field_at_charge)
        self.evaluations += self.cost
        # The lengths reached decide how far the preferred one is raised, which is the engine's matter whatever moves the lines.
        descent.propose()
        descent.decide()
        move = descent.state.move.numpy().astype(np.float64)
        # Mean square of the displacement of a line's charges.
        half = 0.5 * x[:, 3]
        one = np.ones(len(x))
        metric = np.stack([one, one, self.inertia * half**2, 0.25 * self.inertia], axis=1)
        return move, metric * (self.body_charge / self.step[0][self._nodes(x)])[:, None]

    def limited(self, x: np.ndarray, move: np.ndarray) -> np.ndarray:
        return np.concatenate([super().limited(x, move[:, :2]), move[:, 2:]], axis=1)

    def inside(self, x: np.ndarray) -> np.ndarray:
        return np.concatenate([np.clip(x[:, :2], 0.0, self.size), x[:, 2:3], np.maximum(x[:, 3:], 0.0)], axis=1)

    def shifted(self, x: np.ndarray, move: np.ndarray, ahead: np.ndarray | None = None) -> np.ndarray:
        ahead = x if ahead is None else ahead
        descent = self.descent
        descent.state.pose.assign(x.astype(np.float32))
        descent.state.move.assign((self.inside(ahead + self.limited(ahead, move)) - x).astype(np.float32))
        descent.direction.factors.assign(np.array([1.0, 0.0, 0.0, 0.0], dtype=np.float32))
        # What keeps lines in the support and apart is the engine's.
        descent.move()
        descent.contact.push(descent.state.pose, descent.state.bend, descent.state.displacement)
        return descent.state.pose.numpy().astype(np.float64)

    def errors(self, x: np.ndarray) -> np.ndarray:
        body = self.body
        along = (0.5 * x[body, 3] * self.descent.bodies.axial.numpy())[:, None]
        position = x[body, :2] + along * np.stack([np.cos(x[body, 2]), np.sin(x[body, 2])], axis=1)
        position = np.clip(position * self.descent.model.unit, 0.0, self.problem.domain.size)
        return coverage_errors(position, self.charge, self.problem.classes[0].density_image)


def coverage_errors(position: np.ndarray, charge: np.ndarray, image: np.ndarray) -> np.ndarray:
    """Coverage errors for all ``WIDTHS``."""
    return np.array([coverage_error(position, charge, image, SQUARE, k) for k in WIDTHS])


# An optimizer yields the state after every evaluation.
Optimizer = Callable[[Dots, np.ndarray], Iterator[np.ndarray]]


def engine(system: Dots, x: np.ndarray) -> Iterator[np.ndarray]:
    """The engine as it stands."""
    columns = x.shape[1]
    while True:
        system.descent.take_step()
        system.evaluations += 1.0
        yield system.descent.state.pose.numpy()[:, :columns].astype(np.float64)


def direct_descent(system: Dots, x: np.ndarray, *, step: float) -> Iterator[np.ndarray]:
    """The paper's descent, with the step per body."""
    while True:
        move, _ = system.pull(x)
        x = system.shifted(x, step * move)
        yield x


def nesterov(
    system: Dots, x: np.ndarray, *, step: float, growth: float = 1.0, restart: str = "gradient", cap: float = 1.0
) -> Iterator[np.ndarray]:
    """Nesterov's momentum, restarted where it points uphill or, ``restart="speed"``, where bodies slow down.

    ``growth`` is how much faster than usual the momentum comes, ``cap`` what it never exceeds.
    """
    ahead, t, slowest = x, 1.0, 0.0
    while True:
        move, weight = system.pull(ahead)
        new = system.shifted(x, step * move, ahead)
        displacement = new - x
        speed = np.sum(weight * displacement * displacement)
        if (np.sum(weight * move * displacement) < 0.0) if restart == "gradient" else (t > 1.0 and speed < slowest):
            t = 1.0
        slowest = speed
        following = 0.5 * (growth + math.sqrt(growth**2 + 4.0 * t * t))
        momentum = min(cap, max(0.0, t - 1.0) / following)
        t, x = following, new
        ahead = system.inside(x + momentum * displacement)
        yield x


def fire(system: Dots, x: np.ndarray, *, largest_step: float, mixing: float, patience: int = 0) -> Iterator[np.ndarray]:
    """FIRE (Bitzek et al., 2006) with masses that make all bodies equally stiff, and half a step back where it points uphill.

    ``patience`` evaluations pass before the step grows.
    """
    velocity, step, mix, downhill = np.zeros_like(x), 1.0, mixing, 0
    while True:
        move, weight = system.pull(x)
        if np.sum(weight * move * velocity) >= 0.0:
            downhill += 1
            if downhill > patience:
                step, mix = min(1.2 * step, largest_step), 0.99 * mix
        else:
            x = system.shifted(x, -0.5 * step * velocity)
            velocity, step, mix, downhill = np.zeros_like(x), max(0.5 * step, 0.5), mixing, 0
        velocity = velocity + step * move
        speed, strength = (math.sqrt(np.sum(weight * one * one)) for one in (velocity, move))
        velocity = (1.0 - mix) * velocity + mix * speed / max(strength, 1e-30) * move
        new = system.shifted(x, step * velocity)
        velocity, x = (new - x) / step, new
        yield x


def barzilai_borwein(system: Dots, x: np.ndarray, *, largest: float, long: bool) -> Iterator[np.ndarray]:
    """Descent whose step is the curvature along the last one: the long or, else, the long and the short one in turn."""
    move, _ = system.pull(x)
    step, count = SAFE_STEP, 0
    while True:
        new = system.shifted(x, step * move)
        yield new
        last = move
        displacement, x = new - x, new
        move, weight = system.pull(x)
        change = last - move
        curvature = np.sum(weight * displacement * change)
        count += 1
        if curvature <= 0.0:
            step = largest
        elif long or count % 2:
            step = np.sum(weight * displacement * displacement) / curvature
        else:
            step = curvature / np.sum(weight * change * change)
        step = min(max(step, 0.3), largest)


def limited_memory(system: Dots, x: np.ndarray, *, pairs: int, largest: float) -> Iterator[np.ndarray]:
    """L-BFGS without line search (Nocedal and Wright, algorithm 7.4), in the metric of the preconditioner.

    The first guess of the inverse curvature is the last pair's, at most ``largest``; a pair without curvature, and a direction
    that points uphill, makes it forget everything.
    """
    move, weight = system.pull(x)
    known: list[tuple[np.ndarray, np.ndarray, float]] = []
    scale = SAFE_STEP
    while True:
        direction, shares = move.copy(), []
        for displacement, change, inverse in reversed(known):
            shares.append(inverse * np.sum(weight * displacement * direction))
            direction -= shares[-1] * change
        direction *= scale
        for (displacement, change, inverse), share in zip(known, reversed(shares), strict=True):
            direction += displacement * (share - inverse * np.sum(weight * change * direction))
        if np.sum(weight * direction * move) <= 0.0:
            known, scale = [], SAFE_STEP
            direction = scale * move
        new = system.shifted(x, direction)
        yield new
        last = move
        displacement, x = new - x, new
        move, weight = system.pull(x)
        change = last - move
        curvature = np.sum(weight * displacement * change)
        squares = np.sum(weight * displacement * displacement), np.sum(weight * change * change)
        if curvature > SMALLEST_COSINE * math.sqrt(squares[0] * squares[1]):
            known = [*known, (displacement, change, 1.0 / curvature)][-pairs:]
            scale = min(curvature / squares[1], largest)
        elif curvature < 0.0:
            known, scale = [], SAFE_STEP


def memoryless_bfgs(
    system: Dots, x: np.ndarray, *, largest: float, smallest: float = 0.3, first: float = SAFE_STEP
) -> Iterator[np.ndarray]:
    """BFGS that remembers the last step alone (Shanno, 1978), without line search.

    With the displacement s of the last step, the moves m and what they changed by, y = m' - m, all dot products in the metric of the
    preconditioner: direction = g m + [s·m / s·y (1 + g y·y / s·y) - g y·m / s·y] s - g s·m / s·y y, where
    g = |s| / |y|, the geometric mean of both steps of Barzilai and Borwein. So three vectors and six sums over the bodies.
    """
    move, weight = system.pull(x)
    direction = first * move
    while True:
        new = system.shifted(x, direction)
        yield new
        last = move
        displacement, x = new - x, new
        move, weight = system.pull(x)
        change = last - move
        sy, ss, yy, sm, ym, mm = (
            float(np.sum(weight * a * b))
            for a, b in (
                (displacement, change),
                (displacement, displacement),
                (change, change),
                (displacement, move),
                (change, move),
                (move, move),
            )
        )
        of_move, of_displacement, of_change = first, 0.0, 0.0
        if sy > SMALLEST_COSINE * math.sqrt(ss * yy):
            scale = min(max(math.sqrt(ss / yy), smallest), largest)
            of_displacement = sm / sy * (1.0 + scale * yy / sy) - scale * ym / sy
            of_change = -scale * sm / sy
            of_move = scale
            if of_move * mm + of_displacement * sm + of_change * ym <= 0.0:
                of_move, of_displacement, of_change = first, 0.0, 0.0
        direction = of_move * move + of_displacement * displacement + of_change * change


def multilevel(system: Dots, _x: np.ndarray, *, coarse: int, then: Optimizer) -> Iterator[np.ndarray]:
    """A quarter of the bodies first, for ``coarse`` evaluations of a quarter of the cost, each then split into four."""
    problem = system.problem
    classes = [
        replace(one.asked, sizes=[replace(size, count=size.count // 4) for size in one.sizes])
        for one in problem.classes
    ]
    few = Dots(replace(problem, classes=classes), system.launcher)
    for state in then(few, few.start):
        parents = state
        if few.evaluations >= coarse:
            break
    system.evaluations += 0.25 * few.evaluations
    # Corners of a square of half a spacing, turned at random.
    turn = np.random.default_rng(0).random(len(parents)) * 2.0 * np.pi
    reach = few.spacing(parents) * 0.25 * math.sqrt(2.0)
    corners = [np.stack([np.cos(turn + k * np.pi / 2), np.sin(turn + k * np.pi / 2)], axis=1) for k in range(4)]
    split = np.stack([parents + reach * corner for corner in corners], axis=1).reshape(-1, 2)
    unit = few.descent.model.unit / system.descent.model.unit
    start = np.repeat(parents, 4, axis=0) * unit
    x = system.shifted(start, split * unit - start)
    yield x
    yield from then(system, x)


def kept_far_field(system: Dots, x: np.ndarray, *, every: int, then: Optimizer) -> Iterator[np.ndarray]:
    """The mesh part of the field is refreshed every few evaluations only; one without costs ``NEAR_SHARE``."""
    field = system.descent.field
    parts = field._deposit, field._solve_far_field
    evaluate = field.evaluate
    count = 0

    def evaluate_some(position: wp.array, result: wp.array) -> None:
        nonlocal count
        fresh = count % every == 0
        field._deposit, field._solve_far_field = parts if fresh else (lambda *_: None, lambda: None)
        system.cost = 1.0 if fresh else NEAR_SHARE
        count += 1
        evaluate(position, result)

    field.evaluate = evaluate_some
    yield from then(system, x)


def shaken(system: Dots, x: np.ndarray, *, amplitude: float, then: Optimizer) -> Iterator[np.ndarray]:
    """Annealing: kicks of a share of the local spacing after 15 and 30 evaluations, the second half as large."""
    rng = np.random.default_rng(0)
    for until, share in ((15, 1.0), (30, 0.5)):
        for state in then(system, x):
            yield state
            if system.evaluations >= until:
                x = state
                break
        x = system.shifted(x, share * amplitude * system.spacing(x) * rng.normal(size=x.shape))
    yield from then(system, x)


SETTLED_NESTEROV = partial(nesterov, step=1.0)
SETTLED_BFGS = partial(memoryless_bfgs, largest=2.0)

# Every method with the settings that it may choose from.
METHODS: dict[str, list[Optimizer]] = {
    "the engine as it is": [engine],
    "direct descent": [partial(direct_descent, step=step) for step in (0.5, 0.7, 1.0)],
    "Nesterov, step 0.5": [partial(nesterov, step=0.5)],
    "Nesterov": [
        partial(nesterov, step=0.85),
        partial(nesterov, step=1.0),
        partial(nesterov, step=1.15),
        partial(nesterov, step=1.0, restart="speed"),
        partial(nesterov, step=1.0, cap=0.9),
        partial(nesterov, step=1.0, growth=2.0),
    ],
    "FIRE": [
        partial(fire, largest_step=largest, mixing=mixing, patience=patience)
        for largest, mixing, patience in ((1.0, 0.1, 5), (1.2, 0.3, 0), (1.4, 0.2, 0), (1.4, 0.3, 0))
    ],
    "Barzilai-Borwein": [partial(barzilai_borwein, largest=a, long=long) for a in (3.0, 5.0) for long in (True, False)],
    "L-BFGS": [partial(limited_memory, pairs=pairs, largest=a) for pairs in (3, 5, 10) for a in (2.0, 10.0)],
    "memoryless BFGS": [partial(memoryless_bfgs, largest=largest) for largest in (1.0, 1.5, 2.0)],
    "multi-level, memoryless BFGS": [partial(multilevel, coarse=coarse, then=SETTLED_BFGS) for coarse in (20, 40)],
    "far field every 2nd time, Nesterov": [
        partial(kept_far_field, every=2, then=partial(nesterov, step=step)) for step in (0.25, 0.35, 0.5)
    ],
    "shaken, Nesterov": [partial(shaken, amplitude=amplitude, then=SETTLED_NESTEROV) for amplitude in (0.05, 0.15)],
}
# These need states that are positions alone.
DOTS_ONLY = ("multi-level, memoryless BFGS", "far field every 2nd time, Nesterov", "shaken, Nesterov")


def scenes(count: int, seed: int) -> dict[str, Problem]:
    """Problems of about ``count`` charges, a multiple of four bodies of each size; a third of the space is covered."""
    image = photograph().astype(np.float32)
    area = SQUARE.area / count / 3.0
    count = count // 4 * 4
    each = count // 24 * 4
    sizes = [Size("small", 0.5 * area, each), Size("large", 1.5 * area, each)]
    line = Size("line", 3.0 * area, count // 3, line=Line(3.0 * math.sqrt(SQUARE.area / count)))
    return {
        "uniform": Problem(SQUARE, [BodyClass("a", [Size("dot", area, count)])], seed=seed),
        "photograph": Problem(SQUARE, [BodyClass("a", [Size("dot", area, count)], image)], seed=seed),
        "six groups": Problem(SQUARE, [BodyClass(name, sizes) for name in "abc"], seed=seed),
        "lines": Problem(SQUARE, [BodyClass("a", [line], image)], seed=seed),
    }


def errors_along(problem: Problem, launcher: Launcher, optimizer: Optimizer, marks: tuple[int, ...]) -> np.ndarray:
    """Coverage errors after so many evaluations, shape ``[marks, widths]``."""
    system = (Lines if problem.classes[0].sizes[0].line is not None else Dots)(problem, launcher)
    errors: list[np.ndarray] = []
    for x in optimizer(system, system.start):
        while len(errors) < len(marks) and system.evaluations >= marks[len(errors)]:
            errors.append(system.errors(x))
        if len(errors) == len(marks):
            break
    return np.array(errors)


def best_setting(settings: list[Optimizer], problems: list[Problem], launcher: Launcher) -> Optimizer:
    """The setting with the smallest geometric mean of the errors at the two narrower blurs."""
    if len(settings) == 1:
        return settings[0]

    def score(setting: Optimizer) -> float:
        found = [errors_along(problem, launcher, setting, (TUNING_EVALUATIONS,))[0, :2] for problem in problems]
        mean = float(np.mean(np.log(found)))
        return mean if math.isfinite(mean) else math.inf

    return min(settings, key=score)


def told(optimizer: Optimizer) -> str:
    """Settings of an optimizer, as words."""
    values = dict(getattr(optimizer, "keywords", {}))
    if "then" in values:
        values.update(values["then"].keywords)
    return ", ".join(f"{key.replace('_', ' ')} {value}" for key, value in values.items() if key != "then")


def evaluations_to_reach(error: np.ndarray, marks: tuple[int, ...], wanted: float) -> str:
    """Evaluations after which an error that falls along ``marks`` is as small as ``wanted``, interpolated."""
    enough = np.flatnonzero(error <= wanted)
    if len(enough) == 0:
        return f"> {marks[-1]}"
    k = enough[0]
    if k == 0:
        return f"< {marks[0]}"
    share = math.log(error[k - 1] / wanted) / math.log(error[k - 1] / error[k])
    return f"{marks[k - 1] * (marks[k] / marks[k - 1]) ** share:.0f}"


def table(count: int, seeds: int, launcher: Launcher, marks: tuple[int, ...] = MARKS) -> list[str]:
    """Rows of the Markdown table; also printed while they come."""
    tuning = list(scenes(count, TUNING_SEED).values())[:3]
    chosen = {name: best_setting(settings, tuning, launcher) for name, settings in METHODS.items()}
    shown = [mark for mark in SHOWN if mark in marks]
    compared = 100 if 100 in marks else marks[-1]
    reached = f"evaluations to what Nesterov, step 0.5, has after {compared}, k = 0.5 / 1"
    lines = [
        f"Coverage errors at k = {' / '.join(map(str, WIDTHS))}, in 1e-4, means over {seeds} seeds; {count:,} charges.",
        "",
        "| scene | optimizer | " + " | ".join(f"after {mark}" for mark in shown) + f" | {reached} |",
        "|---|---|" + "---|" * (len(shown) + 1),
    ]
    print("\n".join(lines), flush=True)
    problems = [scenes(count, seed) for seed in range(seeds)]
    for scene in problems[0]:
        names = [name for name in chosen if scene != "lines" or name not in DOTS_ONLY]
        means = {
            name: np.mean([errors_along(one[scene], launcher, chosen[name], marks) for one in problems], axis=0)
            for name in names
        }
        wanted = means["Nesterov, step 0.5"][marks.index(compared)]
        for name, mean in means.items():
            cells = [" / ".join(f"{1e4 * error:.3g}" for error in mean[marks.index(mark)]) for mark in shown]
            needed = " / ".join(evaluations_to_reach(mean[:, k], marks, wanted[k]) for k in (0, 1))
            label = f"{name} ({told(chosen[name])})" if told(chosen[name]) else name
            lines.append(f"| {scene} | {label} | {' | '.join(cells)} | {needed} |")
            print(lines[-1], flush=True)
    return lines


def main() -> None:
    """Print and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=Path("output/optimizers.md"))
    parser.add_argument("--bodies", type=int, default=4096)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--device", default="cpu")
    options = parser.parse_args()
    launcher = Launcher(resolve_device(options.device))
    try:
        lines = table(options.bodies, options.seeds, launcher)
    finally:
        launcher.close()
    options.output.parent.mkdir(parents=True, exist_ok=True)
    options.output.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
