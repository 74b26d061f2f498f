// SPDX-License-Identifier: Apache-2.0

// A needle's way through layers: it dents each before it goes through, drags tissue along its
// shaft, and says what it has punctured.
//
// Works on the inserted depth alone, in steps of 0.05 mm that lie at multiples of it. The state and
// the events therefore depend on which steps were passed and where the needle turned round, and not
// on how often it was asked: a recording gives the same events at any frame rate.
//
// On touching a layer the dent d grows with the advance, F = 4 pi (E / 3) w d, E the stiffness of
// the tissue that the tip is in (in air: of what lies under the skin). The layer gives way when F
// exceeds its puncture force times diameter / 1.27 mm, or when d is 3.2 mm; then d falls to a
// quarter, the force of cutting. The tip is in a lumen only after its puncture: when it has pushed
// the near wall as far as the far one, both give way at once.
#pragma once

#include <array>
#include <cstdint>

#include "runtime/needle/needle_shift.h"

namespace sonocase::runtime {

struct NeedleLayer {
    double stiffness_kpa = 8;
    double puncture_n = 0.1;  // of an 18 G needle
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
    double force_n = 0;   // just before
};

class NeedlePuncture {
  public:
    static constexpr double kStep_mm = 0.05;
    static constexpr double kHysteresis_mm = 1;    // trembling by less makes no event
    static constexpr double kLongestMove_mm = 20;  // more in one call is a jump of the reading
    static constexpr int kMostEvents = 16;         // of one call; the last ones are kept
    static constexpr int kMostLayers = 32;         // punctured at a time; older holes are forgotten

    explicit NeedlePuncture(double diameter_mm = 1.27) : scale_(diameter_mm / 1.27) {}

    // Moves the tip to a depth below the skin along its line; negative in front of it. NaN leaves
    // everything as it was; a jump begins anew at the new depth, without events. Cost: a look-up
    // per step, some more on touching a lumen.
    void move_to(double depth_mm, const LayersAlong& layers);
    void reset();

    double tent_mm() const;  // d, for needle_shift
    double drag_mm() const { return drag_mm_; }
    double force_n() const;  // on the tip, along the needle
    // Of the last call, in the order in which they happened.
    int event_count() const { return event_count_; }
    const NeedleEvent& event(int n) const { return events_[static_cast<std::size_t>(n)]; }
    int tip_layer() const { return inside_; }  // that the tip is in: punctured, not only dented

  private:
    struct Hole {
        int layer_before = 0;
        std::int64_t step = 0;  // of the boundary
    };
    void begin(std::int64_t step, const LayersAlong& layers);
    void forward(const LayersAlong& layers);
    void backward();
    void touch(int layer, const LayersAlong& layers);
    void puncture(const LayersAlong& layers);
    void say(NeedleEventKind kind, int layer);
    double dent_mm() const;

    double scale_;
    bool begun_ = false;
    std::int64_t step_ = 0;        // of the tip
    double rest_mm_ = 0;           // of the tip beyond its step, for tent_mm
    int inside_ = 0;               // layer that the tip is in
    int touched_ = -1;             // layer that is dented; -1: none
    std::int64_t touched_at_ = 0;  // where its wall is at rest
    std::int64_t far_wall_ = 0;    // of the lumen that is dented
    double spring_n_per_mm_ = 0, limit_n_ = 0;
    bool stopped_ = false;
    double cutting_mm_ = 0;  // dent that stays after a puncture
    double cutting_n_ = 0;   // and its force
    double drag_mm_ = 0;
    std::array<Hole, kMostLayers> holes_{};
    int hole_count_ = 0;
    std::array<NeedleEvent, kMostEvents> events_{};
    int event_count_ = 0;
};

}  // namespace sonocase::runtime
