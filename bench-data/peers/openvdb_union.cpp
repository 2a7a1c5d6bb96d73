// The union of a soup of closed pieces by OpenVDB: meshToVolume, then volumeToMesh of the level set.
//
//     apt-get install g++ libopenvdb-dev            (or OpenVDB built from source)
//     g++ -O3 -march=native -std=c++17 openvdb_union.cpp -o openvdb_union -lopenvdb -ltbb
//     ./openvdb_union pile.stl 512 2                (cells along the longest side, threads)
//
// Prints one line of JSON: times of reading, of voxels and of the mesh, sizes, and the peak of resident memory.

#include <openvdb/openvdb.h>
#include <openvdb/tools/MeshToVolume.h>
#include <openvdb/tools/VolumeToMesh.h>
#include <openvdb/version.h>
#include <tbb/global_control.h>

#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <vector>

using Clock = std::chrono::steady_clock;

static double seconds_since(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
}

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

int main(int argc, char** argv) {
    if (argc != 4) {
        std::fprintf(stderr, "usage: openvdb_union SOUP.stl CELLS THREADS\n");
        return 2;
    }
    const double cells = std::atof(argv[2]);
    const int threads = std::atoi(argv[3]);
    tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    openvdb::initialize();

    auto start = Clock::now();
    Mesh soup = read_stl(argv[1]);
    const double read = seconds_since(start);

    // As in our root cube: its edge is 32/31 of the longest side.
    const openvdb::Vec3s size = soup.high - soup.low;
    const double edge = std::max({size[0], size[1], size[2]}) * 32.0 / 31.0;
    auto transform = openvdb::math::Transform::createLinearTransform(edge / cells);
    start = Clock::now();
    auto grid = openvdb::tools::meshToLevelSet<openvdb::FloatGrid>(*transform, soup.points, soup.triangles, 3.0f);
    const double voxels = seconds_since(start);

    start = Clock::now();
    std::vector<openvdb::Vec3s> points;
    std::vector<openvdb::Vec3I> triangles;
    std::vector<openvdb::Vec4I> quads;
    openvdb::tools::volumeToMesh(*grid, points, triangles, quads);
    const double mesh = seconds_since(start);

    rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    std::printf("{\"openvdb\": \"%s\", \"cells\": %g, \"threads\": %d, \"facets\": %zu, \"read_s\": %.3f, "
                "\"voxels_s\": %.3f, \"mesh_s\": %.3f, \"active_voxels\": %llu, \"grid_mib\": %.1f, "
                "\"triangles\": %zu, \"peak_mib\": %.1f}\n",
                OPENVDB_LIBRARY_VERSION_STRING, cells, threads, soup.triangles.size(), read, voxels, mesh,
                static_cast<unsigned long long>(grid->activeVoxelCount()), grid->memUsage() / 1048576.0,
                2 * quads.size() + triangles.size(), usage.ru_maxrss / 1024.0);
    return 0;
}
