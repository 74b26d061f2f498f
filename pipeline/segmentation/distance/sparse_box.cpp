// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/distance/sparse_box.h"

#include <algorithm>

namespace sonocase::pipeline {

void SparseBox::begin(const VoxelBox& box, float high, float low) {
    box_ = box;
    runs_ = (box.size.x + kRun - 1) / kRun;
    states_.assign(box.empty() ? 0 : run_index(0, 0, box.size.z), kHigh);
    if (states_.size() + 2 > room_) {
        pool_.reset();
        room_ = states_.size() + 2;
        pool_ = std::make_unique_for_overwrite<float[]>(room_ * kRun);
    }
    std::fill_n(pool_.get(), kRun, high);
    std::fill_n(pool_.get() + kRun, kRun, low);
    used_ = 2;
}

void SparseBox::copy(const SparseBox& other) {
    begin(other.box_, other.high(), other.low());
    states_ = other.states_;
    used_ = other.used_;
    std::copy_n(other.pool_.get(), std::size_t{kRun} * used_, pool_.get());
}

float* SparseBox::open(std::size_t run) {
    std::uint32_t& state = states_[run];
    if (!stored(state)) {
        const float number = state == kHigh ? high() : low();
        state = add(1);
        std::fill_n(at(state), kRun, number);
    }
    return at(state);
}

void to_sparse(
    const VoxelBox& box, const std::vector<float>& values, float high, float low, SparseBox* out) {
    constexpr int kRun = SparseBox::kRun;
    out->begin(box, high, low);
    std::size_t run = 0;
    for (std::size_t row = 0; row < values.size(); row += static_cast<std::size_t>(box.size.x)) {
        for (int i = 0; i < box.size.x; i += kRun, ++run) {
            const float* from = values.data() + row + i;
            const int count = std::min(kRun, box.size.x - i);
            const auto all = [&](float number) {
                return std::all_of(from, from + count, [&](float v) { return v == number; });
            };
            if (all(high)) continue;
            if (all(low)) {
                out->states()[run] = SparseBox::kLow;
            } else {
                std::copy_n(from, count, out->open(run));
            }
        }
    }
}

void to_plain(const SparseBox& in, std::vector<float>* out) {
    constexpr int kRun = SparseBox::kRun;
    const VoxelBox& box = in.box();
    out->resize(box.count());
    std::size_t run = 0;
    for (std::size_t row = 0; row < out->size(); row += static_cast<std::size_t>(box.size.x)) {
        for (int i = 0; i < box.size.x; i += kRun, ++run)
            std::copy_n(in.values(in.states()[run]), std::min(kRun, box.size.x - i),
                        out->data() + row + i);
    }
}

void crop(const SparseBox& in, const VoxelBox& part, SparseBox* out) {
    constexpr int kRun = SparseBox::kRun;
    if (part.first == in.box().first && part.size == in.box().size) {
        out->copy(in);
        return;
    }
    out->begin(part, in.high(), in.low());
    const Int3 shift{part.first.x - in.box().first.x, part.first.y - in.box().first.y,
                     part.first.z - in.box().first.z};
    const int within = shift.x % kRun, last = in.runs() - 1;
    std::size_t run = 0;
    for (int k = 0; k < part.size.z; ++k) {
        for (int j = 0; j < part.size.y; ++j) {
            const std::uint32_t* from =
                in.states().data() + in.run_index(0, j + shift.y, k + shift.z);
            for (int r = 0; r < out->runs(); ++r, ++run) {
                const int at = shift.x / kRun + r;
                const std::uint32_t here = from[at],
                                    next = within > 0 ? from[std::min(at + 1, last)] : here;
                if (here == next && !SparseBox::stored(here)) {
                    out->states()[run] = here;
                    continue;
                }
                const std::uint32_t place = out->states()[run] = out->add(1);
                if (SparseBox::stored(here) && (within == 0 || next == here + 1)) {
                    std::copy_n(in.values(here) + within, kRun, out->at(place));
                    continue;
                }
                std::copy_n(in.values(here) + within, kRun - within, out->at(place));
                std::copy_n(in.values(next), within, out->at(place) + kRun - within);
            }
        }
    }
}

WantedRuns::WantedRuns(const NodeBlocks& blocks, Int3 margin, const VoxelBox& box)
    : edge_(blocks.edge), first_(box.first) {
    Int3 count;
    for (int a = 0; a < 3; ++a) {
        cells_[a] = box.first[a] / edge_;
        count[a] = (box.first[a] + box.size[a] - 1) / edge_ - cells_[a] + 1;
    }
    const auto nx = static_cast<std::size_t>(count.x), ny = static_cast<std::size_t>(count.y);
    std::vector<std::uint8_t> near(nx * ny * static_cast<std::size_t>(count.z));
    Int3 beside;  // blocks within the margin, and within two nodes of a block's neighbours
    for (int a = 0; a < 3; ++a) beside[a] = (margin[a] + 2 + edge_ - 1) / edge_;
    for (const Int3 first : blocks.first) {
        Int3 low, high;
        for (int a = 0; a < 3; ++a) {
            const int at = first[a] / edge_ - cells_[a];
            low[a] = std::max(0, at - beside[a]);
            high[a] = std::min(count[a] - 1, at + beside[a]);
        }
        for (int z = low.z; z <= high.z; ++z) {
            for (int y = low.y; y <= high.y; ++y) {
                const std::size_t row =
                    nx * (static_cast<std::size_t>(y) + ny * static_cast<std::size_t>(z));
                for (int x = low.x; x <= high.x; ++x) near[row + static_cast<std::size_t>(x)] = 1;
            }
        }
    }
    runs_ = static_cast<std::size_t>((box.size.x + SparseBox::kRun - 1) / SparseBox::kRun);
    rows_ = ny;
    wanted_.assign(runs_ * ny * static_cast<std::size_t>(count.z), 0);
    for (std::size_t row = 0; row < near.size() / nx; ++row) {
        for (std::size_t r = 0; r < runs_; ++r) {
            const int from = box.first.x + static_cast<int>(r) * SparseBox::kRun;
            const int to = std::min(from + SparseBox::kRun, box.first.x + box.size.x) - 1;
            for (int x = from / edge_; x <= to / edge_; ++x)
                wanted_[row * runs_ + r] |= near[row * nx + static_cast<std::size_t>(x - cells_.x)];
        }
    }
}

}  // namespace sonocase::pipeline
