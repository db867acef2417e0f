"""Kernels that decide, from sums over all bodies, in which direction they move."""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})

# Sums over all bodies are kept as integers, so that they depend on no order; on a GPU in several slots each, a power of two of them,
# so that few threads wait for each other, on the CPU, where adding is not atomic, in one for every thread. The unit is 2^-30.
SLOTS_ON_GPU = 1024
SLOTS_ON_CPU = 1
# Integers between the sums of two threads: processors fetch two lines of eight at once.
SUMS_APART = 16
# Slots that a thread of a GPU adds up.
SLOTS_AT_ONCE = 8
SUM_SCALE = wp.constant(1073741824.0)
LARGEST_SUMMAND = wp.constant(1.0e6)
# What is summed: the products of the last displacement s, the moves m that the forces ask for, and what they changed by, y, in the
# metric of the curvature; the squared move over the squared local spacing; how many bodies' moves are no finite numbers; then for
# every kind of line the length over the preferred one.
S_Y = wp.constant(0)
S_S = wp.constant(1)
Y_Y = wp.constant(2)
S_M = wp.constant(3)
Y_M = wp.constant(4)
M_M = wp.constant(5)
RESIDUAL = wp.constant(6)
BROKEN = wp.constant(7)
LENGTHS = wp.constant(8)
# Share of the moves that is made where nothing is known of the last step, and bounds on it where something is. Measured on dots of one
# and of two sizes and on lines along a ramp (benchmarks/constants.py --descent, 400 bodies, 800 for the first): with 0.35 and 1 at
# first coverage errors differ by 1 %; a lower bound of 0.1 or 0.7 changes no digit; with an upper one of 1 or 4 they are 1 % larger
# and smaller, and with 4 the forces would still move bodies a tenth farther after 100 steps.
FIRST_SHARE = wp.constant(0.7)
SMALLEST_SHARE = wp.constant(0.3)
LARGEST_SHARE = wp.constant(2.0)
# A last step whose cosine with the change of the moves is below this says nothing about the curvature. Measured on the same: 1e-5 and
# 0.1 change no digit.
SMALLEST_COSINE = wp.constant(1.0e-3)
# Charges that repel one another compress lines. The preferred length is raised until the mean length reached is the one asked for, by
# this share of what is missing at each step (slower than lines follow it, or it would swing), once they are this far grown. Lines far
# shorter than the way to their neighbors, as those of a rare class are, are stretched by their own charges; the stronger the pull
# that this takes, which may be one to less than no length, the faster they follow.
LENGTH_GAIN = wp.constant(0.05)
LARGEST_FACTOR = wp.constant(3.0)
SMALLEST_FACTOR = wp.constant(-50.0)
GROWN = wp.constant(0.6)


# The sums that every body adds to, in the order of their numbers.
Sums = wp.types.vector(BROKEN, wp.float32)

# wp.atomic_add finds its element in an array of three dimensions once for every sum; these lie side by side.
# On a GPU threads of a warp that are all here add up among themselves, and one of them goes to memory for all.
_ADD = f"""
    const int slots = sums.shape[2];
    #if defined(__CUDA_ARCH__)
        const bool whole = __activemask() == 0xffffffffu;
        const bool goes = !whole || threadIdx.x % 32 == 0;
        const int slot = (whole ? i / 32 : i) & (slots - 1);
    #else
        const int slot = i & (slots - 1);
    #endif
    long long* to = (long long*)sums.data + (size_t)thread * sums.shape[1] * slots + slot;
    #if defined(__CUDA_ARCH__)
    #pragma unroll
    #endif
    for (int k = 0; k < {BROKEN}; ++k)
    {{
        // What is no number becomes the smallest one.
        const float value = !(values[k] > -{LARGEST_SUMMAND}f) ? -{LARGEST_SUMMAND}f
            : values[k] > {LARGEST_SUMMAND}f ? {LARGEST_SUMMAND}f : values[k];
        long long amount = (long long)(value * {SUM_SCALE}f);
    #if defined(__CUDA_ARCH__)
        if (whole)
            #pragma unroll
            for (int apart = 16; apart > 0; apart /= 2) amount += __shfl_xor_sync(0xffffffffu, amount, apart);
        if (goes) atomicAdd((unsigned long long*)to + k * slots, (unsigned long long)amount);
    #else
        to[k * slots] += amount;
    #endif
    }}
    // Moves and displacements that are no numbers make their squares none.
    if (!(values[{M_M}] + values[{S_S}] < 1e38f))
    {{
    #if defined(__CUDA_ARCH__)
        atomicAdd((unsigned long long*)to + {BROKEN} * slots, 1ull);
    #else
        to[{BROKEN} * slots] += 1;
    #endif
    }}
"""


