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
    const Point3 v = bundle_.grid.voxel_from_point(p);
    if (!(std::abs(v.x) < 1e6) || !(std::abs(v.y) < 1e6) || !(std::abs(v.z) < 1e6)) return 0;
    const int i = static_cast<int>(std::lround(v.x)), j = static_cast<int>(std::lround(v.y)),
              k = static_cast<int>(std::lround(v.z));
    return bundle_.grid.contains(i, j, k) ? bundle_.label_bricks.at(i, j, k) : 0;
}

int CaseLabels::find(const std::string& name) const {
    for (std::size_t l = 0; l < bundle_.labels.size(); ++l)
        if (bundle_.labels[l].name == name) return static_cast<int>(l);
    return -1;
}

}  // namespace sonocase::pipeline::inline check
