// SPDX-License-Identifier: Apache-2.0

#include "pipeline/check/case_labels.h"

#include <cmath>

namespace sonocase::pipeline::inline check {

CaseLabels::CaseLabels(const CaseBundle& bundle) : bundle_(bundle) {
    const std::vector<int> tissue = tissue_of_label(bundle);
    for (std::size_t l = 0; l < bundle.labels.size(); ++l) {
        const std::string& name = bundle.labels[l].tissue;
        kind_.push_back(l == 0 ? TissueKind::outside : bundle.tissues[tissue[l]].kind);
        skin_.push_back(name == "skin");
        has_skin_ = has_skin_ || name == "skin";
        vessel_.push_back(name == "blood" || name == "vein" || name == "artery");
        plain_.push_back(name == "skin" || name == "fat" || name == "muscle" ||
                         name == "soft_tissue" || name == "fascia");
    }
}

int CaseLabels::label(Point3 p) const {
    // A bundle's grid has no direction: its axes are those of the frame.
    const Grid& grid = bundle_.grid;
    const double x = (p.x - grid.origin_mm.x) / grid.spacing_mm.x,
                 y = (p.y - grid.origin_mm.y) / grid.spacing_mm.y,
                 z = (p.z - grid.origin_mm.z) / grid.spacing_mm.z;
    if (!(x > -0.5 && y > -0.5 && z > -0.5 && x < grid.size.x - 0.5 && y < grid.size.y - 0.5 &&
          z < grid.size.z - 0.5))
        return 0;
    return bundle_.label_bricks.at(static_cast<int>(x + 0.5), static_cast<int>(y + 0.5),
                                   static_cast<int>(z + 0.5));
}

int CaseLabels::find(const std::string& name) const {
    for (std::size_t l = 0; l < bundle_.labels.size(); ++l)
        if (bundle_.labels[l].name == name) return static_cast<int>(l);
    return -1;
}

}  // namespace sonocase::pipeline::inline check
