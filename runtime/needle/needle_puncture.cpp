// SPDX-License-Identifier: Apache-2.0

#include "runtime/needle/needle_puncture.h"

#include <algorithm>
#include <cmath>

namespace sonocase::runtime {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kCutting = 0.25;        // of the dent is left after a puncture
constexpr double kUnderSkin_mm = 5;      // where the stiffness under the skin is taken
constexpr double kFarthestWall_mm = 40;  // of a lumen

// Newtons per mm of dent: 4 pi (E / 3) w, E in N/mm^2.
double spring_of(double stiffness_kpa) {
    return 4 * kPi * stiffness_kpa * 1e-3 / 3 * kTentZone.width_mm;
}

double at_step(std::int64_t step) {
    return static_cast<double>(step) * NeedlePuncture::kStep_mm;
}

}  // namespace

void NeedlePuncture::reset() {
    *this = NeedlePuncture(scale_ * 1.27);
}

double NeedlePuncture::dent_mm() const {
    if (touched_ < 0) return 0;
    return std::clamp(at_step(step_ - touched_at_) + rest_mm_, 0.0, kMostTent_mm);
}

double NeedlePuncture::tent_mm() const {
    return std::max(dent_mm(), cutting_mm_);
}

double NeedlePuncture::force_n() const {
    return std::max(spring_n_per_mm_ * dent_mm(), cutting_n_);
}

void NeedlePuncture::say(NeedleEventKind kind, int layer) {
    if (event_count_ == kMostEvents) {
        std::move(events_.begin() + 1, events_.end(), events_.begin());
        --event_count_;
    }
    events_[static_cast<std::size_t>(event_count_++)] = {kind, layer, at_step(step_), force_n()};
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
    const int under = layers.index(layers.context, at_step(step_) + kUnderSkin_mm);
    const NeedleLayer& soft = before.outside ? layers.layer(layers.context, under) : before;
    touched_ = layer;
    touched_at_ = step_ - 1;
    spring_n_per_mm_ = spring_of(soft.stiffness_kpa);
    limit_n_ = next.puncture_n * scale_;
    stopped_ = false;
    far_wall_ = step_;
    if (!next.lumen) return;
    const auto most = step_ + static_cast<std::int64_t>(kFarthestWall_mm / kStep_mm);
    while (far_wall_ < most && layers.index(layers.context, at_step(far_wall_)) == layer)
        ++far_wall_;
}

void NeedlePuncture::puncture(const LayersAlong& layers) {
    const NeedleLayer& layer = layers.layer(layers.context, touched_);
    say(NeedleEventKind::puncture, touched_);
    cutting_mm_ = kCutting * dent_mm();
    cutting_n_ = kCutting * spring_n_per_mm_ * dent_mm();
    if (hole_count_ == kMostLayers) {
        std::move(holes_.begin() + 1, holes_.end(), holes_.begin());
        --hole_count_;
    }
    holes_[static_cast<std::size_t>(hole_count_++)] = {inside_, touched_at_};
    const bool both = layer.lumen && step_ >= far_wall_;
    inside_ = touched_;
    touched_ = -1;
    if (!both) return;
    // The walls lay on one another: what is behind the lumen is not dented again.
    say(NeedleEventKind::posterior_wall, inside_);
    if (hole_count_ < kMostLayers)
        holes_[static_cast<std::size_t>(hole_count_++)] = {inside_, far_wall_ - 1};
    inside_ = layers.index(layers.context, at_step(step_));
}

void NeedlePuncture::forward(const LayersAlong& layers) {
    ++step_;
    drag_mm_ = std::min(drag_mm_ + kStep_mm, kMostDrag_mm);
    if (touched_ < 0) {
        const int here = layers.index(layers.context, at_step(step_));
        if (here == inside_) return;
        // Through a hole that the needle has made: the tip is back where it was.
        touch(here, layers);
    }
    const NeedleLayer& next = layers.layer(layers.context, touched_);
    if (next.rigid) {
        if (!stopped_) say(NeedleEventKind::stopped, touched_);
        stopped_ = true;
        return;
    }
    const NeedleLayer& before = layers.layer(layers.context, inside_);
    const bool leaves_lumen = before.lumen;
    if (spring_n_per_mm_ * dent_mm() < limit_n_ && dent_mm() < kMostTent_mm - 1e-9) return;
    const int left = inside_;
    puncture(layers);
    if (leaves_lumen) say(NeedleEventKind::posterior_wall, left);
}

void NeedlePuncture::backward() {
    --step_;
    drag_mm_ = std::max(drag_mm_ - kStep_mm, -kMostDrag_mm);
    cutting_mm_ = 0;
    cutting_n_ = 0;
    if (touched_ >= 0 && step_ <= touched_at_) touched_ = -1;
    const auto slack = static_cast<std::int64_t>(kHysteresis_mm / kStep_mm);
    while (hole_count_ > 0 &&
           holes_[static_cast<std::size_t>(hole_count_ - 1)].step - slack >= step_) {
        say(NeedleEventKind::withdrawn, inside_);
        inside_ = holes_[static_cast<std::size_t>(--hole_count_)].layer_before;
    }
}

void NeedlePuncture::move_to(double depth_mm, const LayersAlong& layers) {
    event_count_ = 0;
    if (!std::isfinite(depth_mm) || std::abs(depth_mm) > 1e6) return;
    const double whole = std::floor(depth_mm / kStep_mm);
    const auto step = static_cast<std::int64_t>(whole);
    if (!begun_ || std::abs(depth_mm - at_step(step_)) > kLongestMove_mm) begin(step, layers);
    rest_mm_ = 0;  // at whole steps alone does anything happen
    while (step_ < step) forward(layers);
    while (step_ > step) backward();
    rest_mm_ = depth_mm - whole * kStep_mm;
}

}  // namespace sonocase::runtime
