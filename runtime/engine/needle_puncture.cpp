// SPDX-License-Identifier: Apache-2.0

#include "runtime/engine/needle_puncture.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "formats/base/constants.h"
#include "formats/volume/tissue.h"

namespace sonocase::runtime::inline engine {
namespace {

constexpr double kCutting = 0.25;       // share of the dent that is left after a puncture
constexpr double kUnderSkinMm = 5;      // depth at which the stiffness under the skin is taken
constexpr double kFarthestWallMm = 40;  // from one wall of a lumen to the other
constexpr double kThinMm = 0.5;         // along the needle: less may be a voxel's corner
constexpr double kVoxelMm = 2;          // of the coarsest bundles

// Newtons per mm of dent: 4 pi (E / 3) w, E in N/mm^2.
double spring_of(double stiffness_kpa) {
    return 4 * kPi * stiffness_kpa * 1e-3 / 3 * kTentZone.width_mm;
}

double at_step(std::int64_t step) {
    return static_cast<double>(step) * NeedlePuncture::kStepMm;
}

}  // namespace

void NeedlePuncture::reset() {
    *this = NeedlePuncture(scale_ * 1.27);
}

double NeedlePuncture::dent_mm() const {
    if (touched_ < 0) return 0;
    return std::clamp(at_step(step_ - touched_at_) + rest_mm_, 0.0, kMaxTentMm);
}

double NeedlePuncture::tent_mm() const {
    return std::max(dent_mm(), cutting_mm_);
}

double NeedlePuncture::force_n() const {
    return std::max(spring_n_per_mm_ * dent_mm(), cutting_n_);
}

void NeedlePuncture::add_event(NeedleEventKind kind, int layer) {
    if (event_count_ == kMaxEvents) {
        std::move(events_.begin() + 1, events_.end(), events_.begin());
        --event_count_;
    }
    events_[event_count_++] = {kind, layer, at_step(step_), force_n()};
}

void NeedlePuncture::begin(std::int64_t step, const LayersAlong& layers) {
    reset();
    begun_ = true;
    step_ = step;
    inside_ = layers.index(layers.context, at_step(step));
}

void NeedlePuncture::touch(int layer, const LayersAlong& layers) {
    const NeedleLayer& before = layers.layer(layers.context, inside_);
    const NeedleLayer& next = layers.layer(layers.context, layer);
    const int under = layers.index(layers.context, at_step(step_) + kUnderSkinMm);
    const NeedleLayer& soft = before.outside ? layers.layer(layers.context, under) : before;
    touched_ = layer;
    touched_at_ = step_ - 1;
    spring_n_per_mm_ = spring_of(soft.stiffness_kpa);
    limit_n_ = next.puncture_n * scale_;
    stopped_ = false;
    far_wall_ = step_;
    if (!next.lumen) return;
    // Past the corners of voxels at its near wall: what is thin does not end a lumen.
    const auto limit = step_ + static_cast<std::int64_t>(kFarthestWallMm / kStepMm);
    const auto thin = static_cast<std::int64_t>(kThinMm / kStepMm);
    for (std::int64_t n = far_wall_; n < limit && n - far_wall_ <= thin; ++n)
        if (layers.index(layers.context, at_step(n)) == layer) far_wall_ = n + 1;
}

// Whether `layer` is but the corner of a voxel on a wall that the needle runs along: thin, with the
// tip's own tissue behind it, and, unless that is a lumen, with `layer` again within a voxel. A
// closed vein, thin as it is, has muscle behind it and no second lumen. Bone and skin are never
// corners.
bool NeedlePuncture::is_corner(int layer, const LayersAlong& layers) const {
    const NeedleLayer& before = layers.layer(layers.context, inside_);
    if (layers.layer(layers.context, layer).rigid || before.outside) return false;
    const auto thin = static_cast<std::int64_t>(kThinMm / kStepMm);
    const auto voxel = static_cast<std::int64_t>(kVoxelMm / kStepMm);
    const auto at = [&](std::int64_t n) {
        return layers.index(layers.context, at_step(step_ + n));
    };
    std::int64_t n = 1;
    while (n <= thin && at(n) != inside_) ++n;
    if (n > thin) return false;
    if (before.lumen) return true;
    while (n <= voxel && at(n) != layer) ++n;
    return n <= voxel;
}

void NeedlePuncture::puncture(const LayersAlong& layers) {
    const NeedleLayer& layer = layers.layer(layers.context, touched_);
    add_event(NeedleEventKind::puncture, touched_);
    cutting_mm_ = kCutting * dent_mm();
    cutting_n_ = kCutting * spring_n_per_mm_ * dent_mm();
    if (hole_count_ == kMaxLayers) {
        std::move(holes_.begin() + 1, holes_.end(), holes_.begin());
        --hole_count_;
    }
    holes_[hole_count_++] = {inside_, touched_at_};
    const bool both = layer.lumen && step_ >= far_wall_;
    inside_ = touched_;
    touched_ = -1;
    if (!both) return;
    // The two walls touched: what lies behind the lumen is not dented again.
    add_event(NeedleEventKind::posterior_wall, inside_);
    if (hole_count_ < kMaxLayers) holes_[hole_count_++] = {inside_, far_wall_ - 1};
    inside_ = layers.index(layers.context, at_step(step_));
}

void NeedlePuncture::forward(const LayersAlong& layers) {
    ++step_;
    drag_mm_ = std::min(drag_mm_ + kStepMm, kMaxDragMm);
    if (touched_ < 0) {
        const int here = layers.index(layers.context, at_step(step_));
        if (here == inside_ || is_corner(here, layers)) return;
        touch(here, layers);
    }
    const NeedleLayer& next = layers.layer(layers.context, touched_);
    if (next.rigid) {
        if (!stopped_) add_event(NeedleEventKind::stopped, touched_);
        stopped_ = true;
        return;
    }
    const NeedleLayer& before = layers.layer(layers.context, inside_);
    const bool leaves_lumen = before.lumen;
    if (spring_n_per_mm_ * dent_mm() < limit_n_ && dent_mm() < kMaxTentMm - 1e-9) return;
    const int left = inside_;
    puncture(layers);
    if (leaves_lumen) add_event(NeedleEventKind::posterior_wall, left);
}

void NeedlePuncture::backward() {
    --step_;
    drag_mm_ = std::max(drag_mm_ - kStepMm, -kMaxDragMm);
    cutting_mm_ = 0;
    cutting_n_ = 0;
    if (touched_ >= 0 && step_ <= touched_at_) touched_ = -1;
    const auto slack = static_cast<std::int64_t>(kHysteresisMm / kStepMm);
    while (hole_count_ > 0 && holes_[hole_count_ - 1].step - slack >= step_) {
        add_event(NeedleEventKind::withdrawn, inside_);
        inside_ = holes_[--hole_count_].layer_before;
    }
}

void NeedlePuncture::move_to(double depth_mm, const LayersAlong& layers) {
    event_count_ = 0;
    if (!std::isfinite(depth_mm) || std::abs(depth_mm) > 1e6) return;
    const double whole = std::floor(depth_mm / kStepMm);
    const auto step = static_cast<std::int64_t>(whole);
    if (!begun_ || std::abs(depth_mm - at_step(step_)) > kLongestMoveMm) begin(step, layers);
    rest_mm_ = 0;  // events happen at whole steps only
    while (step_ < step) forward(layers);
    while (step_ > step) backward();
    rest_mm_ = depth_mm - whole * kStepMm;
}

namespace {

constexpr double kBeforeSkinMm = 0.5;  // a needle outside the body counts as this far from the skin

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
        return static_cast<const Line*>(context)->layers[index & 255];
    }
};

}  // namespace

