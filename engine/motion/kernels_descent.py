"""What all kernels that move bodies in the plane know: the bodies, how far they step, and how they stay where they may be.

A body's pose is (x, y, angle, length of its axis); a dot has angle and length 0. The paper is Schmaltz, Gwosdek and Weickert 2012.
"""

from __future__ import annotations

from typing import Any

import warp as wp

from ..model.body_flags import BodyFlags
from ..space.kernels_images import Images, density_pixel, in_support
from ..space.kernels_mesh import Mesh
from ..space.kernels_space import Space, confine, overhang, wrapped

wp.set_module_options({"enable_backward": False})

PINNED = wp.constant(int(BodyFlags.PINNED))
# Times that a line is pushed back into the support before its move is given up. Measured on lines along the edges of bands: once
# leaves a coverage error 5 % larger, eight times change no digit.
PUSHES = wp.constant(3)
# Points at most that are looked at between two charges.
MOST_PIECES = wp.constant(64)


@wp.struct
class Bodies:
    """What bodies are: support, group, kind of line (-1: a dot) and :class:`~.body_flags.BodyFlags` of each, and its charges."""

    support: wp.array(dtype=wp.int32)
    group: wp.array(dtype=wp.int32)
    kind: wp.array(dtype=wp.int32)
    flags: wp.array(dtype=wp.int32)
    first_charge: wp.array(dtype=wp.int32)
    axial: wp.array(dtype=float)
    charge: wp.array(dtype=float)


@wp.struct
class Charges:
    """Positions of all charges, and the field at each."""

    position: wp.array(dtype=wp.vec2)
    field: wp.array(dtype=wp.vec2)


@wp.struct
class Steps:
    """How far the forces move bodies: inverse curvature at every node for every group, the limit at every node, and the mesh."""

    length: wp.array(dtype=float)
    limit: wp.array(dtype=float)
    mesh: Mesh


@wp.struct
class Motion:
    """Of every body: what the last step changed of its pose, the move that the forces ask for, and what that changed by."""

    displacement: wp.array(dtype=wp.vec4)
    move: wp.array(dtype=wp.vec4)
    change: wp.array(dtype=wp.vec4)


@wp.func
def charge_at(pose: wp.vec4, axial: float, bend: float):
    """Position of a charge at ``axial`` (-1..1) along a body's axis and ``bend`` beside it."""
    c = wp.cos(pose[2])
    s = wp.sin(pose[2])
    along = 0.5 * pose[3] * axial
    return wp.vec2(pose[0] + along * c - bend * s, pose[1] + along * s + bend * c)


@wp.func
def nearest_vector(
    position: wp.vec2, vectors: wp.array(dtype=wp.vec2), start: int, height: int, width: int, domain: wp.vec2
):
    """Image of vectors, interpolated bilinearly between the centers of its pixels."""
    u = wp.clamp(position[0] / domain[0] * float(width) - 0.5, 0.0, float(width - 1))
    v = wp.clamp((1.0 - position[1] / domain[1]) * float(height) - 0.5, 0.0, float(height - 1))
    left = wp.clamp(int(u), 0, width - 1)
    top = wp.clamp(int(v), 0, height - 1)
    right = wp.min(left + 1, width - 1)
    bottom = wp.min(top + 1, height - 1)
    fu = u - float(left)
    fv = v - float(top)
    upper = (1.0 - fu) * vectors[start + top * width + left] + fu * vectors[start + top * width + right]
    lower = (1.0 - fu) * vectors[start + bottom * width + left] + fu * vectors[start + bottom * width + right]
    return (1.0 - fv) * upper + fv * lower


@wp.func
def slide(old: wp.vec2, wanted: wp.vec2, k: int, images: Images, space: Space):
    """Where a dot ends that moves from ``old`` to ``wanted``: it stays in the support, and slides along its edge."""
    new = confine(wanted, space)
    if not in_support(new, k, images, space.size):
        along_x = confine(wp.vec2(wanted[0], old[1]), space)
        along_y = confine(wp.vec2(old[0], wanted[1]), space)
        new = old
        if in_support(along_x, k, images, space.size):
            new = along_x
        elif in_support(along_y, k, images, space.size):
            new = along_y
    return new


@wp.func
def vector_into_support(
    pose: wp.vec4,
    begin: int,
    end: int,
    bodies: Bodies,
    bend: wp.array(dtype=float),
    k: int,
    images: Images,
    space: Space,
):
    """(x, y, 1) by which a line must move so that the farthest of it outside is in the support; (0, 0, 0) if all of it is.

    Its charges count, and where there are obstacles what lies between them, too.
    """
    # How far charges reach over the edges of an open domain.
    low = wp.vec2(0.0, 0.0)
    high = wp.vec2(0.0, 0.0)
    farthest = wp.vec2(0.0, 0.0)
    away = float(0.0)
    outside = float(0.0)
    last = wp.vec2(0.0, 0.0)
    for j in range(begin, end):
        p = charge_at(pose, bodies.axial[j], bend[j])
        over = overhang(p, space)
        low = wp.max(low, wp.vec2(over[0], over[1]))
        high = wp.max(high, wp.vec2(over[2], over[3]))
        pieces = int(1)
        if images.step > 0.0 and j > begin:
            pieces = wp.clamp(int(wp.length(p - last) / images.step) + 1, 1, MOST_PIECES)
        for piece in range(1, pieces + 1):
            q = p
            if piece < pieces:
                q = last + (p - last) * (float(piece) / float(pieces))
            pixel = density_pixel(confine(q, space), k, images, space.size)
            if images.pixel[pixel] <= 0.0:
                outside = 1.0
                back = images.to_support[pixel]
                if wp.length_sq(back) > away:
                    away = wp.length_sq(back)
                    farthest = back
        last = p
    inwards = low - high
    if wp.length_sq(inwards) > 0.0:
        outside = 1.0
    return wp.vec3(farthest[0] + inwards[0], farthest[1] + inwards[1], outside)


