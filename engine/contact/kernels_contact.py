"""Kernels that push footprints in contact apart."""

from __future__ import annotations

import warp as wp

from ..motion.kernels_descent import PINNED, Bodies, confine_line, slide
from ..space.kernels_images import Images
from ..space.kernels_meeting import keep_apart
from ..space.kernels_neighborhood import (
    LANES,
    SAFELY,
    ContactGrid,
    Footprints,
    Neighbors,
    Sorted,
    bodies_of_run,
    cells_around,
    closest_along,
    lowest_bit,
    next_near,
    run_count,
    set_sorted,
)
from ..space.kernels_space import confine, difference

wp.set_module_options({"enable_backward": False})

# What is this many times as far as asked is so whatever rounding does.
SURELY = wp.constant(1.0001)


@wp.func
def uncrossed(axis: wp.vec2, crossed: wp.vec2, along: float):
    """Direction across the axis ``crossed`` in which the nearer end of ``axis`` comes back, and how far that is."""
    normal = wp.normalize(wp.vec2(-crossed[1], crossed[0]))
    beyond = wp.dot(normal, axis) * (wp.sign(along) - along)
    if beyond > 0.0:
        normal = -normal
    return wp.vec3(normal[0], normal[1], wp.abs(beyond))


@wp.struct
class Capsule:
    """What contact knows of a footprint: half its axis, how long that is, half its thickness, mass and moment of inertia."""

    half_axis: wp.vec2
    half: float
    radius: float
    mass: float
    inertia: float


@wp.struct
class Push:
    """What another body does to one: a shift and a turn; 1 if it pushes, else 0; how far the axes are apart, below 0 if they cross."""

    shift: wp.vec2
    turn: float
    count: float
    distance: float


@wp.func
def capsule(half_axis: wp.vec2, half: float, radius: float, mass: float):
    """A capsule as heavy to turn as a rod of its length."""
    reach = half + radius
    result = Capsule()
    result.half_axis = half_axis
    result.half = half
    result.radius = radius
    result.mass = mass
    result.inertia = mass * reach * reach / 3.0
    return result


@wp.func
def push_between(i: int, j: int, between: wp.vec2, own: Capsule, other: Capsule, wanted: float):
    """What brings body ``i`` as far from body ``j`` as is ``wanted``; nothing where it is.

    ``between`` is the way from one middle to the other. The pair shares what is missing by mass and moment of inertia.
    """
    result = Push()
    along = closest_along(between, own.half_axis, other.half_axis)
    gap = between + along[1] * other.half_axis - along[0] * own.half_axis
    distance = wp.length(gap)
    if distance < wanted:
        # Bodies on one another part in a direction of their own, opposite for the two.
        away = wp.vec2(wp.cos(float(i + j)), wp.sin(float(i + j)))
        if i > j:
            away = -away
        if distance > 1.0e-6 * (own.radius + other.radius):
            away = -gap / distance
        elif own.half > 0.0 and other.half > 0.0:
            # Axes that cross: the end that reaches less far beyond the other axis goes back.
            own_end = uncrossed(own.half_axis, other.half_axis, along[0])
            other_end = uncrossed(other.half_axis, own.half_axis, along[1])
            if own_end[2] < other_end[2]:
                away = wp.vec2(own_end[0], own_end[1])
                distance = -own_end[2]
                along = wp.vec2(wp.sign(along[0]), along[1])
            else:
                away = -wp.vec2(other_end[0], other_end[1])
                distance = -other_end[2]
                along = wp.vec2(along[0], wp.sign(along[1]))
        lever = along[0] * (own.half_axis[0] * away[1] - own.half_axis[1] * away[0])
        other_lever = along[1] * (other.half_axis[0] * away[1] - other.half_axis[1] * away[0])
        ease = 1.0 / own.mass + lever * lever / own.inertia
        other_ease = 1.0 / other.mass + other_lever * other_lever / other.inertia
        push = (wanted - distance) / (ease + other_ease)
        result.shift = away * (push / own.mass)
        result.turn = push * lever / own.inertia
        result.count = 1.0
    result.distance = distance
    return result


@wp.func
def side_by_side(between: wp.vec2, own: Capsule, axis: wp.vec2, half: float, wanted: float):
    """Whether one axis lies so far on one side of the other one's line that they are surely farther apart than is ``wanted``.

    Most of the many axes around a long one do, and nothing else needs to be known of them.
    """
    across = wp.abs(own.half_axis[0] * axis[1] - own.half_axis[1] * axis[0])
    far = wanted * SURELY + wp.length(between) * (SURELY - 1.0)
    beyond_own = wp.abs(own.half_axis[0] * between[1] - own.half_axis[1] * between[0]) - across
    beyond_other = wp.abs(axis[0] * between[1] - axis[1] * between[0]) - across
    return beyond_own > far * own.half or beyond_other > far * half


