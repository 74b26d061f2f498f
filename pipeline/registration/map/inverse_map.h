// SPDX-License-Identifier: Apache-2.0

// Inverse of the fitted map: the point of the CT that a point of the mannequin comes from.
//
// Newton's method on y = q(x) + d(x) from an approximate quadratic inverse (the map fitted with its
// sides exchanged). The residual and the box are checked: a point without a preimage, or with one
// outside the CT only, is marked and never guessed. If several preimages exist, the one inside the
// CT is returned.
#pragma once

#include <cstdint>
#include <memory>

#include "pipeline/registration/map/registration.h"

namespace sonocase::pipeline::inline registration_map {

// ok           the preimage lies in the CT box and maps back onto the point
// outside      the point has a preimage, but not in the CT box
// no_preimage  no point maps onto the point
enum class MapStatus : std::uint8_t { ok, outside, no_preimage };

class InverseMap {
  public:
    // Copies what it needs. An empty ct_box means that the map is valid everywhere. Cost: a few ms.
    explicit InverseMap(const Registration& registration);
    ~InverseMap();
    InverseMap(InverseMap&&) noexcept;
    InverseMap& operator=(InverseMap&&) noexcept;

    // Double precision, damped Newton until the residual is <= 1e-9 mm (or the rounding of the
    // coordinates, if that is larger) or 50 steps have passed. *ct is NaN for no_preimage; for
    // outside it is the preimage beyond the box. Thread-safe.
    MapStatus invert(Point3 mannequin, Point3* ct) const;

    // `count` points start, start + step, ..., as single-precision arrays; for the volume
    // resampler. Newton's method is run at knots along the row (every 8 points where the map is
    // smooth, up to every point where it is not), with a cubic between them; each interval's cubic
    // is checked against the map and split until the expected error is below 2.5e-4 mm. Coordinates
    // of points that are not ok are NaN; points that provably have no preimage in the box are
    // marked outside without a search. The same bytes on every instruction set. Thread-safe. Cost:
    // about 20 ns per point with a residual field, 10 ns without.
    void invert_row(Point3 start,
                    Vector3 step,
                    int count,
                    float* ct_x,
                    float* ct_y,
                    float* ct_z,
                    MapStatus* status) const;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace sonocase::pipeline::inline registration_map
