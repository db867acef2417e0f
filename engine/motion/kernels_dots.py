"""Kernels that move dots: bodies of a single charge, without angle or length.

The CPU takes several bodies at once where all of them are dots that nothing holds, and elsewhere one after the other, as a GPU does:
both compute the same, to the last bit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import warp as wp

from ..model.body_flags import BodyFlags
from ..space.kernels_images import Images
from ..space.kernels_lanes import LANES, LANES_OF_SPACE
from ..space.kernels_mesh import Mesh, nearest_node
from ..space.kernels_space import Space, along_border, difference
from . import kernels_direction
from .kernels_descent import (
    PINNED,
    Bodies,
    Charges,
    Motion,
    Steps,
    first_step,
    limited,
    move_of,
    slide,
    squared_residual,
)
from .kernels_direction import add_products

__all__ = ["DOTS_AT_ONCE", "move_dots", "propose_dots"]

wp.set_module_options({"enable_backward": False})

# Bodies that an element of these kernels has on the CPU.
DOTS_AT_ONCE = wp.constant(LANES)


def _numbers(of_lane: Callable[[int], Sequence[int]]) -> str:
    """Indices of a shuffle: those of lane after lane."""
    return ", ".join(str(index) for k in range(LANES) for index in of_lane(k))


# What both kernels start with: which bodies these are, and how numbers of all of them are read and written at once.
_OF_DOTS = f"""
    {LANES_OF_SPACE}
    typedef float Pairs __attribute__((ext_vector_type({2 * LANES}), aligned(4)));
    typedef float Quads __attribute__((ext_vector_type({4 * LANES}), aligned(4)));
    auto lanes = [](auto of) -> V {{ return V{{{", ".join(f"of({k})" for k in range(LANES))}}}; }};
    // The first two numbers of every vector of two or four; of one of four the others are zero.
    auto take_pairs = [](const float* p, V& x, V& y)
    {{
        const Pairs of_all = *(const Pairs*)p;
        x = __builtin_shufflevector(of_all, of_all, {_numbers(lambda k: [2 * k])});
        y = __builtin_shufflevector(of_all, of_all, {_numbers(lambda k: [2 * k + 1])});
    }};
    auto take_quads = [](const float* p, V& x, V& y)
    {{
        const Quads of_all = *(const Quads*)p;
        x = __builtin_shufflevector(of_all, of_all, {_numbers(lambda k: [4 * k])});
        y = __builtin_shufflevector(of_all, of_all, {_numbers(lambda k: [4 * k + 1])});
    }};
    auto put_pairs = [](float* p, V x, V y)
    {{
        *(Pairs*)p = __builtin_shufflevector(x, y, {_numbers(lambda k: [k, LANES + k])});
    }};
    auto put_quads = [](float* p, V x, V y)
    {{
        const Pairs both = __builtin_shufflevector(x, y, {", ".join(map(str, range(2 * LANES)))});
        const Pairs none = (Pairs)0.0f;
        *(Quads*)p = __builtin_shufflevector(both, none, {_numbers(lambda k: [k, LANES + k, 2 * LANES, 2 * LANES])});
    }};
    const I line = *(const I*)(bodies.kind.data + start), flags = *(const I*)(bodies.flags.data + start);
    if (!all((line < 0) & ((flags & {int(BodyFlags.PINNED)}) == 0))) return 0;
    const I charges_of_bodies = *(const I*)(bodies.first_charge.data + start);
    const int charge = charges_of_bodies[0];
    if (!all(charges_of_bodies == charge + (I){{{", ".join(map(str, range(LANES)))}}})) return 0;
    auto limited = [](V& x, V& y, V limit)
    {{
        const V length = __builtin_elementwise_sqrt(x * x + y * y);
        const V factor = length > limit ? limit / length : (V)1.0f;
        x *= factor;
        y *= factor;
    }};
"""

_PROPOSE = f"""
#if defined(__CUDA_ARCH__)
    return 0;
