// SPDX-License-Identifier: Apache-2.0

// A needle's way through layers of tissue: it dents each layer before it goes through, drags tissue
// along its shaft, and reports what it has punctured. NeedlePuncture is the mechanics along one
// line; PunctureState finds the layers in the tissue of a case, in the pressed picture.
//
// The mechanics work on the inserted depth alone, in steps of 0.05 mm that lie at multiples of it.
// State and events therefore depend on which steps were passed and where the needle turned round,
// not on how often they were asked for: a recording gives the same events at any frame rate.
//
// On touching a layer the dent d grows with the advance, F = 4 pi (E / 3) w d, E the stiffness of
// the tissue that the tip is in (in air: of what lies under the skin). The layer gives way when F
// exceeds its puncture force times diameter / 1.27 mm, or when d is 3.2 mm; then d falls to a
// quarter, the force of cutting. The tip is in a lumen only after its puncture: when it has pushed
// the near wall as far as the far one, both give way at once.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "formats/bundle/case_bundle.h"
#include "formats/exercise/exercise.h"
#include "formats/scoring/anatomy.h"
#include "formats/scoring/session_monitor.h"
#include "runtime/imaging/core/needle_shift.h"
#include "runtime/imaging/renderer.h"

namespace sonocase::runtime::inline engine {

struct NeedleLayer {
    double stiffness_kpa = 8;
    double puncture_n = 0.1;  // force at which an 18 G needle goes through
    bool outside = false;     // air before the skin
    bool lumen = false;       // a vessel: has a far wall
    bool rigid = false;       // bone: stops the tip
};

// The layer at a depth along the needle's line, in the pressed picture; an index, the same for the
// same tissue.
struct LayersAlong {
    const void* context = nullptr;
    int (*index)(const void* context, double depth_mm) = nullptr;
    const NeedleLayer& (*layer)(const void* context, int index) = nullptr;
};

enum class NeedleEventKind : std::uint8_t {
    puncture,        // through the wall of `layer`, into it
    posterior_wall,  // through the far wall of the lumen `layer`
    withdrawn,       // out of `layer` again, by more than a millimetre
    stopped,         // by something rigid
};

struct NeedleEvent {
    NeedleEventKind kind = NeedleEventKind::puncture;
    int layer = 0;
    double depth_mm = 0;  // a multiple of the step
    double force_n = 0;   // just before the event
};

class NeedlePuncture {
  public:
    static constexpr double kStepMm = 0.05;
    static constexpr double kHysteresisMm = 1;    // trembling by less makes no event
    static constexpr double kLongestMoveMm = 20;  // more in one call is a jump of the reading
    static constexpr int kMaxEvents = 16;         // per call; the last ones are kept
    static constexpr int kMaxLayers = 32;         // punctured at a time; older holes are forgotten

    explicit NeedlePuncture(double diameter_mm = 1.27) : scale_(diameter_mm / 1.27) {}

    // Moves the tip to a depth below the skin along its line; negative in front of it. NaN leaves
    // everything as it was; a jump begins anew at the new depth, without events. Cost: a look-up
    // per step, some more on touching a lumen.
    void move_to(double depth_mm, const LayersAlong& layers);
    void reset();

    double tent_mm() const;  // d, for needle_shift
    double drag_mm() const { return drag_mm_; }
    double force_n() const;  // on the tip, along the needle
    // Events of the last call, in the order in which they happened.
    int event_count() const { return event_count_; }
    const NeedleEvent& event(int n) const { return events_[n]; }
    // The layer that the tip is in: punctured, not only dented.
    int tip_layer() const { return inside_; }

  private:
    struct Hole {
        int layer_before = 0;
        std::int64_t step = 0;  // where the boundary is
    };
    void begin(std::int64_t step, const LayersAlong& layers);
    void forward(const LayersAlong& layers);
    void backward();
    bool is_corner(int layer, const LayersAlong& layers) const;
    void touch(int layer, const LayersAlong& layers);
    void puncture(const LayersAlong& layers);
    void add_event(NeedleEventKind kind, int layer);
    double dent_mm() const;

    double scale_;
    bool begun_ = false;
    std::int64_t step_ = 0;        // step that the tip has reached
    double rest_mm_ = 0;           // how far the tip is beyond its step, for tent_mm
    int inside_ = 0;               // layer that the tip is in
    int touched_ = -1;             // layer that is dented; -1: none
    std::int64_t touched_at_ = 0;  // where its wall is at rest
    std::int64_t far_wall_ = 0;    // far wall of the lumen that is dented
    double spring_n_per_mm_ = 0, limit_n_ = 0;
    bool stopped_ = false;
    double cutting_mm_ = 0;  // dent that stays after a puncture
    double cutting_n_ = 0;   // and its force
    double drag_mm_ = 0;
    std::array<Hole, kMaxLayers> holes_{};
    int hole_count_ = 0;
    std::array<NeedleEvent, kMaxEvents> events_{};
    int event_count_ = 0;
};

// What the needle does in one frame.
struct PunctureReport {
    double tent_mm = 0;  // by which the layer before the tip is dented
    double drag_mm = 0;  // by which tissue is dragged along the shaft
    double force_n = 0;  // on the tip, along the needle
    int label = 0;       // tissue that the tip is in: punctured, not only dented
    static constexpr int kMaxEvents = 4;
    std::array<NeedleEvent, kMaxEvents> events{};  // layer: a label
    int event_count = 0;
};

// Reports to the monitor what scores count: punctures, posterior walls, stops at bone.
void report_punctures(const PunctureReport& report, SessionMonitor& monitor);

class PunctureState {
  public:
    // Takes the figures of the labels from formats/volume/tissue.h. Allocates; update() does not.
    PunctureState(const CaseBundle& bundle, const NeedleModel& needle);
    void reset() { needle_.reset(); }

    // Call this after Renderer::press_probe() of the same frame. depth_mm: inserted length, 0
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

}  // namespace sonocase::runtime::inline engine
