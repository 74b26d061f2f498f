// SPDX-License-Identifier: Apache-2.0

// A camera as a tracker, whatever brings its pictures: poses of both bodies for the moment at which
// they are asked for, and a sentence for the user where something is wrong with what it sees. The
// desktop's tracker and the page's worker are made of it. No threads, no files, no clock.
#pragma once

#include <array>
#include <vector>

#include "formats/base/message.h"
#include "formats/markers/detect/tag_detector.h"
#include "formats/markers/pose_predictor.h"

namespace sonocase {

inline constexpr const char* kNotCalibrated =
    "This camera is not calibrated: it is taken to see 65 degrees across. Lengths may be off by a "
    "fifth until sonocase calibrate camera has measured it.";

// What is known of a camera. Of nothing: it is taken to see kAssumedViewDeg across the longer side
// of its pictures, and the sheets to be as drawn.
struct KnownCamera {
    CameraSetup setup;
    bool calibrated = false;  // setup comes from a file
};
// Its model for pictures of this size. Errors: too small to read tags in; another shape than that
// of the calibration.
Result<CameraModel> camera_for(const KnownCamera& known, int width_px, int height_px);

// Why a picture without tags has none.
Message why_no_tags(const GreyPicture& picture, TagDetector& detector);

class CameraPoses {
  public:
    // Errors: those of camera_for() and TagDetector::create().
    static Result<CameraPoses> create(const KnownCamera& known, int width_px, int height_px);

    // The next picture, of the size given to create(). time_s: of the middle of its exposure;
    // now_s: on the same clock. Cost: that of PictureFollower::follow(); 60 ms more twice a second
    // where no tag has been seen for a second.
    const FollowerPicture& follow(const GreyPicture& picture, double time_s, double now_s);
    // World is the board: a body's pose at a time after that of the last picture, predicted as far
    // as a PosePredictor does. Once for each picture.
    Rigid pose_at(MarkerRole role, double at_s);
    // Of the last picture; empty: all is well.
    const Message& message() const { return message_; }
    const MarkerBody& body(MarkerRole role) const { return *follower_.follower().body(role); }

  private:
    CameraPoses(PictureFollower follower, bool calibrated);
    Message about(const GreyPicture& picture, double now_s);

    PictureFollower follower_;
    std::vector<PosePredictor> predictors_;  // probe, needle
    bool calibrated_;
    FollowerPicture seen_;
    double time_s_ = 0;
    double tags_s_ = -1,
           judged_s_ = -1;  // when a tag was last seen, when its absence was explained
    Message no_tags_, message_;
};

}  // namespace sonocase
