// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/mesh/surface_file.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <tuple>
#include <unordered_map>
#include <vector>

#include "formats/base/stage_report.h"
#include "formats/files/atomic_file.h"
#include "formats/text/number_text.h"
#include "formats/volume/surface.h"
#include "pipeline/base/point_table.h"
#include "pipeline/base/source_checks.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/base/text.h"
#include "pipeline/import/mesh/glb_file.h"
#include "pipeline/import/mesh/mesh_file.h"

namespace sonocase::pipeline::inline import_mesh {

namespace {

constexpr std::size_t kDensePoints = 60000;  // a cloud of more is reduced
constexpr double kThinningMm = 5;
constexpr double kFarMm = 5e5;  // 32 bits are good for 0.03 mm there
constexpr int kBlock = 10;      // cubes along a block, within which cubes are compared
constexpr std::size_t kFew = 3, kTimesAsMany = 5;

// A key of the cube of this edge that holds p, 21 bits per axis.
std::uint64_t key_of(Point3 p, double edge_mm) {
    std::uint64_t key = 0;
    for (int a = 0; a < 3; ++a) {
        const double cell = std::clamp(std::floor(p[a] / edge_mm), -1048576.0, 1048575.0);
        key = key << 21 | static_cast<std::uint64_t>(static_cast<std::int64_t>(cell) + 1048576);
    }
    return key;
}

struct Cube {
    Point3 mean;
    std::size_t readings = 0;
    std::uint64_t block = 0;
};

std::vector<Cube> cubes_of(const std::vector<Point3>& points) {
    std::vector<std::pair<std::uint64_t, std::uint32_t>> keyed;
    keyed.reserve(points.size());
    for (std::size_t i = 0; i < points.size(); ++i)
        keyed.push_back({key_of(points[i], kThinningMm), static_cast<std::uint32_t>(i)});
    std::sort(keyed.begin(), keyed.end());
    std::vector<Cube> cubes;
    for (std::size_t n = 0; n < keyed.size();) {
        Vector3 sum;
        std::size_t end = n;
        for (; end < keyed.size() && keyed[end].first == keyed[n].first; ++end)
            sum = sum + (points[keyed[end].second] - Point3{});
        Cube cube;
        cube.readings = end - n;
        cube.mean = Point3{} + sum / static_cast<double>(cube.readings);
        cube.block = key_of(cube.mean, kBlock * kThinningMm);
        cubes.push_back(cube);
        n = end;
    }
    return cubes;
}

// For each block, the number of readings in the cube in which its middle reading lies.
std::unordered_map<std::uint64_t, std::size_t> usual_sizes(const std::vector<Cube>& cubes) {
    std::vector<std::size_t> order(cubes.size());
    for (std::size_t n = 0; n < order.size(); ++n) order[n] = n;
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        return std::tie(cubes[a].block, cubes[a].readings, a) <
               std::tie(cubes[b].block, cubes[b].readings, b);
    });
    std::unordered_map<std::uint64_t, std::size_t> usual;
    for (std::size_t n = 0; n < order.size();) {
        std::size_t end = n, readings = 0;
        for (; end < order.size() && cubes[order[end]].block == cubes[order[n]].block; ++end)
            readings += cubes[order[end]].readings;
        std::size_t middle = n;
        for (std::size_t seen = 0; middle + 1 < end; ++middle) {
            seen += cubes[order[middle]].readings;
            if (2 * seen >= readings) break;
        }
        usual[cubes[order[n]].block] = cubes[order[middle]].readings;
        n = end;
    }
    return usual;
}

// The largest usual size in the blocks round a cube.
std::size_t usual_near(const std::unordered_map<std::uint64_t, std::size_t>& usual, Point3 p) {
    constexpr double kEdgeMm = kBlock * kThinningMm;
    std::size_t largest = 0;
    for (int n = 0; n < 27; ++n) {
        const int x = n % 3 - 1, y = n / 3 % 3 - 1, z = n / 9 - 1;
        const Vector3 aside{double(x), double(y), double(z)};
        const auto found = usual.find(key_of(p + kEdgeMm * aside, kEdgeMm));
        if (found != usual.end()) largest = std::max(largest, found->second);
    }
    return largest;
}

