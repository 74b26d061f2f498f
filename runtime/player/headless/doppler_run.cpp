// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/headless/doppler_run.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "formats/files/atomic_file.h"
#include "runtime/imaging/doppler/view/doppler_picture.h"
#include "runtime/player/session/clock.h"

namespace sonocase::runtime {
namespace {

double rounded(double value) {
    return std::round(value * 1e4) / 1e4;
}

template <class T>
void put(std::vector<std::uint8_t>& bytes, T value) {
    const std::size_t at = bytes.size();
    bytes.resize(at + sizeof value);
    std::memcpy(bytes.data() + at, &value, sizeof value);
}

void put(std::vector<std::uint8_t>& bytes, const char* text) {
    bytes.insert(bytes.end(), text, text + 4);
}

// RIFF, 16 bits, two channels.
std::vector<std::uint8_t> wav_of(std::span<const float> pairs, double hz) {
    float loudest = 1e-9f;
    for (const float v : pairs) loudest = std::max(loudest, std::abs(v));
    const auto data = static_cast<std::uint32_t>(2 * pairs.size());
    const auto rate = static_cast<std::uint32_t>(std::lround(hz));
    std::vector<std::uint8_t> bytes;
    put(bytes, "RIFF");
    put(bytes, std::uint32_t{36} + data);
    put(bytes, "WAVE");
    put(bytes, "fmt ");
    put(bytes, std::uint32_t{16});
    put(bytes, std::uint16_t{1});
    put(bytes, std::uint16_t{2});
    put(bytes, rate);
    put(bytes, 4 * rate);
    put(bytes, std::uint16_t{4});
    put(bytes, std::uint16_t{16});
    put(bytes, "data");
    put(bytes, data);
    for (const float v : pairs)
        put(bytes, static_cast<std::int16_t>(std::lround(32000 * v / loudest)));
    return bytes;
}

}  // namespace

Result<DopplerRun> DopplerRun::create(CaseView bundle, const ScanEngine& engine) {
    auto view = DopplerView::create(bundle, engine.exercise(), engine.render_options());
    if (!view) return view.error();
    return DopplerRun(std::move(*view));
}

void DopplerRun::aim(const Rigid& mannequin_from_probe, Aim what, DopplerSettings& settings) const {
    FrameInput input;
    input.mannequin_from_probe = mannequin_from_probe;
    const DopplerSettings aimed = view_.aimed(input, settings, what.steering);
    settings.steer_deg = aimed.steer_deg;
    if (what.box) {
        settings.box_left = aimed.box_left;
        settings.box_right = aimed.box_right;
        settings.box_top_mm = aimed.box_top_mm;
        settings.box_bottom_mm = aimed.box_bottom_mm;
    }
    if (what.gate) {
        settings.gate_line = aimed.gate_line;
        settings.gate_depth_mm = aimed.gate_depth_mm;
        settings.gate_mm = aimed.gate_mm;
    }
    if (what.gate && what.cursor) settings.angle_deg = aimed.angle_deg;
}

void DopplerRun::frame(const ScanEngine& engine, std::span<const std::uint8_t> pixels) {
    const FrameInput& input = engine.last().input;
    mode_ = input.settings.doppler.mode;
    if (mode_ == DopplerMode::off) return;
    const double before_s = steady_seconds();
    view_.frame(input, engine.renderer(), pixels);
    ms_ += (steady_seconds() - before_s) * 1e3;
    ++frames_;
    if (mode_ == DopplerMode::spectral) {
        const auto sound = view_.spectrum().sound();
        sound_.insert(sound_.end(), sound.begin(), sound.end());
        sound_hz_ = view_.spectrum().sound_hz();
    } else {
        shown_cells_ += view_.colour().shown_cells;
    }
}

std::span<const std::uint8_t> DopplerRun::picture(std::span<const std::uint8_t> pixels,
                                                  int width,
                                                  int height) {
    rgb_.resize(3 * static_cast<std::size_t>(width) *
                static_cast<std::size_t>(doppler_rows(mode_, height)));
    draw_doppler(view_, mode_, pixels, width, height, rgb_);
    return rgb_;
}

std::string DopplerRun::json() const {
    nlohmann::ordered_json out;
    auto& d = out["doppler"];
    d["ms"] = rounded(frames_ > 0 ? ms_ / frames_ : 0);
    if (mode_ == DopplerMode::spectral) {
        const doppler::SpectralMeasures m = view_.spectrum().measures();
        const doppler::GateLook& look = view_.spectrum().look();
        d["beats"] = m.beats;
        d["psv_cm_s"] = rounded(m.psv_cm_s);
        d["psv_raw_cm_s"] = rounded(m.psv_raw_cm_s);
        d["true_psv_cm_s"] = rounded(m.true_psv_cm_s);
        d["edv_cm_s"] = rounded(m.edv_cm_s);
        d["mean_cm_s"] = rounded(m.mean_cm_s);
        d["resistive_index"] = rounded(m.resistive_index);
        d["flow_ml_min"] = rounded(m.flow_ml_min);
        d["flow_true_area_ml_min"] = rounded(m.flow_true_area_ml_min);
        d["diameter_mm"] = rounded(m.diameter_mm);
        d["true_angle_deg"] = rounded(look.angle_deg);
        d["gate_spans_vessel"] = look.spans;
        d["gate_in_two_vessels"] = look.two_vessels;
    } else if (mode_ == DopplerMode::colour || mode_ == DopplerMode::power) {
        const doppler::ColourReport& report = view_.colour();
        d["cells"] = report.cells;
        d["blood_cells"] = report.blood_cells;
        d["shown_cells_mean"] = rounded(frames_ > 0 ? shown_cells_ / frames_ : 0);
        d["flash"] = report.flash;
        d["machine_frames_per_s"] = rounded(report.frame_hz);
    }
    return out.dump();
}

Status DopplerRun::write_sound(const std::string& path) const {
    if (sound_.empty())
        return Error{"no spectrum was made, so that there is no sound", path,
                     "use --sound with --mode pw"};
    return write_file(path, wav_of(sound_, sound_hz_));
}

}  // namespace sonocase::runtime
