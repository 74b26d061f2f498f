// SPDX-License-Identifier: Apache-2.0

// The price of each label that lets it keep its volume, all labels at once.
//
// Volumes are integrals over the patient's voxels: each is cut into q^3 cells, and a cell that the
// surface between its two best labels passes through is shared between them by the distance to that
// surface over the cell's size. That makes volume a smooth function of the prices, and Newton's
// method on all labels at once (its matrix is the graph of shared surface areas) settles in a few
// steps. Deterministic for any number of threads.
#pragma once

#include <functional>
#include <vector>

#include "pipeline/segmentation/field/label_field.h"

namespace sonocase::pipeline {

struct LabelPriceOptions {
    int iterations = 8;         // Newton steps; 0: all prices stay 0
    double cell_mm = 1.5;       // size of the integration cells, at most a voxel of the map
    double max_price_vx = 1.5;  // limit of a price, voxels of the map in the plane
};

struct LabelPriceReport {
    std::vector<double> target_mm3;   // # labels
    std::vector<double> reached_mm3;  // by the integral
    int iterations = 0;
    double largest_miss = 0;  // relative, over labels whose price is not at its limit
};

// weight(point): how much a mm^3 there weighs (det J of the map; 1 without one).
LabelPriceReport set_label_prices(LabelField* field,
                                  const std::function<double(Point3)>& weight,
                                  const LabelPriceOptions& options = {});

}  // namespace sonocase::pipeline
