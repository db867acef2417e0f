"""Kernels of densities that are computed: noise, and the distance to shapes.

Noise is Perlin's (K. Perlin, "Improving noise", SIGGRAPH 2002, doi:10.1145/566654.566636), with directions that a hash chooses.
"""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})

# Every octave is turned against the one before it, and the first against the axes: the noise is 0 at the corners of its lattice, which
# flat ground must not lie along. A turn by about 0.9 about (1, 2, 3).
TURN = wp.constant(
    wp.mat33d(
        *(0.648638, -0.574003, 0.499789),
        *(0.682114, 0.729721, -0.047186),
        *(-0.337622, 0.371520, 0.864861),
    )
)
# What is a number's bits mixed: the "lowbias32" of C. Wellons' search for hashes of little bias (2018).
FIRST_FACTOR = wp.constant(wp.uint32(0x7FEB352D))
SECOND_FACTOR = wp.constant(wp.uint32(0x846CA68B))


@wp.func
def mixed(bits: wp.uint32) -> wp.uint32:
    """Mix the bits of a number."""
    x = bits ^ (bits >> wp.uint32(16))
    x = x * FIRST_FACTOR
    x = x ^ (x >> wp.uint32(15))
    x = x * SECOND_FACTOR
    return x ^ (x >> wp.uint32(16))


@wp.func
def slope_at(seed: wp.uint32, x: wp.int64, y: wp.int64, z: wp.int64, way: wp.vec3) -> float:
    """Height that the direction drawn for a corner of the lattice gives a point, which lies this way from it."""
    bits = mixed(mixed(mixed(seed ^ wp.uint32(x)) ^ wp.uint32(y)) ^ wp.uint32(z)) & wp.uint32(15)
    # The middles of a cube's 12 edges, four of them twice.
    along = wp.where(bits < wp.uint32(8), way[0], way[1])
    across = way[2]
    if bits < wp.uint32(4):
        across = way[1]
    if bits == wp.uint32(12) or bits == wp.uint32(14):
        across = way[0]
    along = wp.where((bits & wp.uint32(1)) == wp.uint32(0), along, -along)
    return along + wp.where((bits & wp.uint32(2)) == wp.uint32(0), across, -across)


@wp.func
def eased(t: float) -> float:
    return t * t * t * (t * (t * 6.0 - 15.0) + 10.0)


@wp.func
def gradient_noise(seed: wp.uint32, p: wp.vec3d) -> float:
    """Noise at a point of its lattice, between -1 and 1."""
    low = wp.vec3d(wp.floor(p[0]), wp.floor(p[1]), wp.floor(p[2]))
    x, y, z = wp.int64(low[0]), wp.int64(low[1]), wp.int64(low[2])
    way = wp.vec3(p - low)
    u, v, w = eased(way[0]), eased(way[1]), eased(way[2])
    total = float(0.0)
    for corner in range(8):
        i, j, k = corner & 1, (corner >> 1) & 1, corner >> 2
        from_corner = way - wp.vec3(float(i), float(j), float(k))
        height = slope_at(seed, x + wp.int64(i), y + wp.int64(j), z + wp.int64(k), from_corner)
        total += wp.where(i == 1, u, 1.0 - u) * wp.where(j == 1, v, 1.0 - v) * wp.where(k == 1, w, 1.0 - w) * height
    return total


@wp.kernel(enable_backward=False)
def sum_octaves(
    first: int,
    position: wp.array(dtype=wp.vec3d),
    frequency: wp.float64,
    octaves: int,
    seed: wp.uint32,
    # outputs
    height: wp.array(dtype=float),
):
    """Sum octaves of noise, each of half the size and half the height of the one before; divided by their mean square."""
    i = first + wp.tid()
    p = position[i] * frequency
    total, squares, amplitude = float(0.0), float(0.0), float(1.0)
    for octave in range(octaves):
        p = TURN * p
        total += amplitude * gradient_noise(mixed(seed + wp.uint32(octave)), p)
        squares += amplitude * amplitude
        amplitude *= 0.5
        p *= wp.float64(2.0)
    height[i] = total / wp.sqrt(squares)


@wp.kernel(enable_backward=False)
def measure_distance(
    first: int,
    mesh: wp.uint64,
    middle: wp.vec3d,
    from_above: int,
    position: wp.array(dtype=wp.vec3d),
    reach: float,
    # outputs
    distance: wp.array(dtype=float),
):
    """Measure how far points are from a mesh; ``reach`` where it is farther than that. Seen from above it lies in the plane."""
    i = first + wp.tid()
    query = wp.vec3(position[i] - middle)
    if from_above != 0:
        query = wp.vec3(query[0], query[1], 0.0)
    distance[i] = reach
    hit = wp.mesh_query_point_no_sign(mesh, query, reach)
    if hit.result:
        distance[i] = wp.min(reach, wp.length(query - wp.mesh_eval_position(mesh, hit.face, hit.u, hit.v)))


