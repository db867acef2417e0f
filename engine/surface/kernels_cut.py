"""Kernels that cut the triangles of a surface into facets, put these in order and describe them, in double precision."""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})

ZERO = wp.constant(wp.float64(0.0))
HALF = wp.constant(wp.float64(0.5))
# No side counts as shorter.
TINY = wp.constant(wp.float64(1.0e-30))
# Strips of a needle are so many times as long as its shortest side, if they may be; and there are so many at once at most.
STRIP = wp.constant(wp.float64(2.0))
MOST_STRIPS = wp.constant(1 << 20)
# What is slender, so many times as long as it may be, and of which the shortest side is so many times its height is cut at its height.
LEAN = wp.constant(wp.float64(2.0))
LONG = wp.constant(wp.float64(8.0))
# Bits of the Hilbert curve along which facets are in order, per axis; the highest of them, and the cells that they number.
CURVE_BITS = wp.constant(16)
HIGHEST_BIT = wp.constant(1 << 15)
CURVE_CELLS = wp.constant(wp.float64(1 << 16))


@wp.struct
class Pieces:
    """Parts of triangles: their corners, in units, and the weights of the triangle's corners there, three of each; the triangles."""

    corner: wp.array(dtype=wp.vec3d)
    weight: wp.array(dtype=wp.vec3d)
    triangle: wp.array(dtype=wp.int32)


@wp.struct
class Triangles:
    """Of every triangle of a surface: its normal, where the smooth surface looks to at its corners, three for each, and sides.

    Bit k of these is the side opposite of corner k: whether the surface ends there, whether it ends or has a crease there, and whether
    it ends or bends so much there that forces change fast beside it.
    """

    normal: wp.array(dtype=wp.vec3d)
    corner_normal: wp.array(dtype=wp.vec3d)
    open_sides: wp.array(dtype=wp.int32)
    edge_sides: wp.array(dtype=wp.int32)
    bent_sides: wp.array(dtype=wp.int32)


@wp.struct
class Described:
    """The same of facets, and their areas and longest sides."""

    normal: wp.array(dtype=wp.vec3d)
    corner_normal: wp.array(dtype=wp.vec3d)
    open_sides: wp.array(dtype=wp.int32)
    edge_sides: wp.array(dtype=wp.int32)
    bent_sides: wp.array(dtype=wp.int32)
    area: wp.array(dtype=wp.float64)
    longest: wp.array(dtype=wp.float64)


@wp.func
def side_lengths(i: int, pieces: Pieces):
    """Lengths of the sides opposite of each corner."""
    a = pieces.corner[3 * i]
    b = pieces.corner[3 * i + 1]
    c = pieces.corner[3 * i + 2]
    return wp.vec3d(wp.length(c - b), wp.length(a - c), wp.length(b - a))


@wp.func
def area_of(i: int, pieces: Pieces):
    a = pieces.corner[3 * i]
    return HALF * wp.length(wp.cross(pieces.corner[3 * i + 1] - a, pieces.corner[3 * i + 2] - a))


@wp.func
def height_of(i: int, longest: wp.float64, pieces: Pieces):
    """Height above the longest side."""
    return wp.float64(2.0) * area_of(i, pieces) / wp.max(longest, TINY)


@wp.func
def middle_of(i: int, pieces: Pieces):
    return (pieces.corner[3 * i] + pieces.corner[3 * i + 1] + pieces.corner[3 * i + 2]) / wp.float64(3.0)


@wp.func
def between(rows: wp.mat33d, k: int, share: wp.float64):
    """What lies so far on the way from the first row to another; the ends are exact."""
    return (wp.float64(1.0) - share) * rows[0] + share * rows[k]


@wp.kernel
def take_triangles(
    first: int,
    vertex: wp.array(dtype=wp.vec3d),
    triangle: wp.array(dtype=wp.int32),
    middle: wp.vec3d,
    unit: wp.float64,
    # outputs
    pieces: Pieces,
):
    """Whole triangles, from a middle [m], in units; ``triangle`` has the numbers of three vertices [m] for each."""
    i = first + wp.tid()
    for k in range(3):
        pieces.corner[3 * i + k] = (vertex[triangle[3 * i + k]] - middle) / unit
        weight = wp.vec3d(ZERO, ZERO, ZERO)
        weight[k] = wp.float64(1.0)
        pieces.weight[3 * i + k] = weight
    pieces.triangle[i] = i


