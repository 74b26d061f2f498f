// SPDX-License-Identifier: Apache-2.0

// The gate of spectral Doppler: points of blood in it, found once per frame, and their spectrum at
// any moment.
//
// A point with velocity v at an angle theta to the beam gives a triangle about v cos(theta) of
// half-width |v| sin(theta) sin(delta), the spread of angles over the aperture (Newhouse et al.,
// IEEE TSU 27:50, 1980), tan(delta) = 1 / (2 F); at least 1.2 bins, which the window leaves. Bins
// wrap around, so that aliasing follows by itself.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "runtime/imaging/core/frame_input.h"
#include "runtime/imaging/doppler/colour_estimate.h"
#include "runtime/imaging/doppler/flow_scene.h"

namespace sonocase::runtime::doppler {

inline constexpr int kBins = 256;
inline constexpr double kMinHalfBins = 1.2;    // half-width that the transform's window leaves
inline constexpr double kFNumber = 3;          // f-number of the receiving aperture (assumed)
inline constexpr double kSinDelta = 0.164399;  // sin(delta) for tan(delta) = 1 / (2 F)
inline constexpr double kBeamLateralMm = 0.5,
                        kBeamElevationMm = 0.8;  // standard deviations (assumed)
inline constexpr int kProfilePoints = 128;  // along the beam, for the mean velocity of the section

using Spectrum = std::array<float, kBins>;  // power of each bin; bin 128 is velocity 0

// What lies in the gate.
struct GateContent {
    bool blood = false;    // some point is in a vessel
    int vessel = -1;       // the vessel that most points are in
    double angle_deg = 0;  // beam to flow there, [0, 180]: below 90 blood comes towards the probe
    double chord_mm = 0;   // length of the vessel along the beam, at most 30 mm to either side
    double area_mm2 = 0;   // true section there
    double fill = 0;       // share of the gate's points in that vessel
    bool spans = false;    // the gate reaches both walls
    bool two_vessels = false;
};

class SpectralGate {
  public:
    explicit SpectralGate(const FlowScene& scene);

    // Finds where the gate's points lie now. Cost: 10 us for 64 points.
    GateContent aim(const ScanGeometry& geometry,
                    const DopplerSettings& settings,
                    const TissuePlace& place);

    // Expected power at a moment, without noise, the sum over all points at most 1.
    void spectrum(const DopplerSettings& settings, double phase, double inspired, Spectrum& out);
    // Mean velocity of the section along the vessel, mm/s, as found by a scanner that measures the
    // profile along the beam and assumes that it is round: points are weighted by their distance
    // from the middle of the lumen. The cosine of the true angle is taken out.
    double section_mean_mm_s(double phase, double inspired);
    // Velocity of the fastest point of the gate, mm/s, along the vessel.
    double greatest_mm_s(double phase, double inspired);
    // Speed of the fastest blood in the whole section of the vessel that most points are in, mm/s.
    double section_greatest_mm_s(double phase, double inspired);

  private:
    struct Point {
        FlowHit hit;
        float cosine = 0;  // of the angle between beam and flow: positive towards the probe
        float weight = 0;
    };
    const FlowScene& scene_;
    FlowMoment blood_;
    std::vector<Point> points_, profile_;
    std::size_t count_ = 0, profile_count_ = 0;
    int asked_ = 1, vessel_ = -1;
    float per_area_ = 0;  // mean velocity in that vessel there
    std::vector<std::int32_t> near_;
};

}  // namespace sonocase::runtime::doppler
