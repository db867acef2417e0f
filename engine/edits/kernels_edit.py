"""Kernels of an edit: which bodies of a size have too little density now, who stays, and where all of them are afterwards."""

from __future__ import annotations

import enum

import warp as wp

from ..motion.kernels_descent import PINNED
from ..space.kernels_images import Images, in_support

wp.set_module_options({"enable_backward": False})


class Fate(enum.IntEnum):
    """What becomes of a body that was there before an edit."""

    # Nobody asks for its size any more, unless its size is still to be looked at.
    UNDECIDED = 0
    # It acts on others only, or is fixed now.
    USED = 1
    GOES = 2
    STAYS = 3
    # One of those of which some are to go, but most stay.
    TOO_MANY = 4
    # One of those of which most are to go.
    THINNED = 5


class Total(enum.IntEnum):
    """What is summed, in bodies, over the cells and the bodies of a size."""

    # Over cells: how many are to come; to go where most stay; and to stay where most go.
    COMING = 0
    LOST = 1
    SURVIVING = 2
    # Over bodies: how many have no place, are thinned and too many; of the latter two, how many are to stay, and to go.
    WITHOUT_PLACE = 3
    THINNED = 4
    SURVIVORS = 5
    TOO_MANY = 6
    SURPLUS = 7


class Density(enum.IntEnum):
    """Over what points are spread: for those that go where most stay, that stay where most go, that come, or for all."""

    LOSS = 0
    SURVIVAL = 1
    GAIN = 2
    WANTED = 3


UNDECIDED, USED, GOES, STAYS, TOO_MANY, THINNED = (
    wp.constant(int(fate)) for fate in (Fate.UNDECIDED, Fate.USED, Fate.GOES, Fate.STAYS, Fate.TOO_MANY, Fate.THINNED)
)
OF_COMING, OF_LOST, OF_SURVIVING = (wp.constant(int(t)) for t in (Total.COMING, Total.LOST, Total.SURVIVING))
OF_WITHOUT_PLACE, OF_THINNED, OF_SURVIVORS = (
    wp.constant(int(t)) for t in (Total.WITHOUT_PLACE, Total.THINNED, Total.SURVIVORS)
)
OF_TOO_MANY, OF_SURPLUS = wp.constant(int(Total.TOO_MANY)), wp.constant(int(Total.SURPLUS))
LOSS, SURVIVAL, GAIN = (wp.constant(int(d)) for d in (Density.LOSS, Density.SURVIVAL, Density.GAIN))
# Densities that differ by less have not changed: images are read and blurred in float32.
UNCHANGED = wp.constant(1e-4)
# Where fewer stay than this share, it is those that are spread evenly; elsewhere those that go are.
FEW = wp.constant(0.6)
# Sums are of integers, so that their order does not matter; and in so many slots, so that a GPU's threads do not wait for each other.
SUM_SCALE = wp.constant(4294967296.0)
SLOTS = wp.constant(32)


@wp.struct
class Asked:
    """Bodies of a size in cells of a rectangle, ``cells`` along either side, row 0 at the bottom.

    ``share`` of the ``wanted`` ones are to be in every cell, and ``share_before`` of the ``there`` ones have been.
    """

    cells: wp.int32
    share: wp.array(dtype=float)
    wanted: wp.float64
    share_before: wp.array(dtype=float)
    there: wp.float64


@wp.struct
class Around:
    """A rectangle that holds all bodies before and after an edit: the domain, or a part of it."""

    origin: wp.vec2
    size: wp.vec2


@wp.func
def cell_at(position: wp.vec2, cells: int, around: Around):
    """Cell of a rectangle that holds a position, or the nearest one."""
    column = wp.clamp(int((position[0] - around.origin[0]) / around.size[0] * float(cells)), 0, cells - 1)
    row = wp.clamp(int((position[1] - around.origin[1]) / around.size[1] * float(cells)), 0, cells - 1)
    return row * cells + column


@wp.func
def place_of(pose: wp.vec4):
    return wp.vec2(pose[0], pose[1])


@wp.func
def add(sums: wp.array3d(dtype=wp.int64), thread: int, kind: int, i: int, value: wp.float64):
    """Add ``value`` of element ``i`` to a sum, in the slots of a thread."""
    wp.atomic_add(sums, thread, kind, i & (SLOTS - 1), wp.int64(value * wp.float64(SUM_SCALE)))


@wp.func
def are_few(wanted: wp.float64, there: wp.float64):
    """Whether most of those that are there are to go."""
    return wanted < wp.float64(FEW) * there


