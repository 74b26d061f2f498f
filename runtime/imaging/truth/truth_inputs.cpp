// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/truth/truth_inputs.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <hwy/cache_control.h>

#include "formats/volume/boundary_record.h"
#include "formats/volume/brick_volume.h"
#include "formats/volume/tissue.h"
#include "runtime/imaging/core/needle_shift.h"
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

TruthTiles::TruthTiles(const ScanGeometry& g, const TruthPixels& pixels)
    : width_px_(g.width_px),
      across_((g.width_px + kColumns - 1) / kColumns),
      half_mm_(0.5 * std::hypot(kColumns - 1, kRows - 1) * g.mm_per_px) {
    const int down = (g.height_px + kRows - 1) / kRows;
    std::vector<Tile> all(static_cast<std::size_t>(across_) * down);
    one_by_one_.assign(all.size(), false);
    any_in_row_.assign(static_cast<std::size_t>(down), false);
    air_before_.assign(static_cast<std::size_t>(pixels.rays()) + 1, 0);
    pixels.for_each_run([&](const TruthRun& run, std::size_t) {
        for (int n = 0; n < run.count; ++n) {
            Tile& t = all[static_cast<std::size_t>((run.row / kRows) * across_ +
                                                   (run.begin + n) / kColumns)];
            t.rays[0] = std::min<int>(t.rays[0], run.ray[n]);
            t.rays[1] = std::max<int>(t.rays[1], run.ray[n]);
            t.rows = run.row % kRows + 1;
        }
    });
    for (int n = 0; n < static_cast<int>(all.size()); ++n) {
        Tile& t = all[static_cast<std::size_t>(n)];
        if (t.rays[1] < 0) continue;
        t.points.column = n % across_ * kColumns;
        t.points.row = n / across_ * kRows;
        const auto place = [&](double column, double row) {
            return PlanePoint{(t.points.column + column - g.origin_x_px) * g.mm_per_px,
                              (t.points.row + row - g.origin_y_px) * g.mm_per_px};
        };
        t.middle = place(0.5 * (kColumns - 1), 0.5 * (kRows - 1));
        const double last_ray = std::nextafter(static_cast<float>(pixels.rays() - 1), 0.0f);
        for (int i = 0; i < TruthTile::kPoints; ++i) {
            double line = 0, sample = 0;
            g.locate(place(static_cast<double>(TruthTile::kBeside[i]),
                           static_cast<double>(TruthTile::kBelow[i])),
                     line, sample);
            t.points.ray[i] = static_cast<float>(
                std::clamp((line + 0.5) / g.scanlines * pixels.rays() - 0.5, 0.0, last_ray));
            t.points.r_mm[i] = static_cast<float>((sample + 0.5) * g.step_mm);
        }
        tiles_.push_back(t);
    }
}

void TruthTiles::look_up(SimdTarget simd, const TruthFrameRows& f, std::span<std::uint8_t> labels) {
    if (f.gap_mm != nullptr)
        for (int ray = 0; ray < f.rays; ++ray)
            air_before_[ray + 1] = air_before_[ray] + (f.gap_mm[ray] < 0 ? 1 : 0);
    std::fill(any_in_row_.begin(), any_in_row_.end(), false);
    std::fill(one_by_one_.begin(), one_by_one_.end(), false);
    // The last one of which the bricks, and the one before it, of which the voxels were asked for.
    Waiting slots[3], *of_bricks = nullptr, *of_voxels = nullptr;
    int next = 0;
    const auto go_on = [&](Waiting* placed) {
        Waiting* found =
            of_bricks != nullptr && find(simd, f, labels, *of_bricks) ? of_bricks : nullptr;
        if (of_voxels != nullptr) {
            const Tile& t = *of_voxels->tile;
            if (!truth_tile(simd, f, of_voxels->voxels, t.rows, columns(t), first_label(t, labels),
                            width_px_))
                mark_one_by_one(t);
        }
        of_voxels = found;
        of_bricks = placed;
    };
    for (const Tile& t : tiles_) {
        const int in_air =
            f.gap_mm == nullptr ? 0 : air_before_[t.rays[1] + 1] - air_before_[t.rays[0]];
        Step step = Step::one_by_one;
        if (in_air > t.rays[1] - t.rays[0]) {
            fill(t, 0, labels);
            step = Step::done;
        } else if (in_air == 0 && (f.press == nullptr || !bends(*f.press, t))) {
            step = place(simd, f, t, labels, slots[next]);
        }
        if (step == Step::one_by_one) mark_one_by_one(t);
        if (step != Step::waits) continue;
        go_on(&slots[next]);
        next = (next + 1) % 3;
    }
    go_on(nullptr);
    go_on(nullptr);
}