@wp.func
def scale_of_pushes(pushes: float, damping: float):
    """Share of all pushes together that is made at once: many of them push the same way."""
    if pushes > 2.0:
        return damping * 2.0 / pushes
    return damping


@wp.func
def add_pushes_of_run(
    total: wp.vec4,
    i: int,
    at: wp.vec2,
    own: Capsule,
    members: wp.vec2i,
    pose: wp.array(dtype=wp.vec4),
    neighbors: Neighbors,
    slack: float,
):
    """What pushes body ``i`` so far (shift, turn, and how many do), and what the bodies of a run of cells add to it."""
    result = wp.vec4(total[0], total[1], total[2], total[3])
    near = neighbors.bodies
    footprints = neighbors.footprints
    for start in range(members[0], members[1], LANES):
        found = next_near(at, own.half + own.radius, (1.0 + slack) * SAFELY, start, members[1], neighbors)
        while found != 0:
            s = start + lowest_bit(found)
            found = found & (found - 1)
            j = near.body[s]
            if j != i and keep_apart(i, j, footprints.meeting):
                other = pose[j]
                between = difference(at, wp.vec2(other[0], other[1]), neighbors.grid.space)
                wanted = (own.radius + footprints.radius[j]) * (1.0 + slack)
                half = 0.5 * other[3]
                if wp.length(between) < own.half + half + wanted and not side_by_side(
                    between, own, near.half_axis[s], half, wanted
                ):
                    second = capsule(near.half_axis[s], half, footprints.radius[j], footprints.mass[j])
                    push = push_between(i, j, between, own, second, wanted)
                    result += wp.vec4(push.shift[0], push.shift[1], push.turn, push.count)
    return result


# The pushes on discs from `start` to `end` in the order of their cells, in a space that ends: what add_pushes_of_run adds up for
# bodies without axes, in the same order and to the last bit, from what lies side by side there. Only on the CPU.
_PUSH_DISCS = f"""
#if !defined(__CUDA_ARCH__)
    typedef float V __attribute__((ext_vector_type({LANES}), aligned(4)));
    typedef bool B __attribute__((ext_vector_type({LANES})));
    const float* __restrict__ xs = near.x.data;
    const float* __restrict__ ys = near.y.data;
    const float* __restrict__ reaches = near.reach.data;
    const int* __restrict__ bodies = near.body.data;
    const float* __restrict__ masses = footprints.mass.data;
    const int* __restrict__ whose = footprints.meeting.of_body.data;
    const int* __restrict__ apart = footprints.meeting.apart.data;
    const int classes = footprints.meeting.classes;
    const float farther = 1.0f + slack, wider = farther * {SAFELY}f;
    for (int s = start; s < end; ++s)
    {{
        const int i = bodies[s];
        const float x = xs[s], y = ys[s], radius = reaches[s], mass = masses[i];
        float shift_x = 0.0f, shift_y = 0.0f, pushes = 0.0f;
        for (int level = 0; level < grid.level_count; ++level)
        {{
            const float reach = (radius + grid.reach.data[level]) * farther;
            const int columns = grid.count_x.data[level], rows = grid.count_y.data[level];
            auto cell = [](float at, float size, int count) -> int
            {{
                const float most = 2.0f * (float)count;
                const float number = at * ((float)count / size);
                return wp::clamp((int)floorf(number < -most ? -most : number > most ? most : number), 0, count - 1);
            }};
            const int left = cell(x - reach, grid.space.size[0], columns), right = cell(x + reach, grid.space.size[0], columns);
            const int low = cell(y - reach, grid.space.size[1], rows), high = cell(y + reach, grid.space.size[1], rows);
            for (int row = low; row <= high; ++row)
            {{
                const int* __restrict__ cells = cell_start.data + grid.first_cell.data[level] + row * columns;
                const int last = cells[right + 1];
                for (int k = cells[left]; k < last; k += {LANES})
                {{
                    // A quick look first, wrong on the safe side only.
                    const V dx = *(const V*)(xs + k) - x, dy = *(const V*)(ys + k) - y;
                    const V limit = (radius + *(const V*)(reaches + k)) * wider;
                    const B close = __builtin_convertvector(dx * dx + dy * dy < limit * limit, B);
                    unsigned found = __builtin_bit_cast(unsigned char, close);
                    if (last - k < {LANES}) found &= (1u << (last - k)) - 1u;
                    for (; found != 0; found &= found - 1)
                    {{
                        const int other = k + __builtin_ctz(found), j = bodies[other];
                        if (other == s) continue;
                        if (classes != 0 && apart[whose[i] * classes + whose[j]] == 0) continue;
                        const float way_x = xs[other] - x, way_y = ys[other] - y;
                        const float distance = sqrtf(way_x * way_x + way_y * way_y);
                        const float both = radius + reaches[other], wanted = both * farther;
                        if (!(distance < wanted)) continue;
                        float away_x, away_y;
                        if (distance > 1.0e-6f * both)
                        {{
                            away_x = -way_x / distance;
                            away_y = -way_y / distance;
                        }}
                        else
                        {{
                            // Bodies on one another part in a direction of their own, opposite for the two.
                            const float turned = i > j ? -1.0f : 1.0f;
                            away_x = turned * cosf((float)(i + j));
                            away_y = turned * sinf((float)(i + j));
                        }}
                        const float push = (wanted - distance) / (1.0f / mass + 1.0f / masses[j]);
                        const float share = push / mass;
                        shift_x += away_x * share;
                        shift_y += away_y * share;
                        pushes += 1.0f;
                    }}
                }}
            }}
        }}
        const float scale = pushes > 2.0f ? damping * 2.0f / pushes : damping;
        push_of_body.data[i] = wp::vec4(shift_x * scale, shift_y * scale, 0.0f, pushes);
    }}
#endif
"""


