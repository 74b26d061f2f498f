// SPDX-License-Identifier: Apache-2.0

// Which places of the mannequin the CT box can be mapped to: a coarse grid of yes and no, in which
// "no" is proven. The box is divided into cells; the image of each lies in the bounding box of the
// Bernstein coefficients of the quadratic plus the control points of the residual that act there.
#pragma once

#include <cstdint>
#include <vector>

#include "formats/registration/registration.h"

namespace sonocase::pipeline {

class ImageOfBox {
  public:
    // registration.ct_box must not be empty.
    explicit ImageOfBox(const Registration& registration);

    // False: no point of the CT box maps onto p, or into the box.
    bool may_contain(Point3 p) const;
    bool may_touch(const Box3& box) const;

  private:
    double cell_mm_ = 16;
    Point3 origin_;
    Int3 size_{0, 0, 0};
    std::vector<std::uint8_t> reached_;
};

}  // namespace sonocase::pipeline
