// SPDX-License-Identifier: Apache-2.0

// Values on a box of nodes, most of which are one of two numbers: distances up to a limit, and what
// smoothing makes of them. Rows along x are cut into runs of 16 nodes; a run of one of the two
// numbers takes four bytes, others their values as well. The functions give the values of their
// namesakes on plain vectors (signed_distance.h, box_smoothing.h), bit by bit, in time and memory
// that go with the surface and not with the box.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "pipeline/segmentation/distance/box_smoothing.h"
#include "pipeline/segmentation/distance/signed_distance.h"

namespace sonocase::pipeline::inline segmentation_distance {

class SparseBox {
  public:
    static constexpr int kRun = 16;  // nodes
    // What a run holds: the place of its values. The first two places hold the two numbers.
    static constexpr std::uint32_t kHigh = 0, kLow = 1;
    static bool stored(std::uint32_t state) { return state > kLow; }

    // Empties it. Memory stays for the next box.
    void begin(const VoxelBox& box, float high, float low);
    const VoxelBox& box() const { return box_; }
    float high() const { return values(kHigh)[0]; }
    float low() const { return values(kLow)[0]; }
    int runs() const { return runs_; }  // per row
    std::size_t run_index(int run, int j, int k) const {
        return run +
               static_cast<std::size_t>(runs_) * (j + static_cast<std::size_t>(box_.size.y) * k);
    }
    // One per run, x fastest, then y; all high after begin().
    std::vector<std::uint32_t>& states() { return states_; }
    const std::vector<std::uint32_t>& states() const { return states_; }

    // 16 values; those beyond the end of the row mean nothing.
    const float* values(std::uint32_t state) const {
        return pool_.get() + std::size_t{kRun} * state;
    }
    // Places for the values of `count` runs, one after another; no run twice.
    std::uint32_t add(std::uint32_t count) {
        const std::uint32_t place = used_;
        used_ += count;
        return place;
    }
    float* at(std::uint32_t place) { return pool_.get() + std::size_t{kRun} * place; }
    // The values of a run, to be changed.
    float* open(std::size_t run);
    // The value of a node; i, j, k: relative to the first one.
    float value(int i, int j, int k) const {
        return values(states_[run_index(i / kRun, j, k)])[i % kRun];
    }
    void swap(SparseBox& other) noexcept { std::swap(*this, other); }
    // The same values.
    void copy(const SparseBox& other);

  private:
    VoxelBox box_;
    int runs_ = 0;
    std::vector<std::uint32_t> states_;
    // Room for all runs of the largest box so far: the system gives memory to what is used of it.
    std::unique_ptr<float[]> pool_;
    std::size_t room_ = 0;    // runs
    std::uint32_t used_ = 0;  // runs
};

// Plain values to runs, and back.
void to_sparse(
    const VoxelBox& box, const std::vector<float>& values, float high, float low, SparseBox* out);
void to_plain(const SparseBox& in, std::vector<float>* out);

// The values on `part` of the box, which contains it. out: another box.
void crop(const SparseBox& in, const VoxelBox& part, SparseBox* out);

// Cubes of nodes, all of one size and at multiples of it, in which values are needed, each with one
// node beside it.
struct NodeBlocks {
    int edge = 8;
    std::vector<Int3> first;
};

// The runs of a box that lie within a margin of the blocks. What is computed for them alone means
// nothing in other runs, which are high.
class WantedRuns {
  public:
    WantedRuns() = default;  // all
    WantedRuns(const NodeBlocks& blocks, Int3 margin, const VoxelBox& box);
    // Not 0: the run is wanted; # runs of a row. Null: all are.
    const std::uint8_t* row(int j, int k) const {
        if (edge_ == 0) return nullptr;
        const int y = (first_.y + j) / edge_ - cells_.y, z = (first_.z + k) / edge_ - cells_.z;
        return wanted_.data() +
               runs_ * (static_cast<std::size_t>(y) + rows_ * static_cast<std::size_t>(z));
    }

  private:
    int edge_ = 0;
    Int3 first_, cells_;  // of the box, nodes and blocks
    std::size_t runs_ = 0, rows_ = 0;
    std::vector<std::uint8_t> wanted_;  // per run and row of blocks
};

// smooth_box from `in`, which stays, to `out`; `in`, `out` and `scratch` must differ. blocks,
// margin: where the result is needed; null: everywhere.
void smooth_sparse(const SparseBox& in,
                   const BoxKernels& kernels,
                   SparseBox* out,
                   SparseBox* scratch,
                   const NodeBlocks* blocks = nullptr,
                   Int3 margin = {});

// signed_distance along all axes. scratch: three boxes other than `out`.
void sparse_distance(const LabelVolume& volume,
                     const LabelSet& labels,
                     const VoxelBox& box,
                     double limit_mm,
                     SparseBox* out,
                     std::array<SparseBox*, 3> scratch);

}  // namespace sonocase::pipeline::inline segmentation_distance
