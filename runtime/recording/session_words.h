// SPDX-License-Identifier: Apache-2.0

// What a recording says about itself, so that it can be replayed: case, exercise, image. And the
// texts and events that it keeps of its frames.
#pragma once

#include <string>
#include <vector>

#include "formats/base/message.h"
#include "formats/bundle/case_bundle.h"
#include "formats/exercise/exercise.h"
#include "formats/recording/session.h"
#include "formats/scoring/session_monitor.h"
#include "formats/volume/label_volume.h"
#include "runtime/imaging/core/frame_input.h"
#include "runtime/imaging/core/render_options.h"
#include "runtime/imaging/renderer.h"

namespace sonocase::runtime::inline recording {

// trainee: may be empty. started: ISO 8601, UTC.
SessionHeader session_header(const CaseBundle& bundle,
                             const Exercise& exercise,
                             const RenderOptions& render,
                             const std::string& trainee,
                             const std::string& started);

// The console's settings as the text that a recording keeps:
// "gain_db=0 dynamic_range_db=60 tgc_db=0,0,0,0,0,0,0,0 flip=0". Numbers read back as the same
// doubles.
std::string settings_text(const ImageSettings& settings);
// Keys that are missing or malformed leave their setting unchanged.
void apply_settings_text(const std::string& text, ImageSettings& settings);

// What a recording keeps of a frame in a Doppler mode: the report with its labels by name.
// labels: the bundle's; a report's index outside of them names nothing.
DopplerSample doppler_sample(const DopplerReport& report, const std::vector<Label>& labels);

// An event of an attempt in words for the trainee, "Reached: lesion"; empty for events that are not
// shown.
Message event_words(const LiveEvent& event,
                    const Exercise& exercise,
                    const std::vector<Label>& labels);

}  // namespace sonocase::runtime::inline recording