@wp.func_native(_ADD)
def add_all(sums: wp.array3d(dtype=wp.int64), thread: int, i: int, values: Sums): ...


@wp.func
def add(sums: wp.array3d(dtype=wp.int64), thread: int, kind: int, i: int, value: float):
    """Add ``value`` of body ``i`` to one of the sums over all bodies, in the slots of a thread."""
    amount = wp.int64(wp.clamp(value, -LARGEST_SUMMAND, LARGEST_SUMMAND) * SUM_SCALE)
    wp.atomic_add(sums, thread, kind, i & (sums.shape[2] - 1), amount)


@wp.func
def add_length(sums: wp.array2d(dtype=wp.int64), thread: int, block: int, ratio: float):
    """Add a line's length over the preferred one to the sum of its block, and count it."""
    wp.atomic_add(sums, thread, 2 * block, wp.int64(wp.min(ratio, LARGEST_SUMMAND) * SUM_SCALE))
    wp.atomic_add(sums, thread, 2 * block + 1, wp.int64(1))


@wp.func
def add_products(
    sums: wp.array3d(dtype=wp.int64),
    thread: int,
    i: int,
    metric: wp.vec4,
    displacement: wp.vec4,
    change: wp.vec4,
    move: wp.vec4,
    residual: float,
):
    """Add a body's share to the six products that the direction depends on, and how far it is from being settled."""
    of_displacement = wp.cw_mul(metric, displacement)
    of_change = wp.cw_mul(metric, change)
    add_all(
        sums,
        thread,
        i,
        Sums(
            wp.dot(of_displacement, change),
            wp.dot(of_displacement, displacement),
            wp.dot(of_change, change),
            wp.dot(of_displacement, move),
            wp.dot(of_change, move),
            wp.dot(wp.cw_mul(metric, move), move),
            residual,
        ),
    )


@wp.func
def add_up(element: int, at_once: int, sums: wp.array3d(dtype=wp.int64), totals: wp.array(dtype=wp.int64)):
    """Add slots of a sum to its total, and empty them: an element has ``at_once`` of every thread."""
    elements = sums.shape[2] / at_once
    kind = element / elements
    start = element - kind * elements
    total = wp.int64(0)
    for thread in range(sums.shape[0]):
        for k in range(at_once):
            # Neighbors in memory are for threads that are neighbors.
            total += sums[thread, kind, start + k * elements]
            sums[thread, kind, start + k * elements] = wp.int64(0)
    wp.atomic_add(totals, kind, total)


_ARRIVE = """
#if defined(__CUDA_ARCH__)
    // Whoever comes last sees what all others have written before they came.
    __threadfence();
    const int before = atomicAdd(arrived.data, 1);
    __threadfence();
    return before;
#else
    return arrived.data[0]++;
#endif
"""


@wp.func_native(_ARRIVE)
def arrive(arrived: wp.array(dtype=wp.int32)) -> int:
    """How many threads came here before; on the CPU by one thread alone."""
    ...


@wp.func
def sum_of(totals: wp.array(dtype=wp.int64), kind: int):
    return wp.float64(totals[kind]) / wp.float64(SUM_SCALE)


@wp.func
def adapted(factor: float, ratio: float):
    """A factor on preferred lengths, nearer to the one with which lines have them; ``ratio`` is that of their lengths to these."""
    result = factor
    # While lines still grow, what is missing is no pressure.
    if ratio > GROWN:
        raised = factor + LENGTH_GAIN * wp.max(1.0, 2.0 - 2.0 * factor) * (1.0 - ratio)
        result = wp.clamp(raised, SMALLEST_FACTOR, LARGEST_FACTOR)
    return result


