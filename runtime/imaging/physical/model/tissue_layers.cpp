// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/tissue_layers.h"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "formats/base/raw_vector.h"
#include "runtime/imaging/host/parallel_halves.h"
#include "runtime/imaging/noise/periodic_noise.h"
#include "runtime/imaging/physical/model/cell_distance.h"

namespace sonocase::runtime {
namespace {

constexpr int kNoiseEdge = 64;
constexpr double kDistanceUnit = TissueLayers::kDistanceUnit, kNoiseUnit = TissueLayers::kNoiseUnit;

// Tissue of the wall, and what runs through it: everything else is an organ.
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
        const Tissue& tissue = bundle.tissues[static_cast<std::size_t>(tissue_of[l])];
        if (is_organ(bundle.labels[l], tissue)) kinds[l] = 3;
        if (tissue.name == "blood") kinds[l] = 1;
    }
    return kinds;
}

// Where the voxels lie in bricks that stand for the cells along one axis, `samples` for each cell.
// `brick` is a place in the table and `inside` one in a brick, each by the axis' own stride.
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
            out[static_cast<std::size_t>(axis)].push_back(
                {static_cast<std::uint32_t>(voxel / kBrickEdge * brick_stride[axis]),
                 static_cast<std::uint32_t>(voxel % kBrickEdge * inside_stride[axis])});
        }
    }
    return out;
}

// Shares of body, organ and wall in each cell: from eight of its voxels, and from 64 where those
// differ.
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
        const Sample *x = &places[0][static_cast<std::size_t>(samples * i)],
                     *y = &places[1][static_cast<std::size_t>(samples * j)],
                     *z = &places[2][static_cast<std::size_t>(samples * k)];
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
    parallel_halves(jobs, static_cast<std::size_t>(c.size.z),
                    [&](std::size_t, std::size_t begin, std::size_t end) {
                        std::size_t at = begin * static_cast<std::size_t>(c.stride(2));
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

// Fat and vessels between organs are no wall: cells above the organs that are not connected with
// the outside count as organ.
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
            const auto n = static_cast<std::size_t>(c.size[axis]);
            const auto step = static_cast<std::size_t>(c.stride(axis));
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

// To the nearest, halves away from zero.
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
    return {cells_.data() + (static_cast<std::ptrdiff_t>(k) * size_.y + j) * size_.x + i,
            size_.x > 1 ? 1 : 0,
            size_.y > 1 ? size_.x : 0,
            size_.z > 1 ? static_cast<std::ptrdiff_t>(size_.x) * size_.y : 0,
            x,
            y,
            z};
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
    // Above the organs: the share of what is not organ; outside of the body too.
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
                const std::size_t n = static_cast<std::size_t>(
                    i % kNoiseEdge + kNoiseEdge * (j % kNoiseEdge + kNoiseEdge * (k % kNoiseEdge)));
                layers.cells_[at] = {packed(depth[at], kDistanceUnit),
                                     packed(above[at], kDistanceUnit), packed(wave[n], kNoiseUnit),
                                     packed(strength[n], kNoiseUnit)};
            }
        }
    }
    return layers;
}

}  // namespace sonocase::runtime
