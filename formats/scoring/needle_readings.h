// SPDX-License-Identifier: Apache-2.0

// Where the needle is in the body and in the picture, for every reading of a session.
#pragma once

#include <limits>
#include <vector>

#include "formats/scoring/session_score.h"

namespace sonocase {

struct NeedleReading {
    // The tip, and the points ScoreOptions::puncture_mm before and behind it.
    bool inside = false, ahead = false, behind = false;
    bool touches = false;  // the tip is inside or nearer to the skin than contact_mm
    bool no_go = false;    // any point of the inserted shaft is in a structure to be spared
    double depth_mm = 0;   // > 0 inside
    Point3 skin;           // where the shaft passes it
    bool seen = false;     // the probe is tracked in the same sample
    double plane_mm = std::numeric_limits<double>::quiet_NaN();  // signed, of the tip
    bool tip_in_view = false;  // in the image and reached by sound
    double in_beam_mm = 0;     // inserted length in the image that sound reaches
};

// # needle.points. anatomy may be null: then nothing is inside. Readings are independent and are
// distributed by options.jobs.
std::vector<NeedleReading> look_up_readings(const Session& session,
                                            const ToolTrack& needle,
                                            const Exercise& exercise,
                                            const Anatomy* anatomy,
                                            const std::vector<Label>& labels,
                                            const ScoreOptions& options);

}  // namespace sonocase
