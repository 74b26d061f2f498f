// SPDX-License-Identifier: Apache-2.0

// The needle in the tissue of a case: which layers it dents, goes through and leaves, in the
// pressed picture. runtime/needle/needle_puncture.h has the mechanics.
#pragma once

#include <array>
#include <vector>

#include "formats/bundle/case_bundle.h"
#include "formats/exercise/exercise.h"
#include "formats/scoring/anatomy.h"
#include "formats/scoring/session_monitor.h"
#include "runtime/imaging/renderer.h"
#include "runtime/needle/needle_puncture.h"

namespace sonocase::runtime {

// Of a frame.
struct PunctureReport {
    double tent_mm = 0;  // by which the layer before the tip is dented
    double drag_mm = 0;  // by which tissue is dragged along the shaft
    double force_n = 0;  // on the tip, along the needle
    int label = 0;       // that the tip is in: punctured, not only dented
    static constexpr int kMostEvents = 4;
    std::array<NeedleEvent, kMostEvents> events{};  // layer: a label
    int event_count = 0;
};

// Tells the monitor what scores count: punctures, posterior walls, stops at bone.
void report_punctures(const PunctureReport& report, SessionMonitor& monitor);

class PunctureState {
  public:
    // Figures of the labels by formats/volume/tissue_mechanics.h. Allocates; update() does not.
    PunctureState(const CaseBundle& bundle, const NeedleModel& needle);
    void reset() { needle_.reset(); }

    // The needle of a frame for which the renderer has settled. depth_mm: inserted length, 0
    // outside. Cost: one look-up per 0.05 mm of advance, 2 us each while tissue is pressed.
    PunctureReport update(double time_s,
                          Point3 tip,
                          Vector3 direction,
                          double depth_mm,
                          const Anatomy& anatomy,
                          const Renderer& renderer);

  private:
    std::vector<NeedleLayer> layers_;  // # 256, by label
    NeedlePuncture needle_;
};

}  // namespace sonocase::runtime
