// Inverse of the fitted map: where in the CT does a point of the mannequin come from?
//
// Newton's method on y = q(x) + d(x) from an approximate quadratic inverse. The residual and the box
// are checked: a point without a preimage, or whose preimage lies outside the CT, is marked and never
// guessed.
#pragma once

#include <cstdint>
#include <memory>

#include "formats/registration.h"

namespace sonocase::pipeline {

enum class MapStatus : std::uint8_t { ok, outside, no_preimage };

class InverseMap {
  public:
    explicit InverseMap(const Registration& registration);
    ~InverseMap();
    InverseMap(InverseMap&&) noexcept;
    InverseMap& operator=(InverseMap&&) noexcept;

    // Double precision, iterated until the residual is <= 1e-9 mm or 50 steps have passed.
    MapStatus invert(Point3 mannequin, Point3* ct) const;

    // `count` points start, start + step, ... as single-precision structure of arrays, with a fixed
    // number of Newton steps; for the volume resampler. The same bytes on every instruction set.
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