@wp.kernel
def compare_cells(
    first: int,
    thread: int,
    asked: Asked,
    # outputs
    ratio: wp.array(dtype=float),
    sums: wp.array3d(dtype=wp.int64),
):
    """How many of the bodies in a cell are to stay, over how many there are; above 1 where more are to come."""
    c = first + wp.tid()
    wanted = wp.float64(asked.share[c]) * asked.wanted
    there = wp.float64(asked.share_before[c]) * asked.there
    # Who is where nobody was asked for is there by rounding, at the edge of what was: it stays, or is moved beside it.
    ratio[c] = 1.0
    if there > wp.float64(0.0):
        ratio[c] = float(wanted / there)
    if wanted > there:
        add(sums, thread, OF_COMING, c, wanted - there)
    elif are_few(wanted, there):
        add(sums, thread, OF_SURVIVING, c, wanted)
    elif wanted < there:
        add(sums, thread, OF_LOST, c, there - wanted)


@wp.kernel
def find_density(
    first: int,
    asked: Asked,
    kind: int,
    # outputs
    density: wp.array(dtype=float),
):
    """Over what points of a kind are spread."""
    c = first + wp.tid()
    wanted = wp.float64(asked.share[c]) * asked.wanted
    there = wp.float64(asked.share_before[c]) * asked.there
    value = wanted
    if kind == GAIN:
        value = wp.max(wanted - there, wp.float64(0.0))
    elif kind == LOSS or kind == SURVIVAL:
        if are_few(wanted, there) != (kind == SURVIVAL):
            value = wp.float64(0.0)
        elif kind == LOSS:
            value = wp.max(there - wanted, wp.float64(0.0))
    density[c] = float(value)


@wp.kernel
def judge_bodies(
    first: int,
    thread: int,
    pose: wp.array(dtype=wp.vec4),
    around: Around,
    cells: int,
    ratio: wp.array(dtype=float),
    # outputs
    fate: wp.array(dtype=wp.int32),
    sums: wp.array3d(dtype=wp.int64),
):
    """Whether a body may stay where it is. Where nothing has changed, and where more are to come, all stay."""
    i = first + wp.tid()
    if fate[i] != UNDECIDED:
        return
    here = ratio[cell_at(place_of(pose[i]), cells, around)]
    one = wp.float64(1.0)
    if here > 1.0 - UNCHANGED:
        fate[i] = STAYS
    elif here <= 0.0:
        fate[i] = GOES
        add(sums, thread, OF_WITHOUT_PLACE, i, one)
    elif here < FEW:
        fate[i] = THINNED
        add(sums, thread, OF_THINNED, i, one)
        add(sums, thread, OF_SURVIVORS, i, wp.float64(here))
    else:
        fate[i] = TOO_MANY
        add(sums, thread, OF_TOO_MANY, i, one)
        add(sums, thread, OF_SURPLUS, i, one - wp.float64(here))


@wp.kernel
def mark_fates(
    first: int,
    fate: wp.array(dtype=wp.int32),
    begin: int,
    least: int,
    most: int,
    # outputs
    marked: wp.array(dtype=wp.int32),
):
    """Mark bodies, of those from ``begin`` on, whose fate is one of several that follow each other."""
    i = first + wp.tid()
    own = fate[begin + i]
    marked[i] = int(own >= least and own <= most)


@wp.kernel
def decide_fates(
    first: int,
    body: wp.array(dtype=wp.int32),
    decided: int,
    # outputs
    fate: wp.array(dtype=wp.int32),
):
    """Decide the fate of some bodies."""
    fate[body[first + wp.tid()]] = decided


@wp.func
def row_at(k: int, first_row: int, row: wp.array(dtype=wp.int32)) -> int:
    """The k-th of some rows: those from the first one on where they are not listed."""
    return row[k] if row.shape[0] > 0 else first_row + k


@wp.kernel
def take_seats(
    first: int,
    body: wp.array(dtype=wp.int32),
    first_row: int,
    row: wp.array(dtype=wp.int32),
    pose_before: wp.array(dtype=wp.vec4),
    unit_ratio: float,
    size: wp.vec2,
    # outputs
    pose: wp.array(dtype=wp.vec4),
    source: wp.array(dtype=wp.int32),
    row_of: wp.array(dtype=wp.int32),
):
    """Give bodies that stay rows in the new model, where they are what they were, in its unit, and within its size."""
    k = first + wp.tid()
    old = body[k]
    new = row_at(k, first_row, row)
    at = pose_before[old]
    x = wp.clamp(at[0] * unit_ratio, 0.0, size[0])
    y = wp.clamp(at[1] * unit_ratio, 0.0, size[1])
    pose[new] = wp.vec4(x, y, 0.0, 0.0)
    source[new] = old
    row_of[old] = new