void TruthTiles::mark_one_by_one(const Tile& t) {
    one_by_one_[static_cast<std::size_t>(t.points.row / kRows * across_ +
                                         t.points.column / kColumns)] = true;
    any_in_row_[static_cast<std::size_t>(t.points.row / kRows)] = true;
}

void TruthTiles::fill(const Tile& t, int label, std::span<std::uint8_t> labels) const {
    for (int row = 0; row < t.rows; ++row)
        std::fill_n(first_label(t, labels) + static_cast<std::ptrdiff_t>(row) * width_px_,
                    columns(t), static_cast<std::uint8_t>(label));
}

// True where what moves a tile has bends that its points may miss.
bool TruthTiles::bends(const press::PressView& v, const Tile& t) const {
    if (!v.field->pools().empty()) return true;
    const NeedleDent& needle = v.field->needle();
    return needle.moves() && std::hypot(t.middle.x - needle.tip.x, t.middle.z - needle.tip.z) <
                                 kDentReachMm + half_mm_;
}

TruthTiles::Step TruthTiles::place(SimdTarget simd,
                                   const TruthFrameRows& f,
                                   const Tile& t,
                                   std::span<std::uint8_t> labels,
                                   Waiting& out) const {
    constexpr float kSlackVx = 0.01f;  // more than places lose in single precision
    if (!truth_places(simd, f, t.points, out.places)) return Step::one_by_one;
    out.tile = &t;
    out.inside = true;
    bool outside = false, in_region = f.region != nullptr;
    for (int a = 0; a < 3; ++a) {
        const float low = out.places.lower[a] - kSlackVx, high = out.places.upper[a] + kSlackVx;
        const auto last = static_cast<float>(f.size[a] - 1);
        out.inside = out.inside && low > -0.5f && high < last + 0.5f;
        outside = outside || high < -0.5f || low > last + 0.5f;
        in_region = in_region && high >= f.region_lower[a] && low < f.region_upper[a];
        out.from[a] = static_cast<int>(std::clamp(low, 0.0f, last) + 0.5f) >> 2;
        out.to[a] = static_cast<int>(std::clamp(high, 0.0f, last) + 0.5f) >> 2;
    }
    if (outside) {
        fill(t, 0, labels);
        return Step::done;
    }
    if (in_region) return Step::one_by_one;
    for (int k = out.from[2]; k <= out.to[2]; ++k)
        for (int j = out.from[1]; j <= out.to[1]; ++j)
            hwy::Prefetch(f.bricks + k * f.bricks_xy + j * f.bricks_x + out.from[0]);
    return Step::waits;
}

bool TruthTiles::find(SimdTarget simd,
                      const TruthFrameRows& f,
                      std::span<std::uint8_t> labels,
                      Waiting& w) const {
    const int label = label_of_bricks(f, w.from, w.to);
    if (label >= 0 && (w.inside || label == 0) && (!f.closes || f.closed_label[label] == label)) {
        fill(*w.tile, label, labels);
        return false;
    }
    truth_voxels(simd, f, w.places, w.inside, w.tile->rows, w.voxels);
    return true;
}

// The label of all bricks of a box, where that is one without surfaces; -1 otherwise.
int TruthTiles::label_of_bricks(const TruthFrameRows& f, const int from[3], const int to[3]) {
    const auto brick = [&](int i, int j, int k) {
        return f.bricks[k * f.bricks_xy + j * f.bricks_x + i].word;
    };
    const std::uint32_t first = brick(from[0], from[1], from[2]);
    if ((first & (kOneLabel | kHasSurface)) != kOneLabel) return -1;
    for (int k = from[2]; k <= to[2]; ++k)
        for (int j = from[1]; j <= to[1]; ++j)
            for (int i = from[0]; i <= to[0]; ++i)
                if (brick(i, j, k) != first) return -1;
    return static_cast<int>(first & 0xFF);
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
