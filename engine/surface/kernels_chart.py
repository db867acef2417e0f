"""Kernels of the chart: looking at a mesh from above, and reading normals and images at its points.

The mesh that rays are cast at is in float32, relative to its middle, where that is finest; what they find is worked out in float64.
"""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.func
def blend(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, weight: wp.vec3d) -> wp.vec3d:
    return a * weight[0] + b * weight[1] + c * weight[2]


@wp.func
def weights_at(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, x: wp.float64, y: wp.float64) -> wp.vec3d:
    """Weights of a triangle's corners at a position seen from above, clamped to within it."""
    area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    second = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / area
    third = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / area
    low, high = wp.float64(0.0), wp.float64(1.0)
    weight = wp.vec3d(
        wp.clamp(high - second - third, low, high), wp.clamp(second, low, high), wp.clamp(third, low, high)
    )
    return weight / (weight[0] + weight[1] + weight[2])


@wp.kernel(enable_backward=False)
def look_from_above(
    first: int,
    position: wp.array(dtype=wp.vec3d),
    triangle: wp.array(dtype=wp.vec3i),
    # outputs
    cosine: wp.array(dtype=wp.float64),
    projected_area: wp.array(dtype=wp.float64),
):
    """Find z of every triangle's unit normal, and its area seen from above; negative where it is seen from its back."""
    i = first + wp.tid()
    corner = triangle[i]
    a = position[corner[0]]
    cross = wp.cross(position[corner[1]] - a, position[corner[2]] - a)
    cosine[i] = cross[2] / wp.max(wp.length(cross), wp.float64(1.0e-300))
    projected_area[i] = wp.float64(0.5) * cross[2]


@wp.kernel(enable_backward=False)
def cast_down(
    first: int,
    mesh: wp.uint64,
    mesh_triangle: wp.array(dtype=wp.int32),
    position: wp.array(dtype=wp.vec3d),
    triangle: wp.array(dtype=wp.vec3i),
    xy: wp.array(dtype=wp.vec2d),
    middle: wp.vec3d,
    above: float,
    # outputs
    hit_triangle: wp.array(dtype=wp.int32),
    hit_weight: wp.array(dtype=wp.vec3),
    hit_position: wp.array(dtype=wp.vec3d),
):
    """Find the topmost triangle at every position, or -1; the weights of its corners, and where the position lies on it."""
    i = first + wp.tid()
    x, y = xy[i][0], xy[i][1]
    origin = wp.vec3(wp.float32(x - middle[0]), wp.float32(y - middle[1]), above)
    hit = wp.mesh_query_ray(mesh, origin, wp.vec3(0.0, 0.0, -1.0), 4.0 * above)
    if not hit.result:
        hit_triangle[i] = -1
        return
    hit_triangle[i] = mesh_triangle[hit.face]
    corner = triangle[hit_triangle[i]]
    a, b, c = position[corner[0]], position[corner[1]], position[corner[2]]
    weight = weights_at(a, b, c, x, y)
    hit_weight[i] = wp.vec3(weight)
    hit_position[i] = blend(a, b, c, weight)


@wp.kernel(enable_backward=False)
def find_nearest(
    first: int,
    mesh: wp.uint64,
    mesh_triangle: wp.array(dtype=wp.int32),
    position: wp.array(dtype=wp.vec3d),
    triangle: wp.array(dtype=wp.vec3i),
    query: wp.array(dtype=wp.vec3d),
    middle: wp.vec3d,
    reach: float,
    # outputs
    near_triangle: wp.array(dtype=wp.int32),
    near_weight: wp.array(dtype=wp.vec3),
    near_position: wp.array(dtype=wp.vec3d),
):
    """Find the point of the mesh that is nearest to every query: its triangle, the weights of its corners, and where it is."""
    i = first + wp.tid()
    hit = wp.mesh_query_point_no_sign(mesh, wp.vec3(query[i] - middle), reach)
    near_triangle[i] = mesh_triangle[hit.face]
    corner = triangle[near_triangle[i]]
    # They must add up to 1 in float64: far from the world's origin, what float32 rounds off is millimeters.
    first_weight, second_weight = wp.float64(hit.u), wp.float64(hit.v)
    weight = wp.vec3d(first_weight, second_weight, wp.float64(1.0) - first_weight - second_weight)
    near_weight[i] = wp.vec3(weight)
    near_position[i] = blend(position[corner[0]], position[corner[1]], position[corner[2]], weight)