@wp.kernel
def read_numbers(
    first: int,
    body: wp.array(dtype=wp.int32),
    number: wp.array(dtype=wp.int32),
    # outputs
    read: wp.array(dtype=wp.int32),
):
    """Of some bodies a number that every body has: its row, its identity."""
    k = first + wp.tid()
    read[k] = number[body[k]]


@wp.kernel
def put_down(
    first: int,
    first_row: int,
    row: wp.array(dtype=wp.int32),
    point: wp.array(dtype=wp.vec2),
    # outputs
    pose: wp.array(dtype=wp.vec4),
):
    """Put the bodies of some rows to points."""
    k = first + wp.tid()
    pose[row_at(k, first_row, row)] = wp.vec4(point[k][0], point[k][1], 0.0, 0.0)


@wp.kernel
def shift_points(
    first: int,
    by: wp.vec2d,
    # outputs
    point: wp.array(dtype=wp.vec2d),
):
    """Shift points."""
    k = first + wp.tid()
    point[k] = wp.vec2d(point[k][0] + by[0], point[k][1] + by[1])


@wp.kernel
def bring_to_unit(
    first: int,
    point: wp.array(dtype=wp.vec2d),
    unit: wp.float64,
    size: wp.vec2d,
    # outputs
    place: wp.array(dtype=wp.vec2),
):
    """Points [m] in another unit of length [m], within the size of the space in it."""
    k = first + wp.tid()
    x = wp.clamp(point[k][0] / unit, wp.float64(0.0), size[0])
    y = wp.clamp(point[k][1] / unit, wp.float64(0.0), size[1])
    place[k] = wp.vec2(float(x), float(y))


@wp.kernel
def read_places(
    first: int,
    body: wp.array(dtype=wp.int32),
    pose: wp.array(dtype=wp.vec4),
    scale: float,
    # outputs
    point: wp.array(dtype=wp.vec2),
):
    """Where some bodies are, times a scale."""
    k = first + wp.tid()
    point[k] = scale * place_of(pose[body[k]])


@wp.kernel
def part_with(
    first: int,
    body: wp.array(dtype=wp.int32),
    row: wp.array(dtype=wp.int32),
    # outputs
    source: wp.array(dtype=wp.int32),
    row_of: wp.array(dtype=wp.int32),
):
    """Let old bodies go, and others have the rows that they had got."""
    k = first + wp.tid()
    source[row[k]] = -1
    row_of[body[k]] = -1


@wp.kernel
def carry_identities(
    first: int,
    source: wp.array(dtype=wp.int32),
    identity_before: wp.array(dtype=wp.int32),
    # outputs
    identity: wp.array(dtype=wp.int32),
):
    """Identities of bodies that were there before; others have that of the first body for now."""
    i = first + wp.tid()
    identity[i] = identity_before[wp.max(source[i], 0)]


@wp.kernel
def give_identities(
    first: int,
    first_row: int,
    row: wp.array(dtype=wp.int32),
    first_given: int,
    given: wp.array(dtype=wp.int32),
    # outputs
    identity: wp.array(dtype=wp.int32),
):
    """Give identities to the bodies of some rows: those from the first one on where they are not listed."""
    k = first + wp.tid()
    identity[row_at(k, first_row, row)] = row_at(k, first_given, given)


@wp.kernel
def mark_gone(
    first: int,
    row_of: wp.array(dtype=wp.int32),
    # outputs
    marked: wp.array(dtype=wp.int32),
):
    """Mark bodies that have no row any more."""
    i = first + wp.tid()
    marked[i] = int(row_of[i] < 0)


@wp.kernel
def mark_outside(
    first: int,
    pose: wp.array(dtype=wp.vec4),
    support: wp.array(dtype=wp.int32),
    flags: wp.array(dtype=wp.int32),
    images: Images,
    size: wp.vec2,
    # outputs
    marked: wp.array(dtype=wp.int32),
):
    """Mark bodies, other than those that are pinned, that are where they may not be."""
    i = first + wp.tid()
    marked[i] = 0
    if (flags[i] & PINNED) == 0:
        marked[i] = int(not in_support(place_of(pose[i]), support[i], images, size))
