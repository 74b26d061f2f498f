// SPDX-License-Identifier: Apache-2.0

// Spectral Doppler over time: lines of spectrum, their envelope, what is measured from it, and the
// sound.
//
// Line number k belongs to the time k / kLinesPerSecond of the session and is drawn from the gate's
// position when it is made: power times |n|^2, with n complex normals that are hashed from k and
// smoothed over bins. The same draws, transformed back and overlapped, are the sound.
//
// Envelope: of the mean over 5 lines and 3 bins, the outermost bin that lies, together with the two
// bins behind it, above 4 x noise, interpolated; then the median of 3 lines. A spectrum's edge lies
// beyond the fastest blood by the intrinsic broadening, as on every machine, and by the bins over
// which the window and the envelope smooth:
//
//     edge = V cos(theta) + 0.93 max(V sin(theta) sin(delta), 1.2 bins) + 1.1 bins
//
// which the corrected velocities take out. 0.93 and 1.1 are fitted to steady and pulsatile tubes
// whose peak takes up 5 to 63 % of the scale: below a tenth of it a bin is a tenth of the velocity.
// docs/flow.md has the errors.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/imaging/doppler/spectral_gate.h"

namespace sonocase::runtime::doppler {

inline constexpr int kLinesPerSecond = 200;
inline constexpr int kStripLines = 1024;  // lines that are kept: 5 s
// Noise of all bins together, relative to a gate full of blood.
inline constexpr double kSpectralNoiseDb = -20;

// Constants of the envelope's formula.
inline constexpr double kEdgeBroadening = 0.93, kEdgeBins = 1.1;

struct SpectralMeasures {
    int beats = 0;            // number of beats that were measured
    double psv_cm_s = 0;      // corrected for broadening, by the angle cursor
    double psv_raw_cm_s = 0;  // as machines show it
    double edv_cm_s = 0;
    double mean_cm_s = 0;  // over section and time
    double resistive_index = 0;
    double flow_ml_min = 0;  // by the diameter measured, or the chord's; a circle is assumed
    double flow_true_area_ml_min = 0;  // by the true section
    double diameter_mm = 0;            // the diameter that flow_ml_min was worked out with
    double true_psv_cm_s = 0;          // true, among the gate's points
    double vessel_psv_cm_s = 0;        // true, in the vessel's whole section there
};

struct StripLine {
    std::int64_t number = -1;
    double phase = 0;
    float edge_turns = 0;                     // the envelope; 0: none
    float mean_mm_s = 0;                      // mean over the section
    float true_mm_s = 0;                      // fastest blood in the gate
    float vessel_mm_s = 0;                    // fastest blood in the vessel's section there
    std::array<std::uint8_t, kBins> shade{};  // bin 0 at -v_N; grey of a range of 30 dB
};

class SpectralStrip {
  public:
    SpectralStrip(const FlowScene& scene,
                  const ScanGeometry& geometry,
                  double frequency_mhz,
                  std::uint32_t seed);

    // Makes the lines up to time_s. After a jump of more than kStripLines the strip begins again. A
    // change of settings or of the vessel in the gate restarts the measuring, not the strip. Cost:
    // 10 us per line; nothing is allocated.
    void advance(const DopplerSettings& settings,
                 double time_s,
                 double beats_per_min,
                 double breath_s,
                 const TissuePlace& place);

    // What lay in the gate at the last advance().
    const GateContent& gate() const { return content_; }
    SpectralMeasures measures() const;
    // The newest line is number last(); line(k) holds line k where last() - k < kStripLines.
    std::int64_t last() const { return last_; }
    const StripLine& line(std::int64_t k) const { return lines_[k % kStripLines]; }
    // Turns of the middle of the strip: the baseline shift.
    double baseline() const { return baseline_; }

    // Samples of the sound made by the last advance(), in pairs: flow towards the probe, flow away.
    std::span<const float> sound() const { return {sound_.data(), sound_count_}; }
    double sound_hz() const { return sound_hz_; }

  private:
    void make_line(const DopplerSettings& settings,
                   std::int64_t number,
                   double phase,
                   double inspired);
    void find_envelope(std::int64_t number);
    void add_sound();

    SpectralGate gate_;
    ScanGeometry geometry_;
    double frequency_mhz_;
    std::uint32_t seed_;
    GateContent content_;
    DopplerSettings settings_;
    double nyquist_mm_s_ = 1000, baseline_ = 0, sound_hz_ = 8000;
    std::vector<StripLine> lines_;
    std::array<Spectrum, 8> raw_{};  // powers of the last lines, by number
    std::array<float, 4> edges_{};
    std::int64_t last_ = -1, measured_from_ = 0;
    std::array<float, 2 * kBins> draw_{};  // complex amplitudes of the newest line
    std::vector<float> overlap_, sound_;
    std::size_t sound_count_ = 0;
    double sound_left_ = 0;
};

}  // namespace sonocase::runtime::doppler
