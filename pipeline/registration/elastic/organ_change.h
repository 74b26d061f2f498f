// SPDX-License-Identifier: Apache-2.0

// What a map does to each structure of the patient: its volume and its shape.
#pragma once

#include <string>
#include <vector>

#include "formats/volume/label_volume.h"
#include "pipeline/registration/map/registration.h"

namespace sonocase::pipeline::inline registration_elastic {

struct OrganChange {
    std::string label, tissue;
    double before_ml = 0;
    double volume_ratio = 1;  // after over before: the mean of det J over its voxels
    double shape_change = 0;  // mean of the largest |singular value of J - 1| over its voxels
};

// The changes of every label except the outside, in the order of the palette. Large structures are
// sampled at some 1,500 voxels spread over them, which determines both measures to 1 %. Cost: two
// passes over the labels and 30 ms on two cores.
std::vector<OrganChange> organ_changes(const LabelVolume& labels, const Registration& registration);

// The changes of all labels of a kind as one, weighted by their volume; before_ml is 0 if there is
// none.
OrganChange joint_change(const std::vector<OrganChange>& changes,
                         const std::string& name,
                         bool (*belongs)(std::string_view tissue));

}  // namespace sonocase::pipeline::inline registration_elastic
