// SPDX-License-Identifier: Apache-2.0

// What each effect costs and changes in the frames of a run, by ablation: the same renderer draws
// the same frames with and without it, in turn. Effects that are fused into one loop have no time
// of their own that a clock could read; the difference of two frames is theirs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "formats/base/result.h"
#include "runtime/imaging/renderer.h"

namespace sonocase::runtime::inline player_session {

// Negative milliseconds: the frame takes longer without the effect, as where `attenuation` ends
// beams early.
struct EffectTrial {
    bool tried = false;       // it ran in one of the frames, and can be left out
    double ms = 0;            // processor time of a frame with it, less that of one without
    double noise_ms = 0;      // how far the two halves of the turns disagree
    double changed_part = 0;  // of the pixels that the probe scans, those with another grey
    double rms_grey = 0;      // root mean square of the change over all of them
};

using Picture = std::vector<std::uint8_t>;

// Pixels of a picture that the probe scans, at least 1.
double scanned_pixels(const Probe& probe, int width_px, int height_px);

// How much pictures without an effect differ from those with it, over the scanned pixels of each:
// the part with another grey, and the root mean square.
struct PictureChange {
    double part = 0, rms_grey = 0;
};
PictureChange change_of(std::span<const Picture> with,
                        std::span<const Picture> without,
                        double scanned_pixels);

struct EffectTrials {
    int frames = 0;                    // that were drawn again
    double frame_ms = 0;               // processor time of one of them with all effects
    std::vector<EffectTrial> effects;  // # effects of the model
};

// Draws at most kTriedFrames of the inputs, spread evenly, with a renderer of its own. Of each
// frame the fastest of `turns` counts, which is that of an undisturbed machine; two turns at least.
// Errors: those of Renderer::create.
inline constexpr std::size_t kTriedFrames = 12;
Result<EffectTrials> try_effects(CaseView bundle,
                                 const Exercise& exercise,
                                 const RenderOptions& options,
                                 std::span<const FrameInput> inputs,
                                 int turns);

}  // namespace sonocase::runtime::inline player_session
