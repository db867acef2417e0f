"""Native code that the cascade's kernels share: vectors of several neighbors, and pointers to their positions and normals."""

from __future__ import annotations

__all__ = ["LANES", "LANES_CODE", "NEIGHBOR_CODE", "PLANES_CODE"]

# These loops take most of a step's time, so they are native code. A CPU handles this many neighbors at once, which lie side by side in
# a run, a GPU one. Arrays are read beyond the end of a run; what is there does not count.
LANES = 8
# Types of such vectors, and functions that read them, compare, convert and sum.
LANES_CODE = f"""
#if defined(__CUDA_ARCH__)
    typedef float V;
    typedef int I;
    const int lanes = 1;
    const I lane = 0;
    auto load = [](const float* from) -> V {{ return from[0]; }};
    auto numbers = [](const int* from) -> I {{ return from[0]; }};
    auto get = [](const float* from, I at) -> V {{ return from[at]; }};
    auto sum = [](V v) -> float {{ return v; }};
    auto most = [](V a, V b) -> V {{ return fmaxf(a, b); }};
    auto whole = [](V v) -> I {{ return (int)v; }};
    auto real = [](I v) -> V {{ return (float)v; }};
#else
    typedef float V __attribute__((ext_vector_type({LANES})));
    typedef int I __attribute__((ext_vector_type({LANES})));
    const int lanes = {LANES};
    const I lane = {{{", ".join(map(str, range(LANES)))}}};
    auto load = [](const float* from) -> V
    {{
        V v;
        __builtin_memcpy(&v, from, sizeof(V));
        return v;
    }};
    auto numbers = [](const int* from) -> I
    {{
        I v;
        __builtin_memcpy(&v, from, sizeof(I));
        return v;
    }};
    auto get = [](const float* from, I at) -> V
    {{
        V v;
        for (int l = 0; l < {LANES}; ++l) v[l] = from[at[l]];
        return v;
    }};
    auto sum = [](V v) -> float
    {{
        const auto four = v.lo + v.hi;
        const auto two = four.lo + four.hi;
        return two.x + two.y;
    }};
    auto most = [](V a, V b) -> V {{ return a > b ? a : b; }};
    auto whole = [](V v) -> I {{ return __builtin_convertvector(v, I); }};
    auto real = [](I v) -> V {{ return __builtin_convertvector(v, V); }};
#endif
    // exp(-q): a polynomial of q / 16, four times squared. Beyond 14 it is nothing.
    auto fading = [&](V q) -> V
    {{
        const V t = most(q * -0.0625f, (V)-0.9f);
        V e = 1.0f + t * (1.0f + t * (0.5f + t * (0.16666667f + t * (0.041666667f + t * 0.0083333333f))));
        e = e * e;
        e = e * e;
        e = e * e;
        return e * e;
    }};
"""
# The same, and pointers to what ``plane`` has of ``count`` points, one after the other: x, y and z, and those of the normals.
PLANES_CODE = f"""{LANES_CODE}
    const float* x = plane.data;
    const float* y = x + count;
    const float* z = y + count;
    const float* up_x = z + count;
    const float* up_y = up_x + count;
    const float* up_z = up_y + count;
"""
# The way from the neighbors from number j on to a place, its square, and the cosine of the angle between their normals and its own.
NEIGHBOR_CODE = """
            const V dx = position[0] - load(x + j);
            const V dy = position[1] - load(y + j);
            const V dz = position[2] - load(z + j);
            const V square = dx * dx + dy * dy + dz * dz;
            const V cosine = load(up_x + j) * normal[0] + load(up_y + j) * normal[1] + load(up_z + j) * normal[2];
"""
