// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/fit/table_plane.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "pipeline/base/parallel.h"

namespace sonocase::pipeline::inline registration_fit {
namespace {

constexpr long kMinReadings = 8;
constexpr double kWithinMm = 4, kBehindMm = 6, kBesideMm = 15, kMinSpreadMm = 40;
constexpr double kMinShareBeside = 0.6, kMaxShareBehind = 0.005;
constexpr std::size_t kMinAbove = 8;
// Rays to cells of a cube's faces meet the faces of the convex hull that are tried; a table makes a
// large face, because it reaches beyond the body on both sides.
constexpr int kCells = 6, kLayers = 3;
constexpr double kMinFaceMm2 = 5000;
constexpr std::size_t kSample = 1500, kFaces = 30;

struct Plane {
    Point3 place;
    Vector3 normal;
    double height(Point3 p) const { return dot(normal, p - place); }
};

// The convex outline of the points higher than `above_mm` on a plane, and what lies beside it.
class Outline {
  public:
    Outline(std::span<const Point3> points, const Plane& plane, double above_mm)
        : u_(any_perpendicular(plane.normal)), v_(cross(plane.normal, u_)) {
        std::vector<Spot> spots;
        for (const Point3 p : points) {
            if (plane.height(p) > above_mm) spots.push_back(spot(p));
        }
        above_ = spots.size();
        if (above_ < 3) return;
        std::sort(spots.begin(), spots.end(), [](const Spot& a, const Spot& b) {
            return a.x < b.x || (a.x == b.x && a.y < b.y);
        });
        // Andrew's monotone chain: the lower side from left to right, then the upper one back.
        std::vector<Spot> hull;
        const auto half = [&](auto begin, auto end) {
            const std::size_t first = hull.size();
            for (auto s = begin; s != end; ++s) {
                while (hull.size() >= first + 2 &&
                       area(hull[hull.size() - 2], hull.back(), *s) <= 0)
                    hull.pop_back();
                hull.push_back(*s);
            }
            hull.pop_back();
        };
        half(spots.begin(), spots.end());
        half(spots.rbegin(), spots.rend());
        for (std::size_t n = 0; n < hull.size(); ++n) {
            const Spot a = hull[n], b = hull[(n + 1) % hull.size()];
            const double length = std::hypot(b.x - a.x, b.y - a.y);
            if (!(length > 0)) continue;
            const Spot out{(b.y - a.y) / length, (a.x - b.x) / length};
            sides_.push_back({out, out.x * a.x + out.y * a.y});
        }
    }
    std::size_t above() const { return above_; }
    bool beside(Point3 p) const {
        const Spot s = spot(p);
        return std::any_of(sides_.begin(), sides_.end(), [&](const Side& side) {
            return side.out.x * s.x + side.out.y * s.y > side.support + kBesideMm;
        });
    }

  private:
    struct Spot {
        double x, y;
    };
    struct Side {
        Spot out;
        double support;
    };
    Spot spot(Point3 p) const { return {dot(u_, p - Point3{}), dot(v_, p - Point3{})}; }
    static double area(Spot a, Spot b, Spot c) {
        return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
    }

