// SPDX-License-Identifier: Apache-2.0

#include <algorithm>

#include "pipeline/segmentation/distance/sparse_lines.h"
#include "pipeline/segmentation/distance/widest.h"

namespace sonocase::pipeline {
namespace {

constexpr int kRun = SparseBox::kRun;

typedef float Sixteen __attribute__((vector_size(64)));
static_assert(sizeof(Sixteen) == kRun * sizeof(float));

// What becomes of a number that all taps meet: the sum in their order.
float weighed(const std::vector<float>& kernel, float number) {
    float sum = 0;
    for (const float k : kernel) sum += k * number;
    return sum;
}

// Along y or z.
SONOCASE_WIDEST void smooth_lines(const SparseBox& in,
                                  int axis,
                                  const std::vector<float>& kernel,
                                  int stride,
                                  const WantedRuns& wanted,
                                  SparseBox* out) {
    const SparseLines lines(in, axis);
    const auto runs = static_cast<std::size_t>(in.runs());
    const int half = static_cast<int>(kernel.size() / 2);
    RunCounts highs(SparseBox::kHigh, lines, half * stride),
        lows(SparseBox::kLow, lines, half * stride);
    const std::size_t taps = kernel.size();
    const float* weights = kernel.data();
    std::vector<const std::uint32_t*> tap(taps);
    const float* values = in.values(0);
    for (std::size_t sheet = 0; sheet < lines.sheets; ++sheet) {
        const std::size_t first = sheet * lines.width * static_cast<std::size_t>(lines.lines);
        const std::uint32_t* states = in.states().data() + first;
        highs.begin(states);
        lows.begin(states);
        for (int l = 0; l < lines.lines; ++l) {
            highs.move_to(l);
            lows.move_to(l);
            for (int m = -half; m <= half; ++m) {
                const int at = std::clamp(l + m * stride, 0, lines.lines - 1);
                tap[static_cast<std::size_t>(m + half)] =
                    states + static_cast<std::size_t>(at) * lines.width;
            }
            std::uint32_t* to =
                out->states().data() + first + static_cast<std::size_t>(l) * lines.width;
            for (std::size_t w = 0; w < lines.width; w += runs) {
                const std::uint8_t* keep = axis == 1 ? wanted.row(l, static_cast<int>(sheet))
                                                     : wanted.row(static_cast<int>(w / runs), l);
                for (std::size_t r = w; r < w + runs; ++r) {
                    if (highs.all(r) || (keep != nullptr && !keep[r - w])) continue;
                    if (lows.all(r)) {
                        to[r] = SparseBox::kLow;
                        continue;
                    }
                    to[r] = out->add(1);
                    Sixteen sum{}, v;
                    for (std::size_t m = 0; m < taps; ++m) {
                        __builtin_memcpy(&v, values + std::size_t{kRun} * tap[m][r], sizeof v);
                        sum += weights[m] * v;
                    }
                    __builtin_memcpy(out->at(to[r]), &sum, sizeof sum);
                }
            }
        }
    }
}

// Along x. Rows are first laid out with their neighbours, many at a time, since values that have
// just been written are slow to read across their borders.
class RowLayout {
  public:
    struct Span {
        std::size_t padded;  // place of its first node
        std::uint32_t place, count;
    };
    RowLayout(const SparseBox& in, int reach) : in_(in), beside_((reach + kRun - 1) / kRun) {}

    void clear() {
        spans_.clear();
        used_ = 0;
    }
    void add_row(const std::uint32_t* row,
                 const std::uint8_t* keep,
                 std::uint32_t* to,
                 SparseBox* out) {
        const int runs = in_.runs();
        const auto kept = [&](int r) { return keep == nullptr || keep[r]; };
        for (int r = 0; r < runs;) {
            if (kept(r)) to[r] = common(row, r);
            if (!kept(r) || to[r] != kSeveral) {
                ++r;
                continue;
            }
            int end = r + 1;
            while (end < runs && kept(end) && common(row, end) == kSeveral) ++end;
            const auto count = static_cast<std::uint32_t>(end - r);
            const std::uint32_t place = out->add(count);
            for (std::uint32_t q = 0; q < count; ++q) to[r + static_cast<int>(q)] = place + q;
            spans_.push_back({used_ + static_cast<std::size_t>(beside_ * kRun), place, count});
            pad(row, r, end);
            r = end;
        }
    }
    const std::vector<Span>& spans() const { return spans_; }
    const float* padded() const { return padded_.data(); }

