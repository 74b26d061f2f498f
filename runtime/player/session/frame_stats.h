// SPDX-License-Identifier: Apache-2.0

// Times of frames, effects and pictures, and the text that --stats writes of them.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "runtime/imaging/renderer.h"
#include "runtime/player/session/effect_trials.h"

namespace sonocase::runtime::inline player_session {

// path  "-" is standard output; any other file is written under a temporary name and renamed
Status write_text_output(const std::string& path, const std::string& text);

// A histogram with bins of 1 % from 1 us to 100 s: any number of samples, no allocation, quantiles
// to half a bin.
class TimeHistogram {
  public:
    void add(double ms);
    std::uint64_t count() const { return count_; }
    double quantile(double q) const;  // ms; 0 when empty
    double largest() const { return largest_; }

  private:
    static constexpr int kBins = 1852;  // ln(1e8) / ln(1.01)
    std::array<std::uint32_t, kBins> bins_{};
    std::uint64_t count_ = 0;
    double largest_ = 0;
};

// Times of the pictures of a window.
class WindowStats {
  public:
    // between_s  since the picture before
    // work_ms    panels and drawing commands
    // show_ms    until the display has taken it; without a graphics card this includes the painting
    void add(double between_s, double work_ms, double show_ms);
    // {"window": {"frames", "frames_per_s", "between_ms", "work_ms", "show_ms"}}
    std::string json() const;

  private:
    TimeHistogram between_ms_, work_ms_, show_ms_;
    double seconds_ = 0;
};

class FrameStats {
  public:
    // Effects in order of execution.
    void set_effects(std::span<const EffectCost> costs);
    void add(double frame_ms, std::span<const EffectCost> costs);
    // The accuracy of the frame just added, which the governor may have reduced.
    void set_accuracy(const Renderer::Accuracy& accuracy);
    // Frames whose probe touched skin that was not fitted to the mannequin.
    void count_unfitted(bool not_fitted) { unfitted_frames_ += not_fitted ? 1 : 0; }
    // How the frame just added was deformed by the probe.
    void set_press(const PressReport& press);
    void set_first_frame_ms(double ms) { first_frame_ms_ = ms; }
    // What effects cost in frames of this run, measured by leaving them out.
    void set_measured(EffectTrials trials) { trials_ = std::move(trials); }
    // Time of the truth planes and facts of a frame, without writing them.
    void add_truth(double ms) { truth_ms_.add(ms); }

    const TimeHistogram& frame_ms() const { return frame_ms_; }
    // The JSON of --stats. "cost" of an effect says where its "ms" come from: "measured" by
    // set_measured(), or "estimated" as its share of its pass.
    // score_json   of a recorded session (formats/scoring/session_score.h); empty: none
    // window_json  of WindowStats; empty: none
    // The entries of the window follow those of the frames, those of the score come last.
    std::string json(const std::string& score_json,
                     const TimeHistogram* pose_to_pixel_ms,
                     const std::string& window_json = {}) const;

  private:
    struct Effect {
        std::string name;
        double total_ms = 0;
        std::uint64_t ran = 0, skipped = 0;
        const char* ran_because = "";  // as in the last frame that it ran in
        const char* skipped_because = "";
    };
    static std::string why(const Effect& effect);
    TimeHistogram frame_ms_, truth_ms_;
    double first_frame_ms_ = 0;
    double force_sum_n_ = 0, force_max_n_ = 0;
    Renderer::Accuracy accuracy_;
    std::uint64_t reduced_frames_ = 0, unfitted_frames_ = 0;
    std::vector<Effect> effects_;
    EffectTrials trials_;  // empty: not measured
};

}  // namespace sonocase::runtime::inline player_session
