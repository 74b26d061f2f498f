// SPDX-License-Identifier: Apache-2.0

#include "formats/exercise/needle_makes.h"

#include <array>

namespace sonocase {
namespace {

// clang-format off
constexpr std::array kMakes{
    //         name       about                                 mm    rough  lobe  towards away
    NeedleMake{"chiba", "Chiba needle, bevelled",               0.72, 0.1067, 0.1214, 0.2874, 0.1978,
               false, 25, 0.32, 0.75, 0.56},
    NeedleMake{"trocar", "Trocar needle, three facets",         1.27, 0.0750, 0.1109, 0.2655, 0.1748,
               false, 24, 0.29, 0.78, 0.59},
    NeedleMake{"rod", "Polished rod, cut straight",             2.00, 0.0360, 0.0903, 0.0669, 0.0373,
               false, 20, 0.11, 0.30, 0.09},
    NeedleMake{"nitinol", "Nitinol stylet, polished",           2.00, 0.0261, 0.0901, 0.0847, 0.0376,
               false, 20, 0.04, 0.39, 0.09},
    NeedleMake{"ablation", "Ablation electrode, grey coat",     2.00, 0.1172, 0.1231, 0.2533, 0.2025,
               false, 28, 0.53, 0.86, 0.75},
    NeedleMake{"notched", "Notched needle: bright at every angle", 2.00, 0.2167, 0.1150, 0.0659, 0.0238,
               true, 0, 0.80, 0.34, 0.07},
};
// clang-format on

}  // namespace

std::span<const NeedleMake> needle_makes() {
    return kMakes;
}

std::vector<std::string> needle_make_names() {
    std::vector<std::string> names;
    for (const NeedleMake& make : kMakes) names.emplace_back(make.name);
    return names;
}

const NeedleMake* find_needle_make(std::string_view name) {
    for (const NeedleMake& make : kMakes)
        if (name == make.name) return &make;
    return nullptr;
}

}  // namespace sonocase
