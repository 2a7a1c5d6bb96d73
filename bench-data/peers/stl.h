// A binary STL as OpenVDB takes meshes, and the root cube that this program gives it.

#pragma once

#include <openvdb/openvdb.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <vector>

struct Mesh {
    std::vector<openvdb::Vec3s> points;
    std::vector<openvdb::Vec3I> triangles;
    openvdb::Vec3s low{1e30f}, high{-1e30f};
};

// A binary STL with three points of its own for each facet: OpenVDB needs no shared ones.
inline Mesh read_stl(const char* path) {
    std::ifstream file(path, std::ios::binary);
    char header[84];
    if (!file.read(header, sizeof header)) {
        std::fprintf(stderr, "%s: not a binary STL\n", path);
        std::exit(1);
    }
    std::uint32_t count;
    std::memcpy(&count, header + 80, sizeof count);
    Mesh mesh;
    mesh.points.reserve(3 * std::size_t(count));
    mesh.triangles.reserve(count);
    std::vector<char> block(50 << 16);
    for (std::uint32_t done = 0; done < count;) {
        const std::uint32_t facets = std::min<std::uint32_t>(count - done, 1 << 16);
        if (!file.read(block.data(), 50 * std::streamsize(facets))) {
            std::fprintf(stderr, "%s: ends within facet %u\n", path, done);
            std::exit(1);
        }
        for (std::uint32_t f = 0; f < facets; ++f) {
            float corner[9];
            std::memcpy(corner, block.data() + 50 * f + 12, sizeof corner);
            const auto first = std::uint32_t(mesh.points.size());
            for (int v = 0; v < 3; ++v) {
                const openvdb::Vec3s p(corner[3 * v], corner[3 * v + 1], corner[3 * v + 2]);
                for (int a = 0; a < 3; ++a) {
                    mesh.low[a] = std::min(mesh.low[a], p[a]);
                    mesh.high[a] = std::max(mesh.high[a], p[a]);
                }
                mesh.points.push_back(p);
            }
            mesh.triangles.emplace_back(first, first + 1, first + 2);
        }
        done += facets;
    }
    return mesh;
}

// Voxels of which `cells` make the edge of our root cube: 32/31 of the longest side.
inline openvdb::math::Transform::Ptr root_cube(const Mesh& mesh, double cells) {
    const openvdb::Vec3s size = mesh.high - mesh.low;
    const double edge = std::max({size[0], size[1], size[2]}) * 32.0 / 31.0;
    return openvdb::math::Transform::createLinearTransform(edge / cells);
}
