// SPDX-License-Identifier: Apache-2.0

// The first minutes of a newcomer: one thing to do at a time, and the next once it was done. It
// knows nothing of keys or windows; it sees what the tools did.
#pragma once

#include "formats/base/geometry.h"

namespace sonocase::runtime::inline tracking {

enum class GuideStep { slide, tilt, freeze, needle, advance, done };
inline constexpr int kGuideSteps = 5;  // without done

// What the guide sees, once per picture.
struct GuideSight {
    bool has_probe = false;
    Rigid mannequin_from_probe;
    bool frozen = false;
    bool has_needle = false;
    double needle_depth_mm = 0;
};

class GuidedStart {
  public:
    GuideStep step() const { return step_; }
    // Takes note of what was done; true when a step has just been finished.
    bool observe(const GuideSight& sight);
    void skip();  // the present step

  private:
    void begin(GuideStep step);

    GuideStep step_ = GuideStep::slide;
    bool begun_ = false;  // `start_` is set
    Rigid start_, last_;  // last_: of the observation before
    bool was_frozen_ = false;
};

// Words of a step, English keys of the catalogue: what to do, and how.
const char* guide_title(GuideStep step);
const char* guide_words(GuideStep step);

}  // namespace sonocase::runtime::inline tracking