@wp.func
def leans(longest: wp.float64, shortest: wp.float64, height: wp.float64, longest_slender: wp.float64):
    """Whether strips along a long, slender triangle would be needles themselves: its shortest side leads along it."""
    return shortest > LEAN * height and longest > LONG * longest_slender


@wp.func
def strips_of(
    length: wp.vec3d,
    height: wp.float64,
    longest_facet: wp.float64,
    longest_slender: wp.float64,
    most_slender: wp.float64,
):
    """Strips that a needle is cut into, along its two long sides: a power of two, so that those of neighbors end alike."""
    shortest = wp.min(length)
    longest = wp.max(length)
    if longest <= most_slender * shortest or shortest > LEAN * height or shortest > HALF * longest_facet:
        return 1
    # So that what comes out need not be cut once more: the diagonal of a strip is longer than the strip.
    aim = wp.max(longest_slender - shortest, wp.min(STRIP * shortest, HALF * longest_facet))
    strips = int(1)
    while strips < MOST_STRIPS and longest > aim * wp.float64(strips):
        strips = 2 * strips
    return strips


@wp.kernel
def count_cuts(
    first: int,
    pieces: Pieces,
    longest_facet: wp.float64,
    longest_slender: wp.float64,
    most_slender: wp.float64,
    # outputs
    is_cut: wp.array(dtype=wp.int32),
    parts: wp.array(dtype=wp.int32),
):
    """Tell which are longer than a facet may be, or slender, by the side over the height, and longer than that may be.

    These are cut into so many parts: needles into strips of two triangles each, but for the one at the tip; others in two.
    """
    i = first + wp.tid()
    length = side_lengths(i, pieces)
    longest = wp.max(length)
    height = height_of(i, longest, pieces)
    is_cut[i] = int(longest > longest_facet or (longest > longest_slender and longest > most_slender * height))
    parts[i] = 0
    if is_cut[i] != 0:
        strips = strips_of(length, height, longest_facet, longest_slender, most_slender)
        parts[i] = wp.max(2 * strips - 1, 2)


@wp.func
def put_piece(to: int, triangle: int, corner: wp.mat33d, weight: wp.mat33d, pieces: Pieces):
    """Write a piece by the rows of matrices."""
    for k in range(3):
        pieces.corner[3 * to + k] = corner[k]
        pieces.weight[3 * to + k] = weight[k]
    pieces.triangle[to] = triangle


@wp.func
def put_strips(to: int, strips: int, triangle: int, corner: wp.mat33d, weight: wp.mat33d, pieces: Pieces):
    """Write the triangles of so many strips of a triangle, beginning at its first corner."""
    for j in range(strips):
        near = wp.float64(j) / wp.float64(strips)
        far = wp.float64(j + 1) / wp.float64(strips)
        # Where both sides are cut, from the first corner on.
        one = between(corner, 1, near)
        other = between(corner, 2, near)
        next_one = between(corner, 1, far)
        next_other = between(corner, 2, far)
        of_one = between(weight, 1, near)
        of_other = between(weight, 2, near)
        of_next_one = between(weight, 1, far)
        of_next_other = between(weight, 2, far)
        own = wp.matrix_from_rows(one, next_one, next_other)
        put_piece(to + 2 * j, triangle, own, wp.matrix_from_rows(of_one, of_next_one, of_next_other), pieces)
        if j > 0:
            own = wp.matrix_from_rows(one, next_other, other)
            put_piece(to + 2 * j - 1, triangle, own, wp.matrix_from_rows(of_one, of_next_other, of_other), pieces)


