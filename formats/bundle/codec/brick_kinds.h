// SPDX-License-Identifier: Apache-2.0

// What the bytes of `vox.kind` and `ofs.kind` say about a brick: kinds by layer, positions of
// bricks in pools, values of uniform bricks, and small functions that packing and unpacking share.
// docs/format.md, part 2. For the .cpp files of formats/ only.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "formats/base/jobs.h"
#include "formats/bundle/codec/packed_blocks.h"
#include "formats/volume/brick_volume.h"

namespace sonocase::detail {

// `vox.kind`: labels in bits 0 and 1, number of patches in bits 2 to 4, and bit 5 is set if some of
// its records differ from what the patches say.
enum LabelKind : unsigned { kAsBefore = 0, kOneLabel = 1, kMixedLabels = 2, kSidesOfPatch = 3 };
inline constexpr unsigned kCorrected = 32, kKinds = 64;
inline unsigned label_kind(unsigned kind) {
    return kind & 3u;
}
inline std::size_t patch_count(unsigned kind) {
    return kind >> 2 & 7u;
}
inline bool corrected(unsigned kind) {
    return (kind & kCorrected) != 0;
}
inline bool has_records(unsigned kind) {
    return kind >> 2 != 0;
}

// `ofs.kind`, for the echo offsets.
enum OffsetKind : unsigned { kOffsetAsBefore = 0, kOneOffset = 1, kMixedOffsets = 2, kCells = 3 };
inline constexpr unsigned kOffsetKinds = 4;

inline std::size_t layer_bricks(Int3 bricks) {
    return static_cast<std::size_t>(bricks.x) * static_cast<std::size_t>(bricks.y);
}

template <class T>
void brick_values(const BrickVolume<T>& volume, std::size_t brick, T* out) {
    const std::uint32_t entry = volume.table[brick];
    if (entry & kUniformBrick) {
        std::fill(out, out + kBrickVoxels, volume.uniform[entry & ~kUniformBrick]);
    } else {
        std::copy_n(volume.pool.begin() + static_cast<std::ptrdiff_t>(entry) * kBrickVoxels,
                    kBrickVoxels, out);
    }
}

template <class T>
bool all_alike(const T* values) {
    return std::all_of(values, values + kBrickVoxels, [&](T v) { return v == values[0]; });
}

template <class T>
void append(std::vector<T>& to, const std::vector<T>& from) {
    to.insert(to.end(), from.begin(), from.end());
}

// How many bricks of each kind a layer has.
class LayerKinds {
  public:
    LayerKinds(std::span<const std::uint8_t> kinds, std::size_t layer_bricks, JobRunner& jobs)
        : kinds_(kinds), layer_(layer_bricks), counts_(layer_ ? kinds.size() / layer_ : 0) {
        jobs.run(counts_.size(), [&](std::size_t k) {
            // Four counts in turn: most bricks are like their neighbour, and one counter would wait
            // for its own last increment.
            std::array<std::array<std::uint32_t, 256>, 4> parts{};
            const auto kinds_here = kinds_.subspan(k * layer_, layer_);
            for (std::size_t b = 0; b < layer_; ++b) ++parts[b % 4][kinds_here[b]];
            for (std::size_t v = 0; v < 256; ++v)
                counts_[k][v] = parts[0][v] + parts[1][v] + parts[2][v] + parts[3][v];
        });
    }
    std::size_t count(std::size_t layer, unsigned kind) const { return counts_[layer][kind]; }
    // Whether the layer's first uniform brick takes the value of "the one before". value_of: 0 for
    // such a kind, 1 for a kind with a value of its own, more for bricks that are not uniform.
    template <class ValueOf>
    bool begins_as_before(std::size_t layer, ValueOf value_of) const {
        for (const std::uint8_t kind : kinds_.subspan(layer * layer_, layer_)) {
            if (value_of(kind) <= 1) return value_of(kind) == 0;
        }
        return false;
    }

  private:
    std::span<const std::uint8_t> kinds_;
    std::size_t layer_;
    std::vector<std::array<std::uint32_t, 256>> counts_;
};

// Positions of bricks in a pool that is sorted by blocks, so that what is needed together is stored
// together.
class PoolOrder {
  public:
    // stored: whether a brick of that kind is in the pool.
    template <class Stored>
    PoolOrder(std::span<const std::uint8_t> kinds,
              const BlockGrid& grid,
              JobRunner& jobs,
              Stored stored)
        : grid_(grid), columns_(columns_of(grid)), at_(layers() * columns_) {
        jobs.run(layers(), [&](std::size_t k) {
            const std::uint8_t* kind = kinds.data() + k * layer_bricks(grid_.bricks);
            for (int j = 0; j < grid_.bricks.y; ++j, kind += grid_.bricks.x) {
                for (int first = 0; first < grid_.bricks.x; first += grid_.edge) {
                    std::uint32_t n = 0;
                    for (int i = first; i < std::min(first + grid_.edge, grid_.bricks.x); ++i)
                        n += stored(kind[i]);
                    at_[k * columns_ + column(first, j)] += n;
                }
            }
        });
        const auto edge = static_cast<std::size_t>(grid_.edge);
        for (std::size_t first = 0; first < layers(); first += edge) {
            for (std::size_t c = 0; c < columns_; ++c) {
                for (std::size_t k = first; k < std::min(first + edge, layers()); ++k) {
                    const std::uint32_t n = at_[k * columns_ + c];
                    at_[k * columns_ + c] = total_;
                    total_ += n;
                }
            }
        }
    }
    std::size_t total() const { return total_; }
    // A row of a layer's bricks; next() is called in the order of the bricks.
    class Row {
      public:
        Row(std::uint32_t* next, int edge) : next_(next), edge_(edge), end_(edge) {}
        std::uint32_t next(int i) {  // position of brick i of the row
            for (; i >= end_; end_ += edge_) ++next_;
            return (*next_)++;
        }

      private:
        std::uint32_t* next_;  // next position in the block of the last brick
        int edge_, end_;
    };
    Row row(std::size_t layer, int j) {
        return {at_.data() + layer * columns_ + column(0, j), grid_.edge};
    }

  private:
    static std::size_t columns_of(const BlockGrid& grid) {
        const Int3 n = grid.blocks();
        return static_cast<std::size_t>(n.x) * static_cast<std::size_t>(n.y);
    }
    std::size_t layers() const { return static_cast<std::size_t>(grid_.bricks.z); }
    std::size_t column(int i, int j) const {
        return static_cast<std::size_t>(i / grid_.edge + grid_.blocks().x * (j / grid_.edge));
    }
    BlockGrid grid_;
    std::size_t columns_;
    std::vector<std::uint32_t> at_;  // next position in each column of blocks of each layer
    std::uint32_t total_ = 0;
};

// The values of uniform bricks in order of first occurrence.
class ValueOrder {
  public:
    void met(std::uint8_t value) {
        if (met_[value]) return;
        met_[value] = true;
        index_[value] = static_cast<std::uint32_t>(values_.size());
        values_.push_back(value);
    }
    const std::vector<std::uint8_t>& values() const { return values_; }
    // Position of a value that was met.
    const std::array<std::uint32_t, 256>& index() const { return index_; }

  private:
    std::vector<std::uint8_t> values_;
    std::array<std::uint32_t, 256> index_{};
    std::array<bool, 256> met_{};
};

}  // namespace sonocase::detail
