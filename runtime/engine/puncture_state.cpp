// SPDX-License-Identifier: Apache-2.0

#include "runtime/engine/puncture_state.h"

#include <optional>

#include <algorithm>

#include "formats/volume/tissue_mechanics.h"

namespace sonocase::runtime {
namespace {

constexpr double kBeforeSkin_mm = 0.5;  // where the tip of a needle that is out of the body counts

struct Line {
    Point3 tip;
    Vector3 direction;
    double depth_mm = 0, time_s = 0;
    const Anatomy& anatomy;
    const Renderer& renderer;
    const std::vector<NeedleLayer>& layers;

    static int index(const void* context, double depth_mm) {
        const Line& self = *static_cast<const Line*>(context);
        if (depth_mm < 0) return 0;
        const Point3 p = self.tip + (depth_mm - self.depth_mm) * self.direction;
        return self.anatomy.label(self.anatomy.at_rest(self.renderer.at_rest(p), self.time_s));
    }
    static const NeedleLayer& layer(const void* context, int index) {
        return static_cast<const Line*>(context)->layers[static_cast<std::size_t>(index) & 255];
    }
};

}  // namespace

PunctureState::PunctureState(const CaseBundle& bundle, const NeedleModel& needle)
    : layers_(256), needle_(needle_diameter_mm(needle)) {
    const std::vector<int> tissue_of = tissue_of_label(bundle);
    layers_[0].outside = true;
    for (std::size_t l = 1; l < bundle.labels.size() && l < layers_.size(); ++l) {
        if (tissue_of[l] < 0) continue;
        const TissueMechanics m = mechanics_of(
            bundle.tissues[static_cast<std::size_t>(tissue_of[l])], bundle.labels[l].name);
        const bool vessel = vessel_of_label(bundle.labels[l].name) != Vessel::unknown;
        layers_[l] = {m.stiffness_kpa, m.puncture_n, false, m.drains || vessel, m.rigid};
    }
}

PunctureReport PunctureState::update(double time_s,
                                     Point3 tip,
                                     Vector3 direction,
                                     double depth_mm,
                                     const Anatomy& anatomy,
                                     const Renderer& renderer) {
    const Line line{tip, direction, depth_mm, time_s, anatomy, renderer, layers_};
    needle_.move_to(depth_mm > 0 ? depth_mm : -kBeforeSkin_mm, {&line, Line::index, Line::layer});
    PunctureReport report;
    report.tent_mm = needle_.tent_mm();
    report.drag_mm = needle_.drag_mm();
    report.force_n = needle_.force_n();
    report.label = needle_.tip_layer();
    const int first = std::max(0, needle_.event_count() - PunctureReport::kMostEvents);
    for (int n = first; n < needle_.event_count(); ++n)
        report.events[static_cast<std::size_t>(report.event_count++)] = needle_.event(n);
    return report;
}

namespace {

std::optional<LiveEventKind> tissue_event(NeedleEventKind kind) {
    switch (kind) {
        case NeedleEventKind::puncture: return LiveEventKind::tissue_puncture;
        case NeedleEventKind::posterior_wall: return LiveEventKind::posterior_wall;
        case NeedleEventKind::stopped: return LiveEventKind::needle_stopped;
        case NeedleEventKind::withdrawn: break;  // needle_exit and the depth say it
    }
    return {};
}

}  // namespace

void report_punctures(const PunctureReport& report, SessionMonitor& monitor) {
    for (int n = 0; n < report.event_count; ++n) {
        const NeedleEvent& event = report.events[static_cast<std::size_t>(n)];
        if (const auto kind = tissue_event(event.kind))
            monitor.report(*kind, event.layer, event.force_n);
    }
}

}  // namespace sonocase::runtime
