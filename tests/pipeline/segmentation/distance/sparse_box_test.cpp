// SPDX-License-Identifier: Apache-2.0

// Runs of constants against the same functions on plain values, bit by bit.
#include "pipeline/segmentation/distance/sparse_box.h"

#include <gtest/gtest.h>

#include <cstring>
#include <vector>

namespace sonocase::pipeline {
namespace {

// Two balls that touch, a sheet one voxel thick and single voxels, in a box that crosses the
// borders of several runs, or of none.
LabelVolume scene(Int3 size, Vector3 spacing_mm) {
    LabelVolume volume;
    volume.grid.size = size;
    volume.grid.spacing_mm = spacing_mm;
    volume.labels.resize(4);
    volume.voxels.assign(volume.grid.voxel_count(), 0);
    for (int k = 0; k < size.z; ++k) {
        for (int j = 0; j < size.y; ++j) {
            for (int i = 0; i < size.x; ++i) {
                std::uint8_t& v = volume.voxels[volume.grid.index(i, j, k)];
                const auto within = [&](int x, int y, int z, int r) {
                    return (i - x) * (i - x) + (j - y) * (j - y) + (k - z) * (k - z) < r * r;
                };
                if (within(15, 20, 14, 12)) v = 1;
                if (within(size.x - 18, 18, 20, 13)) v = 2;
                if (i == j && k < 9) v = 3;
                if ((i * 7919 + j * 104729 + k * 1299709) % 9973 == 0) v = 1;
            }
        }
    }
    return volume;
}

bool same(const std::vector<float>& a, const std::vector<float>& b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}

std::vector<float> plain(const SparseBox& box) {
    std::vector<float> out;
    to_plain(box, &out);
    return out;
}

const Int3 kSizes[] = {{70, 40, 36}, {64, 33, 41}, {15, 40, 30}, {1, 40, 30}, {97, 1, 30}};

TEST(SparseBox, DistancesAreThoseOfPlainValues) {
    for (const Int3 size : kSizes) {
        for (const Vector3 spacing : {Vector3{1, 1, 1}, Vector3{0.3, 0.7, 0.9}}) {
            const LabelVolume volume = scene(size, spacing);
            for (const double limit_mm : {2.0, 7.4, 40.0}) {
                LabelSet labels = one_label(1);
                labels.set(3);
                const VoxelBox whole{{0, 0, 0}, size};
                const VoxelBox part{{size.x / 3, size.y / 4, 5},
                                    {size.x - size.x / 3, size.y - size.y / 4, size.z - 8}};
                for (const VoxelBox& box : {whole, part}) {
                    std::vector<float> expected;
                    signed_distance(volume, labels, box, limit_mm, {true, true, true}, &expected);
                    SparseBox out, a, b, c;
                    sparse_distance(volume, labels, box, limit_mm, &out, {&a, &b, &c});
                    EXPECT_TRUE(same(plain(out), expected)) << size.x << " " << limit_mm;
                }
            }
        }
    }
}

TEST(SparseBox, SmoothingIsThatOfPlainValues) {
    for (const Int3 size : kSizes) {
        const LabelVolume volume = scene(size, {1, 1, 1});
        const VoxelBox box{{0, 0, 0}, size};
        SparseBox raw, out, scratch, c;
        sparse_distance(volume, one_label(2), box, 4, &raw, {&out, &scratch, &c});
        for (const int stride : {1, 2}) {
            BoxKernels kernels;
            for (std::size_t a = 0; a < 3; ++a) {
                kernels.taps[a] = smoothing_kernel(0.9 + 0.4 * static_cast<double>(a), 1.0 / 3);
                kernels.stride[a] = stride;
            }
            std::vector<float> expected = plain(raw), more;
            smooth_box(box, kernels, &expected, &more);
            smooth_sparse(raw, kernels, &out, &scratch);
            EXPECT_TRUE(same(plain(out), expected)) << size.x << " " << stride;
            kernels.taps[1].clear();
            expected = plain(raw);
            smooth_box(box, kernels, &expected, &more);
            smooth_sparse(raw, kernels, &out, &scratch);
            EXPECT_TRUE(same(plain(out), expected)) << size.x << " along two axes";
        }
    }
}

TEST(SparseBox, FarFromSurfacesNothingIsStored) {
    const LabelVolume volume = scene({200, 60, 60}, {1, 1, 1});
    SparseBox out, a, b, c;
    sparse_distance(volume, one_label(2), {{0, 0, 0}, {200, 60, 60}}, 3, &out, {&a, &b, &c});
    std::size_t stored = 0;
    for (const std::uint32_t state : out.states()) stored += SparseBox::stored(state);
    EXPECT_GT(stored, 0u);
    EXPECT_LT(stored * 16, out.states().size());
}

TEST(SparseBox, PartsAreCutOutAtAnyNode) {
    const Int3 size{70, 40, 36};
    const LabelVolume volume = scene(size, {1, 1, 1});
    const VoxelBox box{{3, 2, 1}, {60, 36, 30}};
    SparseBox in, out, b, c;
    sparse_distance(volume, one_label(1), box, 3, &in, {&out, &b, &c});
    const std::vector<float> all = plain(in);
    EXPECT_TRUE(same(all, plain(in)));
    for (int shift = 0; shift < 20; ++shift) {
        const VoxelBox part{{3 + shift, 4, 5}, {60 - shift - shift % 3, 30, 20}};
        std::vector<float> expected;
        crop(box, all, part, &expected);
        crop(in, part, &out);
        EXPECT_TRUE(same(plain(out), expected)) << shift;
    }
    SparseBox again;
    to_sparse(box, all, in.high(), in.low(), &again);
    EXPECT_TRUE(same(plain(again), all));
}

// The part that is computed is the same as if everything were.
TEST(SparseBox, NeededBlocksHoldWhatTheWholeHolds) {
    const Int3 size{90, 50, 60};
    const LabelVolume volume = scene(size, {1, 1, 1});
    const VoxelBox box{{5, 3, 2}, {80, 45, 55}};
    SparseBox raw, whole, some, scratch, c;
    sparse_distance(volume, one_label(1), box, 6, &raw, {&whole, &some, &scratch});
    BoxKernels kernels;
    for (std::size_t a = 0; a < 3; ++a) kernels.taps[a] = smoothing_kernel(1.7);
    smooth_sparse(raw, kernels, &whole, &scratch);
    for (const int edge : {4, 8, 16}) {
        NodeBlocks blocks{edge, {{16, 16, 0}, {48, 32, 32}}};
        const Int3 margin{3, 5, 2};
        smooth_sparse(raw, kernels, &some, &scratch, &blocks, margin);
        for (const Int3 first : blocks.first) {
            for (int k = first.z - 1 - margin.z; k < first.z + edge + 2 + margin.z; ++k) {
                for (int j = first.y - 1 - margin.y; j < first.y + edge + 2 + margin.y; ++j) {
                    for (int i = first.x - 1 - margin.x; i < first.x + edge + 2 + margin.x; ++i) {
                        const Int3 at{i - box.first.x, j - box.first.y, k - box.first.z};
                        if (at.x < 0 || at.y < 0 || at.z < 0 || at.x >= box.size.x ||
                            at.y >= box.size.y || at.z >= box.size.z)
                            continue;
                        ASSERT_EQ(some.value(at.x, at.y, at.z), whole.value(at.x, at.y, at.z));
                    }
                }
            }
        }
    }
}

}  // namespace
}  // namespace sonocase::pipeline
