// SPDX-License-Identifier: Apache-2.0

#include "formats/markers/marker_follower.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace sonocase {
namespace {

constexpr double kTrustS = 0.15;  // how long a pose helps to find the next
// How long it is looked for where it was: what a hand hides mostly comes back there.
constexpr double kRememberedS = 2;

// The board lies still on what it is glued to, and a camera mostly stands: a pose that agrees with
// the one before is averaged with it.
constexpr double kBoardGain = 0.15;
constexpr double kBoardAgrees = 3;  // standard deviations

void settle_board(std::optional<BodyPose>& kept, const BodyPose& seen) {
    if (!kept) {
        kept = seen;
        return;
    }
    const Rigid &a = kept->camera_from_body, &b = seen.camera_from_body;
    const double turn = rotation_angle(transpose(a.rotation) * b.rotation);
    const double way = norm(a.translation - b.translation);
    if (turn > kBoardAgrees * worst_sigma_rad(seen) + 1e-4 ||
        way > kBoardAgrees * worst_sigma_mm(seen, {}) + 0.02) {
        kept = seen;
        return;
    }
    const Rigid before = a;
    *kept = seen;
    Matrix3 mixed;
    for (int k = 0; k < 9; ++k)
        mixed.m[k] = before.rotation.m[k] +
                     kBoardGain * (seen.camera_from_body.rotation.m[k] - before.rotation.m[k]);
    kept->camera_from_body.rotation = nearest_rotation(mixed);
    kept->camera_from_body.translation =
        before.translation + kBoardGain * (seen.camera_from_body.translation - before.translation);
}

// The same covariance in a frame that is turned.
std::array<double, 9> turned(const std::array<double, 9>& covariance, const Matrix3& turn) {
    Matrix3 c;
    c.m = covariance;
    return (turn * c * transpose(turn)).m;
}

}  // namespace

MarkerFollower::MarkerFollower(const CameraModel& camera,
                               std::vector<MarkerBody> bodies,
                               const FollowerOptions& options)
    : camera_(camera), bodies_(std::move(bodies)), options_(options) {}

std::optional<BodyPose> MarkerFollower::find(MarkerRole role,
                                             std::span<const SeenTag> seen,
                                             std::span<const int> twice,
                                             const Rigid* predicted) {
    std::size_t count = 0;
    for (const MarkerBody& body : bodies_) {
        if (body.role != role) continue;
        for (const MarkerTag& tag : body.tags) {
            if (std::find(twice.begin(), twice.end(), tag.id) != twice.end()) return {};
            for (const SeenTag& one : seen)
                if (one.id == tag.id && count < sights_.size()) sights_[count++] = {&tag, &one};
        }
    }
    return find_body_pose(camera_, std::span<const TagSight>(sights_.data(), count), predicted);
}

const MarkerBody* MarkerFollower::body(MarkerRole role) const {
    for (const MarkerBody& body : bodies_)
        if (body.role == role) return &body;
    return nullptr;
}

std::optional<Rigid> MarkerFollower::expected(MarkerRole role, double time_s) const {
    const Track& track = tracks_[role == MarkerRole::probe ? 0 : 1];
    if (!track.seen || time_s - track.time_s > kRememberedS) return {};
    Rigid pose = track.camera_from_body;
    if (track.time_s < last_s_ || time_s - track.time_s > kTrustS) return pose;
    // Times of a browser's camera come in clumps: two a few milliseconds apart tell no speed.
    constexpr double kMaxPeriods = 3;
    if (track.age_s > 0)
        pose.translation =
            pose.translation + std::min((time_s - track.time_s) / track.age_s, kMaxPeriods) *
                                   (pose.translation - track.before.translation);
    return pose;
}

std::optional<Rigid> MarkerFollower::expected_board() const {
    if (!board_ || last_s_ - board_s_ > options_.board_hidden_after_s) return {};
    return board_->camera_from_body;
}

