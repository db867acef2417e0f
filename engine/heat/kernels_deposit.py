"""Kernels that share charges out among the vertices of a mesh."""

from __future__ import annotations

import warp as wp

from .kernels_cut_mesh import Cut, Stiffness, vertex_at, vertex_within

wp.set_module_options({"enable_backward": False})

# Products of weights at the vertices across the sides of a small triangle: of even ones their determinant is 4, and these vertices get
# an eighth of a charge at most.
LEAST_PRODUCTS = wp.constant(wp.float64(1.0e-3))
MOST_ACROSS = wp.constant(wp.float64(0.5))


@wp.struct
class Across:
    """What lies across the sides of small triangles.

    For every corner of a small triangle the corner of the one across the side opposite of it that is not on that side; -1: there is no
    such triangle, or several. And of the large triangles half the cotangents at their corners, and a third of a small one's area.
    """

    corner: wp.array(dtype=wp.int32)
    cotangent: wp.array(dtype=wp.vec3d)
    area: wp.array(dtype=wp.float64)


@wp.struct
class InSmall:
    """Where a point lies: the first corner of the small triangle that it is in, and weights of the three."""

    begin: wp.int32
    weight: wp.vec3d


@wp.func
def in_small_triangle(triangle: int, weight: wp.vec3d, cut: Cut):
    """Find the small triangle of a point by its triangle and the weights of its corners."""
    cuts = cut.cuts
    x = weight[1] * wp.float64(cuts)
    y = weight[2] * wp.float64(cuts)
    j = wp.clamp(int(y), 0, cuts - 1)
    i = wp.clamp(int(x), 0, cuts - 1 - j)
    fx = x - wp.float64(i)
    fy = y - wp.float64(j)
    one = wp.float64(1.0)
    found = InSmall()
    found.weight = wp.vec3d(one - fx - fy, fx, fy)
    tile = j * (2 * cuts - j) + 2 * i
    if i < cuts - 1 - j and fx + fy > one:
        found.weight = wp.vec3d(fx + fy - one, one - fx, one - fy)
        tile += 1
    found.begin = 3 * (triangle * cut.small + tile)
    return found


@wp.kernel
def share_out(
    first: int,
    triangle: wp.array(dtype=wp.int32),
    barycentric: wp.array(dtype=wp.vec3d),
    charge: wp.array(dtype=wp.float64),
    cut: Cut,
    # outputs
    vertex: wp.array(dtype=wp.int32),
    amount: wp.array(dtype=wp.float64),
):
    """Vertices at the corners of the small triangle that every body lies in, and what each of them gets of its charge."""
    b = first + wp.tid()
    at = in_small_triangle(triangle[b], barycentric[b], cut)
    for k in range(3):
        vertex[3 * b + k] = vertex_at(at.begin + k, cut)
        amount[3 * b + k] = at.weight[k] * charge[b]


@wp.kernel
def find_ends(
    first: int,
    order: wp.array(dtype=wp.int32),
    cut: Cut,
    # outputs
    ahead: wp.array(dtype=wp.int32),
    behind: wp.array(dtype=wp.int32),
):
    """The other two vertices of the small triangles of all corners in ``order``: the one after it, and the one before it."""
    s = first + wp.tid()
    corner = order[s]
    k = corner % 3
    triangle = corner / (3 * cut.small)
    ahead[s] = vertex_within(corner - k + (k + 1) % 3, triangle, cut)
    behind[s] = vertex_within(corner - k + (k + 2) % 3, triangle, cut)


@wp.kernel
def find_across(
    first: int,
    start: wp.array(dtype=wp.int32),
    order: wp.array(dtype=wp.int32),
    ahead: wp.array(dtype=wp.int32),
    behind: wp.array(dtype=wp.int32),
    # outputs
    across: wp.array(dtype=wp.int32),
):
    """Corners across sides, see :class:`Across`, of all sides that begin at a vertex."""
    i = first + wp.tid()
    for s in range(start[i], start[i + 1]):
        k = order[s] % 3
        begin = order[s] - k
        end = ahead[s]
        found = int(-1)
        count = int(0)
        for t in range(start[i], start[i + 1]):
            # The side ends at the next corner there, and lies opposite of the last; or the other way round.
            is_ahead = ahead[t] == end
            m = order[t] % 3
            if (is_ahead or behind[t] == end) and order[t] - m != begin:
                found = order[t] - m + (m + 1 + int(is_ahead)) % 3
                # Twice where two corners of a triangle are one.
                count += 1 + int(ahead[t] == behind[t])
        across[begin + (k + 2) % 3] = wp.where(count == 1, found, -1)


@wp.func
def ahead_of(corner: int, triangle: int, start: int, cut: Cut, across: Across):
    """How far along the side opposite of it a corner lies: 0 beside a vertex that the side starts at, 1 beside its end."""
    k = corner % 3
    half = across.cotangent[triangle]
    one = (k + 1) % 3
    if vertex_within(corner - k + one, triangle, cut) != start:
        one = (k + 2) % 3
    # Twice the area is the height times the side, and the square of the side over the sum of its two cotangents.
    return half[one] / (half[(k + 1) % 3] + half[(k + 2) % 3])


@wp.func
def products(weight: wp.vec3d):
    """Products of weights at the ends of every side."""
    return wp.vec3d(weight[1] * weight[2], weight[2] * weight[0], weight[0] * weight[1])


@wp.struct
class Around:
    """The vertices across the sides of a small triangle.

    Weights of its corners at each, a row for one; and the inverse of the products of these, a row for a side. Beside slivers, where
    they tell nothing of how something curves, it is 0.
    """

    vertex: wp.vec3i
    place: wp.mat33d
    inverse: wp.mat33d


