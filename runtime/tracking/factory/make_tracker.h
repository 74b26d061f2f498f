// SPDX-License-Identifier: Apache-2.0

// A tracker from its name on the command line.
#pragma once

#include <memory>
#include <string>

#include "formats/base/result.h"
#include "formats/exercise/exercise.h"
#include "runtime/engine/skin.h"
#include "runtime/tracking/tracker.h"

namespace sonocase::runtime {

struct TrackerContext {
    const Skin* skin = nullptr;  // both outlive the tracker's making; the bundle outlives it
    const Exercise* exercise = nullptr;
    SessionClock clock;       // for trackers with a thread
    bool loop = true;         // scripts and recordings start over when they end
    double needle_lag_s = 0;  // of a recording: the needle's readings come so much late
};

// spec  mouse | sweep:NAME | sweep | replay:FILE[,NEEDLE_FILE] | igtl:HOST:PORT | igtl:listen:PORT
// |
//       viper | 3dg | liberty | null
// A device that is not there is no error: the tracker waits for it and says so in its health.
Result<std::unique_ptr<Tracker>> make_tracker(const std::string& spec,
                                              const TrackerContext& context);

}  // namespace sonocase::runtime
