// SPDX-License-Identifier: Apache-2.0

#include "formats/exercise/organ_of_interest.h"

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <tuple>
#include <vector>

namespace sonocase {
namespace {

// 64 mm of liver with a vein of 10 mm along x at z = 16, muscle beyond z = 48, and a lesion of 6 mm
// in the middle.
CaseBundle block() {
    CaseBundle b;
    b.grid.size = {64, 64, 64};
    b.grid.spacing_mm = {1, 1, 1};
    for (const auto& [name, tissue, kind] : {std::tuple{"outside", "outside", TissueKind::outside},
                                             std::tuple{"liver", "liver", TissueKind::soft},
                                             std::tuple{"vein", "blood", TissueKind::fluid},
                                             std::tuple{"psoas", "muscle", TissueKind::soft},
                                             std::tuple{"metastasis", "lesion", TissueKind::soft},
                                             std::tuple{"clot", "thrombus", TissueKind::soft}}) {
        b.labels.push_back({name, tissue, static_cast<int>(b.labels.size()), {0, 0, 0}});
        Tissue t;
        t.name = tissue;
        t.kind = kind;
        b.tissues.push_back(t);
    }
    std::vector<std::uint8_t> voxels;
    for (int k = 0; k < 64; ++k) {
        for (int j = 0; j < 64; ++j) {
            for (int i = 0; i < 64; ++i) {
                const Vector3 from_vein{0, j - 32.0, k - 16.0},
                    from_lesion{i - 32.0, j - 32.0, k - 34.0};
                voxels.push_back(norm(from_lesion) < 6 ? 4
                                 : norm(from_vein) < 5 ? (i < 32 ? 2 : 5)
                                 : k > 48              ? 3
                                                       : 1);
            }
        }
    }
    b.label_bricks = bricks_from_dense<std::uint8_t>(voxels, b.grid.size);
    return b;
}

std::string organ(const CaseBundle& bundle, const std::function<void(Exercise&)>& change) {
    Exercise exercise;
    change(exercise);
    const std::vector<bool> found = organ_of_interest(bundle, exercise);
    EXPECT_EQ(found.size(), bundle.labels.size());
    std::string names;
    for (std::size_t l = 0; l < found.size(); ++l)
        if (found[l]) names += (names.empty() ? "" : " ") + bundle.labels[l].name;
    return names;
}

auto target(Point3 centre, double radius_mm, const char* inside) {
    return [=](Exercise& exercise) {
        Target t;
        t.centre = centre;
        t.radius_mm = radius_mm;
        t.inside = inside;
        exercise.targets.push_back(t);
    };
}

TEST(OrganOfInterest, IsTheSoftTissueThatATargetLiesIn) {
    const CaseBundle bundle = block();
    EXPECT_EQ(organ(bundle, target({32, 32, 45}, 3, "liver")), "liver");  // muscle is near
    EXPECT_EQ(organ(bundle, target({32, 32, 56}, 3, "psoas")), "psoas");
}

TEST(OrganOfInterest, IsWhatLiesRoundAVeinAClotOrALesionOfTheCase) {
    const CaseBundle bundle = block();
    EXPECT_EQ(organ(bundle, target({20, 32, 16}, 3, "vein")), "liver");
    EXPECT_EQ(organ(bundle, target({44, 32, 16}, 3, "clot")), "liver");
    EXPECT_EQ(organ(bundle, target({32, 32, 34}, 6, "metastasis")), "liver");
    EXPECT_EQ(organ(bundle, target({32, 32, 47}, 3, "")), "liver psoas");
}

TEST(OrganOfInterest, WithoutTargetsIsWhatStepsAskToBeShown) {
    const CaseBundle bundle = block();
    const auto shows = [](std::vector<std::string> regions) {
        return [=](Exercise& exercise) {
            exercise.procedure.steps.push_back({});
            exercise.procedure.steps[0].done.shows = regions;
        };
    };
    EXPECT_EQ(organ(bundle, shows({"vein", "pso*"})), "psoas");
    EXPECT_EQ(organ(bundle, shows({"vein"})), "liver psoas metastasis");  // all soft tissue
    EXPECT_EQ(organ(bundle, [](Exercise&) {}), "liver psoas metastasis");
}

// A place outside the volume has nothing round it.
TEST(OrganOfInterest, OutsideTheVolumeIsAllSoftTissue) {
    EXPECT_EQ(organ(block(), target({500, 0, 0}, 3, "liver")), "liver psoas metastasis");
}

}  // namespace
}  // namespace sonocase
