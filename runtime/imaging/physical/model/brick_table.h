// SPDX-License-Identifier: Apache-2.0

// The brick tables of a bundle's volumes side by side, so that one cache line holds all words of a
// brick, and ordered block by block, so that the bricks of a frame lie close together. Blocks are
// filled in as frames need them: a fine torso has ten million bricks and a frame meets few.
#pragma once

#include <cstdint>
#include <cstdlib>
#include <memory>
#include <vector>

#include "formats/base/jobs.h"
#include "formats/base/result.h"
#include "formats/bundle/case_bundle.h"

namespace sonocase::runtime {

// In a brick's label word: it holds surfaces.
inline constexpr std::uint32_t kBoundaryFlag = 0x40000000u;

class BrickTable {
  public:
    static constexpr int kWords = 4;  // per brick: label, echo, boundary, unused

    BrickTable() = default;
    // Nothing is filled in yet. The bundle must outlive the table. Error: too little memory.
    static Result<BrickTable> create(const CaseBundle& bundle);

    // Word w of brick (x, y, z) is data()[kWords * ((block << 3 * edge_log2()) + brick) + w];
    // blocks, and the bricks of a block, lie x fastest. A uniform label word is kUniformBrick |
    // label, a uniform echo word kUniformBrick | (offset & 0xFF), a boundary word kUniformBrick
    // where the brick holds no interface. Bricks of a block that is not filled in, and beyond the
    // volume, hold 0.
    const std::uint32_t* data() const { return words_.get(); }
    int edge_log2() const { return edge_log2_; }           // of a block, in bricks
    int edge() const { return kBrickEdge << edge_log2_; }  // of a block, in voxels
    Int3 blocks() const { return blocks_; }
    bool has_echo() const { return has_echo_; }
    bool has_boundary() const { return has_boundary_; }

    // Fills in every block for which wanted(lower) is true; lower: its first voxel. Neither
    // allocates nor throws; one caller at a time.
    template <class Wanted>
    void ensure_loaded(const Wanted& wanted) noexcept {
        if (left_ == 0) return;
        std::size_t block = 0;
        for (int z = 0; z < blocks_.z; ++z) {
            for (int y = 0; y < blocks_.y; ++y) {
                for (int x = 0; x < blocks_.x; ++x, ++block) {
                    if (is_loaded_[block]) continue;
                    if (!wanted(Int3{x * edge(), y * edge(), z * edge()})) continue;
                    fill({x, y, z}, block);
                    is_loaded_[block] = 1;
                    --left_;
                }
            }
        }
    }
    void load_all(JobRunner& jobs);  // every block

  private:
    struct Free {
        void operator()(void* memory) const { std::free(memory); }
    };
    void fill(Int3 block, std::size_t number) noexcept;

    const CaseBundle* bundle_ = nullptr;
    Int3 bricks_{0, 0, 0}, blocks_{0, 0, 0};
    int edge_log2_ = 3;
    bool has_echo_ = false, has_boundary_ = false;
    std::unique_ptr<std::uint32_t[], Free> words_;
    std::size_t bytes_ = 0;
    std::vector<std::uint8_t> is_loaded_;  // per block
    std::size_t left_ = 0;                 // blocks not yet filled in
};

}  // namespace sonocase::runtime
