// Times of frames and effects, for --stats, the bars on screen and the benchmarks.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "runtime/imaging/renderer.h"

namespace sonocase::runtime {

// A histogram with 1 % bins from 1 us to 100 s: any number of samples, no allocation, quantiles to
// half a bin.
class TimeHistogram {
  public:
    void add(double ms);
    void clear() { *this = {}; }
    std::uint64_t count() const { return count_; }
    double quantile(double q) const;  // ms; 0 when empty
    double largest() const { return largest_; }

  private:
    static constexpr int kBins = 1852;  // ln(1e8) / ln(1.01)
    std::array<std::uint32_t, kBins> bins_{};
    std::uint64_t count_ = 0;
    double largest_ = 0;
};

class FrameStats {
  public:
    // Effects in order of execution.
    void set_effects(std::span<const EffectCost> costs);
    void add(double frame_ms, std::span<const EffectCost> costs);
    void set_first_frame_ms(double ms) { first_frame_ms_ = ms; }

    const TimeHistogram& frame_ms() const { return frame_ms_; }
    // The JSON of --stats. score_json: of a recorded session (formats/session/session_score.h); its
    // entries, "metrics" first, are put in as they are.
    std::string json(const std::string& score_json, const TimeHistogram* pose_to_pixel_ms) const;

  private:
    struct Effect {
        std::string name;
        double total_ms = 0;
        std::uint64_t skipped = 0;
        const char* last_reason = "";
    };
    TimeHistogram frame_ms_;
    double first_frame_ms_ = 0;
    std::vector<Effect> effects_;
};

double resident_mb();  // of this process now; 0 where the system does not say

}  // namespace sonocase::runtime