// The readings in each cube of 5 mm become one at their mean, in the order of the cubes. Cubes that
// hold one to three readings where the others near them hold five times as many are readings in the
// air, which would count for as much as a cube full of skin, and are left out. A cloud of
// kDensePoints or fewer is left alone. Normals are dropped. cloud: mm, finite. report: measures
// given_points and sparse_points (left out); may be null. Cost: 0.2 us per reading.
void reduce_points(Surface& cloud, StageReport* report) {
    if (!cloud.triangles.empty() || cloud.points.size() <= kDensePoints) return;
    const std::size_t given = cloud.points.size();
    const std::vector<Cube> cubes = cubes_of(cloud.points);
    const auto usual = usual_sizes(cubes);
    std::size_t sparse = 0;
    cloud.points.clear();
    cloud.normals.clear();
    for (const Cube& cube : cubes) {
        if (cube.readings <= kFew && kTimesAsMany * cube.readings <= usual_near(usual, cube.mean)) {
            sparse += cube.readings;
        } else {
            cloud.points.push_back(cube.mean);
        }
    }
    cloud.points.shrink_to_fit();
    if (report == nullptr) return;
    report->measures.push_back({"given_points", static_cast<double>(given)});
    report->measures.push_back({"sparse_points", static_cast<double>(sparse)});
}

bool is_finite(Point3 p) {
    return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
}

// Takes away the points of a cloud that are not finite; returns how many.
std::size_t leave_out_holes(Surface& cloud) {
    if (!cloud.triangles.empty()) return 0;
    std::size_t kept = 0;
    const std::size_t given = cloud.points.size();
    const bool normals = !cloud.normals.empty();
    for (std::size_t n = 0; n < given; ++n) {
        if (!is_finite(cloud.points[n])) continue;
        cloud.points[kept] = cloud.points[n];
        if (normals) cloud.normals[kept] = cloud.normals[n];
        ++kept;
    }
    cloud.points.resize(kept);
    if (normals) cloud.normals.resize(kept);
    return given - kept;
}

struct GivenSurface {
    Surface surface;  // as given, GLB in metres
    Axes axes = Axes::unsaid;
    double unit_mm = 1;
};

Result<GivenSurface> read_cloud(const std::string& path, StageReport& report) {
    SONOCASE_TRY(auto table, load_point_table(path));
    if (table.left_out > 0)
        report.warnings.push_back(
            std::to_string(table.left_out) +
            " readings without position (or 0, 0, 0) or with a status other than OK were left out");
    return GivenSurface{{std::move(table.points), std::move(table.normals), {}},
                        table.axes,
                        table.unit_mm > 0 ? table.unit_mm : 1};
}

Result<GivenSurface> read_given(const std::string& path,
                                const SurfaceFileOptions& options,
                                bool mesh,
                                StageReport& report) {
    if (!mesh) return read_cloud(path, report);
    SONOCASE_TRY(auto file, read_mesh_file(path, options.scale, options.axes, &report));
    return GivenSurface{std::move(file.surface), file.axes, file.unit_mm};
}

// Few points far from all others make a torso look too large.
std::optional<Error> far_points(const std::vector<Point3>& points, const std::string& path) {
    Box3 most;  // of all points but one in a hundred on each side
    const std::size_t aside = points.size() / 100;
    Point3 low, high;
    std::vector<double> sorted(points.size());
    for (int a = 0; a < 3; ++a) {
        for (std::size_t n = 0; n < points.size(); ++n) sorted[n] = points[n][a];
        std::sort(sorted.begin(), sorted.end());
        low[a] = sorted[aside];
        high[a] = sorted[points.size() - 1 - aside];
    }
    most.include(low);
    most.include(high);
    if (aside == 0 || check_torso_extent(most.extent(), "", "", "")) return std::nullopt;
    std::size_t count = 0;
    Point3 example;
    for (const Point3 p : points) {
        bool far = false;
        for (int a = 0; a < 3; ++a) {
            const double room = most.extent()[a] + 100;
            far = far || p[a] < low[a] - room || p[a] > high[a] + room;
        }
        if (far && ++count == 1) example = p;
    }
    if (count == 0) return std::nullopt;
    return Error{text("%zu of %zu points lie far from all others, such as %.6g, %.6g, %.6g", count,
                      points.size(), example.x, example.y, example.z),
                 path, "take them away (MeshLab, CloudCompare), or delete their rows"};
}

