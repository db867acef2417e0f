"""Kernels that let heat spread over a mesh."""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})

# Of a vertex of triangles without an area.
SMALLEST_MASS = wp.constant(wp.float64(1.0e-300))
# Products of weights at the vertices across the sides of a small triangle: of even ones their determinant is 4, and these vertices get
# an eighth of a charge at most.
LEAST_PRODUCTS = wp.constant(wp.float64(1.0e-3))
MOST_ACROSS = wp.constant(wp.float64(0.5))


@wp.struct
class Cut:
    """How a surface is cut: every triangle into small ones of its shape, whose corners are vertices.

    Number of parts of a side; for every triangle the numbers of its vertices, in rows of ``places``; and the places in such a row of
    the corners of its ``small`` small triangles, three for each.
    """

    cuts: wp.int32
    places: wp.int32
    small: wp.int32
    vertex: wp.array(dtype=wp.int32)
    pattern: wp.array(dtype=wp.int32)


@wp.struct
class Stiffness:
    """The cotangent Laplacian of small triangles.

    Half the cotangents at the corners of the large ones, and a third of a small one's area; and the corners of the small ones in the
    order of the vertices that they are, those of a vertex from ``start`` on.
    """

    cotangent: wp.array(dtype=wp.vec3d)
    area: wp.array(dtype=wp.float64)
    order: wp.array(dtype=wp.int32)
    start: wp.array(dtype=wp.int32)


@wp.struct
class Sides:
    """Sides of triangles, opposite of each corner, three for each triangle: the vertices at both ends, and a number for both."""

    start: wp.array(dtype=wp.int32)
    end: wp.array(dtype=wp.int32)
    number: wp.array(dtype=wp.int32)


@wp.kernel
def number_vertices(
    first: int,
    steps: wp.array(dtype=wp.vec3i),
    sides: Sides,
    corner_count: int,
    side_count: int,
    inner: wp.array(dtype=wp.int32),
    inner_count: int,
    # outputs
    vertex: wp.array(dtype=wp.int32),
):
    """Number the vertices of triangles that are cut; those on shared corners and sides are one.

    ``steps`` are weights of a triangle's corners at every place, whole numbers of the same sum; ``inner`` numbers the places that lie
    on no side. Corners come first, then what is on sides, then what is inside.
    """
    i = first + wp.tid()
    places = steps.shape[0]
    triangle = i / places
    place = i - triangle * places
    step = steps[place]
    cuts = step[0] + step[1] + step[2]
    number = corner_count + side_count * (cuts - 1) + triangle * inner_count + inner[place]
    for k in range(3):
        side = 3 * triangle + k
        ahead = step[(k + 1) % 3]
        behind = step[(k + 2) % 3]
        if step[k] == cuts:
            # What begins the side opposite of the next but one corner.
            number = sides.start[3 * triangle + (k + 2) % 3]
        elif step[k] == 0 and ahead > 0 and behind > 0:
            # Along it from the end with the smaller number, so that the triangles beside it agree.
            along = wp.where(sides.start[side] < sides.end[side], behind, ahead)
            number = corner_count + sides.number[side] * (cuts - 1) + along - 1
            # A side whose ends are one is a point.
            if sides.start[side] == sides.end[side]:
                number = sides.start[side]
    vertex[i] = number


@wp.func
def vertex_at(corner: int, cut: Cut):
    """Vertex that a corner of a small triangle is; the corners are counted through all of them."""
    triangle = corner / (3 * cut.small)
    return cut.vertex[triangle * cut.places + cut.pattern[corner - triangle * 3 * cut.small]]


@wp.kernel
def find_vertices(
    first: int,
    cut: Cut,
    # outputs
    key: wp.array(dtype=wp.int32),
    order: wp.array(dtype=wp.int32),
):
    """Sort the corners of all small triangles by the vertices that they are."""
    i = first + wp.tid()
    key[i] = vertex_at(i, cut)
    order[i] = i


@wp.kernel
def sum_at_vertices(
    first: int,
    cut: Cut,
    stiffness: Stiffness,
    # outputs
    area: wp.array(dtype=wp.float64),
    root: wp.array(dtype=wp.float64),
    rate: wp.array(dtype=wp.float64),
):
    """Area that every vertex stands for, which is its mass, the root of that, and how fast heat leaves it at most."""
    i = first + wp.tid()
    total = wp.float64(0.0)
    leaves = wp.float64(0.0)
    for s in range(stiffness.start[i], stiffness.start[i + 1]):
        k = stiffness.order[s] % 3
        triangle = stiffness.order[s] / 3 / cut.small
        total += stiffness.area[triangle]
        for step in range(2):
            leaves += wp.abs(stiffness.cotangent[triangle][(k + 1 + step) % 3])
    mass = wp.max(total, SMALLEST_MASS)
    area[i] = total
    root[i] = wp.sqrt(mass)
    rate[i] = leaves / mass


