// SPDX-License-Identifier: Apache-2.0

// Shortcuts of the label field, which must not change its results.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "pipeline/segmentation/known_maps.h"
#include "pipeline/segmentation/label_field.h"
#include "support/random.h"
#include "support/shapes.h"

namespace sonocase::pipeline {
namespace {

using namespace sonocase::testing;  // shapes and maps of known answer

// Balls in a ball, one of them in two layers, and a rod one voxel thick: three to five labels at
// many places.
LabelVolume crowded(double slice_mm) {
    return sample_labels(thick_grid(56, slice_mm), 8, [](Point3 p) {
        if (std::hypot(p.x + 3, p.y - 0.4 * p.z) < 1) return 7;
        if (norm(p - Point3{8, 2, 3}) < 4) return 3;
        if (norm(p - Point3{8, 2, 3}) < 7) return 2;
        if (norm(p - Point3{-7, 4, 0}) < 8) return 4;
        if (norm(p - Point3{1, -9, 4}) < 7) return 5;
        if (p.z < -9 && norm_of(p) < 21) return 6;
        return norm_of(p) < 23 ? 1 : 0;
    });
}

struct TopTwo {
    std::uint8_t first = 0, second = 0;
    double apart_mm = 0;
};

TopTwo top_two(const LabelField& field, LabelField::Position at) {
    std::array<float, 256> score;
    field.scores(at, score.data());
    const auto& labels = at.candidates->labels;
    std::vector<std::size_t> order(labels.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    std::sort(order.begin(), order.end(),
              [&](std::size_t a, std::size_t b) { return score[a] < score[b]; });
    if (order.size() < 2) return {labels[order[0]], labels[order[0]], 1e9};
    const std::uint8_t first = labels[order[0]], second = labels[order[1]];
    return {first, second,
            (score[order[1]] - score[order[0]]) / static_cast<double>(field.slope(first, second))};
}

class LabelFieldOf : public ::testing::TestWithParam<double> {};

TEST_P(LabelFieldOf, CandidatesOfACellAnswerLikeAllCandidates) {
    constexpr float kReach = 2;
    const LabelVolume labels = crowded(GetParam());
    LabelField field(labels, {});
    Random random(5);
    for (float& offset : field.volume_offsets_mm())
        offset = static_cast<float>(random.uniform(-0.4, 0.4));
    field.find_candidates(kReach);
    const Vector3 h = field.nodes().spacing_mm;
    std::size_t with_candidates = 0, fewer = 0, sure = 0;
    for (int n = 0; n < 40000; ++n) {
        float v[3];
        Vector3 off;
        Int3 near;
        for (int a = 0; a < 3; ++a) {
            const int last = field.nodes().size[a] - 1;
            v[a] = static_cast<float>(random.uniform(0, last));
            near[a] = static_cast<int>(std::lround(v[a]));
            off[a] = h[a] * (static_cast<double>(v[a]) - near[a]);
        }
        const LabelField::Position at = field.locate(v[0], v[1], v[2]);
        const std::size_t node = field.nodes().index(near.x, near.y, near.z);
        if (at.candidates == nullptr) {
            ASSERT_EQ(field.node_label(node), at.block->labels[0]);
            continue;
        }
        LabelField::Position all = at;
        all.candidates = &at.block->candidate_sets[0];
        const TopTwo short_cut = top_two(field, at), whole = top_two(field, all);
        ++with_candidates;
        fewer += at.candidates->labels.size() < all.candidates->labels.size();
        ASSERT_EQ(short_cut.first, whole.first);
        if (whole.apart_mm < kReach) {
            ASSERT_EQ(short_cut.second, whole.second);
            // Sums of fewer terms of up to 50 mm are rounded differently.
            ASSERT_NEAR(short_cut.apart_mm, whole.apart_mm, 1e-4);
        }
        // The node's margin reaches beyond the point, by `rest`.
        const double rest = static_cast<double>(field.node_margin_mm(node)) - norm(off);
        if (rest <= 0) continue;
        ++sure;
        ASSERT_EQ(field.node_label(node), whole.first);
    }
    EXPECT_GT(with_candidates, 10000u);
    EXPECT_GT(fewer, with_candidates / 2);
    EXPECT_GT(sure, 10000u);
}

// Larger blocks compare the same labels by the same distances; only small ones may miss a label
// that is one voxel beyond the reach from which a label can win.
TEST_P(LabelFieldOf, AnswersDoNotDependOnTheEdgeOfBlocks) {
    const LabelVolume ct = crowded(GetParam());
    LabelField eight(ct, {{}, 8}), sixteen(ct, {{}, 16}), four(ct, {{}, 4});
    for (LabelField* field : {&eight, &sixteen, &four}) field->find_candidates(2);
    Random random(6);
    int others = 0;
    for (int n = 0; n < 20000; ++n) {
        float v[3];
        for (int a = 0; a < 3; ++a)
            v[a] = static_cast<float>(random.uniform(0, eight.nodes().size[a] - 1));
        const auto winner = [&](const LabelField& field) {
            const LabelField::Position at = field.locate(v[0], v[1], v[2]);
            return at.candidates == nullptr ? at.block->labels[0] : top_two(field, at).first;
        };
        others += winner(eight) != winner(sixteen) || winner(eight) != winner(four);
    }
    EXPECT_LE(others, 20);
}

// Volume offsets move surfaces by the same amount on either side of a block's face. What remains is
// a label that is a candidate on one side only: too far away to win, but within the reach of the
// smoothing of its neighbour's own distance. Offsets that counted once on one side and twice on the
// other made steps of 0.3 mm.
TEST_P(LabelFieldOf, NothingJumpsFromBlockToBlock) {
    const LabelVolume labels = crowded(GetParam());
    LabelField field(labels, {});
    Random random(7);
    for (float& offset : field.volume_offsets_mm())
        offset = static_cast<float>(random.uniform(-0.4, 0.4));
    field.find_candidates(2);
    constexpr float kStep = 1e-3f;  // nodes
    std::vector<double> changes;
    for (int n = 0; n < 40000; ++n) {
        float v[3];
        for (int a = 0; a < 3; ++a)
            v[a] = static_cast<float>(random.uniform(0, field.nodes().size[a] - 1));
        const int axis = n % 3;
        v[axis] = 8 * std::round(v[axis] / 8);
        if (v[axis] < 1 || v[axis] > static_cast<float>(field.nodes().size[axis] - 2)) continue;
        v[axis] -= kStep;
        const LabelField::Position before = field.locate(v[0], v[1], v[2]);
        v[axis] += 2 * kStep;
        const LabelField::Position after = field.locate(v[0], v[1], v[2]);
        if (before.candidates == nullptr || after.candidates == nullptr) continue;
        const TopTwo a = top_two(field, before), b = top_two(field, after);
        if (std::min(a.apart_mm, b.apart_mm) > 1) continue;
        changes.push_back(a.first == b.first ? std::abs(a.apart_mm - b.apart_mm)
                                             : a.apart_mm + b.apart_mm);
    }
    ASSERT_GT(changes.size(), 2000u);
    std::sort(changes.begin(), changes.end());
    EXPECT_LT(changes[changes.size() / 2], 0.01);
    EXPECT_LT(changes[changes.size() * 95 / 100], 0.1);
}

// With more candidates than the sets of cells can hold, all of them are compared.
TEST(LabelField, CubesOfTwoHundredLabelsKeepTheirMiddles) {
    constexpr int kEdge = 3, kCubes = 6;  // 216 in the reach of one block of 16
    LabelVolume ct;
    ct.grid = cubic_grid(kEdge * kCubes);
    ct.voxels.resize(ct.grid.voxel_count());
    for (int l = 0; l < kCubes * kCubes * kCubes; ++l)
        ct.labels.push_back({"cube", "muscle", l, {}});
    const auto cube = [](int i, int j, int k) {
        return static_cast<std::uint8_t>(i / kEdge + kCubes * (j / kEdge + kCubes * (k / kEdge)));
    };
    const int edge = ct.grid.size.x;
    for (int k = 0; k < edge; ++k) {
        for (int j = 0; j < edge; ++j) {
            for (int i = 0; i < edge; ++i) ct.voxels[ct.grid.index(i, j, k)] = cube(i, j, k);
        }
    }
    LabelField field(ct, {{}, 16});
    field.find_candidates(2);
    ASSERT_GT(field.blocks()[0].labels.size(), 64u);
    for (int k = 1; k < edge; k += kEdge) {
        for (int j = 1; j < edge; j += kEdge) {
            for (int i = 1; i < edge; i += kEdge) {
                const LabelField::Position at = field.locate(
                    static_cast<float>(i), static_cast<float>(j), static_cast<float>(k));
                ASSERT_EQ(top_two(field, at).first, cube(i, j, k)) << i << " " << j << " " << k;
            }
        }
    }
}

INSTANTIATE_TEST_SUITE_P(Slices, LabelFieldOf, ::testing::Values(1.0, 4.0));

}  // namespace
}  // namespace sonocase::pipeline