#else
    {_OF_DOTS}
    V x, y, move_x, move_y;
    take_pairs((const float*)(charges.position.data + charge), x, y);
    take_pairs((const float*)(charges.field.data + charge), move_x, move_y);
    move_x = along_border(move_x, x, size_x);
    move_y = along_border(move_y, y, size_y);
    const I node = nearest_nodes(x, y);
    const int* __restrict__ group = bodies.group.data + start;
    const int nodes = mesh.count_x * mesh.count_y;
    const V length = lanes([&](int k) {{ return steps.length.data[group[k] * nodes + node[k]]; }});
    const V limit = lanes([&](int k) {{ return steps.limit.data[node[k]]; }});
    move_x *= length;
    move_y *= length;
    limited(move_x, move_y, 2.0f * limit);
    float* __restrict__ moves = (float*)(motion.move.data + start);
    V change_x, change_y, last_x, last_y;
    take_quads(moves, change_x, change_y);
    take_quads((const float*)(motion.displacement.data + start), last_x, last_y);
    change_x -= move_x;
    change_y -= move_y;
    put_quads(moves, move_x, move_y);
    put_quads((float*)(motion.change.data + start), change_x, change_y);

    const V weight = *(const V*)(bodies.charge.data + charge) / length;
    const V of_last_x = weight * last_x, of_last_y = weight * last_y;
    const V of_change_x = weight * change_x, of_change_y = weight * change_y;
    V squared = move_x * move_x + move_y * move_y;
    if (in_contact != 0) squared = __builtin_elementwise_min(squared, last_x * last_x + last_y * last_y);
    const V values[] = {{
        of_last_x * change_x + of_last_y * change_y,
        of_last_x * last_x + of_last_y * last_y,
        of_change_x * change_x + of_change_y * change_y,
        of_last_x * move_x + of_last_y * move_y,
        of_change_x * move_x + of_change_y * move_y,
        weight * move_x * move_x + weight * move_y * move_y,
        squared / (4.0f * limit * limit),
    }};
    // As kernels_direction.add_all adds those of one body.
    typedef long long W __attribute__((ext_vector_type({LANES})));
    const int slots = sums.shape[2];
    long long* to = (long long*)sums.data + (size_t)thread * sums.shape[1] * slots + (start & (slots - 1));
    const float most = {kernels_direction.LARGEST_SUMMAND}f;
    for (int k = 0; k < {kernels_direction.BROKEN}; ++k)
    {{
        const V bounded = values[k] > -most ? (values[k] > most ? (V)most : values[k]) : (V)(-most);
        to[k * slots] += __builtin_reduce_add(__builtin_convertvector(bounded * {kernels_direction.SUM_SCALE}f, W));
    }}
    const I sound = values[{kernels_direction.M_M}] + values[{kernels_direction.S_S}] < 1e38f;
    to[{kernels_direction.BROKEN} * slots] += L + __builtin_reduce_add(sound);
    return 1;
#endif
"""


@wp.func_native(_PROPOSE)
def propose_lanes(
    start: int,
    thread: int,
    charges: Charges,
    bodies: Bodies,
    steps: Steps,
    mesh: Mesh,
    space: Space,
    in_contact: int,
    motion: Motion,
    sums: wp.array3d(dtype=wp.int64),
) -> int: ...


@wp.func
def propose_dot(
    i: int,
    thread: int,
    charges: Charges,
    bodies: Bodies,
    steps: Steps,
    space: Space,
    in_contact: int,
    motion: Motion,
    sums: wp.array3d(dtype=wp.int64),
):
    """The move that the force on a dot asks for, and what it changed by since the last step."""
    # All of them at first: a GPU waits for memory once, and not for one after the other.
    kind = bodies.kind[i]
    flags = bodies.flags[i]
    charge = bodies.first_charge[i]
    group = bodies.group[i]
    before = motion.move[i]
    last = motion.displacement[i]
    at = charges.position[charge]
    field = charges.field[charge]
    amount = bodies.charge[charge]
    if kind >= 0 or (flags & PINNED) != 0:
        return
    force = along_border(field, at, space)
    node = nearest_node(at, steps.mesh)
    length = steps.length[first_step(group, steps) + node]
    limit = steps.limit[node]
    # Beyond a spacing no move is more than a direction.
    wanted = limited(force * length, 2.0 * limit)
    new = wp.vec4(wanted[0], wanted[1], 0.0, 0.0)
    changed = before - new
    motion.move[i] = new
    motion.change[i] = changed
    weight = amount / length
    rest = squared_residual(wp.length_sq(wanted), wp.length_sq(last), limit, in_contact)
    add_products(sums, thread, i, wp.vec4(weight, weight, 0.0, 0.0), last, changed, new, rest)


@wp.kernel
def propose_dots(
    first: int,
    thread: int,
    body_count: int,
    at_once: int,
    charges: Charges,
    bodies: Bodies,
    steps: Steps,
    space: Space,
    in_contact: int,
    # outputs
    motion: Motion,
    sums: wp.array3d(dtype=wp.int64),
):
    """The moves that the forces on dots ask for, and what they changed by since the last step; an element has ``at_once`` bodies."""
    start = (first + wp.tid()) * at_once
    done = int(0)
    if at_once == DOTS_AT_ONCE and start + at_once <= body_count:
        done = propose_lanes(start, thread, charges, bodies, steps, steps.mesh, space, in_contact, motion, sums)
    if done == 0:
        for i in range(start, wp.min(start + at_once, body_count)):
            propose_dot(i, thread, charges, bodies, steps, space, in_contact, motion, sums)


_MOVE = f"""
#if defined(__CUDA_ARCH__)
    return 0;
