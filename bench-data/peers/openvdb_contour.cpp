// The surface of a field of distances, or of pieces united and taken away, by OpenVDB's volumeToMesh, alone in the time.
//
//     apt-get install g++ libopenvdb-dev libboost-dev
//     g++ -O3 -march=native -std=c++17 openvdb_contour.cpp -o openvdb_contour -lopenvdb -ltbb
//     ./openvdb_contour field.npy 0.2 0 0 0 ADAPTIVITY THREADS [MESH.ply]      (spacing and origin)
//     ./openvdb_contour part.stl CELLS ADAPTIVITY THREADS [MESH.ply]
//
// The array holds floats [z,y,x] in any unit, negative inside, of which those at the least and the greatest value are left
// out of the level set. Of a soup every piece, facets that hang together by vertices, becomes a level set of its own;
// csgUnion joins them, and csgDifference takes away those that are inside out. ADAPTIVITY is volumeToMesh's, from 0, uniform,
// to 1. Prints one line of JSON: seconds and processor time of volumeToMesh, sizes.

#include "stl.h"

#include <openvdb/openvdb.h>
#include <openvdb/tools/Composite.h>
#include <openvdb/tools/Dense.h>
#include <openvdb/tools/MeshToVolume.h>
#include <openvdb/tools/Prune.h>
#include <openvdb/tools/VolumeToMesh.h>
#include <openvdb/version.h>
#include <tbb/global_control.h>

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <numeric>
#include <string>
#include <vector>

using Grid = openvdb::FloatGrid;

static void fail(const std::string& path, const char* what) {
    std::fprintf(stderr, "%s: %s\n", path.c_str(), what);
    std::exit(1);
}

// User and system time.
static double processor_seconds() {
    rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    const auto of = [](const timeval& time) { return double(time.tv_sec) + 1e-6 * double(time.tv_usec); };
    return of(usage.ru_utime) + of(usage.ru_stime);
}

// A cubic array of floats as NumPy writes it, mapped, made a level set.
static Grid::Ptr of_array(const std::string& path, double spacing, const openvdb::Vec3d& origin) {
    const int file = open(path.c_str(), O_RDONLY);
    struct stat about;
    if (file < 0 || fstat(file, &about) != 0 || about.st_size < 128) {
        fail(path, "cannot be read");
    }
    const auto bytes = std::size_t(about.st_size);
    char* data = static_cast<char*>(mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE, file, 0));
    if (data == MAP_FAILED) {
        fail(path, "cannot be mapped");
    }
    const auto head = 10 + std::size_t(std::uint8_t(data[8])) + (std::size_t(std::uint8_t(data[9])) << 8);
    const std::string told(data + 10, std::min(head, bytes) - 10);
    const auto side = int(std::lround(std::cbrt(double(bytes - head) / sizeof(float))));
    const bool is_cubic = head + sizeof(float) * std::size_t(side) * side * side == bytes;
    if (std::memcmp(data, "\x93NUMPY\x01", 7) != 0 || told.find("'<f4'") == std::string::npos || !is_cubic) {
        fail(path, "no cubic array of floats");
    }
    auto* values = reinterpret_cast<float*>(data + head);
    const auto [least, greatest] = std::minmax_element(values, values + std::size_t(side) * side * side);
    const float inside = *least, outside = *greatest;
    auto grid = Grid::create(outside);
    const openvdb::CoordBBox box({0, 0, 0}, {side - 1, side - 1, side - 1});
    openvdb::tools::Dense<float, openvdb::tools::LayoutXYZ> dense(box, values);
    openvdb::tools::copyFromDense(dense, *grid, 0.0f);
    for (auto value = grid->beginValueOn(); value; ++value) {
        if (*value <= inside) {
            value.setValueOff();
        }
    }
    openvdb::tools::pruneLevelSet(grid->tree());
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    auto transform = openvdb::math::Transform::createLinearTransform(spacing);
    transform->postTranslate(origin);
    grid->setTransform(transform);
    munmap(data, bytes);
    return grid;
}

// Which of the vertices that facets share stands for all that hang together.
static std::size_t root_of(std::vector<std::size_t>& parents, std::size_t vertex) {
    while (parents[vertex] != vertex) {
        vertex = parents[vertex] = parents[parents[vertex]];
    }
    return vertex;
}

