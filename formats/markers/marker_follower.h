// SPDX-License-Identifier: Apache-2.0

// Turns the tags of one picture after another into poses of the probe's and the needle's body, each
// with its status, as a tracker reports them.
//
// World is the board: camera and mannequin may be moved together or alone, as long as the board
// stays on the mannequin. What the board's own pose is worth counts in every status.
// No threads, no files, no clock: the times of the pictures are passed in.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "formats/base/message.h"
#include "formats/markers/body_pose.h"

namespace sonocase {

enum class MarkerStatus : std::uint8_t {
    lost,  // no pose; the one given is the last
    poor,  // one tag, two poses that fit alike, or a spread beyond that of `good`
    good,
};

struct MarkerReading {
    MarkerStatus status = MarkerStatus::lost;
    Rigid world_from_body;
    // One standard deviation along the worst direction, of the tool's own point (face or tip),
    // board included, and of the angle; negative: no pose.
    double sigma_mm = -1, sigma_rad = -1;
    // 3 x 3, in the world, of the tool's own point (mm2) and of its turn (rad2), without the
    // board's part, which is the same in successive pictures.
    std::array<double, 9> point_covariance{}, turn_covariance{};
    int tags = 0;
    bool two_poses = false;  // a second pose fits nearly as well
};

struct FollowerOptions {
    double good_sigma_mm = 1.6;     // of the tool's own point
    double good_sigma_rad = 0.012;  // 0.7 degrees
    double poor_sigma_mm = 8;       // more is no pose at all
    double good_margin = 30;        // of BodyPose::margin
    double good_residual = 4;       // of BodyPose::residual: beyond it the body is bent or blurred
    double board_hidden_after_s = 0.5;  // without the board poses are poor from then on
    bool with_board = true;             // false: world is the camera
};

struct FollowerPicture {
    double time_s = 0;
    std::array<MarkerReading, 2> tools;  // probe, needle
    bool board_seen = false;
    int foreign_tags = 0;  // of the family, but on none of our sheets
    Message problem;       // a sentence for the user; empty: none
};

class MarkerFollower {
  public:
    MarkerFollower(const CameraModel& camera,
                   std::vector<MarkerBody> bodies,
                   const FollowerOptions& options = {});

    // seen: the tags of a picture after fit_tag(), each id once; twice: ids seen in two places;
    // foreign: how many tags were read that are on none of our sheets.
    // time_s: of the middle of its exposure, rising. Cost: about 0.2 ms; allocates nothing.
    FollowerPicture follow(std::span<const SeenTag> seen,
                           std::span<const int> twice,
                           int foreign,
                           double time_s);

    // camera_from_body at a time, going on as in the last two pictures, or as it was where it was
    // not followed in the last of them; nothing: not for two seconds.
    std::optional<Rigid> expected(MarkerRole role, double time_s) const;
    // camera_from_board, if it was seen within the last half second.
    std::optional<Rigid> expected_board() const;
    const MarkerBody* body(MarkerRole role) const;  // null: there is none

    const CameraModel& camera() const { return camera_; }
    const std::vector<MarkerBody>& bodies() const { return bodies_; }
    // Of the last picture in which the board was seen.
    const std::optional<BodyPose>& board() const { return board_; }

  private:
    struct Track {
        bool seen = false;
        double time_s = 0;
        Rigid camera_from_body, world_from_body;
        // Of the picture before; age_s: how long before, 0: it was not followed there.
        Rigid before;
        double age_s = 0;
        int misfits = 0;  // poses in a row whose tags lie on no such body
        double posed_s = 0;
    };
    std::optional<BodyPose> find(MarkerRole role,
                                 std::span<const SeenTag> seen,
                                 std::span<const int> twice,
                                 const Rigid* predicted);

    CameraModel camera_;
    std::vector<MarkerBody> bodies_;
    FollowerOptions options_;
    std::array<Track, 2> tracks_;
    std::optional<BodyPose> board_;
    double board_s_ = -1e9, last_s_ = -1e9;
    std::array<TagSight, kMarkerTagIds> sights_;
};

}  // namespace sonocase
