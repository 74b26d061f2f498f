// SPDX-License-Identifier: Apache-2.0

#include "pipeline/aim/aim.h"

#include <algorithm>
#include <cmath>

#include "formats/text/nearest_name.h"
#include "pipeline/aim/exercise_targets.h"
#include "pipeline/aim/needle_plan.h"

namespace sonocase::pipeline {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kConeCosine = 0.9703;  // 14 degrees
constexpr double kApartMm = 30;
constexpr double kAtLeastApartMm = 8;  // of windows for which a needle is planned
constexpr std::size_t kPlanned = 60;

std::vector<Vector3> directions(int count) {
    std::vector<Vector3> all;
    const double turn = kPi * (3 - std::sqrt(5.0));
    for (int n = 0; n < count; ++n) {
        const double z = 1 - (2.0 * n + 1) / count, r = std::sqrt(1 - z * z);
        all.push_back({r * std::cos(turn * n), r * std::sin(turn * n), z});
    }
    return all;
}

enum class Ended { skin, bone, gas, deep, cut };

struct Ray {
    Ended ended = Ended::deep;
    Point3 skin;
    double length_mm = 0;
    std::vector<int> crossed;  // labels, from the target out
};

// Outwards from a point to the skin. own: label at the point, which is not "crossed".
Ray look_out(const CaseLabels& labels, Point3 from, Vector3 along, double reach_mm) {
    Ray ray;
    const double step = 0.75 * labels.voxel_mm();
    const int own = labels.label(from);
    int last = own, last_body = own;
    for (double t = 0; t <= reach_mm; t += step) {
        const Point3 p = from + t * along;
        const int label = labels.label(p);
        if (labels.kind(label) == TissueKind::bone && label != own) {
            ray.ended = Ended::bone;
            return ray;
        }
        if (labels.kind(label) == TissueKind::gas && label != own) {
            ray.ended = Ended::gas;
            return ray;
        }
        if (label == 0) {
            // A body that is cut off ends without skin.
            ray.ended = !labels.has_skin() || labels.is_skin(last_body) ? Ended::skin : Ended::cut;
            ray.skin = from + std::max(0.0, t - step) * along;
            ray.length_mm = std::max(0.0, t - step);
            return ray;
        }
        last_body = label;
        if (label != last && label != own && !labels.is_plain(label) &&
            std::find(ray.crossed.begin(), ray.crossed.end(), label) == ray.crossed.end())
            ray.crossed.push_back(label);
        last = label;
    }
    return ray;
}

// Outward normal of the body near a point: from the middle of the body's part of a ball of 12 mm.
Vector3 skin_normal(const CaseLabels& labels, Point3 at) {
    Vector3 sum;
    for (const Vector3 u : directions(60))
        for (const double r : {4.0, 8.0, 12.0})
            if (labels.label(at + r * u) != 0) sum = sum - r * u;
    return normalized(sum);
}

// Planes through the beam, those that see the target from the whole face first: between ribs, along
// them. blocked: rays of each that meet something, of nine.
struct Plane {
    Vector3 lateral;
    int blocked = 0;
};
std::vector<Plane> planes_of(const CaseLabels& labels,
                             const AimTarget& target,
                             const AimWindow& window,
                             const AimOptions& options) {
    const Vector3 first = any_perpendicular(window.beam), second = cross(window.beam, first);
    const double reach = 0.9 * half_face_mm(options.probe);
    std::vector<Plane> planes;
    for (int n = 0; n < 16; ++n) {
        const double angle = 2 * kPi * n / 16;
        Plane plane{std::cos(angle) * first + std::sin(angle) * second};
        for (int ray = -4; ray <= 4; ++ray) {
            const Vector3 to =
                normalized(window.skin + 0.25 * ray * reach * plane.lateral - target.centre);
            plane.blocked +=
                look_out(labels, target.centre, to, options.greatest_depth_mm + 30).ended !=
                Ended::skin;
        }
        planes.push_back(plane);
    }
    std::stable_sort(planes.begin(), planes.end(),
                     [](const Plane& a, const Plane& b) { return a.blocked < b.blocked; });
    return planes;
}

void add_needle(const CaseLabels& labels,
                const AimTarget& target,
                const AimOptions& options,
                const NeedlePlanner& planner,
                AimWindow& window) {
    const std::vector<Plane> planes = planes_of(labels, target, window, options);
    window.lateral = planes[0].lateral;
    std::vector<Vector3> laterals;
    for (const Plane& plane : planes) {
        // The whole face must lie on the body.
        const Vector3 side = 20 * plane.lateral, in = 15 * window.beam;
        if (labels.label(window.skin + side + in) != 0 &&
            labels.label(window.skin - side + in) != 0)
            laterals.push_back(plane.lateral);
    }
    const auto plan = planner.plan(target, window.skin, window.beam, laterals);
    if (!plan) return;
    window.skin = plan->skin;
    window.beam = plan->beam;
    window.lateral = plan->lateral;
    window.entry = plan->entry;
    window.needle_direction = plan->direction;
    window.visible = plan->visible;
    window.needle = true;
}

// The cheapest, no two of them on nearly the same place.
std::vector<AimWindow> spread_out(std::vector<AimWindow> windows) {
    std::vector<AimWindow> kept;
    for (AimWindow& window : windows) {
        const bool apart = std::all_of(kept.begin(), kept.end(), [&](const AimWindow& other) {
            return distance(other.skin, window.skin) >= kAtLeastApartMm;
        });
        if (apart) kept.push_back(std::move(window));
        if (kept.size() == kPlanned) break;
    }
    return kept;
}

}  // namespace