@wp.func
def with_side(span: wp.vec2d, y: wp.float64, a: wp.vec2d, b: wp.vec2d) -> wp.vec2d:
    """Widen a span of x, smallest and largest, by where a side from ``a`` to ``b`` is as high as y."""
    if (a[1] > y) == (b[1] > y):
        return span
    x = a[0] + (y - a[1]) * (b[0] - a[0]) / (b[1] - a[1])
    return wp.vec2d(wp.min(span[0], x), wp.max(span[1], x))


@wp.func
def with_edge(span: wp.vec2d, y: wp.float64, a: wp.vec2d, b: wp.vec2d, reach: wp.float64) -> wp.vec2d:
    """Widen a span of x by what is at y no farther than ``reach`` from an edge, without the disc around its end."""
    result = span
    up = y - a[1]
    if wp.abs(up) <= reach:
        across = wp.sqrt(reach * reach - up * up)
        result = wp.vec2d(wp.min(result[0], a[0] - across), wp.max(result[1], a[0] + across))
    length = wp.length(b - a)
    if length > wp.float64(0.0):
        beside = wp.vec2d(a[1] - b[1], b[0] - a[0]) * (reach / length)
        result = with_side(result, y, a + beside, b + beside)
        result = with_side(result, y, a - beside, b - beside)
        result = with_side(result, y, a - beside, a + beside)
        result = with_side(result, y, b - beside, b + beside)
    return result


@wp.kernel(enable_backward=False)
def draw_triangles(
    first: int,
    corner: wp.array2d(dtype=wp.float64),
    reach: wp.float64,
    cell: wp.vec2d,
    height: int,
    width: int,
    # outputs
    image: wp.array(dtype=wp.bool),
):
    """Set the cells, row 0 at the smallest y, whose middles are no farther than ``reach`` from a triangle: one span in every row."""
    i = first + wp.tid()
    a = wp.vec2d(corner[i, 0], corner[i, 1])
    b = wp.vec2d(corner[i, 2], corner[i, 3])
    c = wp.vec2d(corner[i, 4], corner[i, 5])
    half = wp.float64(0.5)
    none = wp.float64(0.0)
    low = (wp.min(a[1], wp.min(b[1], c[1])) - reach) / cell[1] - half
    high = (wp.max(a[1], wp.max(b[1], c[1])) + reach) / cell[1] - half
    begin = int(wp.ceil(wp.max(low, none)))
    end = int(wp.floor(wp.min(high, wp.float64(height - 1))))
    for row in range(begin, end + 1):
        y = (wp.float64(row) + half) * cell[1]
        span = wp.vec2d(wp.float64(wp.inf), wp.float64(-wp.inf))
        span = with_edge(span, y, a, b, reach)
        span = with_edge(span, y, b, c, reach)
        span = with_edge(span, y, c, a, reach)
        left = int(wp.ceil(wp.max(span[0] / cell[0] - half, none)))
        right = int(wp.floor(wp.min(span[1] / cell[0] - half, wp.float64(width - 1))))
        for column in range(left, right + 1):
            image[row * width + column] = True


@wp.kernel(enable_backward=False)
def count_crossings(
    first: int,
    segment: wp.array(dtype=wp.vec4d),
    band_start: wp.array(dtype=wp.int32),
    band_segment: wp.array(dtype=wp.int32),
    low: wp.float64,
    bands_per_length: wp.float64,
    position: wp.array(dtype=wp.vec3d),
    # outputs
    inside: wp.array(dtype=wp.bool),
):
    """Find whether points lie inside closed outlines, seen from above: a ray towards larger x crosses them an odd number of times.

    Segments are sorted by bands of y, so that every point looks only at those that it can cross.
    """
    i = first + wp.tid()
    x, y = position[i][0], position[i][1]
    inside[i] = False
    where = wp.floor((y - low) * bands_per_length)
    bands = band_start.shape[0] - 1
    if where < wp.float64(0.0) or where > wp.float64(bands):
        return
    band = wp.min(int(where), bands - 1)
    odd = int(0)
    for at in range(band_start[band], band_start[band + 1]):
        one = segment[band_segment[at]]
        if (one[1] > y) != (one[3] > y):
            if x < one[0] + (y - one[1]) * (one[2] - one[0]) / (one[3] - one[1]):
                odd = 1 - odd
    inside[i] = odd == 1
