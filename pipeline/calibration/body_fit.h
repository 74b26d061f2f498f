// SPDX-License-Identifier: Apache-2.0

// Where the tags of a folded body really are, from pictures in which it is turned: bundle
// adjustment by Ceres over the body's pose in every picture and the place of every tag at once,
// each corner with its covariance. Lengths come from the edges of the tags, which are printed.
//
// No picture tells the body's own frame from the places of its tags. It is laid so that the tags'
// corners come as near to where they are drawn as they can (least squares); what a pivot or a touch
// then finds in this frame is the tool.
#pragma once

#include <string>
#include <vector>

#include "pipeline/calibration/camera_fit.h"

namespace sonocase::pipeline::inline calibration {

struct BodyFitOptions {
    int min_views = 15;  // that differ by a turn of min_turn_deg or by min_way_mm
    double min_turn_deg = 4;
    double min_way_mm = 20;
    int min_sights = 4;          // of each tag, with another one in the same picture
    double max_sigma_mm = 0.3;   // of a tag's middle in the body
    double max_sigma_deg = 0.6;  // of its turn
    double max_rms_px = 0.6;
};

struct TagOfBody {
    BuiltTag built;
    int sights = 0;
    double sigma_mm = -1, sigma_deg = -1;  // one standard deviation, worst direction
};

struct BodyFit {
    // Empty: the answer may be used. Otherwise why not, and what to do.
    std::string problem;
    std::vector<TagOfBody> tags;  // in the order of the body's
    int views = 0;
    double drawn_rms_px = -1, rms_px = -1;  // corners, with tags as drawn and as built
    double worst_moved_mm = 0, worst_turned_deg = 0;
    std::vector<std::string> warnings;
};

// views: pictures of one calibrated camera, each with two tags of the body at least, after
// unbend_tag(); those with fewer are left out. Deterministic. Cost: about a second for 80 views.
BodyFit fit_body(const std::vector<MarkerView>& views,
                 const MarkerBody& drawn,
                 const CameraModel& camera,
                 const BodyFitOptions& options = {});

}  // namespace sonocase::pipeline::inline calibration
