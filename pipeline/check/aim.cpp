// SPDX-License-Identifier: Apache-2.0

#include "pipeline/check/aim.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>

#include "formats/base/constants.h"
#include "formats/text/nearest_name.h"
#include "formats/text/number_text.h"
#include "pipeline/check/case_labels.h"
#include "pipeline/check/needle_plan.h"
#include "pipeline/pictures/png.h"

namespace sonocase::pipeline::inline check {

namespace {

constexpr double kConeCosine = 0.9703;  // 14 degrees
constexpr double kApartMm = 30;         // between windows that are returned
constexpr double kPlannedApartMm = 8;   // between windows for which a needle is planned
constexpr std::size_t kMaxPlanned = 60;

// Unit vectors spread evenly over the sphere (golden spiral).
std::vector<Vector3> directions(int count) {
    std::vector<Vector3> all;
    const double turn = kPi * (3 - std::sqrt(5.0));
    for (int n = 0; n < count; ++n) {
        const double z = 1 - (2.0 * n + 1) / count, r = std::sqrt(1 - z * z);
        all.push_back({r * std::cos(turn * n), r * std::sin(turn * n), z});
    }
    return all;
}

enum class RayEnd { skin, bone, gas, deep, cut };

struct Ray {
    RayEnd ended = RayEnd::deep;
    Point3 skin;
    double length_mm = 0;
    std::vector<int> crossed;  // labels, from the target out
};

// Follows a ray from a point outwards to the skin. The label at the point itself is not "crossed".
Ray cast_ray(const CaseLabels& labels, Point3 from, Vector3 along, double reach_mm) {
    Ray ray;
    const double step = 0.75 * labels.voxel_mm();
    const int own = labels.label(from);
    int last = own, last_body = own;
    for (double t = 0; t <= reach_mm; t += step) {
        const Point3 p = from + t * along;
        const int label = labels.label(p);
        if (labels.kind(label) == TissueKind::bone && label != own) {
            ray.ended = RayEnd::bone;
            return ray;
        }
        if (labels.kind(label) == TissueKind::gas && label != own) {
            ray.ended = RayEnd::gas;
            return ray;
        }
        if (label == 0) {
            // A body that is cut off ends without skin.
            ray.ended =
                !labels.has_skin() || labels.is_skin(last_body) ? RayEnd::skin : RayEnd::cut;
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

// The outward normal of the body near a point, away from the middle of the part of a ball of 12 mm
// that lies in the body.
Vector3 skin_normal(const CaseLabels& labels, Point3 at) {
    Vector3 sum;
    for (const Vector3 u : directions(60))
        for (const double r : {4.0, 8.0, 12.0})
            if (labels.label(at + r * u) != 0) sum = sum - r * u;
    return normalized(sum);
}

// An image plane through the beam.
struct Plane {
    Vector3 lateral;
    int blocked = 0;  // rays from the probe's face, of nine, that meet something
};

// Planes through the beam, those that see the target from the whole face first. Between ribs these
// are the planes along them.
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
            plane.blocked += cast_ray(labels, target.centre, to, options.max_depth_mm + 30).ended !=
                             RayEnd::skin;
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

// The windows of lowest cost, no two of them at nearly the same place.
std::vector<AimWindow> spread_out(std::vector<AimWindow> windows) {
    std::vector<AimWindow> kept;
    for (AimWindow& window : windows) {
        const bool apart = std::all_of(kept.begin(), kept.end(), [&](const AimWindow& other) {
            return distance(other.skin, window.skin) >= kPlannedApartMm;
        });
        if (apart) kept.push_back(std::move(window));
        if (kept.size() == kMaxPlanned) break;
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
    options.max_depth_mm = exercise.probe.depth_mm;
    return options;
}

AimResult aim(const CaseLabels& labels, const AimTarget& target, const AimOptions& options) {
    AimResult result;
    const std::vector<Vector3> all = directions(options.directions);
    std::vector<Ray> rays;
    for (const Vector3 u : all)
        rays.push_back(cast_ray(labels, target.centre, u, options.max_depth_mm));
    std::vector<AimWindow> windows;
    for (std::size_t n = 0; n < rays.size(); ++n) {
        const Ray& ray = rays[n];
        result.seen += ray.ended == RayEnd::skin;
        result.blocked_by_bone += ray.ended == RayEnd::bone;
        result.blocked_by_gas += ray.ended == RayEnd::gas;
        result.too_deep += ray.ended == RayEnd::deep;
        result.through_cut += ray.ended == RayEnd::cut;
        if (ray.ended != RayEnd::skin) continue;
        AimWindow window;
        window.skin = ray.skin;
        window.beam = -all[n];
        window.depth_mm = ray.length_mm;
        int around = 0, blocked = 0;
        for (std::size_t m = 0; m < rays.size(); ++m) {
            if (dot(all[m], all[n]) < kConeCosine) continue;
            ++around;
            blocked += rays[m].ended != RayEnd::skin;
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
    // The costly parts are computed for the best of them only.
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

namespace {

template <class V>
std::string triple(V v) {
    char text[96];
    std::snprintf(text, sizeof text, "[%.3f, %.3f, %.3f]", v.x, v.y, v.z);
    return text;
}

std::string direction(Vector3 v) {
    char text[96];
    std::snprintf(text, sizeof text, "[%.6f, %.6f, %.6f]", v.x, v.y, v.z);
    return text;
}

std::string number(double value) {
    return fixed_text(value, 1);
}

void add_key(std::string& text, double time_s, const AimWindow& w, const Point3* tip) {
    text += "\n[[sweeps.keys]]\ntime_s = " + number(time_s) + "\nprobe = " + triple(w.skin) +
            "\nbeam = " + direction(w.beam) + "\nlateral = " + direction(w.lateral) + "\n";
    if (tip != nullptr)
        text += "needle_tip = " + triple(*tip) +
                "\nneedle_direction = " + direction(w.needle_direction) + "\n";
}

std::string probe_text(const Probe& probe, double depth_mm, double focus_mm) {
    std::string text = "\n[probe]\nshape = \"";
    text += probe.shape == ProbeShape::linear        ? "linear"
            : probe.shape == ProbeShape::curvilinear ? "curvilinear"
                                                     : "phased";
    text += "\"\n";
    if (probe.shape == ProbeShape::curvilinear)
        text += "radius_mm = " + number(probe.radius_mm) + "\n";
    else
        text += "width_mm = " + number(probe.width_mm) + "\n";
    if (probe.shape != ProbeShape::linear)
        text += "field_of_view_deg = " + number(probe.field_of_view_rad * kDegPerRad) + "\n";
    return text + "depth_mm = " + number(depth_mm) +
           "\nfrequency_mhz = " + number(probe.frequency_mhz) + "\nfocus_mm = " + number(focus_mm) +
           "\nelevation_mm = " + number(probe.elevation_mm) + "\n";
}

}  // namespace

std::string aim_exercise(const AimTarget& target,
                         const AimResult& result,
                         const AimOptions& options) {
    double depth_mm = options.probe.depth_mm;
    if (target.exercise.empty()) {  // as deep as its windows need
        depth_mm = 100;
        for (const AimWindow& w : result.windows) depth_mm = std::max(depth_mm, w.depth_mm + 40);
    }
    const AimWindow& first = result.windows.front();
    std::string text =
        "# Made by `sonocase aim`: positions are in the mannequin's frame, mm.\n"
        "name = \"aim-" +
        target.name + "\"\ntitle = \"Find " + target.name +
        "\"\nkind = \"biopsy\"\nstart_probe = " + triple(first.skin) +
        "\nstart_beam = " + direction(first.beam) +
        "\nstart_lateral = " + direction(first.lateral) + "\n";
    text += probe_text(options.probe, std::min(300.0, depth_mm), first.depth_mm);
    text += "\n[needle]\ngauge = " + number(options.needle.gauge) +
            "\nlength_mm = " + number(options.needle.length_mm) + "\n";
    text += "\n[[targets]]\nname = \"" + target.name + "\"\ncentre = " + triple(target.centre) +
            "\nradius_mm = " + number(target.radius_mm) + "\nlook = \"none\"\n";
    if (!target.inside.empty()) text += "inside = \"" + target.inside + "\"\n";
    text += "\n[[pass_marks]]\nmetric = \"final_tip_to_target_mm\"\nat_most = " +
            number(std::max(3.0, target.radius_mm)) + "\n";
    text += "\n[[pass_marks]]\nmetric = \"insertions\"\nat_most = 1\n";
    int n = 0;
    for (const AimWindow& w : result.windows) {
        text += "\n[[sweeps]]\nname = \"window-" + std::to_string(++n) + "\"\n";
        add_key(text, 0, w, nullptr);
        if (!w.needle) {
            add_key(text, 4, w, nullptr);
            continue;
        }
        text.resize(text.rfind("\n[[sweeps.keys]]"));
        const double length = norm(target.centre - w.entry);
        // Tip before the skin, in by thirds, a pause in the target, and out again.
        const double share[] = {-12 / length, -2 / length, 0.35, 0.75, 1, 1, 0.5};
        const double time_s[] = {0, 1.5, 4, 6, 7.5, 10.5, 12.5};
        for (std::size_t key = 0; key < std::size(share); ++key) {
            const Point3 tip = w.entry + share[key] * (target.centre - w.entry);
            add_key(text, time_s[key], w, &tip);
        }
    }
    return text;
}

namespace {

constexpr int kPanelPx = 360, kHalfPanelPx = kPanelPx / 2;

}  // namespace

std::vector<std::uint8_t> aim_picture(const CaseLabels& labels,
                                      const AimTarget& target,
                                      const AimResult& result) {
    const int panels = std::max(1, std::min<int>(3, static_cast<int>(result.windows.size())));
    std::vector<std::uint8_t> rgb(3 * panels * kPanelPx * kPanelPx, 0);
    const int width = panels * kPanelPx;
    for (int n = 0; n < std::min<int>(panels, static_cast<int>(result.windows.size())); ++n) {
        const AimWindow& w = result.windows[n];
        const double mm = (w.depth_mm + 70) / kPanelPx;  // per pixel
        const auto plot = [&](int x, int y, std::array<std::uint8_t, 3> colour) {
            if (x < 0 || y < 0 || x >= kPanelPx || y >= kPanelPx) return;
            const auto at = static_cast<std::size_t>(3 * (y * width + n * kPanelPx + x));
            std::copy(colour.begin(), colour.end(), rgb.begin() + static_cast<std::ptrdiff_t>(at));
        };
        for (int y = 0; y < kPanelPx; ++y)
            for (int x = 0; x < kPanelPx; ++x) {
                const Point3 p =
                    w.skin + (x - kHalfPanelPx) * mm * w.lateral + (y * mm - 25) * w.beam;
                plot(x, y, labels.bundle().labels[labels.label(p)].colour);
            }
        const auto stroke = [&](Point3 from, Point3 to, std::array<std::uint8_t, 3> colour) {
            for (int s = 0; s <= 800; ++s) {
                const Vector3 at = from + (s / 800.0) * (to - from) - w.skin;
                const int x = static_cast<int>(std::lround(dot(at, w.lateral) / mm)) + kHalfPanelPx;
                const int y = static_cast<int>(std::lround((dot(at, w.beam) + 25) / mm));
                plot(x, y, colour);
                plot(x + 1, y, colour);
            }
        };
        stroke(w.skin - 25 * w.lateral, w.skin + 25 * w.lateral, {255, 255, 255});
        stroke(w.skin, target.centre, {255, 255, 0});
        if (w.needle) stroke(w.entry - 30 * w.needle_direction, target.centre, {0, 255, 255});
        for (int s = 0; s < 360; ++s) {
            const double a = s * kRadPerDeg;
            const Point3 p = target.centre + target.radius_mm * std::cos(a) * w.lateral +
                             target.radius_mm * std::sin(a) * w.beam;
            stroke(p, p, {255, 0, 0});
        }
    }
    return png_from_rgb(rgb.data(), width, kPanelPx);
}

}  // namespace sonocase::pipeline::inline check
