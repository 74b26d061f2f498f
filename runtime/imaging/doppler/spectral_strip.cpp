// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/doppler/spectral_strip.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "formats/base/constants.h"
#include "formats/flow/flow_field.h"

namespace sonocase::runtime::doppler {
namespace {

constexpr double kRangeDb = 30;
constexpr int kEnvelopeLines = 5;
constexpr float kAboveNoise = 4;
constexpr int kMaxHop = 1024;

float noise_per_bin() {
    static const float noise = static_cast<float>(std::pow(10.0, kSpectralNoiseDb / 10) / kBins);
    return noise;
}

// 10 log10, within 0.03 dB.
float decibels(float power) {
    if (!(power > 0)) return -200;
    const auto bits = std::bit_cast<std::uint32_t>(power);
    const auto exponent = static_cast<float>(static_cast<int>(bits >> 23) - 127);
    const float m = std::bit_cast<float>((bits & 0x7FFFFFu) | 0x3F800000u);
    const float log2 =
        exponent + (-2.153620718f + m * (3.047884161f + m * (-1.051875031f + m * 0.158248697f)));
    return 3.01029996f * log2;
}

// The velocity whose spectrum ends at an edge, in turns; spectral_strip.h has the formula. Slow
// blood's spectrum is as wide as the window makes it, however slow.
double velocity_turns(double edge, double cosine, double sine) {
    const double past = edge - kEdgeBins / kBins,
                 broad = past / (cosine + kEdgeBroadening * sine * kSinDelta),
                 narrow = (past - kEdgeBroadening * kMinHalfBins / kBins) / cosine;
    return std::max(std::min(broad, narrow), 0.0);
}

// Roots of unity of the transform, and the window of the sound.
struct Tables {
    std::array<float, kBins> cosine, sine, window;
    Tables() {
        for (std::size_t i = 0; i < kBins; ++i) {
            const UnitCircle at = unit_circle(static_cast<double>(i) / kBins);
            cosine[i] = static_cast<float>(at.cosine);
            sine[i] = static_cast<float>(at.sine);
            window[i] = static_cast<float>(0.5 - 0.5 * at.cosine);
        }
    }
};
const Tables& tables() {
    static const Tables made;
    return made;
}

// In place, 256 complex values; sign +1: back transform without a factor.
void transform(std::array<float, 2 * kBins>& x) {
    for (std::size_t i = 0, j = 0; i < kBins; ++i) {
        if (i < j) {
            std::swap(x[2 * i], x[2 * j]);
            std::swap(x[2 * i + 1], x[2 * j + 1]);
        }
        std::size_t bit = kBins / 2;
        while (j & bit) {
            j ^= bit;
            bit >>= 1;
        }
        j |= bit;
    }
    const Tables& roots = tables();
    for (std::size_t size = 2; size <= kBins; size *= 2)
        for (std::size_t first = 0; first < kBins; first += size)
            for (std::size_t k = 0; k < size / 2; ++k) {
                const float c = roots.cosine[k * (kBins / size)],
                            s = roots.sine[k * (kBins / size)];
                const std::size_t i = first + k, j = i + size / 2;
                const float re = x[2 * j] * c - x[2 * j + 1] * s,
                            im = x[2 * j] * s + x[2 * j + 1] * c;
                x[2 * j] = x[2 * i] - re;
                x[2 * j + 1] = x[2 * i + 1] - im;
                x[2 * i] += re;
                x[2 * i + 1] += im;
            }
}

}  // namespace

SpectralStrip::SpectralStrip(const FlowScene& scene,
                             const ScanGeometry& geometry,
                             double frequency_mhz,
                             std::uint32_t seed)
    : gate_(scene), geometry_(geometry), frequency_mhz_(frequency_mhz), seed_(seed) {
    tables();  // before the first frame
    lines_.resize(kStripLines);
    overlap_.assign(2 * (kBins + kMaxHop), 0.0f);
    sound_.assign(2 * kStripLines * 64, 0.0f);
}

void SpectralStrip::advance(const DopplerSettings& settings,
                            double time_s,
                            double beats_per_min,
                            double breath_s,
                            const TissuePlace& place) {
    sound_count_ = 0;
    if (!std::isfinite(time_s)) return;
    const auto now = static_cast<std::int64_t>(std::floor(time_s * kLinesPerSecond + 1e-6));
    if (now < last_ || now - last_ > kStripLines || last_ < 0) {
        last_ = now - 1;
        measured_from_ = now;
        for (StripLine& line : lines_) line.number = -1;
    }
    if (settings != settings_) measured_from_ = last_ + 1;
    settings_ = settings;
    nyquist_mm_s_ = 10 * setting_within(settings.spectral_scale_cm_s, 1, 1000, 100);
    baseline_ = setting_within(settings.baseline, -0.9, 0.9, 0) / 2;
    sound_hz_ = 4 * frequency_mhz_ * 1e6 * nyquist_mm_s_ / kSpeedOfSoundMmPerS;
    const int before = content_.vessel;
    content_ = gate_.aim(geometry_, settings, place);
    if (content_.vessel != before) measured_from_ = last_ + 1;
    while (last_ < now) {
        const std::int64_t number = ++last_;
        const double t = static_cast<double>(number) / kLinesPerSecond;
        const double beats = t * beats_per_min / 60;
        make_line(settings, number, beats - std::floor(beats), inspired_at(t, breath_s));
        find_envelope(number);
        add_sound();
    }
}

void SpectralStrip::make_line(const DopplerSettings& settings,
                              std::int64_t number,
                              double phase,
                              double inspired) {
    Spectrum& raw = raw_[number & 7];
    Spectrum expected;
    gate_.spectrum(settings, phase, inspired, expected);
    const float noise = noise_per_bin();
    // Normals, smoothed over neighbouring bins by the window of the transform.
    std::array<float, 2 * kBins> n;
    const std::uint32_t key = mixed(static_cast<std::uint32_t>(number), seed_);
    for (std::uint32_t i = 0; i < 2 * kBins; ++i)
        n[i] = normal(key + i * 0x9E3779B9u) * 0.70710678f;
    constexpr float kSide = 0.40824829f, kMiddle = 0.81649658f;  // [.5 1 .5] / sqrt(1.5)
    const double gain = std::pow(10.0, setting_within(settings.gain_db, -30, 30, 0) / 10);
    const float top = decibels(static_cast<float>(1.0 / 32 / gain));
    StripLine& line = lines_[number % kStripLines];
    line.number = number;
    line.phase = phase;
    line.edge_turns = 0;
    line.mean_mm_s = static_cast<float>(gate_.section_mean_mm_s(phase, inspired));
    line.true_mm_s = static_cast<float>(gate_.greatest_mm_s(phase, inspired));
    line.vessel_mm_s = static_cast<float>(gate_.section_greatest_mm_s(phase, inspired));
    const int shift = static_cast<int>(std::lround(baseline_ * kBins));
    for (std::size_t b = 0; b < kBins; ++b) {
        const std::size_t before = (b + kBins - 1) % kBins, after = (b + 1) % kBins;
        const float re = kMiddle * n[2 * b] + kSide * (n[2 * before] + n[2 * after]),
                    im = kMiddle * n[2 * b + 1] + kSide * (n[2 * before + 1] + n[2 * after + 1]);
        const float power = expected[b] + noise;
        raw[b] = power * (re * re + im * im);
        const float root = std::sqrt(power);
        // Bin 128 is frequency 0 of the transform.
        const std::size_t at = (b + kBins / 2) % kBins;
        draw_[2 * at] = root * re;
        draw_[2 * at + 1] = root * im;
        const int shown = (static_cast<int>(b) - shift + 4 * kBins) % kBins;
        const float part = 1 + (decibels(raw[b]) - top) / static_cast<float>(kRangeDb);
        line.shade[settings.invert ? kBins - 1 - shown : shown] =
            static_cast<std::uint8_t>(std::clamp(255 * part, 0.0f, 255.0f));
    }
}

// Finds the envelope of the line two before this one, whose neighbours are then known.
void SpectralStrip::find_envelope(std::int64_t number) {
    if (number - measured_from_ < kEnvelopeLines - 1) return;
    Spectrum mean{};
    for (int k = 0; k < kEnvelopeLines; ++k) {
        const Spectrum& raw = raw_[(number - k) & 7];
        for (std::size_t b = 0; b < kBins; ++b) mean[b] += raw[b] / kEnvelopeLines;
    }
    // In the order of velocities from the lower to the upper end of the shifted scale.
    std::array<float, kBins> p{};
    const int shift = static_cast<int>(std::lround(baseline_ * kBins));
    float above = 0, below = 0;
    for (int b = 0; b < kBins; ++b) {
        const auto at = [&](int i) { return mean[(i + shift + 4 * kBins) % kBins]; };
        p[b] = (at(b - 1) + at(b) + at(b + 1)) / 3;
        (b + shift > kBins / 2 ? above : below) += at(b);
    }
    const float min_power = kAboveNoise * noise_per_bin();
    const bool upwards = above >= below;
    float edge = 0;
    for (int i = 1; i + 3 < kBins; ++i) {
        const int b = upwards ? kBins - 1 - i : i, step = upwards ? -1 : 1;
        const auto q = [&](int k) { return p[b + k * step]; };
        if (!(q(0) > min_power && q(1) > min_power && q(2) > min_power)) continue;
        const float outside = q(-1);
        const float part = outside < min_power ? (min_power - outside) / (q(0) - outside) : 0;
        const float bin = static_cast<float>(b) - static_cast<float>(step) * (1 - part);
        edge = (bin + static_cast<float>(shift) - 0.5f * kBins) / kBins;
        break;
    }
    edges_[number & 3] = edge;
    if (number - measured_from_ < kEnvelopeLines + 1) return;
    std::array<float, 3> three{edges_[number & 3], edges_[(number - 1) & 3],
                               edges_[(number - 2) & 3]};
    std::sort(three.begin(), three.end());
    lines_[(number - 3) % kStripLines].edge_turns = three[1];
}

void SpectralStrip::add_sound() {
    // Frequencies above and below zero are kept apart: blood that comes and blood that goes, one
    // for each ear. Each ear's sound is the real part of a transform, that is the transform of a
    // Hermitian spectrum. The spectra of both, one of them times i, need one transform.
    std::array<float, 2 * kBins> both;
    const auto put = [&](std::size_t k, float re, float im) {
        both[2 * k] = re;
        both[2 * k + 1] = im;
    };
    put(0, draw_[0], 0);
    put(kBins / 2, 0, draw_[kBins]);
    for (std::size_t k = 1; k < kBins / 2; ++k) {
        const std::size_t n = kBins - k;
        const float re = 0.5f * draw_[2 * k], im = 0.5f * draw_[2 * k + 1],
                    away_re = 0.5f * draw_[2 * n], away_im = 0.5f * draw_[2 * n + 1];
        // towards + i away, at k and at -k, where each has its conjugate.
        put(k, re + away_im, im + away_re);
        put(n, re - away_im, away_re - im);
    }
    transform(both);
    for (std::size_t i = 0; i < kBins; ++i) {
        const float window = tables().window[i];
        overlap_[2 * i] += window * both[2 * i];
        overlap_[2 * i + 1] += window * both[2 * i + 1];
    }
    sound_left_ += sound_hz_ / kLinesPerSecond;
    const auto hop = static_cast<std::size_t>(
        std::clamp(std::floor(sound_left_), 1.0, static_cast<double>(kMaxHop)));
    sound_left_ -= std::floor(sound_left_);
    for (std::size_t i = 0; i < hop && sound_count_ + 2 <= sound_.size(); ++i) {
        sound_[sound_count_++] = i < kBins ? overlap_[2 * i] : 0;
        sound_[sound_count_++] = i < kBins ? overlap_[2 * i + 1] : 0;
    }
    const std::size_t moved = std::min<std::size_t>(hop, kBins);
    std::copy(overlap_.begin() + static_cast<std::ptrdiff_t>(2 * moved),
              overlap_.begin() + 2 * kBins, overlap_.begin());
    std::fill(overlap_.begin() + static_cast<std::ptrdiff_t>(2 * (kBins - moved)),
              overlap_.begin() + 2 * kBins, 0.0f);
}

SpectralMeasures SpectralStrip::measures() const {
    SpectralMeasures m;
    const double angle = setting_within(settings_.angle_deg, -80, 80, 60) * kPi / 180;
    const double cosine = std::cos(angle), sine = std::abs(std::sin(angle));
    const double raw = 2 * nyquist_mm_s_ / 10 / cosine;
    const auto corrected = [&](double turns) {
        return 2 * nyquist_mm_s_ / 10 * velocity_turns(turns, cosine, sine);
    };
    const std::int64_t newest = last_ - 3,
                       oldest = std::max(measured_from_ + 3, last_ - kStripLines + 4);
    double psv = 0, edv = 0, mean = 0, truth = 0, vessel = 0;
    int edv_count = 0, lines = 0, beats = 0;
    // Only whole beats count, so that the mean over time is that of a beat.
    std::int64_t begin = -1;
    std::array<double, 2> top{};
    double fastest = 0, of_vessel = 0, beat_mean = 0;
    int beat_lines = 0;
    for (std::int64_t k = oldest + 1; k <= newest; ++k) {
        const StripLine &line = this->line(k), &before = this->line(k - 1);
        if (line.number != k || before.number != k - 1) continue;
        if (line.phase < before.phase) {  // a beat begins
            if (begin >= 0) {
                psv += (top[0] + top[1]) / 2;
                truth += fastest;
                vessel += of_vessel;
                mean += beat_mean;
                lines += beat_lines;
                ++beats;
            }
            begin = k;
            top = {};
            fastest = of_vessel = beat_mean = 0;
            beat_lines = 0;
        }
        if (begin < 0) continue;
        const auto edge = std::abs(static_cast<double>(line.edge_turns));
        if (edge > top[0]) {
            top[1] = top[0];
            top[0] = edge;
        } else if (edge > top[1]) {
            top[1] = edge;
        }
        fastest = std::max(fastest, std::abs(static_cast<double>(line.true_mm_s)));
        of_vessel = std::max(of_vessel, static_cast<double>(line.vessel_mm_s));
        beat_mean += static_cast<double>(line.mean_mm_s);
        ++beat_lines;
        if (line.phase > 0.96) {
            edv += edge;
            ++edv_count;
        }
    }
    if (beats == 0) return m;
    m.beats = beats;
    m.psv_cm_s = corrected(psv / beats);
    m.psv_raw_cm_s = psv / beats * raw;
    m.true_psv_cm_s = truth / beats / 10;
    m.vessel_psv_cm_s = vessel / beats / 10;
    m.edv_cm_s = edv_count > 0 ? corrected(edv / edv_count) : 0;
    m.resistive_index = m.psv_cm_s > 0 ? (m.psv_cm_s - m.edv_cm_s) / m.psv_cm_s : 0;
    // The profile was measured along the beam: the angle cursor's error enters here as well.
    const double true_cosine = std::abs(std::cos(content_.angle_deg * kPi / 180));
    m.mean_cm_s = lines > 0 ? mean / lines / 10 * true_cosine / cosine : 0;
    m.diameter_mm = settings_.diameter_mm > 0 ? settings_.diameter_mm : content_.chord_mm * sine;
    m.flow_ml_min = 60 * m.mean_cm_s * kPi * m.diameter_mm * m.diameter_mm / 400;
    m.flow_true_area_ml_min = 60 * m.mean_cm_s * content_.area_mm2 / 100;
    return m;
}

}  // namespace sonocase::runtime::doppler
