// A closed triangle mesh with fewer triangles, by CGAL's Surface_mesh_simplification.
//
//     apt-get install g++ libcgal-dev libeigen3-dev
//     g++ -O3 -march=native -DNDEBUG -std=c++17 -I/usr/include/eigen3 cgal_simplify.cpp -o cgal_simplify -lgmp -lmpfr
//     ./cgal_simplify fine.ply 100000 lindstrom-turk|garland-heckbert coarse.ply
//
// Files are binary PLY with three floats a vertex and three numbers a triangle, as `brickfield mesh` writes them. The
// costs are the library's own with its defaults: Lindstrom & Turk 1998, and the planes of Garland & Heckbert 1997 with
// the limit of normals of the example in its manual. Prints the seconds of the simplification alone.

#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/Bounded_normal_change_filter.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/Count_stop_predicate.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/GarlandHeckbert_plane_policies.h>
#include <CGAL/Surface_mesh_simplification/edge_collapse.h>

#include <array>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <iostream>
#include <string>

namespace SMS = CGAL::Surface_mesh_simplification;
using Kernel = CGAL::Simple_cartesian<double>;
using Mesh = CGAL::Surface_mesh<Kernel::Point_3>;

static Mesh read(const char *path) {
    std::ifstream file(path, std::ios::binary);
    std::size_t vertices = 0, triangles = 0;
    for (std::string line; std::getline(file, line) && line != "end_header";) {
        if (line.rfind("element vertex ", 0) == 0) vertices = std::stoull(line.substr(15));
        if (line.rfind("element face ", 0) == 0) triangles = std::stoull(line.substr(13));
    }
    Mesh mesh;
    mesh.reserve(vertices, 3 * triangles / 2, triangles);
    for (std::size_t n = 0; n < vertices; n++) {
        std::array<float, 3> at{};
        file.read(reinterpret_cast<char *>(at.data()), sizeof at);
        mesh.add_vertex({at[0], at[1], at[2]});
    }
    std::size_t refused = 0;
    for (std::size_t n = 0; n < triangles; n++) {
        std::array<char, 13> bytes{};
        std::array<std::uint32_t, 3> ids{};
        file.read(bytes.data(), bytes.size());
        std::memcpy(ids.data(), bytes.data() + 1, sizeof ids);
        refused += mesh.add_face(Mesh::Vertex_index(ids[0]), Mesh::Vertex_index(ids[1]), Mesh::Vertex_index(ids[2])) ==
                   Mesh::null_face();
    }
    if (!file || refused > 0) {
        std::cerr << path << ": cut short, or " << refused << " triangles are not manifold\n";
        std::exit(1);
    }
    return mesh;
}

static void write(const char *path, Mesh &mesh) {
    mesh.collect_garbage();
    std::ofstream file(path, std::ios::binary);
    file << "ply\nformat binary_little_endian 1.0\nelement vertex " << mesh.number_of_vertices()
         << "\nproperty float x\nproperty float y\nproperty float z\nelement face " << mesh.number_of_faces()
         << "\nproperty list uchar uint vertex_indices\nend_header\n";
    for (auto vertex : mesh.vertices()) {
        const auto &p = mesh.point(vertex);
        const std::array<float, 3> at{float(p.x()), float(p.y()), float(p.z())};
        file.write(reinterpret_cast<const char *>(at.data()), sizeof at);
    }
    for (auto face : mesh.faces()) {
        file.put(3);
        for (auto vertex : mesh.vertices_around_face(mesh.halfedge(face))) {
            const std::uint32_t id = vertex;
            file.write(reinterpret_cast<const char *>(&id), sizeof id);
        }
    }
}

int main(int count, char **arguments) {
    if (count != 5) {
        std::cerr << "cgal_simplify FINE.ply TRIANGLES lindstrom-turk|garland-heckbert COARSE.ply\n";
        return 2;
    }
    Mesh mesh = read(arguments[1]);
    // It stops below a number of edges, of which a closed mesh has three for two triangles.
    const SMS::Count_stop_predicate<Mesh> stop(std::stoull(arguments[2]) / 2 * 3 + 1);
    const auto began = std::chrono::steady_clock::now();
    if (std::string(arguments[3]) == "garland-heckbert") {
        using Policies = SMS::GarlandHeckbert_plane_policies<Mesh, Kernel>;
        const Policies policies(mesh);
        const SMS::Bounded_normal_change_filter<> filter;
        SMS::edge_collapse(mesh, stop,
                           CGAL::parameters::get_cost(policies.get_cost())
                               .get_placement(policies.get_placement())
                               .filter(filter));
    } else {
        SMS::edge_collapse(mesh, stop);
    }
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - began;
    write(arguments[4], mesh);
    std::cout << seconds.count() << "\n";
}
