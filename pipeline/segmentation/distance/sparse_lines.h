// SPDX-License-Identifier: Apache-2.0

// Walks the runs of a sparse box along y or z. Internal to sparse_distance.cpp and
// sparse_smoothing.cpp.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "pipeline/segmentation/distance/sparse_box.h"

namespace sonocase::pipeline {

// Lines of runs along an axis: `sheets` times `lines` lines of `width` runs, one after another.
struct SparseLines {
    std::size_t sheets, width;
    int lines;
    SparseLines(const SparseBox& box, int axis) {
        const Int3 n = box.box().size;
        const auto runs = static_cast<std::size_t>(box.runs());
        sheets = axis == 1 ? static_cast<std::size_t>(n.z) : 1;
        width = axis == 1 ? runs : runs * static_cast<std::size_t>(n.y);
        lines = n[axis];
    }
};

// How many runs of a state lie within `reach` lines, as the lines are gone through.
class RunCounts {
  public:
    RunCounts(std::uint32_t state, const SparseLines& lines, int reach)
        : state_(state), lines_(lines), reach_(reach) {}
    void begin(const std::uint32_t* sheet) {
        sheet_ = sheet;
        counts_.assign(lines_.width, 0);
        for (int l = 0; l < std::min(reach_, lines_.lines); ++l) add(l, 1);
    }
    // To line `l`, one after another from 0.
    void move_to(int l) {
        if (l + reach_ < lines_.lines) add(l + reach_, 1);
        if (l - reach_ - 1 >= 0) add(l - reach_ - 1, -1);
        all_ = std::min(lines_.lines - 1, l + reach_) - std::max(0, l - reach_) + 1;
    }
    bool all(std::size_t w) const { return counts_[w] == all_; }

  private:
    void add(int line, int sign) {
        const std::uint32_t* states = sheet_ + static_cast<std::size_t>(line) * lines_.width;
        for (std::size_t w = 0; w < lines_.width; ++w) counts_[w] += states[w] == state_ ? sign : 0;
    }
    std::uint32_t state_;
    const SparseLines& lines_;
    int reach_, all_ = 0;
    const std::uint32_t* sheet_ = nullptr;
    std::vector<int> counts_;
};

}  // namespace sonocase::pipeline
