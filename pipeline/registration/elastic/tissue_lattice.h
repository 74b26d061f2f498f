// SPDX-License-Identifier: Apache-2.0

// How stiff the patient is: shape and volume stiffness of the tissues, averaged over the blocks of
// a spline lattice.
#pragma once

#include <string_view>
#include <vector>

#include "formats/volume/label_volume.h"
#include "pipeline/registration/elastic/spline_lattice.h"

namespace sonocase::pipeline::inline registration_elastic {

// mm^2, against the mean squared gap at the skin. shape: of |F - R|^2; volume: of (log det F)^2.
struct Stiffness {
    double shape = 1, volume = 0;
};

// The stiffness of a tissue of the built-in table (Label::tissue). Bone hardly bends, organs keep
// volume and shape, and fat, skin and what is not known take up the difference.
Stiffness tissue_stiffness(std::string_view tissue);

// Whether a tissue is bone, or a solid organ whose volume a fit should keep.
bool is_bone(std::string_view tissue);
bool is_solid_organ(std::string_view tissue);

struct TissueLattice {
    std::vector<float> shape, volume;  // # lattice samples
    double inside = 0;                 // number of samples inside the body
};

// Means over the voxels in each sample's eighth of a cell; outside the body the stiffness of air.
// Samples on the end faces have half the stiffness of their neighbours. Labels of finer voxels are
// read every 3 mm. An absent or empty volume: the body is one tissue; inside is then `body_share`
// of the samples. Cost: one pass over the voxels read.
TissueLattice make_tissue_lattice(const SplineLattice& lattice,
                                  const LabelVolume* labels,
                                  double body_share = 0.6);

}  // namespace sonocase::pipeline::inline registration_elastic
