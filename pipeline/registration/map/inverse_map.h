// SPDX-License-Identifier: Apache-2.0

// Inverse of the fitted map: where in the CT does a point of the mannequin come from?
//
// Newton's method on y = q(x) + d(x) from an approximate quadratic inverse (the map fitted with the
// sides swapped). The residual and the box are checked: a point without a preimage, or whose
// preimage lies outside the CT, is marked and never guessed. Where several preimages exist the one
// inside the CT wins.
#pragma once

#include <cstdint>
#include <memory>

#include "formats/registration/registration.h"

namespace sonocase::pipeline {

// ok           the preimage lies in the CT box and maps back onto the point
// outside      the point has no preimage in the CT box, but one beyond it
// no_preimage  nothing maps onto the point
enum class MapStatus : std::uint8_t { ok, outside, no_preimage };

class InverseMap {
  public:
    // Copies what it needs. An empty ct_box means that the map holds everywhere. Cost: some ms.
    explicit InverseMap(const Registration& registration);
    ~InverseMap();
    InverseMap(InverseMap&&) noexcept;
    InverseMap& operator=(InverseMap&&) noexcept;

    // Double precision, damped Newton until the residual is <= 1e-9 mm (more where the coordinates
    // themselves are coarser) or 50 steps have passed. *ct is NaN for no_preimage; for outside it
    // is the preimage beyond the box. Thread-safe.
    MapStatus invert(Point3 mannequin, Point3* ct) const;

    // `count` points start, start + step, ... as single-precision structure of arrays; for the
    // volume resampler. Newton is run at knots along the row (every 8 points where the map is
    // gentle, every point where it is not) and a cubic is laid between them; each interval's cubic
    // is checked against the map and split until the expected error is below 2.5e-4 mm. Coordinates
    // of points that are not ok are NaN, and points that provably have no preimage in the box are
    // marked outside without a search. The same bytes on every instruction set. Thread-safe. Cost:
    // about 20 ns a point with a residual field, 10 ns without.
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

}  // namespace sonocase::pipeline
