// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/distance/sparse_box.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

#include "pipeline/segmentation/distance/widest.h"

namespace sonocase::pipeline::inline segmentation_distance {

namespace {

// Lines of runs along y or z: `sheets` times `lines` lines of `width` runs, one after another.
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
    // Moves to line `l`; the lines are gone through one after another from 0.
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

}  // namespace

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
        const auto bits_of = [&](int r) { return inside ? marks[r] : ~marks[r] & whole(r); };
        bool any = false, all = true;
        for (int r = 0; r < runs_; ++r) {
            any = any || marks[r] != 0;
            all = all && marks[r] == whole(r);
        }
        if (inside ? !any : all) return;  // nothing counts
        if (inside ? all : !any) {
            std::fill_n(out->states().data() + row, runs_, SparseBox::kLow);
            return;
        }
        int next = far_;  // from the last node of a run to the next one that counts, nodes
        for (int r = runs_ - 1; r >= 0; --r) {
            right_[r] = next;
            const unsigned bits = bits_of(r);
            next = bits != 0 ? __builtin_ctz(bits) + 1 : std::min(far_, next + kRun);
        }
        int before = far_;  // from the first node of a run to the last one that counts
        for (int r = 0; r < runs_; ++r) {
            const unsigned bits = bits_of(r);
            const int after = right_[r];
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
        for (int i = 0, n = before - 1; i < nodes; ++i) steps[i] = n = bits >> i & 1 ? 0 : n + 1;
        for (int i = nodes - 1, n = after - 1; i >= 0; --i) {
            n = bits >> i & 1 ? 0 : n + 1;
            const int lowest = std::min({steps[i], n, far_});
            to[i] = squares_[lowest];
        }
        std::fill(to + nodes, to + kRun, 0.0f);
    }
    int count_, runs_, far_ = 0;  // far_: steps from which a distance is the limit
    std::vector<float> squares_;
    std::vector<int> right_;  // per run
};

// Adds one more axis, y or z: the minimum over the lines of their squared distances plus the
// squared distance to the line.
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
                Sixteen lowest, v;
                __builtin_memcpy(&lowest, in.values(own), sizeof lowest);
                for (int m = low; m <= high; ++m) {
                    const std::size_t tap = states[static_cast<std::size_t>(m) * lines.width + w];
                    const float along = static_cast<float>(l - m) * spacing;
                    __builtin_memcpy(&v, values + kRun * tap, sizeof v);
                    v += along * along;
                    lowest = v < lowest ? v : lowest;
                }
                to[w] = out->add(1);
                __builtin_memcpy(out->at(to[w]), &lowest, sizeof lowest);
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
    std::vector<unsigned> marks(outside->runs());
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

namespace {

typedef float Sixteen __attribute__((vector_size(64)));
static_assert(sizeof(Sixteen) == kRun * sizeof(float));

// The smoothed value where all taps meet the same number: the sum in their order.
float weighed(const std::vector<float>& kernel, float number) {
    float sum = 0;
    for (const float k : kernel) sum += k * number;
    return sum;
}

// Smooths along y or z.
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
                tap[m + half] = states + static_cast<std::size_t>(at) * lines.width;
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

// Smoothing along x. Rows are first laid out with their neighbours, many at a time, since values
// that have just been written are slow to read across their borders.
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
    margin.y += kernels.reach(1);  // what the passes along y and z need from the one along x
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

}  // namespace sonocase::pipeline::inline segmentation_distance