@wp.kernel(enable_backward=False)
def blend_normals(
    first: int,
    corner: wp.array(dtype=wp.vec3i),
    corner_normal: wp.array(dtype=wp.vec3),
    normal_matrix: wp.mat33,
    cosine: wp.array(dtype=wp.float64),
    triangle: wp.array(dtype=wp.int32),
    weight: wp.array(dtype=wp.vec3),
    # outputs
    normal: wp.array(dtype=wp.vec3),
):
    """Interpolate normals, which lie in the object's space, and turn them to the side that is seen: never down."""
    i = first + wp.tid()
    at, w = corner[triangle[i]], weight[i]
    own = corner_normal[at[0]] * w[0] + corner_normal[at[1]] * w[1] + corner_normal[at[2]] * w[2]
    turned = normal_matrix * own
    # The side that is seen is the upper one, whichever way the face was drawn or the object mirrored.
    if cosine[triangle[i]] < wp.float64(0.0):
        turned = -turned
    upward = wp.vec3(turned[0], turned[1], wp.max(turned[2], 0.0))
    # What is left of a normal that points down is rounding, and has no direction.
    normal[i] = wp.vec3(0.0, 0.0, 1.0)
    if wp.length(upward) > 1.0e-6 * wp.length(turned):
        normal[i] = wp.normalize(upward)


@wp.kernel(enable_backward=False)
def blend_values(
    first: int,
    corner: wp.array(dtype=wp.vec3i),
    triangle: wp.array(dtype=wp.int32),
    weight: wp.array(dtype=wp.vec3),
    values: wp.array2d(dtype=float),
    # outputs
    blended: wp.array2d(dtype=float),
):
    """Interpolate values, each row those of a vertex or a face corner, within triangles."""
    i = first + wp.tid()
    at, w = corner[triangle[i]], weight[i]
    for k in range(values.shape[1]):
        blended[i, k] = w[0] * values[at[0], k] + w[1] * values[at[1], k] + w[2] * values[at[2], k]


@wp.func
def repeated(x: wp.float64) -> wp.float64:
    """Coordinate in an image that repeats; 1 itself is the image's right or upper edge, not the start of its next copy."""
    if x >= wp.float64(0.0) and x <= wp.float64(1.0):
        return x
    return x - wp.floor(x)


@wp.kernel(enable_backward=False)
def interpolate_image(
    first: int,
    image: wp.array2d(dtype=float),
    coordinates: wp.array(dtype=wp.vec2d),
    repeat: bool,
    # outputs
    value: wp.array(dtype=float),
):
    """Interpolate an image at coordinates (0..1, y up); a black pixel stays black to its edge."""
    i = first + wp.tid()
    u, v = coordinates[i][0], coordinates[i][1]
    if repeat:
        u, v = repeated(u), repeated(v)
    height, width = image.shape[0], image.shape[1]
    x = u * wp.float64(width) - wp.float64(0.5)
    y = (wp.float64(1.0) - v) * wp.float64(height) - wp.float64(0.5)
    left, top = wp.floor(x), wp.floor(y)
    fx, fy = wp.float32(x - left), wp.float32(y - top)
    left_column, right_column = wp.clamp(int(left), 0, width - 1), wp.clamp(int(left) + 1, 0, width - 1)
    upper_row, lower_row = wp.clamp(int(top), 0, height - 1), wp.clamp(int(top) + 1, 0, height - 1)
    upper = image[upper_row, left_column] * (1.0 - fx) + image[upper_row, right_column] * fx
    lower = image[lower_row, left_column] * (1.0 - fx) + image[lower_row, right_column] * fx
    nearest = image[wp.where(fy < 0.5, upper_row, lower_row), wp.where(fx < 0.5, left_column, right_column)]
    value[i] = wp.where(nearest > 0.0, upper * (1.0 - fy) + lower * fy, 0.0)


