// SPDX-License-Identifier: Apache-2.0

#include "pipeline/flow/vessel_course.h"

#include <algorithm>
#include <cmath>

#include "formats/base/constants.h"

namespace sonocase::pipeline::inline flow {
namespace {

constexpr double kMaxOfMedian = 1.5, kLongestRayMm = 40;
constexpr double kMaxOfWall = 2.2;             // of the middle's distance to the wall: a flat vein
constexpr double kEndRadii = 1.2, kEndMm = 2;  // of a free end that is dropped

using Line = std::vector<Point3>;

// How much of a place is vessel of the part's kind, [0, 1]; voxels beyond the map repeat its
// border.
class Lumen {
  public:
    Lumen(const LabelVolume& labels, FlowKind kind)
        : labels_(labels),
          kinds_(flow_kinds(labels.labels)),
          kind_(static_cast<std::uint8_t>(1 + static_cast<int>(kind))) {}

    double at(Point3 p) const {
        const Point3 v = labels_.grid.voxel_from_point(p);
        const double fx = std::floor(v.x), fy = std::floor(v.y), fz = std::floor(v.z);
        double sum = 0;
        for (int c = 0; c < 8; ++c) {
            const double wx = c & 1 ? v.x - fx : 1 - (v.x - fx),
                         wy = c & 2 ? v.y - fy : 1 - (v.y - fy),
                         wz = c & 4 ? v.z - fz : 1 - (v.z - fz);
            const int label =
                voxel(static_cast<int>(fx) + (c & 1), static_cast<int>(fy) + (c >> 1 & 1),
                      static_cast<int>(fz) + (c >> 2));
            if (kinds_[label] == kind_) sum += wx * wy * wz;
        }
        return sum;
    }
    int label(Point3 p) const {
        const Point3 v = labels_.grid.voxel_from_point(p);
        const int l = voxel(static_cast<int>(std::lround(v.x)), static_cast<int>(std::lround(v.y)),
                            static_cast<int>(std::lround(v.z)));
        return kinds_[l] == kind_ ? l : 0;
    }
    double voxel_mm() const { return labels_.grid.spacing_mm.x; }
    bool in_map(Point3 p) const {
        const Point3 v = labels_.grid.voxel_from_point(p);
        const Int3 n = labels_.grid.size;
        return v.x > -0.5 && v.y > -0.5 && v.z > -0.5 && v.x < n.x - 0.5 && v.y < n.y - 0.5 &&
               v.z < n.z - 0.5;
    }

