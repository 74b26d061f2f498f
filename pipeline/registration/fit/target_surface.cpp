// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/fit/target_surface.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <queue>

#include "formats/base/constants.h"
#include "pipeline/base/parallel.h"
#include "pipeline/base/text.h"
#include "pipeline/registration/fit/table_plane.h"

namespace sonocase::pipeline::inline registration_fit {
namespace {

constexpr std::size_t kMinPoints = 30;

struct Spread {
    Point3 centre;
    Vector3 deviation;  // standard deviation along the principal axes, smallest first
    Matrix3 axes;       // columns
};

template <class Range>
Spread spread_of(const std::vector<Point3>& points, const Range& indices) {
    Spread s;
    Vector3 sum;
    double count = 0;
    for (auto i : indices) {
        sum = sum + (points[i] - Point3{});
        ++count;
    }
    s.centre = Point3{} + sum / count;
    Eigen::Matrix3d c = Eigen::Matrix3d::Zero();
    for (auto i : indices) {
        const Vector3 d = points[i] - s.centre;
        const Eigen::Vector3d e(d.x, d.y, d.z);
        c += e * e.transpose();
    }
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
    solver.computeDirect(c / count);
    for (int a = 0; a < 3; ++a) {
        s.deviation[a] = std::sqrt(std::max(0.0, solver.eigenvalues()[a]));
        for (int r = 0; r < 3; ++r) s.axes(r, a) = solver.eigenvectors()(r, a);
    }
    return s;
}

std::vector<std::uint32_t> all_of(std::size_t count) {
    std::vector<std::uint32_t> indices(count);
    for (std::size_t i = 0; i < count; ++i) indices[i] = static_cast<std::uint32_t>(i);
    return indices;
}

Result<Done> check_units(const Box3& box) {
    const Vector3 e = box.extent();
    const double diagonal = norm(e);
    if (diagonal >= 100 && diagonal <= 5000) return Done{};
    const char* unit = "check the units";
    if (diagonal >= 0.1 && diagonal < 5) {
        unit = "these look like metres: give --scale 1000";
    } else if (diagonal >= 10 && diagonal < 100) {
        unit = "these look like centimetres: give --scale 10";
    } else if (diagonal >= 1e5 && diagonal < 5e6) {
        unit = "these look like micrometres: divide by 1000";
    }
    return Error{text("surface of %.4g x %.4g x %.4g mm", e.x, e.y, e.z), "",
                 text("a torso of some 200 to 1500 mm was expected; %s", unit)};
}

// Outward normals of a mesh: area-weighted means over the triangles at each point.
void normals_from_triangles(TargetSurface& t) {
    t.normals.assign(t.points.size(), {});
    double volume = 0;
    for (const auto& f : t.triangles) {
        const Vector3 n = cross(t.points[f[1]] - t.points[f[0]], t.points[f[2]] - t.points[f[0]]);
        for (std::uint32_t v : f) t.normals[v] = t.normals[v] + n;
        volume += dot(n, t.points[f[0]] - Point3{});
    }
    // The origin lies inside the body: a mesh that is inside out is turned.
    const double sign = volume < 0 ? -1 : 1;
    if (volume < 0) {
        for (auto& f : t.triangles) std::swap(f[1], f[2]);
    }
    for (Vector3& n : t.normals) n = sign * normalized(n);
}

void rim_from_triangles(TargetSurface& t) {
    std::vector<std::pair<std::uint32_t, std::uint32_t>> edges;
    for (const auto& f : t.triangles) {
        for (std::size_t e = 0; e < 3; ++e) edges.push_back(std::minmax(f[e], f[(e + 1) % 3]));
    }
    std::sort(edges.begin(), edges.end());
    for (std::size_t i = 0; i < edges.size();) {
        std::size_t j = i + 1;
        while (j < edges.size() && edges[j] == edges[i]) ++j;
        if (j - i == 1) t.on_rim[edges[i].first] = t.on_rim[edges[i].second] = 1;
        i = j;
    }
}

// Planes through neighbours: normals without sign; lift-offs; and the rim, where more than a third
// of the directions round a point hold no neighbour.
void planes_from_neighbours(TargetSurface& t,
                            const std::vector<std::vector<std::uint32_t>>& near,
                            const TargetOptions& options) {
    parallel_for(t.points.size(), 64, [&](std::size_t begin, std::size_t end) {
        std::vector<double> angle;
        for (std::size_t i = begin; i < end; ++i) {
            const auto& with_self = near[i];
            const std::vector<std::uint32_t> others(with_self.begin() + 1, with_self.end());
            const Spread without = spread_of(t.points, others);
            const double off = std::abs(dot(t.points[i] - without.centre, without.axes.column(0)));
            t.lifted[i] = off > options.lift_off_mm + 2 * without.deviation.x;
            t.normals[i] = spread_of(t.points, with_self).axes.column(0);
            angle.clear();
            const Vector3 u = any_perpendicular(t.normals[i]), v = cross(t.normals[i], u);
            for (std::uint32_t j : others) {
                const Vector3 d = t.points[j] - t.points[i];
                if (norm(d) < 0.1 * t.spacing_mm) continue;
                angle.push_back(std::atan2(dot(d, v), dot(d, u)));
            }
            std::sort(angle.begin(), angle.end());
            double gap = 2 * kPi;
            for (std::size_t n = 0; n < angle.size(); ++n) {
                const double next = n + 1 < angle.size() ? angle[n + 1] : angle[0] + 2 * kPi;
                if (n == 0) gap = 0;
                gap = std::max(gap, next - angle[n]);
            }
            t.on_rim[i] = gap > 2.4;
        }
    });
}

// Gives all normals one sign, along the tree of neighbours whose planes agree best; then turns the
// whole outwards.
void orient(TargetSurface& t, const std::vector<std::vector<std::uint32_t>>& near) {
    std::vector<std::uint8_t> done(t.points.size(), 0);
    using Entry = std::tuple<double, std::uint32_t, std::uint32_t>;  // disagreement, to, from
    for (std::size_t seed = 0; seed < t.points.size(); ++seed) {
        if (done[seed]) continue;
        std::vector<std::uint32_t> part;
        std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
        queue.push({0, static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed)});
        while (!queue.empty()) {
            const auto [cost, to, from] = queue.top();
            queue.pop();
            if (done[to]) continue;
            done[to] = 1;
            part.push_back(to);
            if (dot(t.normals[to], t.normals[from]) < 0) t.normals[to] = -t.normals[to];
            for (std::uint32_t next : near[to]) {
                if (!done[next]) {
                    queue.push({1 - std::abs(dot(t.normals[to], t.normals[next])), next, to});
                }
            }
        }
        // On balance the part's normals point away from the middle of the whole cloud.
        double outward = 0;
        for (std::uint32_t i : part) outward += dot(t.normals[i], t.points[i] - Point3{});
        if (outward < 0) {
            for (std::uint32_t i : part) t.normals[i] = -t.normals[i];
        }
    }
}

// Indices of the finite points, in order; counts the others.
std::vector<std::uint32_t> finite_points(const Surface& surface, long* not_finite) {
    std::vector<std::uint32_t> order;
    for (std::size_t i = 0; i < surface.points.size(); ++i) {
        const Point3 p = surface.points[i];
        if (std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z)) {
            order.push_back(static_cast<std::uint32_t>(i));
        } else {
            ++*not_finite;
        }
    }
    return order;
}