AimOptions::AimOptions() {
    probe.field_of_view_rad = 65 * kPi / 180;
    probe.depth_mm = 180;
    needle.length_mm = 200;
}

AimOptions aim_options(const Exercise& exercise) {
    AimOptions options;
    options.probe = exercise.probe;
    options.needle = exercise.needle;
    options.breathing = exercise.breathing;
    options.keep_clear = exercise.no_go;
    options.greatest_depth_mm = exercise.probe.depth_mm;
    return options;
}

AimResult aim(const CaseLabels& labels, const AimTarget& target, const AimOptions& options) {
    AimResult result;
    const std::vector<Vector3> all = directions(options.directions);
    std::vector<Ray> rays;
    for (const Vector3 u : all)
        rays.push_back(look_out(labels, target.centre, u, options.greatest_depth_mm));
    std::vector<AimWindow> windows;
    for (std::size_t n = 0; n < rays.size(); ++n) {
        const Ray& ray = rays[n];
        result.seen += ray.ended == Ended::skin;
        result.blocked_by_bone += ray.ended == Ended::bone;
        result.blocked_by_gas += ray.ended == Ended::gas;
        result.too_deep += ray.ended == Ended::deep;
        result.through_cut += ray.ended == Ended::cut;
        if (ray.ended != Ended::skin) continue;
        AimWindow window;
        window.skin = ray.skin;
        window.beam = -all[n];
        window.depth_mm = ray.length_mm;
        int around = 0, blocked = 0;
        for (std::size_t m = 0; m < rays.size(); ++m) {
            if (dot(all[m], all[n]) < kConeCosine) continue;
            ++around;
            blocked += rays[m].ended != Ended::skin;
        }
        window.blocked = around > 0 ? static_cast<double>(blocked) / around : 0;
        window.cost = window.depth_mm + 60 * window.blocked;
        for (const int label : ray.crossed) window.cost += labels.is_vessel(label) ? 25 : 6;
        for (auto it = ray.crossed.rbegin(); it != ray.crossed.rend(); ++it)
            window.crossed.push_back(labels.name(*it));
        windows.push_back(std::move(window));
    }
    const auto cheaper = [](const AimWindow& a, const AimWindow& b) { return a.cost < b.cost; };
    std::stable_sort(windows.begin(), windows.end(), cheaper);
    // What is costly to know is found out for the best of them alone.
    windows = spread_out(std::move(windows));
    const NeedlePlanner planner(labels, options);
    for (AimWindow& window : windows) {
        const double cosine = -dot(window.beam, skin_normal(labels, window.skin));
        window.obliquity_deg = std::acos(std::clamp(cosine, -1.0, 1.0)) * 180 / kPi;
        add_needle(labels, target, options, planner, window);
        window.cost +=
            0.6 * window.obliquity_deg + (window.needle ? 100 * (1 - window.visible) : 200);
    }
    std::stable_sort(windows.begin(), windows.end(), cheaper);
    for (AimWindow& window : windows) {
        const bool apart =
            std::all_of(result.windows.begin(), result.windows.end(), [&](const AimWindow& better) {
                return distance(better.skin, window.skin) >= kApartMm;
            });
        if (apart) result.windows.push_back(std::move(window));
        if (result.windows.size() == static_cast<std::size_t>(options.windows)) break;
    }
    return result;
}

Result<AimTarget> find_aim_target(const CaseBundle& bundle, const std::string& name) {
    std::vector<std::string> names;
    for (const NamedTarget& target : exercise_targets(bundle)) {
        const std::string whole = target.exercise + "/" + target.name;
        if (name == whole || name == target.name)
            return AimTarget{target.name, target.centre, target.radius_mm, target.exercise,
                             target.inside};
        names.push_back(target.name);
    }
    for (std::size_t l = 1; l < bundle.labels.size(); ++l) names.push_back(bundle.labels[l].name);
    const CaseLabels labels(bundle);
    const int label = labels.find(name);
    if (label <= 0)
        return Error{"no target, lesion or label '" + name + "'", bundle.manifest.case_name,
                     suggest_name(name, names)};
    // The voxel of the label that lies farthest from other labels, on a grid of every second one.
    const Int3 size = bundle.grid.size;
    Point3 best;
    int deepest = -1;
    for (int k = 0; k < size.z; k += 2)
        for (int j = 0; j < size.y; j += 2)
            for (int i = 0; i < size.x; i += 2) {
                if (bundle.label_bricks.at(i, j, k) != label) continue;
                int depth = 0;
                const auto inside = [&](int di, int dj, int dk) {
                    return bundle.grid.contains(i + di, j + dj, k + dk) &&
                           bundle.label_bricks.at(i + di, j + dj, k + dk) == label;
                };
                while (depth < 60 && inside(depth, 0, 0) && inside(-depth, 0, 0) &&
                       inside(0, depth, 0) && inside(0, -depth, 0) && inside(0, 0, depth) &&
                       inside(0, 0, -depth))
                    ++depth;
                if (depth <= deepest) continue;
                deepest = depth;
                best = bundle.grid.point_from_voxel(
                    {static_cast<double>(i), static_cast<double>(j), static_cast<double>(k)});
            }
    if (deepest < 0)
        return Error{"label '" + name + "' has no voxel", bundle.manifest.case_name,
                     "name another target"};
    return AimTarget{name, best, std::max(2.0, deepest * labels.voxel_mm()), "", name};
}

}  // namespace sonocase::pipeline