    Vector3 u_, v_;
    std::vector<Side> sides_;
    std::size_t above_ = 0;
};

Vector3 direction_of(std::size_t n) {
    const std::size_t face = n / (kCells * kCells), cell = n % (kCells * kCells),
                      column = cell % kCells, row = cell / kCells;
    const double a = 2 * (static_cast<double>(column) + 0.5) / kCells - 1;
    const double b = 2 * (static_cast<double>(row) + 0.5) / kCells - 1;
    Vector3 d;
    d[static_cast<int>(face / 2)] = face % 2 == 0 ? 1 : -1;
    d[static_cast<int>((face / 2 + 1) % 3)] = a;
    d[static_cast<int>((face / 2 + 2) % 3)] = b;
    return normalized(d);
}

// A face of the convex hull: three of its corners.
struct Face {
    std::array<std::size_t, 3> corner{};
    Plane plane;
    double area_mm2 = 0;
    long near = 0;
};

// The face through which a ray from the origin, which lies inside, leaves the hull of the points.
// Portal refinement (Snethen, Game Programming Gems 7): a cone of three points round the ray is
// narrowed by the farthest point along the normal of its portal until there is none.
Face face_along(std::span<const Vector3> points, Vector3 ray) {
    const auto farthest = [&](Vector3 n) {
        std::size_t best = 0;
        for (std::size_t i = 1; i < points.size(); ++i) {
            if (dot(n, points[i]) > dot(n, points[best])) best = i;
        }
        return best;
    };
    const auto volume = [&](std::size_t i, std::size_t j) {
        return dot(cross(points[i], points[j]), ray);
    };
    std::size_t a = farthest(ray), b = farthest(cross(points[a], ray));
    if (volume(a, b) < 0) std::swap(a, b);
    std::size_t c = 0;
    for (int n = 0; n < 30; ++n) {
        c = farthest(cross(points[a], points[b]));
        if (volume(c, a) < 0) {
            b = c;
        } else if (volume(b, c) < 0) {
            a = c;
        } else {
            break;
        }
    }
    Vector3 normal;
    for (int n = 0; n < 60; ++n) {
        normal = cross(points[b] - points[a], points[c] - points[a]);
        const std::size_t d = farthest(normal);
        if (!(dot(normal, points[d] - points[a]) > 1e-6 * norm(normal))) break;
        // Takes the one of the three cones that d makes which holds the ray.
        const double ab = std::min(volume(b, d), volume(d, a));
        const double bc = std::min(volume(c, d), volume(d, b));
        const double ca = std::min(volume(a, d), volume(d, c));
        (ab >= bc && ab >= ca ? c : bc >= ca ? a : b) = d;
    }
    Face face;
    face.corner = {a, b, c};
    face.area_mm2 = 0.5 * norm(normal);
    if (face.area_mm2 > 0) face.plane = {Point3{} + points[a], -normalized(normal)};
    return face;
}

// Faces of the hull that have readings near them, largest first; of the points and, so that a
// few outliers do not hide a table, of those that remain when the corners found are taken away.
std::vector<Face> large_faces(std::vector<Vector3> points) {
    std::vector<Face> faces;
    const std::vector<Vector3> all = points;
    for (int layer = 0; layer < kLayers && points.size() > 8; ++layer) {
        std::vector<Face> found(std::size_t{6} * kCells * kCells);
        parallel_for(found.size(), 8, [&](std::size_t begin, std::size_t end) {
            for (std::size_t n = begin; n < end; ++n) {
                Face face = face_along(points, direction_of(n));
                if (face.area_mm2 < kMinFaceMm2) continue;
                for (const Vector3 p : all)
                    face.near += std::abs(face.plane.height(Point3{} + p)) <= 2 * kWithinMm;
                found[n] = face;
            }
        });
        std::vector<std::uint8_t> corner(points.size(), 0);
        for (const Face& face : found) {
            for (const std::size_t i : face.corner) corner[i] = 1;
            if (face.near >= kMinReadings) faces.push_back(face);
        }
        std::vector<Vector3> rest;
        for (std::size_t i = 0; i < points.size(); ++i) {
            if (!corner[i]) rest.push_back(points[i]);
        }
        points = std::move(rest);
    }
    std::stable_sort(faces.begin(), faces.end(),
                     [](const Face& a, const Face& b) { return a.area_mm2 > b.area_mm2; });
    std::vector<Face> different;
    for (const Face& face : faces) {
        const bool again = std::any_of(different.begin(), different.end(), [&](const Face& other) {
            return dot(face.plane.normal, other.plane.normal) > 0.9999 &&
                   std::abs(other.plane.height(face.plane.place)) < 2;
        });
        if (!again) different.push_back(face);
        if (different.size() == kFaces) break;
    }
    return different;
}

Plane turned_towards(Plane plane, Vector3 direction) {
    if (dot(plane.normal, direction) < 0) plane.normal = -plane.normal;
    return plane;
}

// The plane through points by least squares; deviation: along the principal axes, smallest first.
Plane fitted_plane(const std::vector<Point3>& points, Vector3 towards, Vector3* deviation) {
    Vector3 sum;
    for (const Point3 p : points) sum = sum + (p - Point3{});
    const auto count = static_cast<double>(points.size());
    Plane plane;
    plane.place = Point3{} + sum / count;
    Eigen::Matrix3d c = Eigen::Matrix3d::Zero();
    for (const Point3 p : points) {
        const Vector3 d = p - plane.place;
        const Eigen::Vector3d e(d.x, d.y, d.z);
        c += e * e.transpose();
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(c / count);
    for (int a = 0; a < 3; ++a) {
        (*deviation)[a] = std::sqrt(std::max(0.0, solver.eigenvalues()[a]));
        plane.normal[a] = solver.eigenvectors()(a, 0);
    }
    return turned_towards(plane, towards);
}

// Fits a candidate to all points near it and beside the body; `found` is false if it is not a
// table.
TablePlane judged(std::span<const Point3> points, Plane plane) {
    TablePlane table;
    double within = kWithinMm;
    Vector3 deviation;
    for (int round = 0; round < 3; ++round) {
        const Outline outline(points, plane, kBesideMm);
        std::vector<Point3> members;
        for (const Point3 p : points) {
            if (std::abs(plane.height(p)) <= 2 * within && outline.beside(p)) members.push_back(p);
        }
        if (static_cast<long>(members.size()) < kMinReadings) return table;
        plane = fitted_plane(members, plane.normal, &deviation);
        within = std::max(kWithinMm, 3 * deviation.x);
    }
    if (!(deviation.y > kMinSpreadMm) || !(deviation.x < 10)) return table;
    const Outline outline(points, plane, kBesideMm);
    long near = 0, beside = 0, behind = 0;
    table.on_table.assign(points.size(), 0);
    for (std::size_t i = 0; i < points.size(); ++i) {
        const double height = plane.height(points[i]);
        behind += height < -std::max(kBehindMm, within);
        if (std::abs(height) > within) continue;
        ++near;
        beside += outline.beside(points[i]);
        table.on_table[i] = 1;
    }
    const auto count = static_cast<double>(points.size());
    table.found = beside >= kMinReadings &&
                  static_cast<double>(beside) >= kMinShareBeside * static_cast<double>(near) &&
                  static_cast<double>(behind) <= 2 + kMaxShareBehind * count &&
                  outline.above() >= kMinAbove;
    table.place = plane.place;
    table.normal = plane.normal;
    table.readings = near;
    return table;
}

}  // namespace

TablePlane find_table(std::span<const Point3> points) {
    TablePlane best;
    if (points.empty()) return best;
    const std::size_t stride = std::max<std::size_t>(1, points.size() / kSample);
    Vector3 middle;
    for (const Point3 p : points) middle = middle + (p - Point3{});
    middle = middle / static_cast<double>(points.size());
    std::vector<Vector3> some;
    for (std::size_t i = 0; i < points.size(); i += stride)
        some.push_back(points[i] - Point3{} - middle);
    const std::vector<Face> faces = large_faces(std::move(some));
    std::vector<TablePlane> tables(faces.size());
    parallel_for(faces.size(), 2, [&](std::size_t begin, std::size_t end) {
        for (std::size_t n = begin; n < end; ++n) {
            const Plane& plane = faces[n].plane;
            tables[n] = judged(points, {plane.place + middle, plane.normal});
        }
    });
    for (TablePlane& table : tables) {
        if (table.found && table.readings > best.readings) best = std::move(table);
    }
    return best;
}

}  // namespace sonocase::pipeline::inline registration_fit
