// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/session/frame_stats.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <nlohmann/json.hpp>

#include "formats/files/atomic_file.h"

namespace sonocase::runtime::inline player_session {

Status write_text_output(const std::string& path, const std::string& text) {
    if (path == "-") {
        std::fwrite(text.data(), 1, text.size(), stdout);
        return Done{};
    }
    return write_file(path, text);
}

}  // namespace sonocase::runtime::inline player_session

#ifdef __linux__
#include <unistd.h>
#endif

namespace sonocase::runtime::inline player_session {
namespace {

constexpr double kMin = 1e-3, kRatio = 1.01;

// Four significant digits, because people read the JSON.
double rounded(double value) {
    if (value == 0 || !std::isfinite(value)) return 0;
    const double scale = std::pow(10.0, 3 - std::floor(std::log10(std::abs(value))));
    return std::round(value * scale) / scale;
}

// Memory of this process now; 0 where the system does not report it.
double resident_mb() {
#ifdef __linux__
    if (std::FILE* file = std::fopen("/proc/self/statm", "r")) {
        unsigned long pages = 0, resident = 0;
        const int got = std::fscanf(file, "%lu %lu", &pages, &resident);
        std::fclose(file);
        if (got == 2) return static_cast<double>(resident) * double(sysconf(_SC_PAGESIZE)) / 1e6;
    }
#endif
    return 0;
}

}  // namespace

void TimeHistogram::add(double ms) {
    if (!std::isfinite(ms)) return;
    const double bin = std::log(std::max(ms, kMin) / kMin) / std::log(kRatio);
    ++bins_[static_cast<std::size_t>(std::clamp(bin, 0.0, kBins - 1.0))];
    ++count_;
    largest_ = std::max(largest_, ms);
}

double TimeHistogram::quantile(double q) const {
    if (count_ == 0) return 0;
    const auto rank = static_cast<std::uint64_t>(std::ceil(q * static_cast<double>(count_)));
    std::uint64_t seen = 0;
    for (int i = 0; i < kBins; ++i) {
        seen += bins_[i];
        if (seen >= std::max<std::uint64_t>(rank, 1)) {
            return std::min(kMin * std::pow(kRatio, i + 0.5), largest_);
        }
    }
    return largest_;
}

void FrameStats::set_effects(std::span<const EffectCost> costs) {
    effects_.assign(costs.size(), {});
    for (std::size_t i = 0; i < costs.size(); ++i) effects_[i].name = costs[i].name;
}

void FrameStats::add(double frame_ms, std::span<const EffectCost> costs) {
    frame_ms_.add(frame_ms);
    if (effects_.size() != costs.size()) set_effects(costs);
    for (std::size_t i = 0; i < costs.size(); ++i) {
        effects_[i].total_ms += costs[i].ran ? costs[i].ms : 0;
        (costs[i].ran ? effects_[i].ran : effects_[i].skipped) += 1;
        (costs[i].ran ? effects_[i].ran_because : effects_[i].skipped_because) = costs[i].why;
    }
}

void FrameStats::set_press(const PressReport& press) {
    force_sum_n_ += press.force_n;
    force_max_n_ = std::max(force_max_n_, press.force_n);
}

void FrameStats::set_accuracy(const Renderer::Accuracy& accuracy) {
    accuracy_ = accuracy;
    if (accuracy.level > 0) ++reduced_frames_;
}

std::string FrameStats::why(const Effect& effect) {
    const std::uint64_t all = effect.ran + effect.skipped;
    std::string text;
    if (effect.ran > 0)
        text = "on in " + std::to_string(effect.ran) + " of " + std::to_string(all) +
               " frames: " + effect.ran_because;
    if (effect.skipped > 0)
        text += (text.empty() ? "skipped: " : "; in the others: ") +
                std::string(effect.skipped_because);
    return text;
}

std::string FrameStats::json(const std::string& score_json,
                             const TimeHistogram* pose_to_pixel_ms,
                             const std::string& window_json) const {
    nlohmann::ordered_json out;
    out["frames"] = frame_ms_.count();
    out["frame_ms"]["median"] = rounded(frame_ms_.quantile(0.5));
    out["frame_ms"]["p99"] = rounded(frame_ms_.quantile(0.99));
    out["first_frame_ms"] = rounded(first_frame_ms_);
    out["resident_mb"] = rounded(resident_mb());
    if (accuracy_.levels > 1) {
        auto& a = out["accuracy"];
        a["level"] = accuracy_.level;
        a["beams"] = accuracy_.scanlines;
        a["samples"] = accuracy_.samples;
        a["dropped_beams"] = accuracy_.full_scanlines - accuracy_.scanlines;
        a["dropped_samples"] = accuracy_.full_samples - accuracy_.samples;
        a["reduced_frames"] = reduced_frames_;
    }
    if (unfitted_frames_ > 0) out["frames_not_fitted"] = unfitted_frames_;
    out["force_n"]["mean"] = rounded(force_sum_n_ / std::max<double>(1, double(frame_ms_.count())));
    out["force_n"]["max"] = rounded(force_max_n_);
    out["effects"] = nlohmann::ordered_json::array();
    for (std::size_t i = 0; i < effects_.size(); ++i) {
        const Effect& effect = effects_[i];
        const bool measured = i < trials_.effects.size() && trials_.effects[i].tried;
        nlohmann::ordered_json entry;
        entry["name"] = effect.name;
        entry["ms"] =
            rounded(measured ? trials_.effects[i].ms
                             : effect.total_ms / std::max<double>(1, double(frame_ms_.count())));
        entry["cost"] = measured ? "measured" : "estimated";
        if (measured) {
            const EffectTrial& trial = trials_.effects[i];
            entry["noise_ms"] = rounded(trial.noise_ms);
            entry["changed_part"] = rounded(trial.changed_part);
            entry["rms_grey"] = rounded(trial.rms_grey);
        }
        entry["skipped_frames"] = effect.skipped;
        entry["why"] = why(effect);
        out["effects"].push_back(entry);
    }
    if (trials_.frames > 0) {
        out["effects_measured"]["frames"] = trials_.frames;
        out["effects_measured"]["frame_ms"] = rounded(trials_.frame_ms);
    }
    if (pose_to_pixel_ms && pose_to_pixel_ms->count() > 0) {
        out["pose_to_pixel_ms"]["median"] = rounded(pose_to_pixel_ms->quantile(0.5));
        out["pose_to_pixel_ms"]["p99"] = rounded(pose_to_pixel_ms->quantile(0.99));
    }
    if (truth_ms_.count() > 0) {
        out["truth_ms"]["median"] = rounded(truth_ms_.quantile(0.5));
        out["truth_ms"]["p99"] = rounded(truth_ms_.quantile(0.99));
    }
    for (const std::string& more : {window_json, score_json}) {
        const auto object = nlohmann::ordered_json::parse(more, nullptr, false);
        if (object.is_object()) out.update(object);
    }
    return out.dump(2) + "\n";
}

void WindowStats::add(double between_s, double work_ms, double show_ms) {
    seconds_ += between_s;
    between_ms_.add(between_s * 1e3);
    work_ms_.add(work_ms);
    show_ms_.add(show_ms);
}

std::string WindowStats::json() const {
    nlohmann::ordered_json out;
    auto& window = out["window"];
    window["frames"] = between_ms_.count();
    window["frames_per_s"] =
        rounded(seconds_ > 0 ? static_cast<double>(between_ms_.count()) / seconds_ : 0);
    const std::pair<const char*, const TimeHistogram*> times[] = {
        {"between_ms", &between_ms_}, {"work_ms", &work_ms_}, {"show_ms", &show_ms_}};
    for (const auto& [name, histogram] : times) {
        window[name]["median"] = rounded(histogram->quantile(0.5));
        window[name]["p99"] = rounded(histogram->quantile(0.99));
    }
    return out.dump();
}

}  // namespace sonocase::runtime::inline player_session
