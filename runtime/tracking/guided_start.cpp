// SPDX-License-Identifier: Apache-2.0

#include "runtime/tracking/guided_start.h"

#include <cmath>

namespace sonocase::runtime::inline tracking {
namespace {

constexpr double kSlideMm = 25;
constexpr double kTiltCos = 0.985;  // of 10 degrees
constexpr double kAdvanceMm = 20;

}  // namespace

void GuidedStart::begin(GuideStep step) {
    step_ = step;
    begun_ = false;
    was_frozen_ = false;
}

void GuidedStart::skip() {
    if (step_ != GuideStep::done) begin(static_cast<GuideStep>(static_cast<int>(step_) + 1));
}

bool GuidedStart::observe(const GuideSight& sight) {
    const Vector3 step = sight.mannequin_from_probe.translation - last_.translation;
    // A jump is no movement of the hand: another exercise began somewhere else.
    if (sight.has_probe && (!begun_ || norm(step) >= kSlideMm)) {
        start_ = sight.mannequin_from_probe;
        begun_ = true;
    }
    if (sight.has_probe) last_ = sight.mannequin_from_probe;
    bool done = false;
    switch (step_) {
        case GuideStep::slide: {
            const Vector3 way = sight.mannequin_from_probe.translation - start_.translation;
            done = begun_ && sight.has_probe && norm(way) >= kSlideMm;
            break;
        }
        case GuideStep::tilt: {
            const Vector3 before = start_.rotation * Vector3{0, 0, 1};
            const Vector3 now = sight.mannequin_from_probe.rotation * Vector3{0, 0, 1};
            done = begun_ && sight.has_probe && dot(before, now) <= kTiltCos;
            break;
        }
        case GuideStep::freeze:
            done = was_frozen_ && !sight.frozen;  // held, and let go again
            was_frozen_ = was_frozen_ || sight.frozen;
            break;
        case GuideStep::needle: done = sight.has_needle; break;
        case GuideStep::advance: done = sight.needle_depth_mm >= kAdvanceMm; break;
        case GuideStep::done: return false;
    }
    if (done) skip();
    return done;
}

const char* guide_title(GuideStep step) {
    switch (step) {
        case GuideStep::slide: return "Slide the probe";
        case GuideStep::tilt: return "Tilt the probe";
        case GuideStep::freeze: return "Hold the picture";
        case GuideStep::needle: return "Take the needle";
        case GuideStep::advance: return "Advance the needle";
        case GuideStep::done: return "Ready for the exercise";
    }
    return "";
}

const char* guide_words(GuideStep step) {
    switch (step) {
        case GuideStep::slide:
            return "Drag the picture, or use the arrow keys, until the anatomy has moved by a few "
                   "centimetres.";
        case GuideStep::tilt:
            return "Drag with the right button, or hold Shift with the arrow keys: the probe fans "
                   "and rocks about its place.";
        case GuideStep::freeze:
            return "Press Space or Freeze to hold the picture, look back with the bar below it, "
                   "then press again.";
        case GuideStep::needle:
            return "Press N: the needle lies beside the probe, in the plane of the picture. A and "
                   "D aim it.";
        case GuideStep::advance:
            return "Hold W to push and S to pull. Watch the bright line: its end is the tip.";
        case GuideStep::done:
            return "Start the attempt with B. Find the target, bring the needle into the picture, "
                   "and stop in its middle.";
    }
    return "";
}

}  // namespace sonocase::runtime::inline tracking