@wp.kernel
def cut(
    first: int,
    pieces: Pieces,
    is_cut: wp.array(dtype=wp.int32),
    cuts_before: wp.array(dtype=wp.int32),
    parts: wp.array(dtype=wp.int32),
    start: wp.array(dtype=wp.int32),
    longest_slender: wp.float64,
    # outputs
    smaller: Pieces,
    done: Pieces,
):
    """Cut what is to be cut: in two across its longest side, or, of more parts, into strips along its two longest. Others are done.

    Of what leans both parts are at a right angle to the longest side, and so no longer do.
    """
    i = first + wp.tid()
    length = side_lengths(i, pieces)
    # The corner that the longest side lies opposite of comes first; of a needle the one of the shortest.
    k = int(0)
    for side in range(3):
        if parts[i] == 2 and length[side] > length[k]:
            k = side
        if parts[i] > 2 and length[side] < length[k]:
            k = side
    triangle = pieces.triangle[i]
    corner = wp.matrix_from_rows(
        pieces.corner[3 * i + k], pieces.corner[3 * i + (k + 1) % 3], pieces.corner[3 * i + (k + 2) % 3]
    )
    weight = wp.matrix_from_rows(
        pieces.weight[3 * i + k], pieces.weight[3 * i + (k + 1) % 3], pieces.weight[3 * i + (k + 2) % 3]
    )
    if is_cut[i] == 0:
        put_piece(i - cuts_before[i], triangle, corner, weight, done)
    elif parts[i] == 2:
        share = HALF
        longest = wp.max(length)
        if leans(longest, wp.min(length), height_of(i, longest, pieces), longest_slender):
            share = wp.dot(corner[0] - corner[1], corner[2] - corner[1]) / (longest * longest)
        middle = (wp.float64(1.0) - share) * corner[1] + share * corner[2]
        there = (wp.float64(1.0) - share) * weight[1] + share * weight[2]
        one = wp.matrix_from_rows(corner[0], corner[1], middle)
        other = wp.matrix_from_rows(corner[0], middle, corner[2])
        put_piece(start[i], triangle, one, wp.matrix_from_rows(weight[0], weight[1], there), smaller)
        put_piece(start[i] + 1, triangle, other, wp.matrix_from_rows(weight[0], there, weight[2]), smaller)
    else:
        put_strips(start[i], (parts[i] + 1) / 2, triangle, corner, weight, smaller)


@wp.kernel
def find_bounds(
    first: int,
    pieces: Pieces,
    block: int,
    # outputs
    low: wp.array(dtype=wp.vec3d),
    high: wp.array(dtype=wp.vec3d),
):
    """Smallest and largest coordinates of the middles of the pieces of every block."""
    b = first + wp.tid()
    least = middle_of(b * block, pieces)
    most = least
    for i in range(b * block + 1, wp.min((b + 1) * block, pieces.triangle.shape[0])):
        middle = middle_of(i, pieces)
        least = wp.min(least, middle)
        most = wp.max(most, middle)
    low[b] = least
    high[b] = most


@wp.func
def place_on_curve(cell: wp.vec3i):
    """Place along a Hilbert curve of a cell (J. Skilling, Programming the Hilbert curve, 2004)."""
    axes = wp.vec3i(cell[0], cell[1], cell[2])
    bit = int(HIGHEST_BIT)
    while bit > 1:
        mask = bit - 1
        for k in range(3):
            if (axes[k] & bit) != 0:
                axes[0] = axes[0] ^ mask
            else:
                swap = (axes[0] ^ axes[k]) & mask
                axes[0] = axes[0] ^ swap
                axes[k] = axes[k] ^ swap
        bit = bit >> 1
    axes[1] = axes[1] ^ axes[0]
    axes[2] = axes[2] ^ axes[1]
    flip = int(0)
    bit = int(HIGHEST_BIT)
    while bit > 1:
        if (axes[2] & bit) != 0:
            flip = flip ^ (bit - 1)
        bit = bit >> 1
    place = wp.int64(0)
    for s in range(CURVE_BITS):
        shift = CURVE_BITS - 1 - s
        for k in range(3):
            place = (place << wp.int64(1)) | wp.int64(((axes[k] ^ flip) >> shift) & 1)
    return place


