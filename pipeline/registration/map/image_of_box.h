// SPDX-License-Identifier: Apache-2.0

// Which places of the mannequin can the CT box reach? A coarse grid of yes and no, where no is
// proven: the box is cut into cells, and each cell's image lies in the box around the Bernstein
// coefficients of the quadratic plus the control points of the residual that act on the cell.
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
