// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/headless/truth_files.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "formats/files/atomic_file.h"
#include "runtime/player/session/clock.h"
#include "runtime/player/session/png_file.h"

namespace sonocase::runtime::inline player_headless {
namespace {

using Json = nlohmann::ordered_json;

Json pose_json(const Rigid& pose) {
    Json rows = Json::array();
    for (int r = 0; r < 3; ++r) {
        rows.push_back(
            {pose.rotation(r, 0), pose.rotation(r, 1), pose.rotation(r, 2), pose.translation[r]});
    }
    rows.push_back({0.0, 0.0, 0.0, 1.0});
    return rows;
}

// A pose whose z is the needle's axis; x and y are any.
// x: the side that the bevel faces.
Json needle_json(const NeedlePose& needle) {
    const bool known =
        norm(needle.bevel) > 0.5 && std::abs(dot(needle.bevel, needle.direction)) < 1e-6;
    const Vector3 x = known ? needle.bevel : any_perpendicular(needle.direction);
    return pose_json({Matrix3::from_columns(x, cross(needle.direction, x), needle.direction),
                      needle.tip - Point3{}});
}

Json point_json(Point3 p) {
    return {p.x, p.y, p.z};
}

Json number_or_null(double value) {
    return std::isfinite(value) ? Json(value) : Json();
}

Json organs_json(const FrameTruth& truth, const std::vector<Label>& labels) {
    Json organs = Json::array();
    for (std::size_t i = 1; i < labels.size(); ++i) {
        if (truth.pixels_of_label[i] == 0) continue;
        organs.push_back({{"index", i},
                          {"name", labels[i].name},
                          {"area_mm2", truth.pixels_of_label[i] * truth.mm2_per_px},
                          {"shadowed_mm2", truth.shadowed_pixels_of_label[i] * truth.mm2_per_px}});
    }
    return organs;
}

Json lesions_json(const FrameTruth& truth, const Exercise& exercise) {
    Json lesions = Json::array();
    const std::vector<Target> shown = shown_lesions(exercise);
    for (std::size_t i = 0; i < shown.size(); ++i) {
        if (truth.pixels_of_lesion[i] == 0) continue;
        lesions.push_back({{"index", i + 1},
                           {"name", shown[i].name},
                           {"kind", lesion_kind_name(shown[i])},
                           {"area_mm2", truth.pixels_of_lesion[i] * truth.mm2_per_px}});
    }
    return lesions;
}

// 0 is kept for what has no depth.
std::vector<std::uint16_t> hundredths(const std::vector<float>& depth_mm) {
    std::vector<std::uint16_t> out;
    out.reserve(depth_mm.size());
    for (const float depth : depth_mm) {
        const float value =
            std::isnan(depth) ? 0.0f : std::clamp(depth * 100 + 0.5f, 1.0f, 65535.0f);
        out.push_back(static_cast<std::uint16_t>(value));
    }
    return out;
}

}  // namespace

std::string truth_json(const FrameTruth& truth,
                       int frame,
                       FrameStatus status,
                       const std::vector<Label>& labels,
                       const Exercise& exercise) {
    Json line = {{"frame", frame}, {"time_s", truth.time_s}};
    if (!truth.posed) {
        line["status"] = "held_bad_pose";
        return line.dump();
    }
    line["status"] = status == FrameStatus::no_contact ? "no_contact" : "rendered";
    line["mannequin_from_probe"] = pose_json(truth.mannequin_from_probe);
    line["mannequin_from_needle"] = truth.has_needle ? needle_json(truth.needle) : Json();
    line["contact"] =
        truth.beams > 0 ? static_cast<double>(truth.beams_touching) / truth.beams : 0.0;
    if (truth.press.pressed) {
        line["press"] = {
            {"force_n", truth.press.force_n},
            {"pressure_kpa", truth.press.pressure_kpa},
            {"deepest_mm", truth.press.deepest_mm},
            {"excess_mm", truth.press.excess_mm},
            {"vein_open", truth.press.vein_open >= 0 ? Json(truth.press.vein_open) : Json()}};
    }
    if (truth.has_needle) {
        const int tip = truth.tip_label;
        line["tip"] = {{"probe_mm", point_json(truth.tip_probe)},
                       {"in_plane", truth.tip_in_plane},
                       {"label", tip},
                       {"name", labels[tip].name},
                       {"visible", truth.tip_visible},
                       {"shaft_in_image_mm", truth.needle_in_image_mm},
                       {"shaft_visible_mm", truth.needle_visible_mm},
                       {"dent_mm", {truth.needle.tent_mm, truth.needle.drag_mm}}};
    }
    line["visible"] = organs_json(truth, labels);
    line["lesions"] = lesions_json(truth, exercise);
    Json targets = Json::array();
    for (std::size_t i = 0; i < truth.targets.size(); ++i) {
        const TargetTruth& target = truth.targets[i];
        targets.push_back({{"name", exercise.targets[i].name},
                           {"centre_mm", point_json(target.centre)},
                           {"radius_mm", exercise.targets[i].radius_mm},
                           {"plane_mm", target.plane_mm},
                           {"in_image", target.in_image},
                           {"tip_mm", number_or_null(target.tip_mm)}});
    }
    line["targets"] = std::move(targets);
    return line.dump();
}

TruthPlaneBuffers::TruthPlaneBuffers(int width, int height)
    : width_px(width),
      height_px(height),
      labels(static_cast<std::size_t>(width) * height),
      needle(labels.size()),
      shadowed(labels.size()),
      lesions(labels.size()),
      skin_depth_mm(labels.size()) {}

TruthPlanes TruthPlaneBuffers::planes() {
    return {.labels = labels,
            .needle = needle,
            .shadowed = shadowed,
            .skin_depth_mm = skin_depth_mm,
            .lesions = lesions};
}

Status TruthPlaneBuffers::write(const std::string& folder, const std::string& name) const {
    const auto path = [&](const char* kind) { return folder + "/" + kind + "_" + name + ".png"; };
    const std::vector<std::uint16_t> wide(labels.begin(), labels.end());
    if (Status done = write_png16(path("labels"), width_px, height_px, wide); !done) return done;
    if (Status done = write_png(path("needle"), width_px, height_px, 1, needle); !done) return done;
    if (Status done = write_png(path("shadow"), width_px, height_px, 1, shadowed); !done)
        return done;
    if (Status done = write_png(path("lesions"), width_px, height_px, 1, lesions); !done)
        return done;
    return write_png16(path("depth"), width_px, height_px, hundredths(skin_depth_mm));
}

TruthFiles::TruthFiles(std::string folder,
                       CaseView bundle,
                       TruthRenderer truth,
                       const ScanEngine& engine)
    : folder_(std::move(folder)),
      bundle_(bundle),
      truth_(std::move(truth)),
      engine_(engine),
      buffers_(engine.render_options().width_px, engine.render_options().height_px) {}

Result<std::unique_ptr<TruthFiles>> TruthFiles::in(const std::string& folder,
                                                   CaseView bundle,
                                                   const ScanEngine& engine) {
    std::error_code failed;
    std::filesystem::create_directories(folder, failed);
    if (failed) {
        return Error{"cannot make the folder: " + failed.message(), folder,
                     "check the path and its permissions"};
    }
    SONOCASE_TRY(auto truth,
                 TruthRenderer::create(bundle, engine.exercise(), engine.render_options()));
    return std::unique_ptr<TruthFiles>(new TruthFiles(folder, bundle, std::move(truth), engine));
}

Status TruthFiles::add(int frame, const FrameInput& input, FrameStatus status, double& ms) {
    const double before_s = steady_seconds();
    const FrameTruth& truth = truth_.render(input, buffers_.planes(), &engine_.renderer());
    ms = (steady_seconds() - before_s) * 1e3;
    lines_ += truth_json(truth, frame, status, bundle_->labels, engine_.exercise()) + "\n";
    if (!truth.posed) return Done{};
    char name[16];
    std::snprintf(name, sizeof name, "%05d", frame);
    return buffers_.write(folder_, name);
}

Status TruthFiles::finish() {
    return write_file(folder_ + "/truth.jsonl", lines_);
}

}  // namespace sonocase::runtime::inline player_headless