Error too_few(const std::string& what) {
    return {what, "",
            text("at least %ld are needed, 500 or more are good", static_cast<long>(kMinPoints))};
}

// The middle nine tenths along each axis, widened by a tenth: gross outliers must not hide the
// units.
Box3 middle_box(const Surface& surface, const std::vector<std::uint32_t>& order) {
    Box3 middle;
    for (int a = 0; a < 3; ++a) {
        std::vector<double> v;
        for (std::uint32_t i : order) v.push_back(surface.points[i][a]);
        std::sort(v.begin(), v.end());
        const double low = v[v.size() / 20], high = v[v.size() - 1 - v.size() / 20];
        middle.lower[a] = low - 0.05 * (high - low);
        middle.upper[a] = high + 0.05 * (high - low);
    }
    return middle;
}

// Takes the distinct points, relative to the origin; repeated points add no evidence and break
// neighbourhoods. Returns for each point of the input its number in the target; UINT32_MAX if it is
// not finite.
std::vector<std::uint32_t> take_distinct_points(const Surface& surface,
                                                std::vector<std::uint32_t> order,
                                                TargetSurface& t) {
    std::vector<std::uint32_t> first_equal(surface.points.size(), UINT32_MAX);
    std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
        const Point3 p = surface.points[a], q = surface.points[b];
        return std::tie(p.x, p.y, p.z, a) < std::tie(q.x, q.y, q.z, b);
    });
    std::vector<std::uint32_t> unique;
    for (std::uint32_t i : order) {
        if (!unique.empty() && surface.points[unique.back()] == surface.points[i]) {
            first_equal[i] = unique.back();
            ++t.repeated;
        } else {
            unique.push_back(i);
            first_equal[i] = i;
        }
    }
    std::sort(unique.begin(), unique.end());
    std::vector<std::uint32_t> position(surface.points.size(), UINT32_MAX);
    for (std::size_t n = 0; n < unique.size(); ++n) {
        position[unique[n]] = static_cast<std::uint32_t>(n);
        t.points.push_back(Point3{} + (surface.points[unique[n]] - t.origin));
        t.given_as.push_back(unique[n]);
    }
    std::vector<std::uint32_t> number(surface.points.size(), UINT32_MAX);
    for (std::size_t i = 0; i < number.size(); ++i) {
        if (first_equal[i] != UINT32_MAX) number[i] = position[first_equal[i]];
    }
    return number;
}

