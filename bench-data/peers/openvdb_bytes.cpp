// What the narrow band of a soup of closed pieces takes as an OpenVDB file: meshToVolume, then the level set written in
// floats and in halves, with each compression that the library was built with.
//
//     apt-get install g++ libopenvdb-dev            (or OpenVDB built from source)
//     g++ -O3 -march=native -std=c++17 openvdb_bytes.cpp -o openvdb_bytes -lopenvdb -ltbb
//     ./openvdb_bytes pile.stl 1024 3 /tmp/band     (cells along the longest side, half width of the band in voxels)
//
// Writes /tmp/band-*.vdb and prints a line of JSON for each: bytes of the file, active voxels, bytes a voxel.

#include "stl.h"

#include <openvdb/openvdb.h>
#include <openvdb/tools/MeshToVolume.h>
#include <openvdb/version.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

int main(int argc, char** argv) {
    if (argc != 5) {
        std::fprintf(stderr, "usage: openvdb_bytes SOUP.stl CELLS HALF_WIDTH PREFIX\n");
        return 2;
    }
    const double cells = std::atof(argv[2]);
    const float half_width = std::strtof(argv[3], nullptr);
    openvdb::initialize();
    Mesh soup = read_stl(argv[1]);
    auto transform = root_cube(soup, cells);
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
