// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstring>

#include "pipeline/segmentation/distance/sparse_lines.h"
#include "pipeline/segmentation/distance/widest.h"

namespace sonocase::pipeline {
namespace {

constexpr int kRun = SparseBox::kRun;
constexpr unsigned kFull = (1u << kRun) - 1;

// Which nodes of a row belong to the labels: one bit per node, one number per run.
void mark_row(const std::uint8_t* row,
              int count,
              const std::array<std::uint8_t, 256>& member,
              std::vector<unsigned>* marks) {
    for (std::size_t r = 0; r < marks->size(); ++r, row += kRun) {
        const int nodes = std::min(kRun, count - static_cast<int>(r) * kRun);
        if (std::memcmp(row, row + 1, static_cast<std::size_t>(nodes - 1)) == 0) {
            (*marks)[r] = member[row[0]] ? kFull >> (kRun - nodes) : 0;
            continue;
        }
        unsigned bits = 0;
        for (int i = 0; i < nodes; ++i) bits |= static_cast<unsigned>(member[row[i]]) << i;
        (*marks)[r] = bits;
    }
}

// Squared distances along x, from one row to the next.
class RowDistances {
  public:
    RowDistances(int count, float spacing, float limit_sq)
        : count_(count), runs_((count + kRun - 1) / kRun), right_(static_cast<std::size_t>(runs_)) {
        float along = 0;  // summed step by step, as a walk along the row would
        for (;; along += spacing) {
            squares_.push_back(std::min(along * along, limit_sq));
            if (squares_.back() == limit_sq) break;
        }
        far_ = static_cast<int>(squares_.size()) - 1;
    }

    // inside: distances to the marked nodes; otherwise to the others.
    void measure(const std::vector<unsigned>& marks, bool inside, std::size_t row, SparseBox* out) {
        const auto bits_of = [&](int r) {
            return inside ? marks[static_cast<std::size_t>(r)]
                          : ~marks[static_cast<std::size_t>(r)] & whole(r);
        };
        bool any = false, all = true;
        for (int r = 0; r < runs_; ++r) {
            any = any || marks[static_cast<std::size_t>(r)] != 0;
            all = all && marks[static_cast<std::size_t>(r)] == whole(r);
        }
        if (inside ? !any : all) return;  // nothing counts
        if (inside ? all : !any) {
            std::fill_n(out->states().data() + row, runs_, SparseBox::kLow);
            return;
        }
        int next = far_;  // from the last node of a run to the next one that counts, nodes
        for (int r = runs_ - 1; r >= 0; --r) {
            right_[static_cast<std::size_t>(r)] = next;
            const unsigned bits = bits_of(r);
            next = bits != 0 ? __builtin_ctz(bits) + 1 : std::min(far_, next + kRun);
        }
        int before = far_;  // from the first node of a run to the last one that counts
        for (int r = 0; r < runs_; ++r) {
            const unsigned bits = bits_of(r);
            const int after = right_[static_cast<std::size_t>(r)];
            std::uint32_t& state = out->states()[row + static_cast<std::size_t>(r)];
            const int nodes = std::min(kRun, count_ - r * kRun);
            if (bits == whole(r)) {
                state = SparseBox::kLow;
            } else if (bits != 0 || before < far_ || after < far_) {
                state = out->add(1);
                fill(bits, before, after, nodes, out->at(state));
            }
            before = bits != 0 ? kRun - 31 + __builtin_clz(bits) : std::min(far_, before + kRun);
        }
    }