PunctureState::PunctureState(const CaseBundle& bundle, const NeedleModel& needle)
    : layers_(256), needle_(needle_diameter_mm(needle)) {
    const std::vector<int> tissue_of = tissue_of_label(bundle);
    layers_[0].outside = true;
    for (std::size_t l = 1; l < bundle.labels.size() && l < layers_.size(); ++l) {
        if (tissue_of[l] < 0) continue;
        const TissueMechanics m = mechanics_of(bundle.tissues[tissue_of[l]], bundle.labels[l].name);
        const bool vessel = vessel_of_label(bundle.labels[l].name) != Vessel::unknown;
        layers_[l] = {.stiffness_kpa = m.stiffness_kpa,
                      .puncture_n = m.puncture_n,
                      .outside = false,
                      .lumen = m.drains || vessel,
                      .rigid = m.rigid};
    }
}

PunctureReport PunctureState::update(double time_s,
                                     Point3 tip,
                                     Vector3 direction,
                                     double depth_mm,
                                     const Anatomy& anatomy,
                                     const Renderer& renderer) {
    const Line line{tip, direction, depth_mm, time_s, anatomy, renderer, layers_};
    needle_.move_to(depth_mm > 0 ? depth_mm : -kBeforeSkinMm, {&line, Line::index, Line::layer});
    PunctureReport report;
    report.tent_mm = needle_.tent_mm();
    report.drag_mm = needle_.drag_mm();
    report.force_n = needle_.force_n();
    report.label = needle_.tip_layer();
    const int first = std::max(0, needle_.event_count() - PunctureReport::kMaxEvents);
    for (int n = first; n < needle_.event_count(); ++n)
        report.events[report.event_count++] = needle_.event(n);
    return report;
}

namespace {

std::optional<LiveEventKind> tissue_event(NeedleEventKind kind) {
    switch (kind) {
        case NeedleEventKind::puncture: return LiveEventKind::tissue_puncture;
        case NeedleEventKind::posterior_wall: return LiveEventKind::posterior_wall;
        case NeedleEventKind::stopped: return LiveEventKind::needle_stopped;
        case NeedleEventKind::withdrawn: break;  // needle_exit and the depth report it
    }
    return {};
}

}  // namespace

void report_punctures(const PunctureReport& report, SessionMonitor& monitor) {
    for (int n = 0; n < report.event_count; ++n) {
        const NeedleEvent& event = report.events[n];
        if (const auto kind = tissue_event(event.kind))
            monitor.report(*kind, event.layer, event.force_n);
    }
}

}  // namespace sonocase::runtime::inline engine