@wp.func
def lattice_point(first: wp.int64, cuts: int, column: int, row: int):
    """Number of a point among those of all triangles: rows towards the third corner, each a point shorter than the one before."""
    return first + wp.int64(row * (cuts + 1) - row * (row - 1) / 2 + column)


@wp.func
def between_rows(
    values: wp.array(dtype=float), start: wp.int64, steps: int, across: int, corner: int, barycentric: wp.vec3d
):
    """What is between values in rows of a triangle, ``across`` steps each, the first of which is a corner."""
    one, zero = wp.float64(1.0), wp.float64(0.0)
    near, far = barycentric[(corner + 1) % 3], barycentric[(corner + 2) % 3]
    share = zero
    if near + far > zero:
        share = wp.clamp(far / (near + far), zero, one)
    up, along = (near + far) * wp.float64(steps), share * wp.float64(across)
    row = wp.clamp(int(wp.floor(up)), 0, steps - 1)
    column = wp.clamp(int(wp.floor(along)), 0, across - 1)
    u, v = along - wp.float64(column), wp.clamp(up - wp.float64(row), zero, one)
    here = start + wp.int64(row * (across + 1) + column)
    above = here + wp.int64(across + 1)
    low = (one - u) * wp.float64(values[here]) + u * wp.float64(values[here + wp.int64(1)])
    high = (one - u) * wp.float64(values[above]) + u * wp.float64(values[above + wp.int64(1)])
    return (one - v) * low + v * high


@wp.kernel(enable_backward=False)
def interpolate_lattice(
    first: int,
    values: wp.array(dtype=float),
    cuts: wp.array(dtype=wp.int64),
    across: wp.array(dtype=wp.int64),
    apex: wp.array(dtype=wp.int64),
    first_point: wp.array(dtype=wp.int64),
    triangle: wp.array(dtype=wp.int64),
    barycentric: wp.array(dtype=wp.vec3d),
    # outputs
    value: wp.array(dtype=wp.float64),
):
    """Interpolate values that are known at evenly spaced points of every triangle, see :mod:`.lattices`."""
    i = first + wp.tid()
    start, steps = first_point[triangle[i]], int(cuts[triangle[i]])
    if across[triangle[i]] > wp.int64(0):
        corner = int(apex[triangle[i]])
        value[i] = between_rows(values, start, steps, int(across[triangle[i]]), corner, barycentric[i])
        return
    one, zero = wp.float64(1.0), wp.float64(0.0)
    along, up = barycentric[i][1] * wp.float64(steps), barycentric[i][2] * wp.float64(steps)
    row = wp.clamp(int(wp.floor(up)), 0, steps - 1)
    column = wp.clamp(int(wp.floor(along)), 0, steps - 1 - row)
    u, v = along - wp.float64(column), up - wp.float64(row)
    b, c = values[lattice_point(start, steps, column + 1, row)], values[lattice_point(start, steps, column, row + 1)]
    a = float(0.0)
    if u + v > one and column + row < steps - 1:
        # In the triangle that stands on its tip.
        a = values[lattice_point(start, steps, column + 1, row + 1)]
        u, v = one - v, one - u
    else:
        a = values[lattice_point(start, steps, column, row)]
    u, v = wp.clamp(u, zero, one), wp.clamp(v, zero, one)
    value[i] = (one - u - v) * wp.float64(a) + u * wp.float64(b) + v * wp.float64(c)