  private:
    int voxel(int i, int j, int k) const {
        const Int3 n = labels_.grid.size;
        return labels_.voxels[labels_.grid.index(
            std::clamp(i, 0, n.x - 1), std::clamp(j, 0, n.y - 1), std::clamp(k, 0, n.z - 1))];
    }
    const LabelVolume& labels_;
    std::array<std::uint8_t, 256> kinds_;
    std::uint8_t kind_;
};

double length_of(const Line& line) {
    double sum = 0;
    for (std::size_t i = 0; i + 1 < line.size(); ++i) sum += distance(line[i], line[i + 1]);
    return sum;
}

// Returns evenly spaced points of the line, its ends included.
Line resampled(const Line& line, double step_mm) {
    const double length = length_of(line);
    const int pieces = std::max(1, static_cast<int>(std::lround(length / step_mm)));
    Line out{line.front()};
    std::size_t i = 0;
    double before = 0;
    for (int k = 1; k < pieces; ++k) {
        const double at = length * k / pieces;
        double here = distance(line[i], line[i + 1]);
        while (before + here < at && i + 2 < line.size()) {
            before += here;
            ++i;
            here = distance(line[i], line[i + 1]);
        }
        const double t = here > 0 ? std::clamp((at - before) / here, 0.0, 1.0) : 0;
        out.push_back(line[i] + t * (line[i + 1] - line[i]));
    }
    out.push_back(line.back());
    return out;
}

// Smooths with a Gaussian along the line, reflected through its ends so that they stay.
Line smoothed(const Line& line, double sigma_mm) {
    const auto n = static_cast<int>(line.size());
    if (n < 3) return line;
    const double step = length_of(line) / (n - 1);
    const int reach = std::min(n - 1, static_cast<int>(std::ceil(3 * sigma_mm / step)));
    const auto at = [&](int i) {
        if (i < 0) return line.front() + (line.front() - line[-i]);
        if (i >= n) return line.back() + (line.back() - line[2 * (n - 1) - i]);
        return line[i];
    };
    Line out;
    for (int i = 0; i < n; ++i) {
        double weight = 0;
        Vector3 sum;
        for (int k = -reach; k <= reach; ++k) {
            const double w = std::exp(-0.5 * k * k * step * step / (sigma_mm * sigma_mm));
            weight += w;
            sum = sum + w * (at(i + k) - Point3{});
        }
        out.push_back(Point3{} + sum / weight);
    }
    return out;
}

// The part of a line from arc length `from` to `to`.
Line part_of(const Line& line, double from, double to) {
    const Line fine = resampled(line, 0.5);
    const double step = length_of(fine) / static_cast<double>(fine.size() - 1);
    const auto first = static_cast<std::size_t>(std::lround(from / step)),
               last = std::min(static_cast<std::size_t>(std::lround(to / step)), fine.size() - 1);
    if (first + 1 >= last) return {};
    return {fine.begin() + first, fine.begin() + last + 1};
}

Vector3 direction_at(const Line& line, std::size_t i) {
    const std::size_t a = i > 0 ? i - 1 : i, b = i + 1 < line.size() ? i + 1 : i;
    // Rounded as a bundle keeps it, so that rays are counted from the same direction there.
    Vector3 d = normalized(line[b] - line[a]);
    for (int axis = 0; axis < 3; ++axis) d[axis] = std::round(d[axis] * 32767) / 32767;
    return d;
}

// Goes straight on from the end of a line to the end of the lumen.
void run_on(const Lumen& lumen, Line& line, double max_mm) {
    const std::size_t n = line.size(), back = std::min<std::size_t>(n - 1, 12);
    const Vector3 d = normalized(line[n - 1] - line[n - 1 - back]);
    Point3 p = line.back();
    for (double s = 0; s < max_mm; s += 0.5) {
        p = p + 0.5 * d;
        if (!lumen.in_map(p) || lumen.at(p) < 0.5) break;
        line.push_back(p);
    }
}

double ray_radius(const Lumen& lumen, Point3 centre, Vector3 d) {
    const double step = 0.5 * lumen.voxel_mm();
    double inside = lumen.at(centre);
    for (double r = step; r < kLongestRayMm; r += step) {
        const double here = lumen.at(centre + r * d);
        if (here < 0.5 && inside >= 0.5) return r - step * (0.5 - here) / (inside - here);
        inside = here;
    }
    return kLongestRayMm;
}

std::array<float, kFlowRays> section(const Lumen& lumen,
                                     Point3 centre,
                                     SectionAxes axes,
                                     double max_radius_mm) {
    std::array<double, kFlowRays> r{};
    for (std::size_t ray = 0; ray < kFlowRays; ++ray) {
        const double angle = 2 * kPi * static_cast<double>(ray) / kFlowRays;
        r[ray] =
            ray_radius(lumen, centre, std::cos(angle) * axes.first + std::sin(angle) * axes.second);
    }
    auto sorted = r;
    std::sort(sorted.begin(), sorted.end());
    const double median = 0.5 * (sorted[kFlowRays / 2 - 1] + sorted[kFlowRays / 2]);
    // A blend of voxels sees a round wall from inside a little nearer than it is: by the second
    // moment of the blend over twice the radius.
    const double vx = lumen.voxel_mm(), moment = vx * vx / 6;
    std::array<float, kFlowRays> out{};
    for (std::size_t ray = 0; ray < kFlowRays; ++ray) {
        const double kept = std::clamp(
            r[ray], 0.25 * vx, std::max(std::min(kMaxOfMedian * median, max_radius_mm), 0.25 * vx));
        out[ray] = static_cast<float>(kept + moment / (2 * std::max(kept, vx)));
    }
    return out;
}

Vector3 centroid_of(const std::array<float, kFlowRays>& r, SectionAxes axes) {
    double area = 0, x = 0, y = 0;
    for (std::size_t i = 0; i < kFlowRays; ++i) {
        const double angle = 2 * kPi * static_cast<double>(i) / kFlowRays,
                     rr = static_cast<double>(r[i]);
        area += rr * rr / 2;
        x += rr * rr * rr / 3 * std::cos(angle);
        y += rr * rr * rr / 3 * std::sin(angle);
    }
    return (x / area) * axes.first + (y / area) * axes.second;
}

std::vector<SectionAxes> axes_along(const Line& line) {
    std::vector<SectionAxes> axes;
    Vector3 first = any_perpendicular(direction_at(line, 0));
    for (std::size_t i = 0; i < line.size(); ++i) {
        const Vector3 d = direction_at(line, i);
        Vector3 across = first - dot(first, d) * d;
        if (!(norm(across) > 1e-6)) across = any_perpendicular(d);
        first = normalized(across);
        axes.push_back({first, cross(d, first)});
    }
    return axes;
}

// Points of the line that stay in place while it is centred: those within a fork.
struct Held {
    double first_mm = 0, last_mm = 0;
};

void centre_line(const Lumen& lumen, const Held& held, double max_radius_mm, Line& line) {
    for (int pass = 0; pass < 2; ++pass) {
        const auto axes = axes_along(line);
        const double step = length_of(line) / static_cast<double>(line.size() - 1);
        Line moved = line;
        for (std::size_t i = 0; i < line.size(); ++i) {
            const double at = step * static_cast<double>(i);
            if (at < held.first_mm || length_of(line) - at < held.last_mm) continue;
            moved[i] =
                line[i] + centroid_of(section(lumen, line[i], axes[i], max_radius_mm), axes[i]);
        }
        line = smoothed(moved, 0.8 * step);
    }
}

// Gives nodes within a fork the next section outside it, and smooths once along the vessel
// elsewhere.
void finish_sections(const Held& held, double step, std::vector<FlowNode>& nodes) {
    const auto n = static_cast<int>(nodes.size());
    const int low = std::min(n / 2, static_cast<int>(std::ceil(held.first_mm / step))),
              high = std::max(n / 2, n - 1 - static_cast<int>(std::ceil(held.last_mm / step)));
    for (int i = 0; i < low; ++i) nodes[i].radius_mm = nodes[low].radius_mm;
    for (int i = high + 1; i < n; ++i) nodes[i].radius_mm = nodes[high].radius_mm;
    const std::vector<FlowNode> raw = nodes;
    for (std::size_t i = 1; i + 1 < nodes.size(); ++i)
        for (std::size_t ray = 0; ray < kFlowRays; ++ray)
            nodes[i].radius_mm[ray] =
                0.75f * raw[i].radius_mm[ray] +
                0.125f * (raw[i - 1].radius_mm[ray] + raw[i + 1].radius_mm[ray]);
}

double step_of(const std::vector<FlowNode>& nodes) {
    double sum = 0;
    for (std::size_t i = 0; i + 1 < nodes.size(); ++i)
        sum += distance(nodes[i].centre, nodes[i + 1].centre);
    return sum / static_cast<double>(nodes.size() - 1);
}

void measure(const Lumen& lumen, VesselCourse& course) {
    FlowField field;
    field.nodes = course.nodes;
    FlowVessel vessel;
    vessel.nodes = static_cast<int>(course.nodes.size());
    const auto axes = section_axes(field, vessel);
    for (std::size_t i = 0; i < course.nodes.size(); ++i)
        course.nodes[i].radius_mm =
            section(lumen, course.nodes[i].centre, axes[i], course.max_radius_mm);
    finish_sections({course.fork_first_mm, course.fork_last_mm}, step_of(course.nodes),
                    course.nodes);
}

VesselCourse course_of(const Lumen& lumen,
                       const CentreTree& tree,
                       const CentreLine& from,
                       const CourseOptions& options) {
    VesselCourse course;
    course.first = from.first;
    course.last = from.last;
    const CentreNode &a = tree.nodes[from.first], &b = tree.nodes[from.last];
    const double length = length_of(from.points);
    const auto drop = [&](const CentreNode& node, double radius) {
        return node.degree == 1 ? std::min(kEndRadii * radius + kEndMm, 0.3 * length) : 0.0;
    };
    const double middle = from.radius_mm[from.radius_mm.size() / 2];
    Line line = part_of(from.points, drop(a, middle), length - drop(b, middle));
    if (line.size() < 4) return course;
    line = smoothed(resampled(line, 1), options.smooth_mm);
    const double max_mm = 3 * middle + 10;
    if (b.degree == 1) run_on(lumen, line, max_mm);
    if (a.degree == 1) {
        std::reverse(line.begin(), line.end());
        run_on(lumen, line, max_mm);
        std::reverse(line.begin(), line.end());
    }
    line = resampled(line, options.node_mm);
    const auto fork = [&](const CentreNode& node) {
        return node.degree > 1 ? std::min(1.2 * node.radius_mm, 0.4 * length) : 0.0;
    };
    const Held held{fork(a), fork(b)};
    auto sorted = from.radius_mm;
    std::sort(sorted.begin(), sorted.end());
    course.max_radius_mm = kMaxOfWall * sorted[sorted.size() / 2] + lumen.voxel_mm();
    centre_line(lumen, held, course.max_radius_mm, line);
    course.fork_first_mm = held.first_mm;
    course.fork_last_mm = held.last_mm;
    std::array<int, 256> votes{};
    for (std::size_t i = 0; i < line.size(); ++i) {
        ++votes[lumen.label(line[i])];
        course.nodes.push_back({line[i], direction_at(line, i), {}});
    }
    measure(lumen, course);
    course.label =
        static_cast<int>(std::max_element(votes.begin() + 1, votes.end()) - votes.begin());
    return course;
}

}  // namespace

std::vector<VesselCourse> vessel_courses(const LabelVolume& labels,
                                         const VesselPart& part,
                                         const CentreTree& tree,
                                         const CourseOptions& options) {
    const Lumen lumen(labels, part.kind);
    std::vector<VesselCourse> courses;
    for (const CentreLine& line : tree.lines)
        courses.push_back(course_of(lumen, tree, line, options));
    return courses;
}

void measure_sections(const LabelVolume& labels, FlowKind kind, VesselCourse& course) {
    measure(Lumen(labels, kind), course);
}

void reverse_course(const LabelVolume& labels, FlowKind kind, VesselCourse& course) {
    std::reverse(course.nodes.begin(), course.nodes.end());
    for (FlowNode& node : course.nodes) node.direction = -node.direction;
    std::swap(course.first, course.last);
    std::swap(course.fork_first_mm, course.fork_last_mm);
    measure_sections(labels, kind, course);
}

}  // namespace sonocase::pipeline::inline flow