#else
    {_OF_DOTS}
    float* __restrict__ poses = (float*)(pose.data + start);
    float* __restrict__ displacements = (float*)(motion.displacement.data + start);
    V x, y, wanted_x, wanted_y, last_x, last_y, change_x, change_y;
    take_quads(poses, x, y);
    take_quads((const float*)(motion.move.data + start), wanted_x, wanted_y);
    take_quads(displacements, last_x, last_y);
    take_quads((const float*)(motion.change.data + start), change_x, change_y);
    const float of_move = direction.data[0], of_displacement = direction.data[1], of_change = direction.data[2];
    V move_x = of_move * wanted_x + of_displacement * last_x + of_change * change_x;
    V move_y = of_move * wanted_y + of_displacement * last_y + of_change * change_y;
    const I node = nearest_nodes(x, y);
    limited(move_x, move_y, lanes([&](int k) {{ return steps.limit.data[node[k]]; }}));
    const V new_x = confined(x + move_x, size_x), new_y = confined(y + move_y, size_y);
    // Those that would leave the support slide along its edge, one by one.
    const I support = *(const I*)(bodies.support.data + start);
    if (!all(support == support[0])) return 0;
    const I pixel = pixels(new_x, new_y, images.height.data[support[0]], images.width.data[support[0]]);
    const float* __restrict__ image = images.pixel.data + images.start.data[support[0]];
    if (!all(lanes([&](int k) {{ return image[pixel[k]]; }}) > 0.0f)) return 0;
    const V gone_x = way(x, new_x, size_x), gone_y = way(y, new_y, size_y);
    put_quads(poses, new_x, new_y);
    put_quads(displacements, gone_x, gone_y);
    put_pairs((float*)(charge_position.data + charge), new_x, new_y);
    return 1;
#endif
"""


@wp.func_native(_MOVE)
def move_lanes(
    start: int,
    direction: wp.array(dtype=float),
    bodies: Bodies,
    steps: Steps,
    mesh: Mesh,
    images: Images,
    space: Space,
    motion: Motion,
    pose: wp.array(dtype=wp.vec4),
    charge_position: wp.array(dtype=wp.vec2),
) -> int: ...


@wp.func
def move_dot(
    i: int,
    direction: wp.array(dtype=float),
    bodies: Bodies,
    steps: Steps,
    images: Images,
    space: Space,
    motion: Motion,
    pose: wp.array(dtype=wp.vec4),
    charge_position: wp.array(dtype=wp.vec2),
):
    """Move a dot in the direction that was found; it stays in the support."""
    if bodies.kind[i] >= 0 or (bodies.flags[i] & PINNED) != 0:
        return
    old = wp.vec2(pose[i][0], pose[i][1])
    d = move_of(i, direction, motion)
    wanted = old + limited(wp.vec2(d[0], d[1]), steps.limit[nearest_node(old, steps.mesh)])
    new = slide(old, wanted, bodies.support[i], images, space)
    shift = difference(old, new, space)
    pose[i] = wp.vec4(new[0], new[1], 0.0, 0.0)
    motion.displacement[i] = wp.vec4(shift[0], shift[1], 0.0, 0.0)
    charge_position[bodies.first_charge[i]] = new


@wp.kernel
def move_dots(
    first: int,
    body_count: int,
    at_once: int,
    direction: wp.array(dtype=float),
    bodies: Bodies,
    steps: Steps,
    images: Images,
    space: Space,
    # outputs
    motion: Motion,
    pose: wp.array(dtype=wp.vec4),
    charge_position: wp.array(dtype=wp.vec2),
):
    """Move dots in the direction that was found; they stay in the support. An element has ``at_once`` bodies."""
    start = (first + wp.tid()) * at_once
    done = int(0)
    if at_once == DOTS_AT_ONCE and start + at_once <= body_count:
        done = move_lanes(start, direction, bodies, steps, steps.mesh, images, space, motion, pose, charge_position)
    if done == 0:
        for i in range(start, wp.min(start + at_once, body_count)):
            move_dot(i, direction, bodies, steps, images, space, motion, pose, charge_position)