  private:
    static constexpr std::uint32_t kSeveral = SparseBox::kLow + 1;
    // The state of all runs that the taps of run r meet, if it is the same number.
    std::uint32_t common(const std::uint32_t* row, int r) const {
        const std::uint32_t state = row[r];
        if (SparseBox::stored(state)) return kSeveral;
        const int last = std::min(in_.runs() - 1, r + beside_);
        for (int q = std::max(0, r - beside_); q <= last; ++q)
            if (row[q] != state) return kSeveral;
        return state;
    }
    // Runs [first, end) and what lies beside them; the row's ends are repeated.
    void pad(const std::uint32_t* row, int first, int end) {
        const std::size_t begin = used_;
        used_ += static_cast<std::size_t>((end - first + 2 * beside_) * kRun);
        if (used_ > padded_.size()) padded_.resize(2 * used_);
        const int runs = in_.runs(), last = (in_.box().size.x - 1) % kRun;
        float* to = padded_.data() + begin;
        for (int q = first - beside_; q < end + beside_; ++q, to += kRun) {
            if (q < 0) {
                std::fill_n(to, kRun, in_.values(row[0])[0]);
            } else if (q >= runs) {
                std::fill_n(to, kRun, in_.values(row[runs - 1])[last]);
            } else {
                __builtin_memcpy(to, in_.values(row[q]), sizeof(Sixteen));
                if (q == runs - 1) std::fill(to + last + 1, to + kRun, to[last]);
            }
        }
    }

    const SparseBox& in_;
    int beside_;  // runs that the reach touches
    std::vector<float> padded_;
    std::size_t used_ = 0;
    std::vector<Span> spans_;
};

SONOCASE_WIDEST void smooth_rows(const SparseBox& in,
                                 const std::vector<float>& kernel,
                                 int stride,
                                 const WantedRuns& wanted,
                                 SparseBox* out) {
    constexpr int kRows = 32;  // at a time
    const std::size_t taps = kernel.size();
    const float* weights = kernel.data();
    const std::ptrdiff_t reach = static_cast<std::ptrdiff_t>(taps / 2) * stride;
    RowLayout layout(in, static_cast<int>(reach));
    const Int3 n = in.box().size;
    for (int k = 0; k < n.z; ++k) {
        for (int first = 0; first < n.y; first += kRows) {
            layout.clear();
            for (int j = first; j < std::min(n.y, first + kRows); ++j) {
                const std::size_t row = in.run_index(0, j, k);
                layout.add_row(in.states().data() + row, wanted.row(j, k),
                               out->states().data() + row, out);
            }
            for (const RowLayout::Span& span : layout.spans()) {
                const float* from = layout.padded() + span.padded - reach;
                float* to = out->at(span.place);
                for (std::uint32_t q = 0; q < span.count; ++q, from += kRun, to += kRun) {
                    Sixteen sum{}, v;
                    for (std::size_t m = 0; m < taps; ++m) {
                        __builtin_memcpy(&v, from + static_cast<std::ptrdiff_t>(m) * stride,
                                         sizeof v);
                        sum += weights[m] * v;
                    }
                    __builtin_memcpy(to, &sum, sizeof sum);
                }
            }
        }
    }
}

}  // namespace

void smooth_sparse(const SparseBox& in,
                   const BoxKernels& kernels,
                   SparseBox* out,
                   SparseBox* scratch,
                   const NodeBlocks* blocks,
                   Int3 margin) {
    const SparseBox* from = &in;
    if (kernels.empty()) {
        crop(in, in.box(), out);
        return;
    }
    margin.y += kernels.reach(1);  // of what the passes along y and z need of the one along x
    margin.z += kernels.reach(2);
    for (std::size_t a = 0; a < 3; ++a) {
        const int axis = static_cast<int>(a);
        if (a > 0) margin[axis] -= kernels.reach(axis);
        const std::vector<float>& kernel = kernels.taps[a];
        if (kernel.empty()) continue;
        const WantedRuns wanted =
            blocks != nullptr ? WantedRuns(*blocks, margin, in.box()) : WantedRuns();
        out->begin(in.box(), weighed(kernel, from->high()), weighed(kernel, from->low()));
        if (a == 0) {
            smooth_rows(*from, kernel, kernels.stride[a], wanted, out);
        } else {
            smooth_lines(*from, axis, kernel, kernels.stride[a], wanted, out);
        }
        out->swap(*scratch);
        from = scratch;
    }
    out->swap(*scratch);
}

}  // namespace sonocase::pipeline
