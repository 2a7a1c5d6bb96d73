// The union of a soup of closed pieces by OpenVDB: meshToVolume, then volumeToMesh of the level set.
//
//     apt-get install g++ libopenvdb-dev libboost-dev     (or OpenVDB built from source)
//     g++ -O3 -march=native -std=c++17 openvdb_union.cpp -o openvdb_union -lopenvdb -ltbb
//     ./openvdb_union pile.stl 512 2 mesh.stl       (cells along the longest side, threads; the mesh's file may be left out)
//
// Prints one line of JSON: times of reading, of voxels, of the mesh, and of its binary STL until it is on the disk; sizes,
// and the peak of resident memory.

#include "stl.h"

#include <openvdb/openvdb.h>
#include <openvdb/tools/MeshToVolume.h>
#include <openvdb/tools/VolumeToMesh.h>
#include <openvdb/version.h>
#include <tbb/global_control.h>

#include <fcntl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <vector>

using Clock = std::chrono::steady_clock;

static double seconds_since(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
}

// The quads as two triangles each, written in large blocks, normals left to the reader as zeros, and made durable.
static void write_stl(const char* path, const std::vector<openvdb::Vec3s>& points,
                      const std::vector<openvdb::Vec3I>& triangles, const std::vector<openvdb::Vec4I>& quads) {
    const int file = open(path, O_CREAT | O_TRUNC | O_WRONLY, 0666);
    std::vector<char> block(84);
    bool written = file >= 0;
    const auto flush = [&] {
        for (std::size_t done = 0; written && done < block.size();) {
            const ssize_t bytes = write(file, block.data() + done, block.size() - done);
            written = bytes > 0;
            done += std::size_t(bytes);
        }
        block.clear();
    };
    const auto facet = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
        const float values[12] = {0, 0, 0, points[a][0], points[a][1], points[a][2], points[b][0], points[b][1], points[b][2],
                                  points[c][0], points[c][1], points[c][2]};
        const std::size_t at = block.size();
        block.resize(at + 50);
        std::memcpy(block.data() + at, values, sizeof values);
        if (block.size() > (1 << 22)) {
            flush();
        }
    };
    const auto count = std::uint32_t(triangles.size() + 2 * quads.size());
    std::memcpy(block.data() + 80, &count, sizeof count);
    block.reserve((1 << 22) + 100);
    for (const auto& t : triangles) {
        facet(t[0], t[1], t[2]);
    }
    for (const auto& q : quads) {
        facet(q[0], q[1], q[2]);
        facet(q[0], q[2], q[3]);
    }
    flush();
    if (!written || fsync(file) != 0 || close(file) != 0) {
        std::perror(path);
        std::exit(1);
    }
}

int main(int argc, char** argv) {
    if (argc != 4 && argc != 5) {
        std::fprintf(stderr, "usage: openvdb_union SOUP.stl CELLS THREADS [MESH.stl]\n");
        return 2;
    }
    const double cells = std::atof(argv[2]);
    const int threads = std::atoi(argv[3]);
    tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    openvdb::initialize();

    auto start = Clock::now();
    Mesh soup = read_stl(argv[1]);
    const double read = seconds_since(start);

    auto transform = root_cube(soup, cells);
    start = Clock::now();
    auto grid = openvdb::tools::meshToLevelSet<openvdb::FloatGrid>(*transform, soup.points, soup.triangles, 3.0f);
    const double voxels = seconds_since(start);

    start = Clock::now();
    std::vector<openvdb::Vec3s> points;
    std::vector<openvdb::Vec3I> triangles;
    std::vector<openvdb::Vec4I> quads;
    openvdb::tools::volumeToMesh(*grid, points, triangles, quads);
    const double mesh = seconds_since(start);

    start = Clock::now();
    if (argc == 5) {
        write_stl(argv[4], points, triangles, quads);
    }
    const double file = seconds_since(start);

    rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    std::printf("{\"openvdb\": \"%s\", \"cells\": %g, \"threads\": %d, \"facets\": %zu, \"read_s\": %.3f, "
                "\"voxels_s\": %.3f, \"mesh_s\": %.3f, \"file_s\": %.3f, \"active_voxels\": %llu, \"grid_mib\": %.1f, "
                "\"triangles\": %zu, \"peak_mib\": %.1f}\n",
                OPENVDB_LIBRARY_VERSION_STRING, cells, threads, soup.triangles.size(), read, voxels, mesh, file,
                static_cast<unsigned long long>(grid->activeVoxelCount()), grid->memUsage() / 1048576.0,
                2 * quads.size() + triangles.size(), usage.ru_maxrss / 1024.0);
    return 0;
}