@wp.func
def limited(
    triangle: int, begin: int, cut: Cut, stiffness: Stiffness, root: wp.array(dtype=wp.float64), fastest: wp.float64
):
    """Half the cotangents at the corners ``begin`` to ``begin + 2`` of a small triangle, none above what its sides may have."""
    half = stiffness.cotangent[triangle]
    for k in range(3):
        lighter = wp.min(root[vertex_at(begin + (k + 1) % 3, cut)], root[vertex_at(begin + (k + 2) % 3, cut)])
        half[k] = wp.min(half[k], fastest * lighter * lighter)
    for k in range(3):
        if half[k] < wp.float64(0.0):
            # An obtuse angle takes back some of the other two: no more than there is.
            one = half[(k + 1) % 3]
            other = half[(k + 2) % 3]
            half[k] = wp.max(half[k], -one * other / (one + other))
    return half


@wp.kernel
def fill_operator(
    first: int,
    cut: Cut,
    stiffness: Stiffness,
    root: wp.array(dtype=wp.float64),
    fastest: wp.float64,
    # outputs
    column: wp.array(dtype=wp.int32),
    value: wp.array(dtype=float),
    diagonal: wp.array(dtype=float),
    bound: wp.array(dtype=wp.float64),
):
    """The Laplacian over the roots of both masses, and what no row of it exceeds.

    Beside the diagonal there are two entries for every corner, those of a vertex side by side. Across no side heat spreads faster than
    ``fastest`` allows: with the masses as they are it still ends where it ought to.
    """
    i = first + wp.tid()
    own = wp.float64(0.0)
    others = wp.float64(0.0)
    for s in range(stiffness.start[i], stiffness.start[i + 1]):
        corner = stiffness.order[s]
        k = corner % 3
        halves = limited(corner / 3 / cut.small, corner - k, cut, stiffness, root, fastest)
        for step in range(2):
            # The angle that counts for a side lies opposite of it.
            other = vertex_at(corner - k + (k + 1 + step) % 3, cut)
            half = halves[(k + 2 - step) % 3]
            own += half
            others += wp.abs(half)
            column[2 * s + step] = other
            value[2 * s + step] = wp.float32(-half / (root[i] * root[other]))
    diagonal[i] = wp.float32(own / (root[i] * root[i]))
    bound[i] = (own + others) / (root[i] * root[i])


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


@wp.func
def beside(corner: int, cut: Cut, stiffness: Stiffness):
    """Corner of the small triangle across the side opposite of a corner that is not on it; -1: there is none, or several."""
    k = corner % 3
    begin = corner - k
    one = vertex_at(begin + (k + 1) % 3, cut)
    other = vertex_at(begin + (k + 2) % 3, cut)
    found = int(-1)
    count = int(0)
    for s in range(stiffness.start[one], stiffness.start[one + 1]):
        at = stiffness.order[s]
        m = at % 3
        if at - m != begin:
            for step in range(2):
                if vertex_at(at - m + (m + 1 + step) % 3, cut) == other:
                    found = at - m + (m + 2 - step) % 3
                    count += 1
    return wp.where(count == 1, found, -1)


