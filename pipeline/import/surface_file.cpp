#include "pipeline/import/surface_file.h"

#include <chrono>
#include <cmath>
#include <filesystem>

#include "pipeline/import/delimited_text.h"
#include "pipeline/import/plausible_size.h"
#include "pipeline/import/surface_readers.h"

namespace sonocase::pipeline {
namespace {

namespace fs = std::filesystem;

// Sum over the triangles of the volume towards the points' middle: positive where they face
// outwards. The middle is inside a torso, so that a mesh open at its cuts is told as well as a
// closed one.
double signed_volume(const Surface& surface) {
    Vector3 sum;
    for (const Point3 p : surface.points) sum = sum + (p - Point3{});
    const Point3 middle = Point3{} + sum / static_cast<double>(surface.points.size());
    double volume = 0;
    for (const auto& t : surface.triangles) {
        const Vector3 a = surface.points[t[0]] - middle, b = surface.points[t[1]] - middle,
                      c = surface.points[t[2]] - middle;
        volume += dot(a, cross(b, c)) / 6;
    }
    return volume;
}

void add_vertex_normals(Surface& surface) {
    surface.normals.assign(surface.points.size(), Vector3{});
    for (const auto& t : surface.triangles) {
        const Point3 a = surface.points[t[0]], b = surface.points[t[1]], c = surface.points[t[2]];
        const Vector3 twice_area = cross(b - a, c - a);
        for (const std::uint32_t v : t) surface.normals[v] = surface.normals[v] + twice_area;
    }
    for (Vector3& normal : surface.normals) normal = normalized(normal);
}

}  // namespace

Result<Surface> import_surface(const std::string& path,
                               const SurfaceFileOptions& options,
                               StageReport* report) {
    const auto start = std::chrono::steady_clock::now();
    StageReport own;
    own.stage = "surface_file";
    std::error_code code;
    if (!fs::exists(path, code)) return Error{"no such file", path, "check the path"};
    if (fs::is_directory(path, code)) return Error{"is a folder", path, "expected a surface file"};
    if (fs::file_size(path, code) == 0) return Error{"file is empty", path, "export it again"};
    const std::string ending = lower_case(fs::path(path).extension().string());
    const bool mesh = ending == ".ply" || ending == ".stl" || ending == ".obj" || ending == ".vtp";
    const bool cloud = ending == ".csv" || ending == ".xyz" || ending == ".txt" ||
                       ending == ".pts" || ending == ".asc" || ending == ".tsv";
    if (!mesh && !cloud)
        return Error{"not a known surface file name", path,
                     "expected .ply, .stl, .obj, .vtp, .csv, .tsv, .txt or .xyz"};
    auto surface = mesh ? read_mesh_file(path) : read_point_file(path, &own.warnings);
    if (!surface) return surface.error();
    if (surface->points.empty())
        return Error{"surface holds no points", path,
                     "expected the digitised skin; check that this is the right file"};
    for (const Point3 p : surface->points)
        if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z))
            return Error{"surface has a vertex that is not finite", path, "export it again"};
    if (surface->points.size() < kFewestSurfacePoints)
        return Error{"surface of " + std::to_string(surface->points.size()) + " points", path,
                     "expected at least 100 all round the torso; take more readings"};
    if (options.scale != 1)
        for (Point3& p : surface->points) p = Point3{} + options.scale * (p - Point3{});
    Box3 box;
    for (const Point3 p : surface->points) box.include(p);
    if (const auto error = check_torso_extent(box.extent(), "surface", path, "--scale"))
        return *error;

    if (!surface->triangles.empty()) {
        if (signed_volume(*surface) < 0) {
            for (auto& t : surface->triangles) std::swap(t[1], t[2]);
            own.warnings.push_back("the triangles face inwards and were turned");
        }
        add_vertex_normals(*surface);
    }
    own.measures = {{"points", static_cast<double>(surface->points.size())},
                    {"triangles", static_cast<double>(surface->triangles.size())},
                    {"width_mm", box.extent().x},
                    {"depth_mm", box.extent().y},
                    {"height_mm", box.extent().z}};
    own.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    if (report != nullptr) *report = std::move(own);
    return surface;
}

}  // namespace sonocase::pipeline
