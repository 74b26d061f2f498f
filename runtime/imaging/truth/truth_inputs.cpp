// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/truth/truth_inputs.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "formats/volume/boundary_record.h"
#include "formats/volume/brick_volume.h"
#include "formats/volume/tissue.h"
#include "runtime/imaging/physical/model/region_look_up.h"
#include "runtime/imaging/press/press_view.h"

namespace sonocase::runtime {
namespace {

bool is_artery(const std::string& name) {  // the same labels as in model `physical`
    return name.find("aorta") != std::string::npos || name.find("arter") != std::string::npos;
}

template <class T>
const std::int32_t* words_of(const T& values) {
    return reinterpret_cast<const std::int32_t*>(values.data());
}

}  // namespace

TruthVolume::TruthVolume(const BrickVolume<std::uint8_t>& labels,
                         const BrickVolume<std::uint32_t>& boundary)
    : labels_(labels), boundary_(boundary) {
    boundary_uniform_.assign(boundary.uniform.begin(), boundary.uniform.end());
    const auto none = kUniformBrick | static_cast<std::uint32_t>(boundary_uniform_.size());
    boundary_uniform_.push_back(kNoBoundary);
    for (const std::uint32_t record : boundary.uniform)
        plain_boundaries_ = plain_boundaries_ && record == kNoBoundary;
    bricks_.resize(labels.table.size() + 1, {kOneLabel, none});
    for (std::size_t n = 0; n < labels.table.size(); ++n) {
        TruthBrick& brick = bricks_[n];
        if (!boundary.table.empty()) brick.boundary = boundary.table[n];
        brick.word = labels.table[n];
        if (!(brick.word & kUniformBrick)) continue;
        brick.word = kOneLabel | labels.uniform[brick.word & ~kUniformBrick];
        if (!(brick.boundary & kUniformBrick) ||
            boundary_uniform_[brick.boundary & ~kUniformBrick] != kNoBoundary)
            brick.word |= kHasSurface;
    }
}

void TruthVolume::fill(TruthFrameRows& f) const {
    f.bricks = bricks_.data();
    f.outside = static_cast<std::int32_t>(bricks_.size() - 1);
    f.label_pool = words_of(labels_.pool);
    f.boundary_pool = words_of(boundary_.pool);
    f.boundary_uniform = words_of(boundary_uniform_);
    f.plain_boundaries = plain_boundaries_;
    const Int3 bricks = brick_count(labels_.size);
    f.bricks_x = bricks.x;
    f.bricks_xy = bricks.x * bricks.y;
    for (int a = 0; a < 3; ++a) f.size[a] = labels_.size[a];
}

TruthVoxels::TruthVoxels(const CaseBundle& bundle, bool physical)
    : bundle_(&bundle), volume_(bundle.label_bricks, bundle.boundary) {
    if (physical && bundle.region)
        region_.emplace(bundle.region->label_bricks, bundle.region->boundary);
    // A palette has 255 entries at most; 256 let a look-up of any byte stay inside.
    labels_.resize(256);
    for (std::size_t i = 0; i < labels_.size(); ++i) labels_[i] = static_cast<std::int32_t>(i);
    const std::vector<int> tissues = tissue_of_label(bundle);
    for (std::size_t i = 0; i < bundle.labels.size(); ++i) {
        const Tissue& tissue = bundle.tissues[tissues[i]];
        if (is_artery(bundle.labels[i].name))
            labels_[i] |= kArtery;
        else if (mechanics_of(tissue, bundle.labels[i].name).drains)
            labels_[i] |= kVein;
        if (physical ? tissue.kind == TissueKind::bone || tissue.kind == TissueKind::gas
                     : tissue.casts_shadow)
            labels_[i] |= kHard;
    }
}

void TruthVoxels::fill(TruthFrameRows& f, TruthFrameRows& region) const {
    volume_.fill(f);
    f.label_count = static_cast<std::int32_t>(bundle_->labels.size());
    f.labels = labels_.data();
    f.region = nullptr;
    if (!region_) return;
    region_->fill(region);
    region.label_count = f.label_count;
    region.labels = f.labels;
    const RegionPlace place = region_place(*bundle_->region, bundle_->grid);
    for (int a = 0; a < 3; ++a) {
        f.region_lower[a] = static_cast<float>(place.lower_vx[a]);
        f.region_upper[a] = static_cast<float>(place.upper_vx[a]);
        f.region_first[a] = static_cast<float>(place.first[a]);
    }
    f.region_per_voxel = static_cast<float>(place.per_voxel);
    f.region = &region;
}

namespace {

constexpr std::size_t kVectorSlack = 64;

// One ray per pixel where a row of pixels meets most beams: at the greatest depth.
int ray_count(const ScanGeometry& g) {
    const double across_mm = 2 * g.half_extent * (g.fan ? g.radius_mm + g.depth_mm : 1.0);
    return std::clamp(static_cast<int>(std::ceil(across_mm / g.mm_per_px)), 64, 16384);
}

}  // namespace

TruthPixels::TruthPixels(const ScanGeometry& g) : width_px_(g.width_px), rays_(ray_count(g)) {
    const double ray_step = 2 * g.half_extent / rays_;  // rad or mm
    rays_per_px_at_face_ = static_cast<float>(
        g.mm_per_px / (g.fan ? std::max(g.radius_mm, 1e-3) * ray_step : ray_step));
    visit_scanned_pixels(g, 0, g.height_px, runs_, [&](double line, double sample) {
        const double ray = (line + 0.5) / g.scanlines * rays_;
        ray_.push_back(static_cast<std::uint16_t>(std::clamp(static_cast<int>(ray), 0, rays_ - 1)));
        r_mm_.push_back(static_cast<float>((sample + 0.5) * g.step_mm));
    });
    ray_.resize(ray_.size() + kVectorSlack, 0);
    r_mm_.resize(r_mm_.size() + kVectorSlack, 0.0f);
}

bool TruthPixels::scanned(int column, int row) const {
    const auto after = std::partition_point(runs_.begin(), runs_.end(), [&](const PixelRun& r) {
        return r.row < row || (r.row == row && r.end <= column);
    });
    return after != runs_.end() && after->row == row && after->begin <= column;
}

PlainTiles::PlainTiles(const ScanGeometry& g, const TruthPixels& pixels, double reach_mm)
    : geometry_(g),
      across_((g.width_px + kColumns - 1) / kColumns),
      half_mm_(0.5 * std::hypot(kColumns - 1, kRows - 1) * g.mm_per_px) {
    const int down = (g.height_px + kRows - 1) / kRows;
    tiles_.resize(static_cast<std::size_t>(across_) * down);
    label_.assign(tiles_.size(), -1);
    pixels.for_each_run([&](const TruthRun& run, std::size_t) {
        for (int n = 0; n < run.count; ++n) {
            Tile& t = tiles_[static_cast<std::size_t>((run.row / kRows) * across_ +
                                                      (run.begin + n) / kColumns)];
            t.rays[0] = std::min<int>(t.rays[0], run.ray[n]);
            t.rays[1] = std::max<int>(t.rays[1], run.ray[n]);
            t.r_mm[0] = std::min(t.r_mm[0], run.r_mm[n]);
            t.r_mm[1] = std::max(t.r_mm[1], run.r_mm[n]);
        }
    });
    for (Tile& t : tiles_)  // a little more and less than exp2_fading(), which is good to 1.1e-4
        for (const int end : {0, 1})
            t.fade[end] = static_cast<float>(
                std::exp(-static_cast<double>(t.r_mm[1 - end]) / reach_mm) * (0.999 + 0.002 * end) -
                1e-6 * (1 - end));
    for (std::size_t n = 0; n < tiles_.size(); ++n) lay_beam(n);
}

void PlainTiles::lay_beam(std::size_t tile) {
    const ScanGeometry& g = geometry_;
    const auto n = static_cast<int>(tile);
    const int first_column = n % across_ * kColumns, first_row = n / across_ * kRows;
    Tile& t = tiles_[tile];
    t.x = (first_column + 0.5 * (kColumns - 1) - g.origin_x_px) * g.mm_per_px;
    t.z = (first_row + 0.5 * (kRows - 1) - g.origin_y_px) * g.mm_per_px;
    if (!g.fan) return;
    const double away = std::hypot(t.x, t.z + g.radius_mm);
    t.any_turn = away < 2 * half_mm_;
    t.dx = t.x / away;
    t.dz = (t.z + g.radius_mm) / away;
    t.turn = half_mm_ / (away - half_mm_);
}

void PlainTiles::find(SimdTarget simd, const TruthFrameRows& f) {
    constexpr double kSlackVx = 0.05;  // more than places lose in single precision
    const double column = 0.5 * (kColumns - 1), row = 0.5 * (kRows - 1);
    for (int a = 0; a < 3; ++a) beam_vx_[a] = std::hypot(f.beam_x[a], f.beam_z[a]);
    for (std::size_t n = 0; n < tiles_.size(); ++n) {
        label_[n] = -1;
        if (tiles_[n].rays[1] < 0) continue;
        const auto tile = static_cast<int>(n);
        const int first_column = tile % across_ * kColumns, first_row = tile / across_ * kRows;
        Box box;
        for (int a = 0; a < 3; ++a) {
            box.middle[a] =
                f.origin[a] + (first_column + column) * f.across[a] + (first_row + row) * f.down[a];
            box.half[a] = kSlackVx + column * std::abs(f.across[a]) + row * std::abs(f.down[a]);
        }
        if (!move(simd, f, n, box)) continue;
        if (f.weight != nullptr) {
            if (label_in(f, breathed_middle(f, box)) < 0) continue;  // most tiles fail here
            breathe(f, box);
        }
        const int label = label_in(f, box);
        if (label < 0) continue;
        if (f.press != nullptr && f.closed_label[label] != label) continue;
        label_[n] = static_cast<std::int16_t>(label);
    }
}

// Contact and pressing: false where no bound is known.
bool PlainTiles::move(SimdTarget simd, const TruthFrameRows& f, std::size_t tile, Box& box) const {
    if (f.gap_mm == nullptr && f.press == nullptr) return true;
    const Tile& t = tiles_[tile];
    if (t.any_turn) return false;
    double along[2] = {0, 0}, side[2] = {0, 0};
    if (f.gap_mm != nullptr) {
        const auto [least, most] =
            std::minmax_element(f.gap_mm + t.rays[0], f.gap_mm + t.rays[1] + 1);
        if (!(*least >= 0)) return false;  // a beam in air
        along[0] = std::max(static_cast<double>(*least * t.fade[0]), 0.0);
        along[1] = static_cast<double>(*most * t.fade[1]);
    }
    if (f.press != nullptr) {
        const press::PressView& v = *f.press;
        if (!v.field->pools().empty()) return false;
        const NeedleDent& needle = v.field->needle();
        if (needle.moves() &&
            std::hypot(t.x - needle.tip.x, t.z - needle.tip.z) < kDentReachMm + half_mm_)
            return false;
        if (v.pressed && !v.columns_follow_beams) return false;
        if (v.pressed) {
            const int rows = std::min(v.active, v.capacity);
            const auto node = [&](int ray) {
                return static_cast<int>(
                    ((static_cast<float>(ray) + 0.5f) * f.lines_per_ray - 0.5f) /
                    static_cast<float>(v.every));
            };
            const auto sample = [&](float r) { return static_cast<int>(r / v.step_mm - 0.5f); };
            const PressRange range =
                press_range(simd, v, std::clamp(node(t.rays[0]) - 1, 0, v.node_stride - 1),
                            std::clamp(node(t.rays[1]) + 2, 0, v.node_stride - 1),
                            std::clamp(sample(t.r_mm[0]) - 1, 0, std::max(rows - 2, 0)),
                            std::clamp(sample(t.r_mm[1]) + 2, 0, std::max(rows - 1, 0)));
            for (const int end : {0, 1}) {
                along[end] += static_cast<double>(range.along[end]);
                side[end] += static_cast<double>(range.side[end]);
            }
        }
    }
    const double middle = 0.5 * (along[0] + along[1]), beside = 0.5 * (side[0] + side[1]);
    const double half = 0.5 * (along[1] - along[0]), half_side = 0.5 * (side[1] - side[0]);
    const double turned = t.turn * (std::abs(middle) + half + std::abs(beside) + half_side);
    for (int a = 0; a < 3; ++a) {
        const double u = t.dx * f.beam_x[a] + t.dz * f.beam_z[a],
                     v = t.dz * f.beam_x[a] - t.dx * f.beam_z[a];
        box.middle[a] += middle * u + beside * v;
        box.half[a] += half * std::abs(u) + half_side * std::abs(v) + turned * beam_vx_[a];
    }
    return true;
}

// A place that the box, breathed, holds: its middle, moved by the weight of the cell it lies in.
PlainTiles::Box PlainTiles::breathed_middle(const TruthFrameRows& f, const Box& box) {
    int node[3];
    for (int a = 0; a < 3; ++a)
        node[a] = static_cast<int>(
            std::clamp((box.middle[a] - f.first_vx[a]) * f.per_voxel, 0.0, f.lattice[a] - 2.0));
    const double weight =
        f.weight[(std::ptrdiff_t{node[2]} * f.lattice[1] + node[1]) * f.lattice[0] + node[0]];
    Box place;
    for (int a = 0; a < 3; ++a) {
        place.middle[a] = box.middle[a] - weight * f.shift_vx[a];
        place.half[a] = 0;
    }
    return place;
}

// Breathing: by as much as the least and the greatest weight of the cells that the box meets.
void PlainTiles::breathe(const TruthFrameRows& f, Box& box) {
    int from[3], to[3];
    for (int a = 0; a < 3; ++a) {
        const auto node = [&](double at) {
            return std::clamp(std::floor((at - f.first_vx[a]) * f.per_voxel), 0.0,
                              f.lattice[a] - 1.0);
        };
        from[a] = std::min(static_cast<int>(node(box.middle[a] - box.half[a])), f.lattice[a] - 2);
        to[a] = std::min(static_cast<int>(node(box.middle[a] + box.half[a])) + 1, f.lattice[a] - 1);
    }
    const std::ptrdiff_t row = f.lattice[0], plane = row * f.lattice[1];
    float least = f.weight[from[2] * plane + from[1] * row + from[0]], most = least;
    for (int k = from[2]; k <= to[2]; ++k)
        for (int j = from[1]; j <= to[1]; ++j)
            for (int i = from[0]; i <= to[0]; ++i) {
                const float weight = f.weight[k * plane + j * row + i];
                least = std::min(least, weight);
                most = std::max(most, weight);
            }
    for (int a = 0; a < 3; ++a) {
        box.middle[a] -= 0.5 * (least + most) * f.shift_vx[a];
        box.half[a] += 0.5 * (most - least) * std::abs(f.shift_vx[a]);
    }
}

// The label of all bricks that the box meets, where that is one without surfaces; -1 otherwise.
int PlainTiles::label_in(const TruthFrameRows& f, const Box& box) {
    int from[3], to[3];
    bool leaves = false, outside = false;
    for (int a = 0; a < 3; ++a) {
        const double low = box.middle[a] - box.half[a] + 0.5,
                     high = box.middle[a] + box.half[a] + 0.5;
        leaves = leaves || low < 0 || high >= f.size[a];
        outside = outside || high < 0 || low >= f.size[a];
        from[a] = static_cast<int>(std::clamp(std::floor(low), 0.0, f.size[a] - 1.0)) >> 2;
        to[a] = static_cast<int>(std::clamp(std::floor(high), 0.0, f.size[a] - 1.0)) >> 2;
    }
    if (outside) return 0;
    if (f.region != nullptr) {
        bool meets = true;
        for (int a = 0; a < 3; ++a)
            meets = meets && box.middle[a] + box.half[a] >= f.region_lower[a] &&
                    box.middle[a] - box.half[a] < f.region_upper[a];
        if (meets) return -1;
    }
    const auto brick = [&](int i, int j, int k) {
        return f.bricks[k * f.bricks_xy + j * f.bricks_x + i].word;
    };
    const std::uint32_t first = brick(from[0], from[1], from[2]);
    if ((first & (kOneLabel | kHasSurface)) != kOneLabel) return -1;
    const auto label = static_cast<int>(first & 0xFF);
    if (leaves && label != 0) return -1;
    for (int k = from[2]; k <= to[2]; ++k)
        for (int j = from[1]; j <= to[1]; ++j)
            for (int i = from[0]; i <= to[0]; ++i)
                if (brick(i, j, k) != first) return -1;
    return label;
}

void needle_plane(const ScanGeometry& g,
                  const TruthPixels& pixels,
                  const NeedleShape& n,
                  double tip_mm,
                  std::span<std::uint8_t> plane) {
    // [near, far]: the part of the axis that can lie in the slab. margin: how far from the axis the
    // needle can show.
    const double reach = 0.5 * n.slab_mm + n.radius_mm;
    double near = -n.length_mm, far = 0;
    if (std::abs(n.axis.y) > 1e-9) {
        const double a = (-reach - n.tip.y) / n.axis.y, b = (reach - n.tip.y) / n.axis.y;
        near = std::max(near, std::min(a, b));
        far = std::min(far, std::max(a, b));
    } else if (std::abs(n.tip.y) > reach) {
        return;
    }
    if (near > far) return;
    const double margin = n.radius_mm + n.slab_mm * std::abs(n.axis.y) + g.mm_per_px;
    const PlanePoint a{n.tip.x + near * n.axis.x, n.tip.z + near * n.axis.z},
        b{n.tip.x + far * n.axis.x, n.tip.z + far * n.axis.z};
    pixels.for_each_run([&](const TruthRun& run, std::size_t at) {
        const double z = (run.row - g.origin_y_px) * g.mm_per_px;
        if (z < std::min(a.z, b.z) - margin || z > std::max(a.z, b.z) + margin) return;
        // [x0, x1]: the part of the axis that is within the margin of this row.
        double x0 = std::min(a.x, b.x), x1 = std::max(a.x, b.x);
        const double dz = b.z - a.z;
        if (std::abs(dz) > 1e-6) {
            const double u0 = std::clamp((z - margin - a.z) / dz, 0.0, 1.0),
                         u1 = std::clamp((z + margin - a.z) / dz, 0.0, 1.0);
            const double xa = a.x + u0 * (b.x - a.x), xb = a.x + u1 * (b.x - a.x);
            x0 = std::min(xa, xb);
            x1 = std::max(xa, xb);
        }
        const auto column = [&](double x) {
            return static_cast<int>(std::clamp(x / g.mm_per_px + g.origin_x_px, -1.0, 1e5));
        };
        const int first = std::max(column(x0 - margin), run.begin),
                  last = std::min(column(x1 + margin) + 1, run.begin + run.count - 1);
        for (int c = first; c <= last; ++c) {
            double along = 0;
            if (needle_share(n, (c - g.origin_x_px) * g.mm_per_px, z, along) > 0)
                plane[at + static_cast<std::size_t>(c - run.begin)] = along <= tip_mm ? 2 : 1;
        }
    });
}

}  // namespace sonocase::runtime