void turn(Surface& surface, Axes axes) {
    if (axes != Axes::lps) return;
    for (Point3& p : surface.points) p = to_ras(p, axes);
    for (Vector3& n : surface.normals) n = to_ras(Point3{} + n, axes) - Point3{};
}

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
    const Stopwatch watch;
    StageReport own;
    own.stage = "surface_file";
    SONOCASE_TRY_DONE(check_source_file(path, "expected a surface file"));
    const std::string ending = lower_case(std::filesystem::path(path).extension().string());
    const bool glb = ending == ".glb", mesh = ending == ".vtk" || is_mesh_file(path);
    const bool cloud = ending == ".csv" || ending == ".xyz" || ending == ".txt" ||
                       ending == ".pts" || ending == ".asc" || ending == ".tsv" ||
                       ending == ".fcsv" || is_markups_file(path);
    if (!mesh && !cloud) {
        if (auto foreign = foreign_format(path, Wanted::surface)) return *std::move(foreign);
        return Error{
            "not a known surface file name", path,
            "expected .ply, .stl, .obj, .vtp, .vtk, .glb, .csv, .tsv, .txt, .xyz, .fcsv or "
            ".mrk.json"};
    }
    SONOCASE_TRY(auto given, read_given(path, options, mesh, own));
    Surface& surface = given.surface;
    if (surface.points.empty())
        return Error{"surface holds no points", path,
                     "expected the digitised skin; check that this is the right file"};
    if (const std::size_t holes = leave_out_holes(surface); holes > 0)
        own.warnings.push_back(std::to_string(holes) +
                               " points without a position (NaN), as depth cameras write them for "
                               "what they do not see, were left out");
    for (const Point3 p : surface.points)
        if (!is_finite(p))
            return Error{"a triangle's corner is not a number (NaN)", path,
                         "take such vertices away (MeshLab: Filters, Cleaning and Repairing) and "
                         "export it again"};
    if (surface.points.empty())
        return Error{"no point of the surface is a number", path,
                     "expected the digitised skin; export it again"};
    if (options.torso && surface.points.size() < kMinSurfacePoints)
        return Error{
            "surface of " + std::to_string(surface.points.size()) + " points", path,
            "expected at least 30 all round the torso, 500 or more are good; take more readings"};
    // Of a cloud the unit told by hand counts; of a GLB it is one of metres.
    const double mm = glb                  ? 1000 * options.scale
                      : options.scale != 1 ? options.scale
                                           : given.unit_mm;
    if (mm != 1)
        for (Point3& p : surface.points) p = Point3{} + mm * (p - Point3{});
    if (!glb) turn(surface, options.axes != Axes::unsaid ? options.axes : given.axes);
    own.notes.push_back(
        {"axes", glb ? gltf_axes_sentence(options.axes) : axes_sentence(given.axes, options.axes)});
    own.notes.push_back({"axes_said", name_of_axes(given.axes)});
    if (!mesh && given.unit_mm != 1)
        own.notes.push_back(
            {"unit", options.scale != 1
                         ? "the option --scale counts, and not the unit that the file says"
                         : "the file says its unit: " + number_text(given.unit_mm, 4) + " mm"});
    if (options.torso) reduce_points(surface, &own);
    Box3 box;
    for (const Point3 p : surface.points) box.include(p);
    double farthest = 0;
    for (int a = 0; a < 3; ++a)
        farthest = std::max({farthest, std::abs(box.lower[a]), std::abs(box.upper[a])});
    if (farthest > kFarMm)
        own.warnings.push_back(text(
            "the surface lies %.3g m from the origin of its axes, where numbers of 32 bits are no "
            "finer than %.2g mm: shift it to the origin (CloudCompare: Global Shift) and export it "
            "again",
            farthest / 1000, farthest * std::numeric_limits<float>::epsilon()));
    if (options.torso) {
        // The advice is for the file as it is.
        const double told = glb ? options.scale : mm;
        if (auto error = check_torso_extent(box.extent(), "surface", path, "--scale")) {
            if (auto far = far_points(surface.points, path)) return *std::move(far);
            if (told != 1) error->expected = scale_advice(box.extent() / told, "--scale");
            return *error;
        }
    }

    if (!surface.triangles.empty()) {
        // Folds that the reduction of a dense scan leaves are no fault of the file.
        const std::size_t turned = orient_outwards(surface);
        if (turned > 0 && own.measures.empty())
            own.warnings.push_back(
                std::to_string(turned) + " triangles faced inwards and were turned" +
                (turned == surface.triangles.size()
                     ? "; all triangles do where a mesh was mirrored: check its sides"
                     : ""));
        add_vertex_normals(surface);
    }
    const std::vector<Measure> reduction = std::move(own.measures);
    own.measures = {{"points", static_cast<double>(surface.points.size())},
                    {"triangles", static_cast<double>(surface.triangles.size())},
                    {"width_mm", box.extent().x},
                    {"depth_mm", box.extent().y},
                    {"height_mm", box.extent().z}};
    own.measures.insert(own.measures.end(), reduction.begin(), reduction.end());
    own.seconds = watch.seconds();
    if (report != nullptr) *report = std::move(own);
    return std::move(surface);
}

}  // namespace sonocase::pipeline::inline import_mesh
