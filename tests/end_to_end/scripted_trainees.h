// SPDX-License-Identifier: Apache-2.0

// Trainees without a window: hands that move the mouse tracker, an attempt that is recorded and
// scored as the player does it, but draws no picture. Those that bluff do not look at all; the
// expert looks only at what the picture shows: where the target is in the scan plane once sound
// reaches it there, and which organs lie on the way.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "formats/bundle/case_bundle.h"
#include "formats/recording/session.h"
#include "formats/scoring/draw_attempt.h"
#include "formats/scoring/session_score.h"
#include "runtime/engine/needle_state.h"
#include "runtime/engine/skin.h"
#include "runtime/tracking/mouse_tracker.h"
#include "support/random.h"

namespace sonocase::testing {

// One attempt: a drawn exercise, the mouse's tools and the recording of their poses.
class Attempt {
  public:
    // at_rest, breathing: anatomies of the bundle. All must outlive the attempt.
    Attempt(const CaseBundle& cooked,
            const Anatomy& at_rest,
            const Anatomy& breathing,
            const Exercise& written,
            std::uint64_t seed)
        : bundle(cooked),
          anatomy(breathing),
          exercise(draw_attempt(written, at_rest, cooked.labels, seed).exercise),
          skin(cooked),
          mouse(skin, exercise),
          needle(&breathing, written.needle) {}

    static constexpr double kTickS = 0.05;
    // A sample of the tools as they are now.
    void tick() {
        SessionSample sample;
        sample.time_s = time_s;
        sample.probe_ok = true;
        sample.mannequin_from_probe = mouse.mannequin_from_probe();
        sample.needle_ok = mouse.has_needle();
        if (sample.needle_ok) {
            sample.mannequin_from_needle = mouse.mannequin_from_needle();
            sample.mannequin_from_drawn =
                needle.update(time_s, sample.mannequin_from_needle).mannequin_from_drawn;
        }
        session.samples.push_back(sample);
        time_s += kTickS;
    }
    // By speed_mm_s until the tip is so deep.
    void push_to(double depth_mm, double speed_mm_s) {
        while (mouse.has_needle() && mouse.needle_depth_mm() < depth_mm) {
            const double left = depth_mm - mouse.needle_depth_mm();
            mouse.advance_needle(std::min(left, speed_mm_s * kTickS));
            tick();
            if (!(mouse.needle_depth_mm() < exercise.needle.length_mm)) return;
        }
    }
    SessionScore score() const { return score_session(session, exercise, &anatomy, bundle.labels); }

    const CaseBundle& bundle;
    const Anatomy& anatomy;
    Exercise exercise;
    runtime::Skin skin;
    runtime::MouseTracker mouse;
    runtime::NeedleState needle;
    Session session;
    double time_s = 0;
};

// Keys held for fixed times: the same `recipe` makes the same movements in every attempt.
void bluff_with_fixed_keys(Attempt& attempt, int recipe);
// The probe wanders, the needle goes in somewhere.
void bluff_with_a_random_walk(Attempt& attempt, Random& random);
// From where the attempt begins straight in, to a random depth.
void bluff_with_a_straight_push(Attempt& attempt, Random& random);

// The exercise's own script of that name, in as many readings from its first key to its last as
// the player's --frames would take.
void play_script(Attempt& attempt, const std::string& sweep, int readings);

// What the expert has found, and not yet done: the probe over the target, the needle beside it and
// aimed at it.
struct ExpertPlan {
    runtime::MouseTracker hands;
    double depth_mm = 0, visible = 0;  // of the needle at the target; share of it that will show
};
// Nothing where no picture shows a free way to the target.
std::optional<ExpertPlan> plan_as_an_expert(Attempt& attempt);
// The probe alone over the target: some ways to hold it there.
std::vector<runtime::MouseTracker> look_as_an_expert(Attempt& attempt);

// The player plays the script "expert" of a procedure of this bundle: every item is ticked.
void expect_expert_ticks_all(const std::string& bundle, const std::string& exercise);

// False if the expert found no picture with a free way to the target, and did not try.
bool play_as_an_expert(Attempt& attempt);

}  // namespace sonocase::testing
