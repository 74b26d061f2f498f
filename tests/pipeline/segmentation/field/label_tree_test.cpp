// SPDX-License-Identifier: Apache-2.0

// Which unions of labels a map's surfaces are measured as.
#include <gtest/gtest.h>

#include "pipeline/segmentation/distance/signed_distance.h"
#include "pipeline/segmentation/label_tree.h"
#include "support/shapes.h"

namespace sonocase::pipeline {
namespace {

using sonocase::testing::cubic_grid;
using sonocase::testing::norm_of;
using sonocase::testing::sample_labels;

// Air, skin, fat and muscle as shells, two organs in the muscle that share a face; label 6 absent.
LabelVolume body() {
    return sample_labels(cubic_grid(40), 7, [](Point3 p) {
        const double r = norm_of(p);
        if (r > 18) return 0;
        if (r > 17) return 1;
        if (r > 14) return 2;
        if (r < 6) return p.x > 0 ? 4 : 5;
        return 3;
    });
}

TEST(LabelTree, ShellsHangInAChainAndOrgansInWhatHoldsThem) {
    const LabelTree tree = nest_labels(body());
    EXPECT_EQ(tree.parent, (std::vector<int>{LabelTree::kRoot, 0, 1, 2, 3, 3, LabelTree::kAbsent}));
    EXPECT_EQ(tree.members[2], LabelSet(0b111100));  // fat and all that it encloses
    EXPECT_EQ(tree.members[4], LabelSet(0b010000));
    EXPECT_EQ(tree.steps_between(0, 1), 1);
    EXPECT_EQ(tree.steps_between(1, 3), 2);
    EXPECT_EQ(tree.steps_between(4, 5), 2);
}

TEST(LabelTree, OnlyTheLabelBetweenTouchingOrgansNeedsItsOwnDistance) {
    const LabelTree tree = nest_labels(body());
    EXPECT_EQ(tree.between, (std::vector<bool>{false, false, false, true, false, false, false}));
}

// The claim behind the sum of distances, tested on measured distances, whatever the tree.
TEST(LabelTree, TheSumIsLeastForTheLabelOfEveryVoxel) {
    const LabelVolume volume = body();
    const LabelTree tree = nest_labels(volume);
    const std::size_t n = volume.labels.size();
    const VoxelBox all{{0, 0, 0}, volume.grid.size};
    std::vector<std::vector<float>> phi(n);
    for (std::size_t l = 0; l < n; ++l) {
        if (tree.parent[l] < 0) continue;
        signed_distance(volume, tree.members[l], all, 8, {true, true, true}, &phi[l]);
    }
    for (std::size_t v = 0; v < volume.voxels.size(); ++v) {
        std::size_t best = 0;
        double lowest = 1e9;
        for (std::size_t l = 0; l < n; ++l) {
            if (tree.parent[l] == LabelTree::kAbsent) continue;
            double score = 0;
            for (std::size_t e = 0; e < n; ++e) {
                if (!phi[e].empty() && tree.members[e][l]) score += phi[e][v];
            }
            if (score < lowest) {
                lowest = score;
                best = l;
            }
        }
        ASSERT_EQ(best, volume.voxels[v]) << v;
    }
}

}  // namespace
}  // namespace sonocase::pipeline