@wp.func
def ahead_of(corner: int, start: int, cut: Cut, stiffness: Stiffness):
    """How far along the side opposite of it a corner lies: 0 beside a vertex that the side starts at, 1 beside its end."""
    k = corner % 3
    half = stiffness.cotangent[corner / 3 / cut.small]
    one = (k + 1) % 3
    if vertex_at(corner - k + one, cut) != start:
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
def around(begin: int, cut: Cut, stiffness: Stiffness):
    """Find what is around the small triangle whose corners begin at a number.

    The triangles beside it are laid flat into its plane. Where there is none the surface goes on as in a mirror, as it does for heat.
    """
    found = Around()
    area = stiffness.area[begin / 3 / cut.small]
    product = wp.mat33d()
    for k in range(3):
        corner = begin + k
        start = vertex_at(begin + (k + 1) % 3, cut)
        along = ahead_of(corner, start, cut, stiffness)
        far = wp.float64(1.0)
        along_beside = along
        vertex = vertex_at(corner, cut)
        other = beside(corner, cut, stiffness)
        if other >= 0:
            far = stiffness.area[other / 3 / cut.small] / area
            along_beside = ahead_of(other, start, cut, stiffness)
            vertex = vertex_at(other, cut)
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
    stiffness: Stiffness,
    # outputs
    vertex: wp.array(dtype=wp.int32),
    amount: wp.array(dtype=wp.float64),
):
    """As :func:`share_out`, with the vertices across the three sides, so that charges are spread as widely wherever they lie."""
    b = first + wp.tid()
    at = in_small_triangle(triangle[b], barycentric[b], cut)
    near = around(at.begin, cut, stiffness)
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
    stiffness: Stiffness,
    # outputs
    vertex: wp.array(dtype=wp.int32),
    amount: wp.array(dtype=wp.float64),
):
    """Share out the area of every small triangle as :func:`share_out_evenly` does what is spread over it."""
    i = first + wp.tid()
    near = around(3 * i, cut, stiffness)
    third = stiffness.area[i / cut.small]
    one = wp.float64(1.0)
    # The mean of a product of two weights is a twelfth.
    share = share_across(wp.vec3d(one / wp.float64(12.0)), near)
    left = wp.vec3d(one / wp.float64(3.0)) - share @ near.place
    for k in range(3):
        vertex[6 * i + k] = vertex_at(3 * i + k, cut)
        vertex[6 * i + 3 + k] = near.vertex[k]
        amount[6 * i + k] = wp.float64(3.0) * third * left[k]
        amount[6 * i + 3 + k] = wp.float64(3.0) * third * share[k]


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


@wp.kernel
def add_times(
    first: int,
    values: wp.array(dtype=wp.float64),
    factor: wp.float64,
    # outputs
    total: wp.array(dtype=wp.float64),
):
    """Add so many times some numbers to others."""
    i = first + wp.tid()
    total[i] = total[i] + factor * values[i]


@wp.kernel
def begin_spread(
    first: int,
    charge: wp.array(dtype=wp.float64),
    total: wp.float64,
    target: wp.array(dtype=wp.float64),
    root: wp.array(dtype=wp.float64),
    coefficient: wp.float64,
    # outputs
    now: wp.array(dtype=float),
    result: wp.array(dtype=float),
):
    """Charges over their total, less the target, over the roots of the masses; and the first term of what becomes of it."""
    i = first + wp.tid()
    start = (charge[i] / total - target[i]) / root[i]
    now[i] = wp.float32(start)
    result[i] = wp.float32(coefficient * start)


@wp.kernel
def halve(
    first: int,
    # outputs
    values: wp.array(dtype=float),
):
    i = first + wp.tid()
    values[i] = 0.5 * values[i]


@wp.kernel
def chebyshev_step(
    first: int,
    start: wp.array(dtype=wp.int32),
    column: wp.array(dtype=wp.int32),
    value: wp.array(dtype=float),
    diagonal: wp.array(dtype=float),
    scale: float,
    now: wp.array(dtype=float),
    factor: float,
    # outputs
    before: wp.array(dtype=float),
    result: wp.array(dtype=float),
):
    """The next Chebyshev polynomial of a sparse operator, in the place of the one before the last; add it to the result.

    ``start`` counts pairs of entries.
    """
    i = first + wp.tid()
    total = diagonal[i] * now[i]
    for k in range(2 * start[i], 2 * start[i + 1]):
        total += value[k] * now[column[k]]
    # T_{k+1} = 2 (1 - scale A) T_k - T_{k-1}
    new = 2.0 * (now[i] - scale * total) - before[i]
    before[i] = new
    result[i] = result[i] + factor * new


@wp.kernel
def read(
    first: int,
    vertex: wp.array(dtype=wp.int32),
    amount: wp.array(dtype=wp.float64),
    smooth: wp.array(dtype=float),
    root: wp.array(dtype=wp.float64),
    factor: wp.float64,
    # outputs
    value: wp.array(dtype=float),
):
    """What is at points of what has spread, as a density, times a factor."""
    i = first + wp.tid()
    total = wp.float64(0.0)
    for k in range(3 * i, 3 * i + 3):
        v = vertex[k]
        total += amount[k] * wp.float64(smooth[v]) / root[v]
    value[i] = float(factor * total)