@wp.func_native(_PUSH_DISCS)
def push_discs(
    start: int,
    end: int,
    near: Sorted,
    footprints: Footprints,
    cell_start: wp.array(dtype=wp.int32),
    grid: ContactGrid,
    slack: float,
    damping: float,
    push_of_body: wp.array(dtype=wp.vec4),
): ...


@wp.kernel
def push_apart(
    first: int,
    pose: wp.array(dtype=wp.vec4),
    neighbors: Neighbors,
    slack: float,
    damping: float,
    body_count: int,
    at_once: int,
    discs: int,
    # outputs
    push_of_body: wp.array(dtype=wp.vec4),
):
    """The shift and turn that bring every body out of those that it overlaps, and how many these are.

    ``slack`` is how much farther than touching, as a share of the radii, bodies are pushed. An element is ``at_once`` bodies: where
    all are ``discs``, in the order of their cells.
    """
    near = neighbors.bodies
    footprints = neighbors.footprints
    block = (first + wp.tid()) * at_once
    if discs != 0:
        end = wp.min(block + at_once, body_count)
        push_discs(block, end, near, footprints, neighbors.cell_start, neighbors.grid, slack, damping, push_of_body)
        return
    for i in range(block, wp.min(block + at_once, body_count)):
        at = wp.vec2(pose[i][0], pose[i][1])
        own = capsule(near.half_axis[near.rank[i]], 0.5 * pose[i][3], footprints.radius[i], footprints.mass[i])
        total = wp.vec4(0.0, 0.0, 0.0, 0.0)
        for m in range(neighbors.grid.level_count):
            within = (own.half + own.radius + neighbors.grid.reach[m]) * (1.0 + slack)
            around = cells_around(at, within, m, neighbors)
            for run in range(run_count(around)):
                members = bodies_of_run(run, around, neighbors)
                total = add_pushes_of_run(total, i, at, own, members, pose, neighbors, slack)
        scale = scale_of_pushes(total[3], damping)
        push_of_body[i] = wp.vec4(total[0] * scale, total[1] * scale, total[2] * scale, total[3])


@wp.kernel
def accept_push(
    first: int,
    push_of_body: wp.array(dtype=wp.vec4),
    bodies: Bodies,
    bend: wp.array(dtype=float),
    images: Images,
    # outputs
    neighbors: Neighbors,
    pose: wp.array(dtype=wp.vec4),
    displacement: wp.array(dtype=wp.vec4),
):
    """Push bodies as far as they may go, and count that as part of the displacement."""
    i = first + wp.tid()
    push = push_of_body[i]
    if push[3] == 0.0 or (bodies.flags[i] & PINNED) != 0:
        return
    space = neighbors.grid.space
    old = pose[i]
    new = old
    k = bodies.support[i]
    if bodies.kind[i] < 0:
        p = wp.vec2(old[0], old[1])
        q = slide(p, p + wp.vec2(push[0], push[1]), k, images, space)
        new = wp.vec4(q[0], q[1], 0.0, 0.0)
    else:
        new = confine_line(
            old,
            wp.vec4(old[0] + push[0], old[1] + push[1], old[2] + push[2], old[3]),
            bodies.first_charge[i],
            bodies.first_charge[i + 1],
            bodies,
            bend,
            k,
            images,
            space,
        )
        # Lines that left a periodic domain come in again: nobody looks for them farther out than a period.
        inside = confine(wp.vec2(new[0], new[1]), space)
        new = wp.vec4(inside[0], inside[1], new[2], new[3])
    way = difference(wp.vec2(old[0], old[1]), wp.vec2(new[0], new[1]), space)
    displacement[i] = displacement[i] + wp.vec4(way[0], way[1], new[2] - old[2], new[3] - old[3])
    pose[i] = new
    set_sorted(neighbors.bodies.rank[i], new, neighbors.footprints.radius[i], neighbors.bodies)