// Triangles between distinct points of the target.
void take_triangles(const Surface& surface,
                    const std::vector<std::uint32_t>& number,
                    TargetSurface& t) {
    for (const auto& f : surface.triangles) {
        std::array<std::uint32_t, 3> g{};
        bool whole_triangle = true;
        for (std::size_t v = 0; v < 3; ++v) {
            g[v] = f[v] < number.size() ? number[f[v]] : UINT32_MAX;
            whole_triangle = whole_triangle && g[v] != UINT32_MAX;
        }
        if (whole_triangle && g[0] != g[1] && g[1] != g[2] && g[2] != g[0])
            t.triangles.push_back(g);
    }
}

// Takes the readings of a table out of the points; `number` of those becomes UINT32_MAX.
void take_table_out(TargetSurface& t, std::vector<std::uint32_t>& number) {
    const TablePlane table = find_table(t.points);
    if (!table.found) return;
    t.table = {true, table.place, table.normal, table.readings};
    std::vector<std::uint32_t> moved(t.points.size(), UINT32_MAX);
    std::size_t kept = 0;
    for (std::size_t i = 0; i < t.points.size(); ++i) {
        if (table.on_table[i]) continue;
        moved[i] = static_cast<std::uint32_t>(kept);
        t.points[kept] = t.points[i];
        t.given_as[kept++] = t.given_as[i];
    }
    t.points.resize(kept);
    t.given_as.resize(kept);
    for (std::uint32_t& n : number) {
        if (n != UINT32_MAX) n = moved[n];
    }
}

// The nearest `count` neighbours of each point, itself first; sets spacing_mm.
std::vector<std::vector<std::uint32_t>> neighbourhoods(TargetSurface& t, int count) {
    std::vector<double> sixth(t.points.size());
    std::vector<std::vector<std::uint32_t>> near(t.points.size());
    parallel_for(t.points.size(), 64, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            near[i] = t.index.nearest(t.points[i], count);
            // The point itself comes first, whatever the order of ties.
            auto self = std::find(near[i].begin(), near[i].end(), static_cast<std::uint32_t>(i));
            if (self != near[i].end()) std::rotate(near[i].begin(), self, self + 1);
            sixth[i] = distance(t.points[i],
                                t.points[near[i][std::min<std::size_t>(6, near[i].size() - 1)]]);
        }
    });
    std::nth_element(sixth.begin(), sixth.begin() + static_cast<std::ptrdiff_t>(sixth.size() / 2),
                     sixth.end());
    t.spacing_mm = sixth[sixth.size() / 2];
    return near;
}

}  // namespace

Result<TargetSurface> prepare_target(const Surface& surface, const TargetOptions& options) {
    TargetSurface t;
    t.given = static_cast<long>(surface.points.size());
    std::vector<std::uint32_t> order = finite_points(surface, &t.not_finite);
    if (order.size() < kMinPoints) {
        return too_few(text("surface of %ld usable points (%ld given, %ld not finite)",
                            static_cast<long>(order.size()), t.given, t.not_finite));
    }
    const Box3 middle = middle_box(surface, order);
    SONOCASE_TRY_DONE(check_units(middle));
    t.origin = middle.centre();
    std::vector<std::uint32_t> number = take_distinct_points(surface, std::move(order), t);
    if (options.find_table) take_table_out(t, number);
    if (t.points.size() < kMinPoints) {
        return too_few(t.table.found
                           ? text("surface of %ld points beside %ld readings of the table",
                                  static_cast<long>(t.points.size()), t.table.readings)
                           : text("surface of %ld distinct points among %ld",
                                  static_cast<long>(t.points.size()), t.given));
    }
    const Spread whole = spread_of(t.points, all_of(t.points.size()));
    t.thickness_mm = whole.deviation.x;
    if (whole.deviation.y < 5 || whole.deviation.x < 3) {
        return Error{text("readings lie %s: standard deviations %.3g, %.3g and %.3g mm",
                          whole.deviation.y < 5 ? "on a line" : "in a plane", whole.deviation.z,
                          whole.deviation.y, whole.deviation.x),
                     "", "sweep round the body, so that the pose is determined"};
    }
    t.index = PointIndex(t.points);
    t.normals.resize(t.points.size());
    t.on_rim.assign(t.points.size(), 0);
    t.lifted.assign(t.points.size(), 0);
    take_triangles(surface, number, t);
    const bool mesh = !t.triangles.empty();
    const auto near = neighbourhoods(t, mesh ? 7 : options.neighbours + 1);
    if (mesh) {
        normals_from_triangles(t);
        rim_from_triangles(t);
    } else {
        planes_from_neighbours(t, near, options);
        orient(t, near);
    }
    t.lift_offs = std::count(t.lifted.begin(), t.lifted.end(), 1);
    return t;
}

}  // namespace sonocase::pipeline::inline registration_fit