  private:
    unsigned whole(int r) const { return kFull >> (kRun - std::min(kRun, count_ - r * kRun)); }
    void fill(unsigned bits, int before, int after, int nodes, float* to) const {
        std::array<int, kRun> steps{};
        for (int i = 0, n = before - 1; i < nodes; ++i)
            steps[static_cast<std::size_t>(i)] = n = bits >> i & 1 ? 0 : n + 1;
        for (int i = nodes - 1, n = after - 1; i >= 0; --i) {
            n = bits >> i & 1 ? 0 : n + 1;
            const int least = std::min({steps[static_cast<std::size_t>(i)], n, far_});
            to[i] = squares_[static_cast<std::size_t>(least)];
        }
        std::fill(to + nodes, to + kRun, 0.0f);
    }
    int count_, runs_, far_ = 0;  // far_: steps from which a distance is the limit
    std::vector<float> squares_;
    std::vector<int> right_;  // per run
};

// One more axis, y or z: the least of the lines' squared distances plus the squared way to them.
SONOCASE_WIDEST void line_distances(
    const SparseBox& in, int axis, float spacing, float limit_sq, SparseBox* out) {
    typedef float Sixteen __attribute__((vector_size(64)));
    const SparseLines lines(in, axis);
    const int reach = static_cast<int>(std::sqrt(limit_sq) / spacing);
    RunCounts highs(SparseBox::kHigh, lines, reach);
    out->begin(in.box(), in.high(), in.low());
    const float* values = in.values(0);
    for (std::size_t sheet = 0; sheet < lines.sheets; ++sheet) {
        const std::size_t first = sheet * lines.width * static_cast<std::size_t>(lines.lines);
        const std::uint32_t* states = in.states().data() + first;
        highs.begin(states);
        for (int l = 0; l < lines.lines; ++l) {
            highs.move_to(l);
            const std::size_t line = static_cast<std::size_t>(l) * lines.width;
            std::uint32_t* to = out->states().data() + first + line;
            const int low = std::max(0, l - reach), high = std::min(lines.lines - 1, l + reach);
            for (std::size_t w = 0; w < lines.width; ++w) {
                if (highs.all(w)) continue;
                const std::uint32_t own = states[line + w];
                if (own == SparseBox::kLow) {
                    to[w] = own;
                    continue;
                }
                Sixteen least, v;
                __builtin_memcpy(&least, in.values(own), sizeof least);
                for (int m = low; m <= high; ++m) {
                    const std::size_t tap = states[static_cast<std::size_t>(m) * lines.width + w];
                    const float along = static_cast<float>(l - m) * spacing;
                    __builtin_memcpy(&v, values + kRun * tap, sizeof v);
                    v += along * along;
                    least = v < least ? v : least;
                }
                to[w] = out->add(1);
                __builtin_memcpy(out->at(to[w]), &least, sizeof least);
            }
        }
    }
}

// phi from squared distances to the labels and to all others.
void to_signed(
    const SparseBox& outside, const SparseBox& inside, float limit, float half, SparseBox* phi) {
    const auto far = std::min(std::sqrt(outside.high()), limit);
    phi->begin(outside.box(), far - half, half - far);
    for (std::size_t r = 0; r < phi->states().size(); ++r) {
        const std::uint32_t out = outside.states()[r], in = inside.states()[r];
        std::uint32_t& state = phi->states()[r];
        if (out == SparseBox::kHigh) continue;
        if (out == SparseBox::kLow && in == SparseBox::kHigh) {
            state = SparseBox::kLow;
            continue;
        }
        state = phi->add(1);
        const float *a = outside.values(out), *b = inside.values(in);
        float* to = phi->at(state);
        for (int i = 0; i < kRun; ++i) {
            const float d = a[i] > 0 ? std::min(std::sqrt(a[i]), limit) - half : 0.0f;
            to[i] = b[i] > 0 ? half - std::min(std::sqrt(b[i]), limit) : d;
        }
    }
}

}  // namespace

void sparse_distance(const LabelVolume& volume,
                     const LabelSet& labels,
                     const VoxelBox& box,
                     double limit_mm,
                     SparseBox* out,
                     std::array<SparseBox*, 3> scratch) {
    assert(limit_mm > 0);
    std::array<std::uint8_t, 256> member;
    for (std::size_t l = 0; l < member.size(); ++l) member[l] = labels[l];
    const Vector3 h = volume.grid.spacing_mm;
    double sum = 0;
    for (int a = 0; a < 3; ++a) sum += h[a];
    const float half = static_cast<float>(0.5 * sum / 3);
    const float limit = static_cast<float>(limit_mm) + half, limit_sq = limit * limit;
    auto& [outside, inside, other] = scratch;
    outside->begin(box, limit_sq, 0);
    inside->begin(box, limit_sq, 0);
    RowDistances rows(box.size.x, static_cast<float>(h.x), limit_sq);
    std::vector<unsigned> marks(static_cast<std::size_t>(outside->runs()));
    for (int k = 0; k < box.size.z; ++k) {
        for (int j = 0; j < box.size.y; ++j) {
            mark_row(volume.voxels.data() +
                         volume.grid.index(box.first.x, box.first.y + j, box.first.z + k),
                     box.size.x, member, &marks);
            const std::size_t row = outside->run_index(0, j, k);
            rows.measure(marks, true, row, outside);
            rows.measure(marks, false, row, inside);
        }
    }
    for (SparseBox* squares : {outside, inside}) {
        for (const int axis : {1, 2}) {
            line_distances(*squares, axis, static_cast<float>(h[axis]), limit_sq, other);
            squares->swap(*other);
        }
    }
    to_signed(*outside, *inside, limit, half, out);
}

}  // namespace sonocase::pipeline
