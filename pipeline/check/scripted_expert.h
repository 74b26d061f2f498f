// SPDX-License-Identifier: Apache-2.0

// A scripted expert plays an exercise through windows that `aim` found and is scored as a trainee
// is. This tells whether the exercise can be passed at all.
#pragma once

#include <string>
#include <vector>

#include "formats/exercise/exercise.h"
#include "formats/recording/session.h"
#include "formats/scoring/session_score.h"
#include "pipeline/check/aim.h"

namespace sonocase::pipeline::inline check {

struct ExpertAttempt {
    Session session;  // 20 samples per second
    SessionScore score;
    // Marks that were missed, "final_tip_to_target_mm = 7.2 (at most 5)"; empty: passed. Marks of
    // pressing, which a script without tissue mechanics cannot earn, are left out.
    std::vector<std::string> missed;
};

// windows: one per target of the exercise, in order; those without a needle are only looked at.
// The probe rests on the window, the needle waits for the end of a breath, goes in at 10 mm/s along
// the planned path, and stays until the end of another breath. Between targets it comes out again.
// The exercise is played as written, without randomised targets. Cost: about 50 ms.
ExpertAttempt play_as_expert(const CaseBundle& bundle,
                             const Exercise& exercise,
                             const std::vector<AimWindow>& windows);

}  // namespace sonocase::pipeline::inline check
