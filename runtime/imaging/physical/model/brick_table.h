// SPDX-License-Identifier: Apache-2.0

// The brick tables of a bundle's volumes side by side, so that one cache line holds all words of a
// brick, and ordered block by block, so that the bricks of a frame lie close together. Blocks are
// filled in when frames need them: a fine torso has ten million bricks and a frame meets few.
#pragma once

#include <cstdint>
#include <cstdlib>
#include <memory>
#include <utility>
#include <vector>

#include "formats/base/jobs.h"
#include "formats/base/result.h"
#include "formats/bundle/case_bundle.h"

namespace sonocase::runtime {

// Bit of a brick's label word: the brick holds surfaces.
inline constexpr std::uint32_t kBoundaryFlag = 0x40000000u;

// Bit of a brick's label word: the fine region may hold something else than the brick.
inline constexpr std::uint32_t kRegionFlag = 0x20000000u;

// Marks of the bricks in a box of a volume, x fastest.
struct BrickMarks {
    Int3 lower{0, 0, 0}, size{0, 0, 0};  // bricks
    std::vector<std::uint8_t> marked;    // # product of size; 1: marked

    bool has(Int3 brick) const {
        const Int3 b{brick.x - lower.x, brick.y - lower.y, brick.z - lower.z};
        if (b.x < 0 || b.y < 0 || b.z < 0 || b.x >= size.x || b.y >= size.y || b.z >= size.z)
            return false;
        return marked[b.x + size.x * (b.y + size.y * static_cast<std::size_t>(b.z))] != 0;
    }
};

class BrickTable {
  public:
    static constexpr int kWords = 4;  // per brick: label, echo, boundary, unused

    BrickTable() = default;
    // Nothing is filled in yet. The bundle must outlive the table. Error: too little memory.
    static Result<BrickTable> create(const CaseBundle& bundle);
    // Makes the table from volumes, which must outlive it. echo, boundary: null or empty where
    // there are none.
    static Result<BrickTable> create(const BrickVolume<std::uint8_t>& labels,
                                     const BrickVolume<std::int8_t>* echo,
                                     const BrickVolume<std::uint32_t>* boundary);

    // Sets kRegionFlag in the label words of these bricks. Call it before anything is filled in.
    void mark(BrickMarks marks) { marks_ = std::move(marks); }

    // Word w of brick (x, y, z) is data()[kWords * ((block << 3 * edge_log2()) + brick) + w];
    // blocks, and the bricks of a block, lie x fastest. A uniform label word is kUniformBrick |
    // label, a uniform echo word kUniformBrick | (offset & 0xFF), a boundary word kUniformBrick
    // where the brick holds no interface. Bricks of a block that is not filled in, and beyond the
    // volume, hold 0.
    const std::uint32_t* data() const { return words_.get(); }
    int edge_log2() const { return edge_log2_; }           // log2 of a block's edge in bricks
    int edge() const { return kBrickEdge << edge_log2_; }  // a block's edge in voxels
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

    BrickMarks marks_;
    const BrickVolume<std::uint8_t>* labels_ = nullptr;
    const BrickVolume<std::int8_t>* echo_ = nullptr;
    const BrickVolume<std::uint32_t>* boundary_ = nullptr;
    Int3 bricks_{0, 0, 0}, blocks_{0, 0, 0};
    int edge_log2_ = 3;
    bool has_echo_ = false, has_boundary_ = false;
    std::unique_ptr<std::uint32_t[], Free> words_;
    std::size_t bytes_ = 0;
    std::vector<std::uint8_t> is_loaded_;  // per block
    std::size_t left_ = 0;                 // blocks not yet filled in
};

}  // namespace sonocase::runtime
