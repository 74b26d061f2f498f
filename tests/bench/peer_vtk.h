// SPDX-License-Identifier: Apache-2.0

// What a user would take instead for a bare slice: vtkImageReslice on the same volume and poses.
#pragma once

#include <memory>
#include <span>

#include "formats/bundle/case_bundle.h"

namespace sonocase::bench {

class VtkReslice {
  public:
    explicit VtkReslice(const CaseBundle& bundle);  // labels, dense
    ~VtkReslice();
    // Nearest neighbour, size x size pixels, one thread, x and z of the probe across and down.
    void slice(const Rigid& volume_from_probe, double mm_per_px, int size);

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace sonocase::bench
