// SPDX-License-Identifier: Apache-2.0

#include "formats/markers/detect/camera_poses.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

namespace sonocase {

Result<CameraModel> camera_for(const KnownCamera& known, int width_px, int height_px) {
    constexpr int kMinSide = 480;
    if (std::max(width_px, height_px) < kMinSide) {
        return Error{Message("The camera's pictures of {} x {} are too small: tags cannot be read.",
                             {std::to_string(width_px), std::to_string(height_px)}),
                     "", ""};
    }
    if (known.calibrated) return at_size(known.setup.camera, width_px, height_px);
    const double half = std::tan(0.5 * kAssumedViewDeg * kRadPerDeg);
    const bool upright = height_px > width_px;  // a phone that is held so
    const double view_deg =
        upright ? 2 * std::atan(half * width_px / height_px) / kRadPerDeg : kAssumedViewDeg;
    return assumed_camera(width_px, height_px, view_deg);
}

Message why_no_tags(const GreyPicture& picture, TagDetector& detector) {
    constexpr int kEvery = 97;  // pixels
    double sum = 0, count = 0;
    for (std::int64_t i = 0; i < std::int64_t{picture.width_px} * picture.height_px; i += kEvery) {
        const std::int64_t row = i / picture.width_px, column = i % picture.width_px;
        sum += picture.pixels[row * picture.stride + column];
        count += 1;
    }
    constexpr double kDark = 16;
    if (sum < kDark * count)
        return "The camera's picture is dark: switch a light on, or open its cover.";
    if (detector.count_mirrored(picture) > 0)
        return "The camera's picture is mirrored: switch mirroring off in the camera's settings.";
    return "The camera sees no tag: place the printed bodies and the board in its view.";
}

CameraPoses::CameraPoses(PictureFollower follower, bool calibrated)
    : follower_(std::move(follower)), calibrated_(calibrated) {
    for (const MarkerRole role : {MarkerRole::probe, MarkerRole::needle})
        predictors_.emplace_back(body(role).body_from_tool * Point3{});
}

Result<CameraPoses> CameraPoses::create(const KnownCamera& known, int width_px, int height_px) {
    SONOCASE_TRY(const CameraModel camera, camera_for(known, width_px, height_px));
    SONOCASE_TRY(TagDetector detector, TagDetector::create());
    return CameraPoses(
        PictureFollower(std::move(detector), MarkerFollower(camera, marker_bodies(known.setup))),
        known.calibrated);
}

const FollowerPicture& CameraPoses::follow(const GreyPicture& picture,
                                           double time_s,
                                           double now_s) {
    seen_ = follower_.follow(picture, time_s);
    time_s_ = time_s;
    message_ = about(picture, now_s);
    return seen_;
}

Rigid CameraPoses::pose_at(MarkerRole role, double at_s) {
    const int tool = role == MarkerRole::probe ? 0 : 1;
    return predictors_[tool].follow(seen_.tools[tool], time_s_, at_s);
}

Message CameraPoses::about(const GreyPicture& picture, double now_s) {
    // After a second without tags, and twice a second from then on.
    if (follower_.any_tags() || tags_s_ < 0) {
        tags_s_ = now_s;
        no_tags_ = {};
    } else if (now_s - tags_s_ > 1 && now_s - judged_s_ > 0.5) {
        judged_s_ = now_s;
        no_tags_ = why_no_tags(picture, follower_.detector());
    }
    if (!no_tags_.empty()) return no_tags_;
    if (!seen_.problem.empty()) return seen_.problem;
    return calibrated_ ? Message() : Message(kNotCalibrated);
}

}  // namespace sonocase
