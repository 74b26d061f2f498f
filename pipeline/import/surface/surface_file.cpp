// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/surface/surface_file.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <tuple>

#include "formats/files/atomic_file.h"
#include "pipeline/base/delimited_text.h"
#include "pipeline/base/plausible_size.h"
#include "pipeline/import/source/source_path.h"
#include "pipeline/import/surface/dense_points.h"
#include "pipeline/import/surface/surface_readers.h"

namespace sonocase::pipeline {
namespace {

// Turns triangles until each agrees with its neighbours and every connected part faces outwards: on
// the whole, away from the mean of the points. That point is inside a torso, so that this works for
// a mesh that is open at its cuts as well as for a closed one. An edge of more than two triangles
// does not link them. Returns how many were turned.
std::size_t orient_outwards(Surface& surface) {
    const std::size_t count = surface.triangles.size();
    struct Side {
        std::uint32_t low, high, triangle;
        bool rising;  // the triangle runs along it from low to high
    };
    std::vector<Side> sides;
    for (std::uint32_t t = 0; t < count; ++t) {
        for (std::size_t c = 0; c < 3; ++c) {
            const std::uint32_t from = surface.triangles[t][c],
                                to = surface.triangles[t][(c + 1) % 3];
            sides.push_back({std::min(from, to), std::max(from, to), t, from < to});
        }
    }
    std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) {
        return std::tie(a.low, a.high, a.triangle) < std::tie(b.low, b.high, b.triangle);
    });
    struct Link {
        std::uint32_t other;
        bool same_sense;  // both have the same winding as read
    };
    std::vector<std::vector<Link>> links(count);
    for (std::size_t i = 0; i < sides.size();) {
        std::size_t end = i + 1;
        while (end < sides.size() && sides[end].low == sides[i].low &&
               sides[end].high == sides[i].high)
            ++end;
        if (end - i == 2) {
            const bool same = sides[i].rising != sides[i + 1].rising;
            links[sides[i].triangle].push_back({sides[i + 1].triangle, same});
            links[sides[i + 1].triangle].push_back({sides[i].triangle, same});
        }
        i = end;
    }
    Vector3 sum;
    for (const Point3 p : surface.points) sum = sum + (p - Point3{});
    const Point3 middle = Point3{} + sum / static_cast<double>(surface.points.size());
    const auto volume = [&](std::uint32_t t) {
        const auto& corner = surface.triangles[t];
        return dot(surface.points[corner[0]] - middle,
                   cross(surface.points[corner[1]] - middle, surface.points[corner[2]] - middle));
    };
    std::vector<std::int8_t> sense(count, 0);  // 1: as read, -1: turned, 0: not yet visited
    std::size_t turned = 0;
    for (std::uint32_t seed = 0; seed < count; ++seed) {
        if (sense[seed] != 0) continue;
        std::vector<std::uint32_t> part{seed};
        sense[seed] = 1;
        double outward = 0;
        for (std::size_t next = 0; next < part.size(); ++next) {
            const std::uint32_t t = part[next];
            outward += sense[t] * volume(t);
            for (const Link& link : links[t]) {
                if (sense[link.other] != 0) continue;
                sense[link.other] =
                    static_cast<std::int8_t>(link.same_sense ? sense[t] : -sense[t]);
                part.push_back(link.other);
            }
        }
        for (const std::uint32_t t : part) {
            if ((sense[t] > 0) == (outward >= 0)) continue;
            std::swap(surface.triangles[t][1], surface.triangles[t][2]);
            ++turned;
        }
    }
    return turned;
}

}  // namespace

Result<Surface> import_surface(const std::string& path,
                               const SurfaceFileOptions& options,
                               StageReport* report) {
    const auto start = std::chrono::steady_clock::now();
    StageReport own;
    own.stage = "surface_file";
    if (auto status = check_source_file(path, "expected a surface file"); !status)
        return status.error();
    const std::string ending = lower_case(std::filesystem::path(path).extension().string());
    const bool mesh = ending == ".ply" || ending == ".stl" || ending == ".obj" || ending == ".vtp";
    const bool cloud = ending == ".csv" || ending == ".xyz" || ending == ".txt" ||
                       ending == ".pts" || ending == ".asc" || ending == ".tsv";
    if (!mesh && !cloud)
        return Error{"not a known surface file name", path,
                     "expected .ply, .stl, .obj, .vtp, .csv, .tsv, .txt or .xyz"};
    auto surface =
        mesh ? read_mesh_file(path, options.scale, &own) : read_point_file(path, &own.warnings);
    if (!surface) return surface.error();
    if (surface->points.empty())
        return Error{"surface holds no points", path,
                     "expected the digitised skin; check that this is the right file"};
    for (const Point3 p : surface->points)
        if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z))
            return Error{"surface has a vertex that is not finite", path, "export it again"};
    if (options.torso && surface->points.size() < kFewestSurfacePoints)
        return Error{
            "surface of " + std::to_string(surface->points.size()) + " points", path,
            "expected at least 30 all round the torso, 500 or more are good; take more readings"};
    if (options.scale != 1)
        for (Point3& p : surface->points) p = Point3{} + options.scale * (p - Point3{});
    if (!mesh && options.torso) reduce_points(*surface, &own);
    Box3 box;
    for (const Point3 p : surface->points) box.include(p);
    if (options.torso) {
        if (const auto error = check_torso_extent(box.extent(), "surface", path, "--scale"))
            return *error;
    }

    if (!surface->triangles.empty()) {
        // Folds that the reduction of a dense scan leaves are no fault of the file.
        const std::size_t turned = orient_outwards(*surface);
        if (turned > 0 && own.measures.empty())
            own.warnings.push_back(std::to_string(turned) +
                                   " triangles faced inwards and were turned");
        add_vertex_normals(*surface);
    }
    const std::vector<Measure> reduction = std::move(own.measures);
    own.measures = {{"points", static_cast<double>(surface->points.size())},
                    {"triangles", static_cast<double>(surface->triangles.size())},
                    {"width_mm", box.extent().x},
                    {"depth_mm", box.extent().y},
                    {"height_mm", box.extent().z}};
    own.measures.insert(own.measures.end(), reduction.begin(), reduction.end());
    own.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    if (report != nullptr) *report = std::move(own);
    return surface;
}

}  // namespace sonocase::pipeline
