// SPDX-License-Identifier: Apache-2.0

#include "runtime/tracking/tracker.h"

namespace sonocase::runtime::inline tracking {

const char* phase_name(TrackerPhase phase) {
    switch (phase) {
        case TrackerPhase::searching: return "searching";
        case TrackerPhase::starting: return "starting";
        case TrackerPhase::streaming: return "streaming";
        case TrackerPhase::ended: return "ended";
        case TrackerPhase::failed: return "failed";
    }
    return "";
}

}  // namespace sonocase::runtime::inline tracking
