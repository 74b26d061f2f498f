// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <cstdio>
#include <iterator>

#include "pipeline/aim/aim.h"

namespace sonocase::pipeline {
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
    char text[32];
    std::snprintf(text, sizeof text, "%.1f", value);
    return text;
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
        text += "field_of_view_deg = " + number(probe.field_of_view_rad * 180 / 3.14159265358979) +
                "\n";
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
        "\nstart_beam = " + direction(first.beam) + "\n";
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

}  // namespace sonocase::pipeline
