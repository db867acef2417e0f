"""Kernels that number the vertices of triangles that are cut evenly."""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})


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
    return vertex_within(corner, corner / (3 * cut.small), cut)


@wp.func
def vertex_within(corner: int, triangle: int, cut: Cut):
    """The same of a corner within a triangle that is known, which spares a division."""
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