// The facets of each piece, and whether it is to be added.
static std::vector<std::pair<std::vector<openvdb::Vec3I>, bool>> pieces_of(const Mesh& soup) {
    std::map<std::array<float, 3>, std::size_t> numbers;
    std::vector<std::size_t> own(soup.points.size());
    for (std::size_t n = 0; n < own.size(); ++n) {
        const auto& p = soup.points[n];
        own[n] = numbers.try_emplace({p[0], p[1], p[2]}, numbers.size()).first->second;
    }
    std::vector<std::size_t> parents(numbers.size());
    std::iota(parents.begin(), parents.end(), std::size_t(0));
    for (const auto& t : soup.triangles) {
        parents[root_of(parents, own[t[0]])] = root_of(parents, own[t[1]]);
        parents[root_of(parents, own[t[1]])] = root_of(parents, own[t[2]]);
    }
    std::map<std::size_t, std::vector<openvdb::Vec3I>> facets;
    for (const auto& t : soup.triangles) {
        facets[root_of(parents, own[t[0]])].push_back(t);
    }
    std::vector<std::pair<std::vector<openvdb::Vec3I>, bool>> pieces;
    for (auto& [root, piece] : facets) {
        double volume = 0;
        for (const auto& t : piece) {
            const openvdb::Vec3d a(soup.points[t[0]]), b(soup.points[t[1]]), c(soup.points[t[2]]);
            volume += a.dot(b.cross(c));
        }
        pieces.emplace_back(std::move(piece), volume > 0);
    }
    return pieces;
}

// Pieces that point outward together, less those that point inward.
static Grid::Ptr of_pieces(const std::string& path, double cells) {
    const Mesh soup = read_stl(path.c_str());
    const auto transform = root_cube(soup, cells);
    const auto pieces = pieces_of(soup);
    Grid::Ptr whole;
    for (const bool added : {true, false}) {
        for (const auto& [facets, is_added] : pieces) {
            if (is_added != added) {
                continue;
            }
            auto grid = openvdb::tools::meshToLevelSet<Grid>(*transform, soup.points, facets, 3.0f);
            if (!whole) {
                whole = grid;
            } else if (added) {
                openvdb::tools::csgUnion(*whole, *grid);
            } else {
                openvdb::tools::csgDifference(*whole, *grid);
            }
        }
    }
    return whole;
}

// Binary PLY, quadrilaterals as two triangles each.
static void write_ply(const std::string& path, const std::vector<openvdb::Vec3s>& points,
                      const std::vector<openvdb::Vec3I>& triangles, const std::vector<openvdb::Vec4I>& quads) {
    std::ofstream file(path, std::ios::binary);
    file << "ply\nformat binary_little_endian 1.0\nelement vertex " << points.size()
         << "\nproperty float x\nproperty float y\nproperty float z\nelement face " << triangles.size() + 2 * quads.size()
         << "\nproperty list uchar int vertex_indices\nend_header\n";
    file.write(reinterpret_cast<const char*>(points.data()), std::streamsize(sizeof(points[0]) * points.size()));
    // From outside counter-clockwise; OpenVDB's are clockwise.
    const auto face = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
        const std::uint32_t corners[3] = {c, b, a};
        file.put(3).write(reinterpret_cast<const char*>(corners), sizeof corners);
    };
    for (const auto& t : triangles) {
        face(t[0], t[1], t[2]);
    }
    for (const auto& q : quads) {
        face(q[0], q[1], q[2]);
        face(q[0], q[2], q[3]);
    }
    if (!file.flush()) {
        fail(path, "cannot be written");
    }
}

int main(int argc, char** argv) {
    const std::string input = argc > 1 ? argv[1] : "";
    const bool is_array = input.size() > 4 && input.substr(input.size() - 4) == ".npy";
    const int sizes = is_array ? 4 : 1;
    if (argc != sizes + 4 && argc != sizes + 5) {
        std::fprintf(stderr, "usage: openvdb_contour FIELD.npy SPACING X Y Z ADAPTIVITY THREADS [MESH.ply]\n"
                             "       openvdb_contour PIECES.stl CELLS ADAPTIVITY THREADS [MESH.ply]\n");
        return 2;
    }
    const auto number = [&](int n) { return std::atof(argv[n]); };
    const double adaptivity = number(sizes + 2);
    const int threads = std::atoi(argv[sizes + 3]);
    tbb::global_control limit(tbb::global_control::max_allowed_parallelism, std::size_t(threads));
    openvdb::initialize();
    const auto grid = is_array ? of_array(input, number(2), {number(3), number(4), number(5)}) : of_pieces(input, number(2));

    std::vector<openvdb::Vec3s> points;
    std::vector<openvdb::Vec3I> triangles;
    std::vector<openvdb::Vec4I> quads;
    const double processor = processor_seconds();
    const auto start = std::chrono::steady_clock::now();
    openvdb::tools::volumeToMesh(*grid, points, triangles, quads, 0.0, adaptivity);
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    const double spent = processor_seconds() - processor;
    if (argc == sizes + 5) {
        write_ply(argv[sizes + 4], points, triangles, quads);
    }
    std::printf("{\"version\": \"%s\", \"adaptivity\": %g, \"seconds\": %.4f, \"cpu_seconds\": %.4f, "
                "\"active_voxels\": %llu, \"vertices\": %zu, \"triangles\": %zu}\n",
                OPENVDB_LIBRARY_VERSION_STRING, adaptivity, seconds, spent,
                static_cast<unsigned long long>(grid->activeVoxelCount()), points.size(),
                triangles.size() + 2 * quads.size());
    return 0;
}