FollowerPicture MarkerFollower::follow(std::span<const SeenTag> seen,
                                       std::span<const int> twice,
                                       int foreign,
                                       double time_s) {
    FollowerPicture out;
    out.time_s = last_s_ = time_s;
    out.foreign_tags = foreign;
    const std::size_t ours = seen.size();

    if (options_.with_board) {
        const std::optional<BodyPose> board =
            find(MarkerRole::board, seen, twice, board_ ? &board_->camera_from_body : nullptr);
        // A flat board of one tag has two poses; of several far apart it has one.
        if (board && board->tags >= 3 && board->margin > options_.good_margin) {
            settle_board(board_, *board);
            board_s_ = time_s;
            out.board_seen = true;
        }
    }
    const bool board_known =
        !options_.with_board || (board_ && time_s - board_s_ <= options_.board_hidden_after_s);

    bool misfit = false;
    for (const MarkerRole role : {MarkerRole::probe, MarkerRole::needle}) {
        const std::size_t index = role == MarkerRole::probe ? 0 : 1;
        Track& track = tracks_[index];
        MarkerReading& reading = out.tools[index];
        const bool recent = track.seen && time_s - track.time_s <= kTrustS;
        const std::optional<BodyPose> pose =
            find(role, seen, twice, recent ? &track.camera_from_body : nullptr);
        reading.world_from_body = track.world_from_body;
        // A finger or a blurred picture does not last. What lies on no body is not followed, so
        // that it has a pose in some pictures alone.
        constexpr int kMisfits = 8, kManyTags = 3;
        constexpr double kMisfitS = 0.5;
        if (pose) {
            const bool misfits = pose->tags >= kManyTags && pose->residual > options_.good_residual;
            track.misfits = misfits ? track.misfits + 1 : 0;
            track.posed_s = time_s;
        }
        misfit = misfit || (track.misfits >= kMisfits && time_s - track.posed_s < kMisfitS);
        if (!pose) continue;
        const Point3 tool_body = body(role)->body_from_tool * Point3{};
        double sigma_mm = worst_sigma_mm(*pose, tool_body), sigma_rad = worst_sigma_rad(*pose);
        Rigid world_from_body = pose->camera_from_body;
        if (options_.with_board && board_) {
            const Rigid board_from_camera = inverse(board_->camera_from_body);
            world_from_body = board_from_camera * pose->camera_from_body;
            sigma_mm = std::hypot(sigma_mm, worst_sigma_mm(*board_, world_from_body * tool_body));
            sigma_rad = std::hypot(sigma_rad, worst_sigma_rad(*board_));
        }
        reading.two_poses = !(pose->margin > options_.good_margin);
        reading.tags = pose->tags;
        if (!(sigma_mm <= options_.poor_sigma_mm)) continue;
        // Of two poses that fit alike, the one that the hand can have come to since the last
        // picture is shown, and as poor.
        Rigid camera_from_body = pose->camera_from_body;
        if (reading.two_poses && recent) {
            const auto away = [&](const Rigid& p) {
                return rotation_angle(transpose(track.camera_from_body.rotation) * p.rotation);
            };
            if (away(pose->second) < away(camera_from_body)) {
                camera_from_body = pose->second;
                world_from_body = options_.with_board && board_
                                      ? inverse(board_->camera_from_body) * camera_from_body
                                      : camera_from_body;
            }
        }
        const bool good = board_known && pose->tags >= 2 && !reading.two_poses &&
                          pose->residual <= options_.good_residual &&
                          sigma_mm <= options_.good_sigma_mm &&
                          sigma_rad <= options_.good_sigma_rad;
        reading.status = good ? MarkerStatus::good : MarkerStatus::poor;
        reading.sigma_mm = sigma_mm;
        reading.sigma_rad = sigma_rad;
        reading.world_from_body = world_from_body;
        const Matrix3 world_from_camera =
            world_from_body.rotation * transpose(camera_from_body.rotation);
        reading.point_covariance = turned(point_covariance(*pose, tool_body), world_from_camera);
        reading.turn_covariance = turned(turn_covariance(*pose), world_from_camera);
        const double age_s = recent ? time_s - track.time_s : 0;
        track.before = track.camera_from_body, track.age_s = age_s;
        track.seen = true, track.time_s = time_s;
        track.camera_from_body = camera_from_body, track.world_from_body = world_from_body;
    }

    if (!twice.empty()) {
        out.problem = Message("Tag {} is in view twice: put the second sheet away.",
                              {std::to_string(twice[0])});
    } else if (ours == 0 && out.foreign_tags > 0) {
        out.problem = "These tags are on none of our sheets: print them with sonocase markers.";
    } else if (ours > 0 && options_.with_board && !board_known) {
        out.problem =
            "The board is not in view: place it on the mannequin so that the camera sees it.";
    } else if (misfit) {
        out.problem =
            "Tags of a body do not lie as they were drawn: fold its sheet, or measure it as it was "
            "glued (sonocase calibrate body).";
    }
    return out;
}

}  // namespace sonocase
