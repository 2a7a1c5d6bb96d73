// What the narrow band of a soup of closed pieces takes as an OpenVDB file: meshToVolume, then the level set written in
// floats and in halves, with each compression that the library was built with; and as a NanoVDB file, in floats and
// quantized to 4, 8, 16 and a variable number of bits, where that library's headers are there.
//
//     apt-get install g++ libopenvdb-dev libboost-dev     (or OpenVDB built from source)
//     g++ -O3 -march=native -std=c++17 openvdb_bytes.cpp -o openvdb_bytes -lopenvdb -ltbb
//     ./openvdb_bytes pile.stl 1024 3 /tmp/band     (cells along the longest side, half width of the band in voxels)
//
// With NanoVDB, which is headers alone (the folder nanovdb of OpenVDB's source), of which Blosc and zlib are options:
//
//     g++ ... -I openvdb/nanovdb -DNANOVDB_USE_BLOSC -DNANOVDB_USE_ZIP ... -lblosc -lz
//
// Writes /tmp/band-*.vdb and .nvdb and prints a line of JSON for each: bytes of the file, active voxels, bytes a voxel, and
// of quantized values how far they are off, in voxels, at most and as the root of the mean square over active voxels.

#include "stl.h"

#include <openvdb/openvdb.h>
#include <openvdb/tools/MeshToVolume.h>
#include <openvdb/version.h>

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#if __has_include(<nanovdb/tools/CreateNanoGrid.h>)
#define NANOVDB_USE_OPENVDB
#include <nanovdb/NanoVDB.h>
#include <nanovdb/io/IO.h>
#include <nanovdb/tools/CreateNanoGrid.h>

// One way to store the values, with each compression.
template <typename Build>
void nano(const openvdb::FloatGrid& grid, const char* values, const char* prefix, unsigned long long active) {
    using namespace nanovdb;
    auto handle = tools::createNanoGrid<openvdb::FloatGrid, Build>(grid, tools::StatsMode::Disable, CheckMode::Disable);
    auto accessor = handle.template grid<Build>()->getAccessor();
    double worst = 0, squares = 0;
    for (auto value = grid.cbeginValueOn(); value; ++value) {
        const auto at = value.getCoord();
        const double off = double(accessor.getValue(Coord(at[0], at[1], at[2]))) - double(*value);
        worst = std::max(worst, std::abs(off));
        squares += off * off;
    }
    const double voxel = grid.voxelSize()[0];
    const struct { const char* name; io::Codec codec; } codings[] = {
        {"none", io::Codec::NONE},
#ifdef NANOVDB_USE_ZIP
        {"zip", io::Codec::ZIP},
#endif
#ifdef NANOVDB_USE_BLOSC
        {"blosc", io::Codec::BLOSC},
#endif
    };
    for (const auto& coding : codings) {
        const std::string path = std::string(prefix) + "-" + values + "-" + coding.name + ".nvdb";
        io::writeGrid(path, handle, coding.codec);
        const auto bytes = static_cast<unsigned long long>(std::filesystem::file_size(path));
        std::printf("{\"nanovdb\": \"%i.%i.%i\", \"values\": \"%s\", \"compression\": \"%s\", \"bytes\": %llu, "
                    "\"active_voxels\": %llu, \"bytes_per_voxel\": %.3f, \"off_at_most\": %.2g, \"off_rms\": %.2g}\n",
                    NANOVDB_MAJOR_VERSION_NUMBER, NANOVDB_MINOR_VERSION_NUMBER, NANOVDB_PATCH_VERSION_NUMBER, values,
                    coding.name, bytes, active, double(bytes) / double(active), worst / voxel,
                    std::sqrt(squares / double(active)) / voxel);
    }
}

static void all_nano(const openvdb::FloatGrid& grid, const char* prefix, unsigned long long active) {
    nano<float>(grid, "float", prefix, active);
    nano<nanovdb::Fp16>(grid, "Fp16", prefix, active);
    nano<nanovdb::Fp8>(grid, "Fp8", prefix, active);
    nano<nanovdb::Fp4>(grid, "Fp4", prefix, active);
    // Up to a thirtieth of the half width, as its own tools choose for level sets.
    nano<nanovdb::FpN>(grid, "FpN", prefix, active);
}
#else
static void all_nano(const openvdb::FloatGrid&, const char*, unsigned long long) {}
#endif

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
    all_nano(*grid, argv[4], active);
    return 0;
}
