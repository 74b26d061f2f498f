// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/tissue_layers.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/base/memory.h"
#include "runtime/imaging/core/host.h"
#include "runtime/imaging/core/noise.h"

namespace sonocase::runtime {
namespace {

constexpr double kCellMm = 6;

using CellField = std::vector<float>;  // # Cells::count(), x fastest

struct Cells {
    Int3 size{0, 0, 0};
    int edge = 1;  // voxels
    double mm = kCellMm;

    std::size_t count() const { return static_cast<std::size_t>(size.x) * size.y * size.z; }
    std::ptrdiff_t stride(int axis) const {
        return axis == 0 ? 1 : axis == 1 ? size.x : static_cast<std::ptrdiff_t>(size.x) * size.y;
    }
};

// Solves |grad u| = 1 (Godunov's upwind scheme) for one cell from its smallest neighbours.
float upwind(float a, float b, float c, float h) {
    if (a > b) std::swap(a, b);
    if (b > c) std::swap(b, c);
    if (a > b) std::swap(a, b);
    float u = a + h;
    if (u <= b) return u;
    u = 0.5f * (a + b + std::sqrt(std::max(2 * h * h - (a - b) * (a - b), 0.0f)));
    if (u <= c) return u;
    const float s = a + b + c;
    return (s + std::sqrt(std::max(s * s - 3 * (a * a + b * b + c * c - h * h), 0.0f))) / 3;
}

// Fast sweeping (Zhao 2005): eight orders of the cells, each of which follows the characteristics
// of one octant. Cells that are not open keep their value.
void march(const Cells& c, const std::vector<std::uint8_t>& open, CellField& u) {
    const auto h = static_cast<float>(c.mm);
    constexpr auto kFar = static_cast<float>(kLayerFarMm);
    const std::ptrdiff_t sy = c.stride(1), sz = c.stride(2);
    const CellField beyond(c.size.x, kFar);  // a row outside the volume
    // Per row: where the open cells begin and end.
    std::vector<std::array<int, 2>> open_in(c.size.y * c.size.z);
    for (std::size_t row = 0; row < open_in.size(); ++row) {
        const std::uint8_t* p = open.data() + row * c.size.x;
        int begin = 0, end = c.size.x;
        while (begin < end && !p[begin]) ++begin;
        while (end > begin && !p[end - 1]) --end;
        open_in[row] = {begin, end};
    }
    // A row that its last visit left as it was is visited again only after it or a row beside it
    // has changed: rows count their visits. Most rows lie far from the surface.
    std::vector<int> changed_at(open_in.size(), 0), settled_at(open_in.size(), -1);
    int visit = 0;
    bool changed = true;  // when one order changes nothing, the next ones will not either
    for (int order = 0; order < 8 && changed; ++order) {
        changed = false;
        const auto index = [&](int i, int axis) {
            return order >> axis & 1 ? c.size[axis] - 1 - i : i;
        };
        for (int k0 = 0; k0 < c.size.z; ++k0) {
            const int k = index(k0, 2);
            for (int j0 = 0; j0 < c.size.y; ++j0) {
                const int j = index(j0, 1);
                const std::size_t row_at = static_cast<std::size_t>(k) * c.size.y + j;
                const auto [begin, end] = open_in[row_at];
                int last = changed_at[row_at];
                if (j > 0) last = std::max(last, changed_at[row_at - 1]);
                if (j < c.size.y - 1) last = std::max(last, changed_at[row_at + 1]);
                if (k > 0) last = std::max(last, changed_at[row_at - c.size.y]);
                if (k < c.size.z - 1) last = std::max(last, changed_at[row_at + c.size.y]);
                if (settled_at[row_at] >= last) continue;
                ++visit;
                bool moved = false;
                const std::ptrdiff_t first = j * sy + k * sz;
                float* row = u.data() + first;
                const std::uint8_t* open_row = open.data() + first;
                const float *before_y = j > 0 ? row - sy : beyond.data(),
                            *after_y = j < c.size.y - 1 ? row + sy : beyond.data(),
                            *before_z = k > 0 ? row - sz : beyond.data(),
                            *after_z = k < c.size.z - 1 ? row + sz : beyond.data();
                for (int n = 0; n < end - begin; ++n) {
                    const int i = order & 1 ? end - 1 - n : begin + n;
                    if (!open_row[i]) continue;
                    const float x =
                        std::min(i > 0 ? row[i - 1] : kFar, i < c.size.x - 1 ? row[i + 1] : kFar);
                    const float y = std::min(before_y[i], after_y[i]);
                    const float z = std::min(before_z[i], after_z[i]);
                    // A front that comes from farther away does not bring the cell nearer.
                    if (std::min({x, y, z}) >= row[i]) continue;
                    const float nearer = upwind(x, y, z, h);
                    if (nearer >= row[i]) continue;
                    row[i] = nearer;
                    moved = true;
                }
                (moved ? changed_at : settled_at)[row_at] = visit;
                changed = changed || moved;
            }
        }
    }
}

// True if the share is all or nothing, and that of the neighbours is the same.
bool is_flat(const Cells& c, const CellField& share, std::size_t at, Int3 cell) {
    const float* p = share.data() + at;
    if (*p != 0 && *p != 1) return false;
    for (int axis = 0; axis < 3; ++axis) {
        const std::ptrdiff_t step = c.stride(axis);
        if (cell[axis] > 0 && p[-step] != *p) return false;
        if (cell[axis] + 1 < c.size[axis] && p[step] != *p) return false;
    }
    return true;
}

// The mean of three neighbours along each axis; the border repeats.
void smooth_cells(const Cells& c, CellField& f) {
    const std::size_t width = c.size.x;
    const auto mean = [](float a, float b, float c3) { return (a + b + c3) * (1 / 3.0f); };
    CellField before(width), here(width);  // rows as they were
    for (std::size_t row = 0; row < f.size(); row += width) {
        float* p = f.data() + row;
        std::copy(p, p + width, here.begin());
        for (std::size_t i = 0; i < width; ++i)
            p[i] = mean(here[i > 0 ? i - 1 : 0], here[i], here[std::min(i + 1, width - 1)]);
    }
    // Row by row along y, then along z; each row needs the one before it as it was.
    for (const int axis : {1, 2}) {
        const int lines = axis == 1 ? c.size.z : c.size.y;
        for (int line = 0; line < lines; ++line) {
            float* p = f.data() + line * c.stride(3 - axis);
            for (int n = 0; n < c.size[axis]; ++n, p += c.stride(axis)) {
                const float* after = n + 1 < c.size[axis] ? p + c.stride(axis) : p;
                std::copy(p, p + width, here.begin());
                if (n == 0) before = here;
                for (std::size_t i = 0; i < width; ++i) p[i] = mean(before[i], here[i], after[i]);
                std::swap(before, here);
            }
        }
    }
}

// Distance into the side where `share` is large, mm, smoothed; on the other side the negative
// distance down to -kLayerBandMm. share: smoothed. wanted: share of the body, outside which
// distances do not matter; null: everywhere. Cost: 12 ms for a torso.
CellField distance_into(const Cells& c, const CellField& share, const CellField* wanted) {
    CellField u(share.size());
    std::vector<std::uint8_t> open(share.size(), 0);
    constexpr auto kFar = static_cast<float>(kLayerFarMm), kBand = static_cast<float>(kLayerBandMm);
    const auto mm = static_cast<float>(c.mm);
    std::size_t at = 0;
    for (int k = 0; k < c.size.z; ++k) {
        for (int j = 0; j < c.size.y; ++j) {
            for (int i = 0; i < c.size.x; ++i, ++at) {
                const float s = share[at];
                u[at] = s >= 0.5f ? kFar : -kBand;
                if (is_flat(c, share, at, {i, j, k})) {  // most cells: far from the surface
                    open[at] = s >= 0.5f && (wanted == nullptr || (*wanted)[at] > 0.05f);
                    continue;
                }
                const auto slope = [&](int n, int axis) {
                    const int last = c.size[axis] - 1;
                    const float* p = share.data() + at;
                    const std::ptrdiff_t step = c.stride(axis);
                    return (p[n < last ? step : 0] - p[n > 0 ? -step : 0]) /
                           (mm * static_cast<float>((n < last) + (n > 0) > 0 ? (n < last) + (n > 0)
                                                                             : 1));
                };
                const float gx = slope(i, 0), gy = slope(j, 1), gz = slope(k, 2);
                const float steep = std::sqrt(gx * gx + gy * gy + gz * gz);
                const float level = (s - 0.5f) / std::max(steep, 1e-6f);
                if (std::abs(level) < mm) {
                    u[at] = level;  // near the surface the share itself is the distance
                } else if (s >= 0.5f) {
                    open[at] = wanted == nullptr || (*wanted)[at] > 0.05f;
                } else {
                    u[at] = std::max(level, -kBand);
                }
            }
        }
    }
    march(c, open, u);
    smooth_cells(c, u);
    return u;
}

constexpr int kNoiseEdge = 64;
constexpr double kDistanceUnit = TissueLayers::kDistanceUnit, kNoiseUnit = TissueLayers::kNoiseUnit;

// True unless the tissue belongs to the wall, or to what runs through it.
bool is_organ(const Label& label, const Tissue& tissue) {
    constexpr std::array<std::string_view, 9> kWall{
        "skin", "fat", "muscle", "tendon", "fascia", "nerve", "soft_tissue", "cartilage", "blood"};
    if (label.name.find("visceral") != std::string::npos) return true;
    if (tissue.kind == TissueKind::outside || tissue.kind == TissueKind::bone) return false;
    return std::find(kWall.begin(), kWall.end(), tissue.name) == kWall.end();
}

// Bit 0: body, bit 1: organ, bit 2: wall. Vessels are neither: they run through both.
std::vector<std::uint8_t> kinds_of_labels(const CaseBundle& bundle) {
    const std::vector<int> tissue_of = tissue_of_label(bundle);
    std::vector<std::uint8_t> kinds(256, 0);
    for (std::size_t l = 1; l < bundle.labels.size() && l < kinds.size(); ++l) {
        kinds[l] = 5;
        if (tissue_of[l] < 0) continue;
        const Tissue& tissue = bundle.tissues[tissue_of[l]];
        if (is_organ(bundle.labels[l], tissue)) kinds[l] = 3;
        if (tissue.name == "blood") kinds[l] = 1;
    }
    return kinds;
}

// The voxels that stand for the cells along one axis, `samples` per cell, and where they lie in the
// bricks: `brick` is the part of the place in the table and `inside` that in the brick which the
// axis adds.
struct Sample {
    std::uint32_t brick = 0, inside = 0;
};
using Samples = std::array<std::vector<Sample>, 3>;

Samples samples_of(const BrickVolume<std::uint8_t>& labels, const Cells& c, int samples) {
    const Int3 bricks = brick_count(labels.size);
    const Int3 brick_stride{1, bricks.x, bricks.x * bricks.y};
    const Int3 inside_stride{1, kBrickEdge, kBrickEdge * kBrickEdge};
    Samples out;
    for (int axis = 0; axis < 3; ++axis) {
        for (int n = 0; n < samples * c.size[axis]; ++n) {
            const int in_cell = c.edge * (2 * (n % samples) + 1) / (2 * samples);
            const int voxel = std::min(n / samples * c.edge + in_cell, labels.size[axis] - 1);
            out[axis].push_back(
                {static_cast<std::uint32_t>(voxel / kBrickEdge * brick_stride[axis]),
                 static_cast<std::uint32_t>(voxel % kBrickEdge * inside_stride[axis])});
        }
    }
    return out;
}

// Finds the shares of body, organ and wall in each cell, from eight of its voxels, and from 64
// where those differ.
void find_shares(const CaseBundle& bundle,
                 const Cells& c,
                 JobRunner& jobs,
                 CellField& body,
                 CellField& organ,
                 CellField& wall) {
    const std::vector<std::uint8_t> kinds = kinds_of_labels(bundle);
    const BrickVolume<std::uint8_t>& labels = bundle.label_bricks;
    const Samples few = samples_of(labels, c, 2), many = samples_of(labels, c, 4);
    struct Shares {
        float body = 0, organ = 0, wall = 0;
    };
    const auto kind_at = [&](Sample x, Sample y, Sample z) {
        const std::uint32_t entry = labels.table[x.brick + y.brick + z.brick];
        return kinds[entry & kUniformBrick ? labels.uniform[entry & ~kUniformBrick]
                                           : labels.pool[std::size_t{entry} * kBrickVoxels +
                                                         x.inside + y.inside + z.inside]];
    };
    const auto shares_of = [&](const Samples& places, int samples, int i, int j, int k) {
        const Sample *x = &places[0][samples * i], *y = &places[1][samples * j],
                     *z = &places[2][samples * k];
        int inside = 0, organs = 0, walls = 0;
        for (int w = 0; w < samples; ++w) {
            for (int v = 0; v < samples; ++v) {
                for (int u = 0; u < samples; ++u) {
                    const std::uint8_t kind = kind_at(x[u], y[v], z[w]);
                    inside += kind & 1;
                    organs += kind >> 1 & 1;
                    walls += kind >> 2;
                }
            }
        }
        const float unit = 1 / static_cast<float>(samples * samples * samples);
        return Shares{unit * static_cast<float>(inside), unit * static_cast<float>(organs),
                      unit * static_cast<float>(walls)};
    };
    const auto mixed = [](float share) { return share > 0 && share < 1; };
    parallel_halves(jobs, c.size.z, [&](std::size_t, std::size_t begin, std::size_t end) {
        std::size_t at = begin * c.stride(2);
        for (int k = static_cast<int>(begin); k < static_cast<int>(end); ++k) {
            for (int j = 0; j < c.size.y; ++j) {
                for (int i = 0; i < c.size.x; ++i, ++at) {
                    Shares s = shares_of(few, 2, i, j, k);
                    if (mixed(s.body) || mixed(s.organ) || mixed(s.wall))
                        s = shares_of(many, 4, i, j, k);
                    body[at] = s.body;
                    organ[at] = s.organ;
                    wall[at] = s.wall;
                }
            }
        }
    });
}

// Fat and vessels between organs do not belong to the wall: cells above the organs that are not
// connected with the outside count as organ.
void keep_what_reaches_out(const Cells& c, const CellField& body, CellField& above) {
    std::vector<std::uint8_t> met(above.size(), 0);
    std::vector<std::size_t> front;
    const auto visit = [&](std::size_t at) {
        if (met[at] || above[at] < 0.5f) return;
        met[at] = 1;
        front.push_back(at);
    };
    for (std::size_t at = 0; at < body.size(); ++at) {
        if (body[at] < 0.5f) visit(at);
    }
    if (front.empty()) return;  // a block without surroundings
    while (!front.empty()) {
        const std::size_t at = front.back();
        front.pop_back();
        std::size_t rest = at;
        for (int axis = 0; axis < 3; ++axis) {
            const std::size_t n = c.size[axis], step = c.stride(axis);
            const std::size_t i = rest % n;
            rest /= n;
            if (i > 0) visit(at - step);
            if (i + 1 < n) visit(at + step);
        }
    }
    for (std::size_t at = 0; at < above.size(); ++at) {
        if (!met[at]) above[at] = std::min(above[at], 0.3f);
    }
}

// Rounds to the nearest, halves away from zero.
std::int16_t packed(float value, double unit) {
    const double scaled = std::clamp(static_cast<double>(value) * unit, -32767.0, 32767.0);
    return static_cast<std::int16_t>(scaled + std::copysign(0.5, scaled));
}

}  // namespace

TissueLayers::Around TissueLayers::around(Point3 voxel) const noexcept {
    const auto place = [&](double v, int size, int& first) {
        const double cell = std::clamp((v + 0.5) * cells_per_voxel_ - 0.5, 0.0, size - 1.0);
        first = std::min(static_cast<int>(cell), std::max(size - 2, 0));
        return static_cast<float>(cell - first);
    };
    int i = 0, j = 0, k = 0;
    const float x = place(voxel.x, size_.x, i), y = place(voxel.y, size_.y, j),
                z = place(voxel.z, size_.z, k);
    return {.lowest = cells_.data() + (static_cast<std::ptrdiff_t>(k) * size_.y + j) * size_.x + i,
            .sx = size_.x > 1 ? 1 : 0,
            .sy = size_.y > 1 ? size_.x : 0,
            .sz = size_.z > 1 ? static_cast<std::ptrdiff_t>(size_.x) * size_.y : 0,
            .x = x,
            .y = y,
            .z = z};
}

LayerPoint TissueLayers::at(Point3 voxel) const noexcept {
    const Around a = around(voxel);
    // Distances are linear between cells; noises have no kinks there.
    const auto even = [](float t) { return t * t * (3 - 2 * t); };
    const float u = even(a.x), v = even(a.y), w = even(a.z);
    std::array<float, 4> sum{};
    for (int corner = 0; corner < 8; ++corner) {
        const float linear = Around::share(corner, a.x, a.y, a.z),
                    smooth = Around::share(corner, u, v, w);
        const auto& cell = a.corner(corner);
        for (std::size_t n = 0; n < 2; ++n) sum[n] += linear * static_cast<float>(cell[n]);
        for (std::size_t n = 2; n < 4; ++n) sum[n] += smooth * static_cast<float>(cell[n]);
    }
    return {static_cast<double>(sum[0]) / kDistanceUnit,
            static_cast<double>(sum[1]) / kDistanceUnit, static_cast<double>(sum[2]) / kNoiseUnit,
            static_cast<double>(sum[3]) / kNoiseUnit};
}

double TissueLayers::depth_at(Point3 voxel) const noexcept {
    const Around a = around(voxel);
    float sum = 0;
    for (int corner = 0; corner < 8; ++corner)
        sum += Around::share(corner, a.x, a.y, a.z) * static_cast<float>(a.corner(corner)[0]);
    return static_cast<double>(sum) / kDistanceUnit;
}

TissueLayers make_tissue_layers(const CaseBundle& bundle, JobRunner& jobs) {
    Cells c;
    const double voxel_mm = bundle.grid.spacing_mm.x;
    c.edge = std::max(1, static_cast<int>(std::lround(kCellMm / voxel_mm)));
    c.mm = c.edge * voxel_mm;
    const auto cells = [&](int voxels) { return (voxels + c.edge - 1) / c.edge; };
    const Int3 voxels = bundle.label_bricks.size;
    c.size = {cells(voxels.x), cells(voxels.y), cells(voxels.z)};
    CellField body(c.count()), organ(c.count()), wall(c.count());
    find_shares(bundle, c, jobs, body, organ, wall);
    for (CellField* share : {&body, &organ, &wall}) smooth_cells(c, *share);
    // From here on `organ` is the share above the organs, that is of what is not organ, also
    // outside the body.
    for (std::size_t at = 0; at < organ.size(); ++at) {
        const float known = organ[at] + wall[at] + (1 - body[at]);
        organ[at] = known > 0.05f ? 1 - organ[at] / known : 0;
    }
    keep_what_reaches_out(c, body, organ);
    CellField depth, above;
    RawVector<float> wave, strength;
    jobs.run(2, [&](std::size_t job) {
        if (job == 0) {
            depth = distance_into(c, body, nullptr);
            wave = smooth_periodic_noise(kNoiseEdge, 1, 41);
        } else {
            above = distance_into(c, organ, &body);
            strength = smooth_periodic_noise(kNoiseEdge, 1, 42);
        }
    });
    TissueLayers layers;
    layers.size_ = c.size;
    layers.cells_per_voxel_ = 1.0 / c.edge;
    layers.cells_.resize(c.count());
    std::size_t at = 0;
    for (int k = 0; k < c.size.z; ++k) {
        for (int j = 0; j < c.size.y; ++j) {
            for (int i = 0; i < c.size.x; ++i, ++at) {
                const int n =
                    i % kNoiseEdge + kNoiseEdge * (j % kNoiseEdge + kNoiseEdge * (k % kNoiseEdge));
                layers.cells_[at] = {packed(depth[at], kDistanceUnit),
                                     packed(above[at], kDistanceUnit), packed(wave[n], kNoiseUnit),
                                     packed(strength[n], kNoiseUnit)};
            }
        }
    }
    return layers;
}

}  // namespace sonocase::runtime
