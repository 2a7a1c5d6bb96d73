// What the narrow band of a soup of closed pieces takes as an OpenVDB file: meshToVolume, then the level set written in
// floats and in halves, with each compression that the library was built with.
//
//     apt-get install g++ libopenvdb-dev            (or OpenVDB built from source)
//     g++ -O3 -march=native -std=c++17 openvdb_bytes.cpp -o openvdb_bytes -lopenvdb -ltbb
//     ./openvdb_bytes pile.stl 1024 3 /tmp/band     (cells along the longest side, half width of the band in voxels)
//
// Writes /tmp/band-*.vdb and prints a line of JSON for each: bytes of the file, active voxels, bytes a voxel.

#include <openvdb/openvdb.h>
#include <openvdb/tools/MeshToVolume.h>
#include <openvdb/version.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

struct Mesh {
    std::vector<openvdb::Vec3s> points;
    std::vector<openvdb::Vec3I> triangles;
    openvdb::Vec3s low{1e30f}, high{-1e30f};
};

// A binary STL with three points of its own for each facet: OpenVDB needs no shared ones.
static Mesh read_stl(const char* path) {
    std::ifstream file(path, std::ios::binary);
    char header[84];
    if (!file.read(header, sizeof header)) {
        std::fprintf(stderr, "%s: not a binary STL\n", path);
        std::exit(1);
    }
    std::uint32_t count;
    std::memcpy(&count, header + 80, sizeof count);
    Mesh mesh;
    for (std::uint32_t f = 0; f < count; ++f) {
        char facet[50];
        if (!file.read(facet, sizeof facet)) {
            std::fprintf(stderr, "%s: ends within facet %u\n", path, f);
            std::exit(1);
        }
        float corner[9];
        std::memcpy(corner, facet + 12, sizeof corner);
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
    return mesh;
}

int main(int argc, char** argv) {
    if (argc != 5) {
        std::fprintf(stderr, "usage: openvdb_bytes SOUP.stl CELLS HALF_WIDTH PREFIX\n");
        return 2;
    }
    const double cells = std::atof(argv[2]);
    const float half_width = std::strtof(argv[3], nullptr);
    openvdb::initialize();
    Mesh soup = read_stl(argv[1]);

    // As in our root cube: its edge is 32/31 of the longest side.
    const openvdb::Vec3s size = soup.high - soup.low;
    const double edge = std::max({size[0], size[1], size[2]}) * 32.0 / 31.0;
    auto transform = openvdb::math::Transform::createLinearTransform(edge / cells);
    auto grid = openvdb::tools::meshToLevelSet<openvdb::FloatGrid>(*transform, soup.points, soup.triangles, half_width);
    const auto active = static_cast<unsigned long long>(grid->activeVoxelCount());

    using namespace openvdb::io;
    const struct { const char* name; std::uint32_t flags; bool available; } codings[] = {
        {"mask", COMPRESS_ACTIVE_MASK, true},
        {"zip", COMPRESS_ZIP | COMPRESS_ACTIVE_MASK, true},
        {"blosc", COMPRESS_BLOSC | COMPRESS_ACTIVE_MASK, Archive::hasBloscCompression()},
    };
    for (const bool half : {false, true}) {
        grid->setSaveFloatAsHalf(half);
        for (const auto& coding : codings) {
            if (!coding.available) {
                continue;
            }
            const std::string path = std::string(argv[4]) + (half ? "-half-" : "-float-") + coding.name + ".vdb";
            File file(path);
            file.setCompression(coding.flags);
            file.write({grid});
            file.close();
            const auto bytes = static_cast<unsigned long long>(std::filesystem::file_size(path));
            std::printf("{\"openvdb\": \"%s\", \"cells\": %g, \"half_width\": %g, \"values\": \"%s\", \"compression\": "
                        "\"%s\", \"bytes\": %llu, \"active_voxels\": %llu, \"bytes_per_voxel\": %.3f}\n",
                        OPENVDB_LIBRARY_VERSION_STRING, cells, half_width, half ? "half" : "float", coding.name, bytes,
                        active, double(bytes) / double(active));
        }
    }
    return 0;
}