@wp.func
def middle_confined(pose: wp.vec4, space: Space):
    """A pose whose middle is wrapped into a periodic space; an open one holds it by its charges."""
    middle = wrapped(wp.vec2(pose[0], pose[1]), space)
    return wp.vec4(middle[0], middle[1], pose[2], pose[3])


@wp.func
def confine_line(
    old: wp.vec4,
    wanted: wp.vec4,
    begin: int,
    end: int,
    bodies: Bodies,
    bend: wp.array(dtype=float),
    k: int,
    images: Images,
    space: Space,
):
    """Where a line ends that moves from ``old``, in the support, to ``wanted``: in the support again.

    Its middle stays inside a periodic space, too.
    """
    new = middle_confined(wanted, space)
    for _attempt in range(PUSHES):
        back = vector_into_support(new, begin, end, bodies, bend, k, images, space)
        if back[2] == 0.0:
            return new
        new = middle_confined(wp.vec4(new[0] + back[0], new[1] + back[1], new[2], new[3]), space)
    if vector_into_support(new, begin, end, bodies, bend, k, images, space)[2] == 0.0:
        return new
    # A shift without the turn, then a turn without the shift.
    new = middle_confined(wp.vec4(wanted[0], wanted[1], old[2], old[3]), space)
    if vector_into_support(new, begin, end, bodies, bend, k, images, space)[2] == 0.0:
        return new
    new = wp.vec4(old[0], old[1], wanted[2], wanted[3])
    if vector_into_support(new, begin, end, bodies, bend, k, images, space)[2] == 0.0:
        return new
    return old


@wp.func
def limited(move: Any, limit: float):
    """A move in the plane or in space, no longer than a limit."""
    length = wp.length(move)
    if length > limit:
        return move * (limit / length)
    return move


@wp.func
def squared_residual(squared_move: float, squared_displacement: float, limit: float, in_contact: int):
    """Squared move over squared spacing; what presses against others and does not get away has settled, too."""
    squared = squared_move
    if in_contact != 0:
        squared = wp.min(squared_move, squared_displacement)
    return squared / (4.0 * limit * limit)


@wp.func
def first_step(group: int, steps: Steps):
    """Index of a group's first step length."""
    return group * steps.mesh.count_x * steps.mesh.count_y


@wp.func
def move_of(i: int, direction: wp.array(dtype=float), motion: Motion):
    """How far body ``i`` goes in the direction that :func:`~.kernels_direction.decide_direction` found."""
    return direction[0] * motion.move[i] + direction[1] * motion.displacement[i] + direction[2] * motion.change[i]


@wp.kernel
def place_charges(
    first: int,
    pose: wp.array(dtype=wp.vec4),
    bodies: Bodies,
    bend: wp.array(dtype=float),
    space: Space,
    # outputs
    charge_position: wp.array(dtype=wp.vec2),
):
    i = first + wp.tid()
    for j in range(bodies.first_charge[i], bodies.first_charge[i + 1]):
        charge_position[j] = confine(charge_at(pose[i], bodies.axial[j], bend[j]), space)


@wp.kernel
def find_step_lengths(
    first: int,
    attraction: wp.array(dtype=float),
    node_count: int,
    inverse_node_area: float,
    least: wp.array(dtype=float),
    share: wp.array(dtype=float),
    # outputs
    step_length: wp.array(dtype=float),
):
    """Inverse of the energy's curvature, 2 pi times the attracting density, which counts as ``least`` of its group at least.

    It is multiplied by the ``share`` of the forces that counts at a node; an empty array says that they count wholly.
    """
    i = first + wp.tid()
    density = wp.max(attraction[i] * inverse_node_area, least[i / node_count])
    length = 1.0 / (2.0 * wp.pi * density)
    if share.shape[0] > 0:
        length = length * share[i]
    step_length[i] = length


@wp.kernel
def find_step_limits(
    first: int,
    number: wp.array(dtype=float),
    inverse_node_area: float,
    least: float,
    share: float,
    # outputs
    step_limit: wp.array(dtype=float),
):
    """A share of the spacing of bodies where so many are asked for."""
    i = first + wp.tid()
    step_limit[i] = share / wp.sqrt(wp.max(number[i] * inverse_node_area, least))