@wp.kernel
def adapt_blocks(
    first: int,
    kind_count: int,
    # outputs
    sums: wp.array2d(dtype=wp.int64),
    length_factor: wp.array(dtype=float),
):
    """What makes up for compressed lines block by block; ``length_factor`` has those behind the kinds'. Leaves the sums empty."""
    i = first + wp.tid()
    total = wp.int64(0)
    count = wp.int64(0)
    for thread in range(sums.shape[0]):
        total += sums[thread, 2 * i]
        count += sums[thread, 2 * i + 1]
        sums[thread, 2 * i] = wp.int64(0)
        sums[thread, 2 * i + 1] = wp.int64(0)
    if count > wp.int64(0):
        ratio = float(wp.float64(total) / (wp.float64(SUM_SCALE) * wp.float64(count)))
        length_factor[kind_count + i] = adapted(length_factor[kind_count + i], ratio)


@wp.func
def decide(
    kind_count: int,
    most_stretch: float,
    line_count: wp.array(dtype=float),
    pressed: wp.array(dtype=float),
    totals: wp.array(dtype=wp.int64),
    direction: wp.array(dtype=float),
    length_factor: wp.array(dtype=float),
):
    """The direction of memoryless BFGS (Shanno, 1978), and what makes up for compressed lines.

    With the last displacement s, the moves m and what they changed by, y, it is
    g m + (s·m / s·y (1 + g y·y / s·y) - g y·m / s·y) s - g s·m / s·y y, where g = |s| / |y|: BFGS that remembers one step, without a
    line search; it is at most ``most_stretch`` times as long as the moves. ``direction`` is the three factors, and the sum of the
    squared moves over squared spacings; NaN where a move is no finite number. Leaves the totals empty.
    """
    sy = sum_of(totals, S_Y)
    ss = sum_of(totals, S_S)
    yy = sum_of(totals, Y_Y)
    sm = sum_of(totals, S_M)
    ym = sum_of(totals, Y_M)
    of_move = wp.float64(FIRST_SHARE)
    of_displacement = wp.float64(0.0)
    of_change = wp.float64(0.0)
    if sy > wp.float64(SMALLEST_COSINE) * wp.sqrt(ss * yy) and sy > wp.float64(0.0):
        g = wp.clamp(wp.sqrt(ss / yy), wp.float64(SMALLEST_SHARE), wp.float64(LARGEST_SHARE))
        displacement = sm / sy * (wp.float64(1.0) + g * yy / sy) - g * ym / sy
        change = -g * sm / sy
        mm = sum_of(totals, M_M)
        # Only downhill.
        if g * mm + displacement * sm + change * ym > wp.float64(0.0):
            square = g * g * mm + displacement * displacement * ss + change * change * yy
            square += wp.float64(2.0) * (g * displacement * sm + g * change * ym + displacement * change * sy)
            bound = wp.min(
                wp.float64(1.0), wp.float64(most_stretch) * wp.sqrt(mm / wp.max(square, wp.float64(1.0e-30)))
            )
            of_move = bound * g
            of_displacement = bound * displacement
            of_change = bound * change
    direction[0] = float(of_move)
    direction[1] = float(of_displacement)
    direction[2] = float(of_change)
    direction[3] = float(sum_of(totals, RESIDUAL))
    if not wp.isfinite(direction[0] + direction[1] + direction[2]):
        totals[BROKEN] = wp.int64(1)
    if totals[BROKEN] != wp.int64(0):
        direction[3] = wp.NAN
    for kind in range(kind_count):
        ratio = float(sum_of(totals, LENGTHS + kind)) / wp.max(line_count[kind], 1.0)
        if pressed[kind] > 0.0:
            length_factor[kind] = adapted(length_factor[kind], ratio)
    # What is broken once stays so, however many steps are taken before somebody looks.
    for kind in range(totals.shape[0]):
        if kind != BROKEN:
            totals[kind] = wp.int64(0)


@wp.kernel
def decide_direction(
    first: int,
    element_count: int,
    at_once: int,
    kind_count: int,
    most_stretch: float,
    line_count: wp.array(dtype=float),
    pressed: wp.array(dtype=float),
    # outputs
    sums: wp.array3d(dtype=wp.int64),
    totals: wp.array(dtype=wp.int64),
    arrived: wp.array(dtype=wp.int32),
    direction: wp.array(dtype=float),
    length_factor: wp.array(dtype=float),
):
    """Add all sums up; the last one that has done so decides the direction."""
    add_up(first + wp.tid(), at_once, sums, totals)
    if arrive(arrived) == element_count - 1:
        arrived[0] = 0
        decide(kind_count, most_stretch, line_count, pressed, totals, direction, length_factor)