@wp.kernel
def find_places(
    first: int,
    pieces: Pieces,
    triangles: Triangles,
    low: wp.vec3d,
    extent: wp.float64,
    # outputs
    place: wp.array(dtype=wp.int64),
):
    """Places along a Hilbert curve, one for each of six directions that facets look to, one curve behind the other."""
    i = first + wp.tid()
    along = (middle_of(i, pieces) - low) / extent * CURVE_CELLS
    last = 2 * HIGHEST_BIT - 1
    cell = wp.vec3i(wp.min(int(along[0]), last), wp.min(int(along[1]), last), wp.min(int(along[2]), last))
    normal = triangles.normal[pieces.triangle[i]]
    axis = int(0)
    if wp.abs(normal[1]) > wp.abs(normal[axis]):
        axis = 1
    if wp.abs(normal[2]) > wp.abs(normal[axis]):
        axis = 2
    sheet = 2 * axis + int(normal[axis] > ZERO)
    place[i] = (wp.int64(sheet) << wp.int64(3 * CURVE_BITS)) | place_on_curve(cell)


@wp.func
def sides_on(i: int, pieces: Pieces, of_triangle: int):
    """Sides that lie on one of some sides of their triangle: both their ends have no weight of the corner opposite of it."""
    found = int(0)
    for k in range(3):
        one = pieces.weight[3 * i + (k + 1) % 3]
        other = pieces.weight[3 * i + (k + 2) % 3]
        for c in range(3):
            if (of_triangle & (1 << c)) != 0 and one[c] == ZERO and other[c] == ZERO:
                found = found | (1 << k)
    return found


@wp.kernel
def describe(
    first: int,
    order: wp.array(dtype=wp.int32),
    pieces: Pieces,
    triangles: Triangles,
    # outputs
    facets: Pieces,
    described: Described,
):
    """Bring pieces into their order, and say of each what its triangle and its corners say."""
    f = first + wp.tid()
    i = order[f]
    own = pieces.triangle[i]
    for k in range(3):
        weight = pieces.weight[3 * i + k]
        facets.corner[3 * f + k] = pieces.corner[3 * i + k]
        facets.weight[3 * f + k] = weight
        smooth = weight[0] * triangles.corner_normal[3 * own]
        smooth += weight[1] * triangles.corner_normal[3 * own + 1]
        smooth += weight[2] * triangles.corner_normal[3 * own + 2]
        described.corner_normal[3 * f + k] = wp.normalize(smooth)
    facets.triangle[f] = own
    described.normal[f] = triangles.normal[own]
    described.open_sides[f] = sides_on(i, pieces, triangles.open_sides[own])
    described.edge_sides[f] = sides_on(i, pieces, triangles.edge_sides[own])
    described.bent_sides[f] = sides_on(i, pieces, triangles.bent_sides[own])
    described.area[f] = area_of(i, pieces)
    described.longest[f] = wp.max(side_lengths(i, pieces))


@wp.kernel
def find_turns(
    first: int,
    corner: wp.array(dtype=wp.vec3d),
    corner_normal: wp.array(dtype=wp.vec3d),
    most: wp.float64,
    # outputs
    turn: wp.array(dtype=wp.float64),
):
    """How much the smooth surface turns along a facet's sides at most, over their lengths [rad per unit], and no more than that."""
    f = first + wp.tid()
    steepest = ZERO
    for k in range(3):
        one = 3 * f + k
        other = 3 * f + (k + 1) % 3
        way = wp.max(wp.length(corner[one] - corner[other]), wp.float64(1.0e-6))
        steepest = wp.max(steepest, wp.length(corner_normal[one] - corner_normal[other]) / way)
    turn[f] = wp.min(steepest, most)


@wp.kernel
def to_single(
    first: int,
    values: wp.array(dtype=wp.vec3d),
    # outputs
    result: wp.array(dtype=wp.vec3),
):
    """The same in single precision."""
    i = first + wp.tid()
    result[i] = wp.vec3(values[i])
