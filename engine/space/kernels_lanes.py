"""C++ for the CPU's kernels that ask the space, the mesh and the images for several positions at once.

Every function computes what its like in :mod:`.kernels_space`, :mod:`.kernels_mesh` or :mod:`.kernels_images` does for one position,
to the last bit. Where bodies are few or unusual, kernels ask those.
"""

from __future__ import annotations

__all__ = ["LANES", "LANES_OF_SPACE"]

# Positions that are asked for at once.
LANES = 8

# Functions for a native function whose arguments are `space` and `mesh`. No product is fused with a sum: one position alone gets none.
LANES_OF_SPACE = f"""
#pragma clang fp contract(off)
    enum {{ L = {LANES} }};
    typedef float V __attribute__((ext_vector_type({LANES}), aligned(4)));
    typedef int I __attribute__((ext_vector_type({LANES}), aligned(4)));
    const bool wraps = space.periodic != 0;
    const float size_x = space.size[0], size_y = space.size[1];

    auto all = [](I mask) -> bool
    {{
        int both = -1;
        for (int k = 0; k < L; ++k) both &= mask[k];
        return both != 0;
    }};
    auto clamped = [](I i, int count) -> I
    {{
        return __builtin_elementwise_min(__builtin_elementwise_max(i, (I)0), (I)(count - 1));
    }};
    auto inside = [&](I i, int count) -> I
    {{
        if (wraps) i += i < 0 ? (I)count : i >= count ? (I)(-count) : (I)0;
        return clamped(i, count);
    }};
    auto nearest_nodes = [&](V x, V y) -> I
    {{
        const V u = (x - mesh.origin[0]) * mesh.inverse_spacing[0], v = (y - mesh.origin[1]) * mesh.inverse_spacing[1];
        const I column = __builtin_convertvector(u + 0.5f, I) + mesh.margin;
        const I row = __builtin_convertvector(v + 0.5f, I) + mesh.margin;
        return inside(row, mesh.count_y) * mesh.count_x + inside(column, mesh.count_x);
    }};
    auto confined = [&](V x, float size) -> V
    {{
        if (wraps)
        {{
            const V before = __builtin_elementwise_floor(x / size) * size;
            x = x - before;
            x = x >= size ? (V)0.0f : x;
        }}
        x = x >= 0.0f ? x : (V)0.0f;
        return x < size ? x : (V)size;
    }};
    auto way = [&](V start, V end, float size) -> V
    {{
        const V vector = end - start;
        if (!wraps) return vector;
        const V periods = size * __builtin_elementwise_round(vector / size);
        return vector - periods;
    }};
    auto along_border = [&](V force, V position, float size) -> V
    {{
        if (wraps) return force;
        const I outwards = ((position <= 0.0f) & (force < 0.0f)) | ((position >= size) & (force > 0.0f));
        return outwards ? (V)0.0f : force;
    }};
    auto pixels = [&](V x, V y, int height, int width) -> I
    {{
        const V u = x / size_x * (float)width, v = (1.0f - y / size_y) * (float)height;
        const I column = clamped(__builtin_convertvector(u, I), width);
        return clamped(__builtin_convertvector(v, I), height) * width + column;
    }};
"""