@wp.func
def around(begin: int, cut: Cut, across: Across):
    """Find what is around the small triangle whose corners begin at a number.

    The triangles beside it are laid flat into its plane. Where there is none the surface goes on as in a mirror, as it does for heat.
    """
    found = Around()
    triangle = begin / (3 * cut.small)
    product = wp.mat33d()
    for k in range(3):
        corner = begin + k
        start = vertex_within(begin + (k + 1) % 3, triangle, cut)
        along = ahead_of(corner, triangle, start, cut, across)
        far = wp.float64(1.0)
        along_beside = along
        vertex = vertex_within(corner, triangle, cut)
        other = across.corner[corner]
        if other >= 0:
            beside = other / (3 * cut.small)
            far = across.area[beside] / across.area[triangle]
            along_beside = ahead_of(other, beside, start, cut, across)
            vertex = vertex_within(other, beside, cut)
        place = wp.vec3d()
        place[k] = -far
        place[(k + 2) % 3] = along_beside + far * along
        place[(k + 1) % 3] = wp.float64(1.0) + far - place[(k + 2) % 3]
        found.vertex[k] = vertex
        found.place[k] = place
        product[k] = products(place)
    if wp.abs(wp.determinant(product)) > LEAST_PRODUCTS:
        found.inverse = wp.inverse(product)
    return found


@wp.func
def share_across(product: wp.vec3d, near: Around):
    """What the vertices across the sides get of a charge, by products of the weights where it lies.

    What is linear along a small triangle leaves out half of the sum over its sides of those products times how much something curves
    along the side. Its values at these vertices tell how much that is.
    """
    share = product @ near.inverse
    return wp.where(wp.max(wp.abs(share)) > MOST_ACROSS, wp.vec3d(), share)


@wp.kernel
def share_out_evenly(
    first: int,
    triangle: wp.array(dtype=wp.int32),
    barycentric: wp.array(dtype=wp.vec3d),
    charge: wp.array(dtype=wp.float64),
    cut: Cut,
    across: Across,
    # outputs
    vertex: wp.array(dtype=wp.int32),
    amount: wp.array(dtype=wp.float64),
):
    """As :func:`share_out`, with the vertices across the three sides, so that charges are spread as widely wherever they lie."""
    b = first + wp.tid()
    at = in_small_triangle(triangle[b], barycentric[b], cut)
    near = around(at.begin, cut, across)
    share = share_across(products(at.weight), near)
    left = at.weight - share @ near.place
    for k in range(3):
        vertex[6 * b + k] = vertex_at(at.begin + k, cut)
        vertex[6 * b + 3 + k] = near.vertex[k]
        amount[6 * b + k] = left[k] * charge[b]
        amount[6 * b + 3 + k] = share[k] * charge[b]


@wp.kernel
def share_out_area(
    first: int,
    cut: Cut,
    across: Across,
    whole: wp.float64,
    # outputs
    amount: wp.array(dtype=wp.float64),
):
    """Share out the area of every small triangle, over the ``whole``, as :func:`share_out_evenly` does what is spread over it.

    To the three corners, and to the vertices across the sides opposite of them.
    """
    i = first + wp.tid()
    near = around(3 * i, cut, across)
    one = wp.float64(1.0)
    # What is known of a small triangle is a third of its area.
    area = wp.float64(3.0) * across.area[i / cut.small] / whole
    # The mean of a product of two weights is a twelfth.
    share = share_across(wp.vec3d(one / wp.float64(12.0)), near)
    left = wp.vec3d(one / wp.float64(3.0)) - share @ near.place
    for k in range(3):
        amount[6 * i + k] = area * left[k]
        amount[6 * i + 3 + k] = area * share[k]


@wp.kernel
def add_areas(
    first: int,
    stiffness: Stiffness,
    across: Across,
    amount: wp.array(dtype=wp.float64),
    # outputs
    total: wp.array(dtype=wp.float64),
):
    """What every vertex gets of the areas around it, see :func:`share_out_area`, always added up in one order."""
    i = first + wp.tid()
    found = wp.float64(0.0)
    for s in range(stiffness.start[i], stiffness.start[i + 1]):
        corner = stiffness.order[s]
        # Across a side from a small triangle is whoever it is across from; beyond a border it is the corner itself.
        found += amount[corner / 3 * 6 + corner % 3]
        giver = across.corner[corner]
        if giver < 0:
            found += amount[corner / 3 * 6 + 3 + corner % 3]
        elif across.corner[giver] == corner:
            found += amount[giver / 3 * 6 + 3 + giver % 3]
    total[i] = found


@wp.kernel
def find_shares(
    first: int,
    vertex: wp.array(dtype=wp.int32),
    # outputs
    key: wp.array(dtype=wp.int32),
    order: wp.array(dtype=wp.int32),
):
    """Sort shares of charges by the vertices that get them."""
    i = first + wp.tid()
    key[i] = vertex[i]
    order[i] = i


@wp.kernel
def add_shares(
    first: int,
    start: wp.array(dtype=wp.int32),
    order: wp.array(dtype=wp.int32),
    amount: wp.array(dtype=wp.float64),
    # outputs
    total: wp.array(dtype=wp.float64),
):
    """What every vertex gets, always added up in one order."""
    i = first + wp.tid()
    found = wp.float64(0.0)
    for s in range(start[i], start[i + 1]):
        found += amount[order[s]]
    total[i] = found
