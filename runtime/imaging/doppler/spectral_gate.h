// SPDX-License-Identifier: Apache-2.0

// The gate of spectral Doppler: points of blood in it, found once a frame, and their spectrum at
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

#include "runtime/imaging/doppler/colour_estimate.h"
#include "runtime/imaging/doppler/flow_scene.h"
#include "runtime/imaging/doppler/tissue_place.h"
#include "runtime/imaging/frame/doppler_settings.h"

namespace sonocase::runtime::doppler {

inline constexpr int kBins = 256;
inline constexpr double kLeastHalfBins = 1.2;  // of a point's triangle: the transform's window
inline constexpr double kFNumber = 3;          // of the receiving aperture (a)
inline constexpr double kSinDelta = 0.164399;  // of 1 / (2 F)
inline constexpr double kBeamLateralMm = 0.5, kBeamElevationMm = 0.8;  // standard deviations (a)
inline constexpr int kProfilePoints = 128;  // along the beam, for the mean velocity of the section

using Spectrum = std::array<float, kBins>;  // power of each bin; bin 128 is velocity 0

struct GateLook {
    bool blood = false;  // some point is in a vessel
    int vessel = -1;     // that most points are in
    double angle_deg =
        0;  // between the beam and the flow there, [0, 180]: below 90 towards the probe
    double chord_mm = 0;  // length of the vessel along the beam, as far as 30 mm from the gate
    double area_mm2 = 0;  // true section there
    double fill = 0;      // share of the gate's points in that vessel
    bool spans = false;   // the gate reaches both walls
    bool two_vessels = false;
};

class SpectralGate {
  public:
    explicit SpectralGate(const FlowScene& scene);

    // Where the gate's points lie now. Cost: 64 points 10 us.
    GateLook aim(const ScanGeometry& geometry,
                 const DopplerSettings& settings,
                 const TissuePlace& place);

    // Expected power at a moment, without noise, the sum over all points at most 1.
    void spectrum(const DopplerSettings& settings, double phase, double inspired, Spectrum& out);
    // Mean velocity of the section along the vessel, mm/s, as a scanner finds it that measures the
    // profile along the beam and takes it for round: points weighted by their distance from the
    // middle of the lumen. Cosine of the true angle taken out.
    double section_mean_mm_s(double phase, double inspired);
    // Greatest velocity of any point of the gate, mm/s, along the vessel.
    double greatest_mm_s(double phase, double inspired);
    // The same of the whole section of the vessel that most points are in, without a sign.
    double section_greatest_mm_s(double phase, double inspired);

  private:
    struct Point {
        FlowHit hit;
        float cosine = 0;  // of beam and flow: positive towards the probe
        float weight = 0;
    };
    const FlowScene& scene_;
    FlowMoment blood_;
    std::vector<Point> points_, profile_;
    std::size_t count_ = 0, profile_count_ = 0;
    int asked_ = 1, vessel_ = -1;
    float per_area_ = 0;  // mean velocity of that vessel there
    std::vector<std::int32_t> near_;
};

}  // namespace sonocase::runtime::doppler
