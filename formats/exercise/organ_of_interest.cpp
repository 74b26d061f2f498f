// SPDX-License-Identifier: Apache-2.0

#include "formats/exercise/organ_of_interest.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace sonocase {
namespace {

constexpr double kReachMm = 20;
constexpr int kStepsToReach = 8;
constexpr double kOwnShare = 0.2, kOtherShare = 0.1;  // of the soft tissue round a target

// Soft tissue round a place: # labels, voxels looked up.
std::vector<double> soft_tissue_near(const CaseBundle& bundle,
                                     const std::vector<bool>& soft,
                                     Point3 centre,
                                     double reach_mm) {
    std::vector<double> found(soft.size(), 0.0);
    const Point3 middle = bundle.grid.voxel_from_point(centre);
    const int reach = static_cast<int>(reach_mm / bundle.grid.spacing_mm.x);
    const int step = std::max(reach / kStepsToReach, 1);
    const Int3 size = bundle.grid.size;
    for (int k = -reach; k <= reach; k += step) {
        for (int j = -reach; j <= reach; j += step) {
            for (int i = -reach; i <= reach; i += step) {
                if (i * i + j * j + k * k > reach * reach) continue;
                const int x = static_cast<int>(std::floor(middle.x + 0.5)) + i,
                          y = static_cast<int>(std::floor(middle.y + 0.5)) + j,
                          z = static_cast<int>(std::floor(middle.z + 0.5)) + k;
                if (x < 0 || y < 0 || z < 0 || x >= size.x || y >= size.y || z >= size.z) continue;
                const std::size_t label = bundle.label_bricks.at(x, y, z);
                if (soft[label]) found[label] += 1;
            }
        }
    }
    return found;
}

}  // namespace

std::vector<bool> organ_of_interest(const CaseBundle& bundle, const Exercise& exercise) {
    const std::vector<int> tissue = tissue_of_label(bundle);
    std::vector<bool> soft(bundle.labels.size()), organ(bundle.labels.size());
    for (std::size_t l = 1; l < soft.size(); ++l) {
        const Tissue& t = bundle.tissues[static_cast<std::size_t>(tissue[l])];
        soft[l] = t.kind == TissueKind::soft && t.name != "thrombus";
    }
    for (const Target& target : exercise.targets) {
        const std::vector<double> found =
            soft_tissue_near(bundle, soft, target.centre, std::max(2 * target.radius_mm, kReachMm));
        double all = 0, own = 0;
        for (std::size_t l = 0; l < found.size(); ++l) {
            all += found[l];
            if (bundle.labels[l].name == target.inside) own = found[l];
        }
        for (std::size_t l = 0; l < found.size(); ++l) {
            const bool is_own = bundle.labels[l].name == target.inside;
            if (own > kOwnShare * all ? is_own : !is_own && found[l] > kOtherShare * all)
                organ[l] = true;
        }
    }
    const auto add_shown = [&](const Condition& condition) {
        for (const std::string& region : condition.shows)
            for (std::size_t l = 0; l < soft.size(); ++l)
                if (soft[l] && region_names_label(region, bundle.labels[l].name)) organ[l] = true;
    };
    if (exercise.targets.empty()) {
        for (const ProcedureStep& step : exercise.procedure.steps) add_shown(step.done);
        for (const ProcedureItem& item : exercise.procedure.items) add_shown(item.condition);
    }
    return std::find(organ.begin(), organ.end(), true) != organ.end() ? organ : soft;
}

}  // namespace sonocase
