// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/setup_guide.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <utility>

#include "runtime/player/words/words.h"

namespace sonocase::runtime::inline player_app {
namespace {

constexpr double kFitEvery = 0.5;        // seconds
constexpr std::size_t kMaxPoses = 3000;  // of a step; then every second one is dropped
constexpr std::size_t kMinReadings = 10, kMinSweepReadings = 50;  // for a fit
constexpr double kGoodTilt = 0.35;  // rad, about 20 degrees of tilt in every direction

double worst(Vector3 sigma) {
    return std::max({sigma.x, sigma.y, sigma.z});
}

void keep_last(std::vector<float>& out, const std::vector<PoseResidual>& residuals) {
    const std::size_t n = std::min<std::size_t>(residuals.size(), 200);
    out.clear();
    for (std::size_t i = residuals.size() - n; i < residuals.size(); ++i) {
        out.push_back(static_cast<float>(residuals[i].residual_mm));
    }
}

void show_point(const PointFit& fit,
                std::span<const Pose> poses,
                double needed_mm,
                SetupView& view) {
    view.rms_mm = fit.rms_mm;
    view.tilts = tilt_fields(poses, fit.tip_mm);
    view.coverage = std::clamp(fit.swing.z / kGoodTilt, 0.0, 1.0);
    keep_last(view.residuals_mm, fit.residuals);
    if (!fit.determined) {
        view.sentence = fit.problem;
        return;
    }
    view.sigma_mm = view.figure_mm = worst(fit.sigma_mm);
    view.good_enough = fit.inliers >= 30 && view.sigma_mm < needed_mm && view.coverage > 0.5;
    view.sentence = view.good_enough
                        ? filled(tr("Good: the point is known to %.2f mm."), view.sigma_mm)
                    : view.coverage <= 0.5 ? tr("Tilt it further, in every direction.")
                                           : tr("Continue: more readings make it more certain.");
}

void show_direction(const DirectionFit& fit, SetupView& view) {
    view.rms_mm = fit.rms_mm;
    view.coverage = std::clamp(fit.length_mm / 60, 0.0, 1.0);
    keep_last(view.residuals_mm, fit.residuals);
    if (!fit.determined) {
        view.sentence = fit.problem;
        return;
    }
    // At 100 mm, a deep target.
    view.sigma_mm = view.figure_mm = 100 * fit.sigma_rad;
    view.good_enough =
        fit.length_mm > 40 && view.figure_mm < setup_needed_mm(SetupStep::probe_depth);
    view.sentence = view.good_enough
                        ? filled(tr("Good: known to %.2f degrees."), fit.sigma_rad * 57.29578)
                        : tr("Slide it further, straight and without turning it.");
}

}  // namespace

double setup_seconds(SetupStep step) {
    switch (step) {
        case SetupStep::probe_depth:
        case SetupStep::probe_lateral: return 10;
        case SetupStep::needle: return 30;
        case SetupStep::mannequin: return 40;
        default: return 15;
    }
}

double setup_needed_mm(SetupStep step) {
    switch (step) {
        case SetupStep::probe_tip: return 1;
        case SetupStep::probe_depth:
        case SetupStep::probe_lateral: return 2;
        case SetupStep::needle: return 1.5;
        case SetupStep::mannequin: return 4;
        case SetupStep::trackers:
        case SetupStep::done: break;
    }
    return 0;
}

std::optional<TiltFields> tilt_fields(std::span<const Pose> poses, Vector3 tip_mm) {
    constexpr double kMinArmMm = 5;
    Vector3 mean;
    std::vector<Vector3> up;  // from the pin to the sensor
    if (norm(tip_mm) < kMinArmMm) return std::nullopt;
    for (const Pose& pose : poses) {
        if (!pose.ok) continue;
        up.push_back(normalized(-1 * (pose.tracker_from_tool.rotation * tip_mm)));
        mean = mean + up.back();
    }
    if (up.empty() || norm(mean) < 1e-6) return std::nullopt;
    mean = normalized(mean);
    const Vector3 other = std::abs(mean.x) < 0.7 ? Vector3{1, 0, 0} : Vector3{0, 1, 0};
    const Vector3 across = normalized(cross(mean, other)), along = cross(mean, across);
    TiltFields fields;
    for (const Vector3& u : up) {
        const double x = dot(u, across), y = dot(u, along), n = std::hypot(x, y);
        const double lean_rad = std::asin(std::clamp(n, 0.0, 1.0));
        fields.x_rad = n > 0 ? lean_rad * x / n : 0;
        fields.y_rad = n > 0 ? lean_rad * y / n : 0;
        const double turn = std::atan2(y, x) / (2 * std::numbers::pi) + 0.5;  // [0, 1]
        const auto sector = [&](int count) {
            return std::min(static_cast<int>(turn * count), count - 1);
        };
        const int field = lean_rad < TiltFields::kInnerRad ? 0
                          : lean_rad < TiltFields::kOuterRad
                              ? 1 + sector(TiltFields::kInner)
                              : 1 + TiltFields::kInner + sector(TiltFields::kOuter);
        fields.leaned[static_cast<std::size_t>(field)] = true;
    }
    return fields;
}

const char* setup_title(SetupStep step) {
    switch (step) {
        case SetupStep::trackers: return "Trackers";
        case SetupStep::probe_tip: return "Probe: middle of the face";
        case SetupStep::probe_depth: return "Probe: depth direction";
        case SetupStep::probe_lateral: return "Probe: lateral direction";
        case SetupStep::needle: return "Needle";
        case SetupStep::mannequin: return "Mannequin";
        case SetupStep::done: return "Try it and save";
    }
    return "";
}

const char* setup_instruction(SetupStep step) {
    switch (step) {
        case SetupStep::trackers:
            return "Move the probe, then the needle, and check that the right sensor follows. "
                   "Choose another sensor if it does not.";
        case SetupStep::probe_tip:
            return "Rest the middle of the probe's face on a fixed point, such as a pin, and tilt "
                   "the probe in every direction for about fifteen seconds.";
        case SetupStep::probe_depth:
            return "Slide the probe along a ruler in the direction in which it looks, without "
                   "turning it.";
        case SetupStep::probe_lateral:
            return "Slide the probe sideways, towards its orientation mark, without turning it.";
        case SetupStep::needle:
            return "Push the needle through a fixed pinhole and tilt it; record this at three "
                   "or more depths, the last with the tip in the hole.";
        case SetupStep::mannequin:
            return "Sweep the middle of the probe's face over the mannequin: front, both sides, "
                   "and as far up and down as it goes.";
        case SetupStep::done:
            return "Put the probe on the mannequin and check that the picture follows. Then save.";
    }
    return "";
}

void SetupGuide::go_to(SetupStep step) {
    record(false);
    step_ = step;
    view_ = {};
    fit();
}

void SetupGuide::record(bool on) {
    if (recording_ && !on) {
        if (step_ == SetupStep::needle && !poses_of(step_).empty()) {
            depths_.push_back(std::exchange(poses_of(step_), {}));
        }
        recording_ = false;
        fit();
        return;
    }
    if (on && !recording_ && step_ != SetupStep::needle) poses_of(step_).clear();
    recording_ = on && step_ != SetupStep::trackers && step_ != SetupStep::done;
    fitted_s_ = -1;
}

void SetupGuide::clear_step() {
    poses_of(step_).clear();
    if (step_ == SetupStep::needle) depths_.clear();
    view_ = {};
    fit();
}

void SetupGuide::observe(const TrackerReading& reading,
                         const SensorAssignment& assignment,
                         double now_s) {
    if (!recording_ || reading.in_mannequin || reading.sequence == last_sequence_) return;
    last_sequence_ = reading.sequence;
    const SensorAssignment places = places_of(reading, assignment);
    const int index = step_ == SetupStep::needle ? places.needle : places.probe;
    if (index < 0 || index >= reading.sensor_count) return;
    const SensorReading& sensor = reading.sensors[index];
    if (sensor.in_mannequin) return;
    const std::optional<Rigid> placed = sensor_pose(reading, places, index);
    Pose pose;
    pose.frame = static_cast<std::int64_t>(reading.sequence);
    pose.timestamp_s = sensor.time_s >= 0 ? sensor.time_s : reading.time_s;
    pose.ok = sensor.state == SensorState::ok && placed;
    if (placed) pose.tracker_from_tool = *placed;
    std::vector<Pose>& poses = poses_of(step_);
    // What another sensor's message brought along again is no reading of this one.
    if (sensor.time_s >= 0 && !poses.empty() && poses.back().timestamp_s == pose.timestamp_s)
        return;
    poses.push_back(pose);
    if (poses.size() > kMaxPoses) {  // every second one is dropped: the whole time stays covered
        for (std::size_t i = 0; 2 * i < poses.size(); ++i) poses[i] = poses[2 * i];
        poses.resize((poses.size() + 1) / 2);
    }
    view_.readings = static_cast<int>(poses.size());
    view_.seconds = poses.back().timestamp_s - poses.front().timestamp_s;
    if (now_s - fitted_s_ < kFitEvery) return;
    fitted_s_ = now_s;
    fit();
}

void SetupGuide::fit() {
    const std::vector<Pose>& poses = poses_of(step_);
    view_.readings = static_cast<int>(poses.size());
    view_.seconds = poses.empty() ? 0 : poses.back().timestamp_s - poses.front().timestamp_s;
    view_.good_enough = false;
    view_.figure_mm = -1;
    switch (step_) {
        case SetupStep::probe_tip:
            if (poses.size() < kMinReadings) return;
            tip_ = fit_point(poses);
            show_point(tip_, poses, setup_needed_mm(step_), view_);
            return;
        case SetupStep::probe_depth:
        case SetupStep::probe_lateral:
            if (poses.size() >= kMinReadings) fit_probe_direction(poses);
            return;
        case SetupStep::needle: fit_needle_depths(poses); return;
        case SetupStep::mannequin:
            if (poses.size() >= kMinSweepReadings) fit_mannequin(poses);
            return;
        case SetupStep::trackers:
        case SetupStep::done: return;
    }
}

void SetupGuide::fit_probe_direction(const std::vector<Pose>& poses) {
    DirectionOptions options;
    options.tip_mm = tip_.tip_mm;
    DirectionFit& fit = step_ == SetupStep::probe_depth ? depth_ : lateral_;
    fit = fit_direction(poses, options);
    show_direction(fit, view_);
    if (!depth_.determined || !lateral_.determined) return;
    frame_ = make_probe_frame(depth_, lateral_);
    if (!frame_.determined) {
        view_.good_enough = false;
        view_.sentence = frame_.problem;
    }
}

// While a depth is recorded its pinhole is fitted, to show the coverage; afterwards all depths.
void SetupGuide::fit_needle_depths(const std::vector<Pose>& poses) {
    view_.recordings = static_cast<int>(depths_.size());
    if (recording_) {
        if (poses.size() < kMinReadings) return;
        show_point(fit_point(poses), poses, setup_needed_mm(step_), view_);
        view_.good_enough = false;
        return;
    }
    if (depths_.size() < 2) {
        view_.sentence = depths_.empty() ? "" : tr("Record the next depth.");
        return;
    }
    needle_ = fit_needle(depths_);
    view_.rms_mm = needle_.rms_mm;
    view_.sigma_mm = view_.figure_mm = worst(needle_.tip_sigma_mm);
    view_.tilts.reset();
    view_.coverage = std::min(1.0, static_cast<double>(depths_.size()) / 3);
    view_.good_enough = needle_.determined && view_.sigma_mm < setup_needed_mm(step_);
    view_.sentence = !needle_.determined ? needle_.problem
                     : view_.good_enough
                         ? filled(tr("Good: the tip is known to %.2f mm."), view_.sigma_mm)
                         : tr("Record another depth.");
}

void SetupGuide::fit_mannequin(const std::vector<Pose>& poses) {
    const Surface& skin =
        bundle_->mannequin_skin.points.empty() ? bundle_->patient_skin : bundle_->mannequin_skin;
    if (!tip_.determined) {
        view_.sentence = tr("Calibrate the probe's face first.");
        return;
    }
    if (skin.points.empty()) {
        view_.sentence = tr("This bundle has no skin to fit the sweep to.");
        return;
    }
    std::vector<Pose> usable;
    for (const Pose& pose : poses) {
        if (pose.ok) usable.push_back(pose);
    }
    const std::vector<Point3> trace = tip_trace(usable, tip_.tip_mm);
    mannequin_ = fit_skin_sweep(skin, trace);
    view_.rms_mm = mannequin_.rms_mm;
    Box3 box;
    for (const Point3& p : trace) box.include(p);
    const Vector3 extent = box.extent();
    view_.coverage = std::clamp((extent.x + extent.y + extent.z) / 600, 0.0, 1.0);
    view_.sigma_mm = mannequin_.determined ? worst(mannequin_.sigma_mm) : -1;
    view_.residuals_mm.clear();
    for (double r : mannequin_.residuals_mm) view_.residuals_mm.push_back(static_cast<float>(r));
    view_.figure_mm = mannequin_.determined ? mannequin_.rms_mm : -1;
    view_.good_enough = mannequin_.determined && mannequin_.rms_mm < setup_needed_mm(step_);
    view_.sentence =
        !mannequin_.determined ? mannequin_.problem
        : view_.good_enough
            ? filled(tr("Good: the sweep fits the skin within %.1f mm."), mannequin_.rms_mm)
            : tr("Sweep more of the mannequin, including its sides.");
}

bool SetupGuide::found(SetupStep step) const {
    switch (step) {
        case SetupStep::probe_tip: return tip_.determined;
        case SetupStep::probe_depth: return depth_.determined;
        case SetupStep::probe_lateral: return lateral_.determined;
        case SetupStep::needle: return needle_.determined;
        case SetupStep::mannequin: return mannequin_.determined;
        case SetupStep::trackers:
        case SetupStep::done: break;
    }
    return false;
}

Calibrations SetupGuide::calibrations(const std::string& sensor, const std::string& date) const {
    Calibrations out;
    const auto base = [&](const char* kind, double rms, Vector3 sigma, double condition, int poses,
                          const std::vector<std::string>& warnings) {
        Calibration c;
        c.kind = kind;
        c.sensor = sensor;
        c.rms_mm = rms;
        c.sigma_mm = sigma;
        c.condition = condition;
        c.poses = poses;
        c.date = date;
        c.warnings = warnings;
        return c;
    };
    if (probe_ready()) {
        out.probe =
            base("probe", tip_.rms_mm, tip_.sigma_mm, tip_.condition, tip_.poses, tip_.warnings);
        out.probe->sensor_from_tool = {frame_.sensor_from_probe, tip_.tip_mm};
    }
    if (needle_.determined) {
        out.needle = base("needle", needle_.rms_mm, needle_.tip_sigma_mm, needle_.condition,
                          needle_.poses, needle_.warnings);
        out.needle->sensor_from_tool = needle_.sensor_from_needle();
    }
    if (mannequin_.determined) {
        out.mannequin = base("mannequin", mannequin_.rms_mm, mannequin_.sigma_mm,
                             mannequin_.condition, mannequin_.points, mannequin_.warnings);
        out.mannequin->sensor_from_tool = mannequin_.to_from;
        out.mannequin->scale = mannequin_.scale;
    }
    return out;
}

}  // namespace sonocase::runtime::inline player_app
