// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/landmark_candidates.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "pipeline/pictures/png.h"

namespace sonocase::pipeline::inline registration {
namespace {

constexpr std::size_t kMinPoints = 100;
constexpr double kBandMm = 20, kSliceMm = 15, kLegMm = 25;  // band and legs: from the midline
constexpr double kTrunkDepth = 0.8;                         // of the slice, on the midline
constexpr double kNavelBandMm = 35, kDimpleMm = 1.5;
constexpr double kInnerMm = 9, kOuterMm = 40;  // a navel, and the skin round it
constexpr double kPlaceMm = 25;                // across one extreme
constexpr int kPanelPx = 360;

// The patient's axes: right, front, up.
struct BodyAxes {
    BodyAxes(Vector3 given_up, Vector3 given_front) {
        up = normalized(given_up);
        front = normalized(given_front - dot(given_front, up) * up);
        right = cross(front, up);
    }
    Point3 body(Point3 p) const {
        const Vector3 v = p - Point3{};
        return {dot(v, right), dot(v, front), dot(v, up)};
    }
    Point3 given(Point3 b) const { return Point3{} + b.x * right + b.y * front + b.z * up; }
    Vector3 up, front, right;
};

Point3 extreme(const std::vector<Point3>& points, int axis, double sign) {
    std::vector<std::size_t> order(points.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    const std::size_t count = std::max<std::size_t>(5, points.size() / 500);
    std::partial_sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(count),
                      order.end(), [&](std::size_t a, std::size_t b) {
                          const double va = sign * points[a][axis], vb = sign * points[b][axis];
                          return va > vb || (va == vb && a < b);
                      });
    // Only points near the farthest one count: back and buttocks may both be far.
    Vector3 sum;
    double near = 0;
    for (std::size_t i = 0; i < count; ++i) {
        if (distance(points[order[i]], points[order[0]]) > kPlaceMm) continue;
        sum = sum + (points[order[i]] - Point3{});
        ++near;
    }
    return Point3{} + (1 / near) * sum;
}

// The lowest slice that is as deep on the midline as beside it, with two slices below it that are
// not and have skin on both sides: thighs may touch, but between them the body is not deep.
bool find_crotch(const std::vector<Point3>& points,
                 double middle,
                 const Box3& box,
                 Point3& crotch) {
    struct Slice {
        Box3 all, band;
        Vector3 sum;
        int in_band = 0, right = 0, left = 0;
    };
    std::vector<Slice> slices(static_cast<std::size_t>((box.upper.z - box.lower.z) / kSliceMm) + 1);
    for (const Point3 p : points) {
        Slice& slice = slices[static_cast<std::size_t>((p.z - box.lower.z) / kSliceMm)];
        slice.all.include(p);
        slice.right += p.x > middle + kLegMm;
        slice.left += p.x < middle - kLegMm;
        if (std::abs(p.x - middle) > kBandMm) continue;
        slice.band.include(p);
        slice.sum = slice.sum + (p - Point3{});
        ++slice.in_band;
    }
    int legs = 0;
    for (std::size_t n = 0; n < slices.size(); ++n) {
        const Slice& slice = slices[n];
        if (slice.right < 3 || slice.left < 3) continue;
        const bool trunk =
            slice.in_band >= 2 && slice.band.extent().y > kTrunkDepth * slice.all.extent().y;
        if (!trunk) {
            ++legs;
            continue;
        }
        if (legs < 2) return false;
        crotch = Point3{} + (1.0 / slice.in_band) * slice.sum;
        crotch.z = box.lower.z + static_cast<double>(n) * kSliceMm;
        return true;
    }
    return false;
}

// How far the skin within kInnerMm of p lies behind the quadratic through the skin round it.
double dimple_mm(const std::vector<Point3>& front, Point3 p) {
    std::vector<Point3> round;
    double inner = 0;
    int inside = 0;
    for (const Point3 q : front) {
        const double r = std::hypot(q.x - p.x, q.z - p.z);
        if (r < kInnerMm) {
            inner += q.y;
            ++inside;
        } else if (r < kOuterMm && r > 1.5 * kInnerMm) {
            round.push_back(q);
        }
    }
    if (inside < 3 || round.size() < 30) return 0;
    Eigen::MatrixXd a(static_cast<Eigen::Index>(round.size()), 6);
    Eigen::VectorXd y(a.rows());
    for (std::size_t i = 0; i < round.size(); ++i) {
        const double u = (round[i].x - p.x) / kOuterMm, v = (round[i].z - p.z) / kOuterMm;
        const auto row = static_cast<Eigen::Index>(i);
        a.row(row) << 1, u, v, u * u, u * v, v * v;
        y[row] = round[i].y;
    }
    const Eigen::VectorXd fit = a.colPivHouseholderQr().solve(y);
    return fit[0] - inner / inside;
}

void add_navel(const BodyAxes& axes,
               const std::vector<Point3>& points,
               double middle,
               double low,
               double high,
               std::vector<LandmarkCandidate>& out) {
    double mean_y = 0;
    for (const Point3 p : points) mean_y += p.y / static_cast<double>(points.size());
    std::vector<Point3> front;
    for (const Point3 p : points)
        if (p.y > mean_y && std::abs(p.x - middle) < kNavelBandMm + kOuterMm) front.push_back(p);
    double deepest = kDimpleMm;
    Point3 best;
    bool found = false;
    for (const Point3 p : front) {
        const double share = (p.z - low) / (high - low);
        if (std::abs(p.x - middle) > kNavelBandMm || share < 0.15 || share > 0.85) continue;
        const double depth = dimple_mm(front, p);
        if (depth <= deepest) continue;
        deepest = depth;
        best = p;
        found = true;
    }
    if (!found) return;
    char how[48];
    std::snprintf(how, sizeof how, "dimple of %.1f mm", deepest);
    out.push_back({"navel", axes.given(best), how});
}

}  // namespace

std::vector<LandmarkCandidate> landmark_candidates(const Surface& skin,
                                                   Vector3 up,
                                                   Vector3 given_front) {
    std::vector<LandmarkCandidate> out;
    if (skin.points.size() < kMinPoints) return out;
    const BodyAxes axes(up, given_front);
    std::vector<Point3> points;
    Box3 box;
    for (const Point3 p : skin.points) {
        points.push_back(axes.body(p));
        box.include(points.back());
    }
    const struct {
        const char* name;
        int axis;
        double sign;
    } extremes[] = {
        {"rightmost", 0, 1}, {"leftmost", 0, -1}, {"front_most", 1, 1}, {"hindmost", 1, -1}};
    for (const auto& e : extremes)
        out.push_back({e.name, axes.given(extreme(points, e.axis, e.sign)), "extreme"});
    // The midline is that of the lower half, where the arms are not.
    double left = 1e300, right = -1e300;
    for (const Point3 p : points) {
        if (p.z > box.centre().z) continue;
        left = std::min(left, p.x);
        right = std::max(right, p.x);
    }
    const double middle = 0.5 * (left + right);
    double low = box.lower.z;
    Point3 crotch;
    if (find_crotch(points, middle, box, crotch)) {
        out.push_back({"crotch", axes.given(crotch), "legs part below it"});
        low = crotch.z;
    }
    add_navel(axes, points, middle, low, box.upper.z, out);
    return out;
}

CandidateColour candidate_colour(const std::string& candidate) {
    const std::pair<const char*, CandidateColour> colours[] = {
        {"rightmost", {"yellow", {240, 220, 60}}}, {"leftmost", {"orange", {250, 150, 40}}},
        {"front_most", {"green", {80, 210, 90}}},  {"hindmost", {"blue", {90, 140, 250}}},
        {"crotch", {"violet", {210, 110, 230}}},   {"navel", {"red", {240, 70, 70}}}};
    for (const auto& [name, colour] : colours)
        if (candidate == name) return colour;
    return {"white", {255, 255, 255}};
}

std::vector<std::uint8_t> landmark_picture(const std::vector<CandidateView>& views) {
    const int width = 2 * kPanelPx,
              height = std::max<int>(1, static_cast<int>(views.size())) * kPanelPx;
    std::vector<std::uint8_t> rgb(3 * width * height, 16);
    const auto plot = [&](int x, int y, int radius, std::array<std::uint8_t, 3> colour) {
        for (int v = -radius; v <= radius; ++v)
            for (int u = -radius; u <= radius; ++u) {
                if (u * u + v * v > radius * radius || x + u < 0 || x + u >= width || y + v < 0 ||
                    y + v >= height)
                    continue;
                const auto at = static_cast<std::size_t>(3 * ((y + v) * width + x + u));
                std::copy(colour.begin(), colour.end(),
                          rgb.begin() + static_cast<std::ptrdiff_t>(at));
            }
    };
    for (std::size_t n = 0; n < views.size(); ++n) {
        const CandidateView& view = views[n];
        const BodyAxes axes(view.up, view.front);
        Box3 box;
        for (const Point3 p : view.skin->points) box.include(axes.body(p));
        if (box.empty()) continue;
        const Vector3 extent = box.extent();
        const double mm = std::max({extent.x, extent.y, extent.z, 1.0}) / (0.92 * kPanelPx);
        const Point3 c = box.centre();
        // From the front, the patient's right is at the left of the panel; from the right, the
        // front is.
        for (int panel = 0; panel < 2; ++panel) {
            const int across = panel == 0 ? 0 : 1, into = 1 - across;
            const auto draw = [&](Point3 given, int radius, std::array<std::uint8_t, 3> colour) {
                const Point3 p = axes.body(given);
                plot(panel * kPanelPx + kPanelPx / 2 +
                         static_cast<int>(std::lround((c[across] - p[across]) / mm)),
                     static_cast<int>(n) * kPanelPx + kPanelPx / 2 -
                         static_cast<int>(std::lround((p.z - c.z) / mm)),
                     radius, colour);
            };
            for (const Point3 given : view.skin->points) {
                const Point3 p = axes.body(given);
                if (p[into] < c[into]) continue;  // the far side
                const auto grey = static_cast<std::uint8_t>(
                    70 +
                    110 * std::clamp((p[into] - c[into]) / (0.5 * extent[into] + 1e-9), 0.0, 1.0));
                draw(given, 1, {grey, grey, grey});
            }
            for (const LandmarkCandidate& candidate : view.candidates)
                draw(candidate.place, 6, candidate_colour(candidate.name).rgb);
        }
    }
    return png_from_rgb(rgb.data(), width, height);
}

std::string landmark_rows(const std::vector<LandmarkCandidate>& ct,
                          const std::vector<LandmarkCandidate>& mannequin) {
    std::string out = "name,ct_x,ct_y,ct_z,x,y,z\n";
    for (const LandmarkCandidate& a : ct)
        for (const LandmarkCandidate& b : mannequin) {
            if (a.name != b.name) continue;
            char row[200];
            std::snprintf(row, sizeof row, "%s,%.1f,%.1f,%.1f,%.1f,%.1f,%.1f\n", a.name.c_str(),
                          a.place.x, a.place.y, a.place.z, b.place.x, b.place.y, b.place.z);
            out += row;
        }
    return out;
}

}  // namespace sonocase::pipeline::inline registration
