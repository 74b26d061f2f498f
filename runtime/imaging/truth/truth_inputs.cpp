// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/truth/truth_inputs.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "formats/volume/boundary_record.h"
#include "formats/volume/brick_volume.h"
#include "formats/volume/tissue.h"
#include "runtime/imaging/physical/model/region_look_up.h"

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
    // At least one, so that a vector in which no brick is uniform has something to read.
    boundary_uniform_.assign(boundary.uniform.begin(), boundary.uniform.end());
    boundary_uniform_.push_back(kNoBoundary);
    for (const std::uint32_t record : boundary.uniform)
        plain_boundaries_ = plain_boundaries_ && record == kNoBoundary;
    bricks_.resize(labels.table.size());
    for (std::size_t n = 0; n < bricks_.size(); ++n) {
        const std::uint32_t entry = labels.table[n];
        if (!(entry & kUniformBrick)) {
            bricks_[n] = static_cast<std::int32_t>(entry);
            continue;
        }
        std::uint32_t word = kOneLabel | labels.uniform[entry & ~kUniformBrick];
        if (!boundary.table.empty()) {
            const std::uint32_t record = boundary.table[n];
            if (!(record & kUniformBrick) ||
                boundary.uniform[record & ~kUniformBrick] != kNoBoundary)
                word |= kHasSurface;
        }
        bricks_[n] = static_cast<std::int32_t>(word);
    }
}

void TruthVolume::fill(TruthFrameRows& f) const {
    f.bricks = bricks_.data();
    f.label_pool = words_of(labels_.pool);
    const bool surfaces = !boundary_.table.empty();
    f.boundary_table = surfaces ? words_of(boundary_.table) : nullptr;
    f.boundary_pool = surfaces ? words_of(boundary_.pool) : nullptr;
    f.boundary_uniform = plain_boundaries_ ? nullptr : words_of(boundary_uniform_);
    const Int3 bricks = brick_count(labels_.size);
    f.bricks_x = bricks.x;
    f.bricks_xy = bricks.x * bricks.y;
    for (int a = 0; a < 3; ++a) f.size[a] = labels_.size[a];
}

TruthVoxels::TruthVoxels(const CaseBundle& bundle, bool physical)
    : bundle_(&bundle), volume_(bundle.label_bricks, bundle.boundary) {
    // A palette has 255 entries at most; 256 let a look-up of any byte stay inside.
    constexpr std::size_t kBytes = 256;
    if (physical && bundle.region)
        region_.emplace(bundle.region->label_bricks, bundle.region->boundary);
    swells_.assign(kBytes, 0);
    hard_.assign(kBytes, 0);
    const std::vector<int> tissues = tissue_of_label(bundle);
    for (std::size_t i = 0; i < bundle.labels.size(); ++i) {
        const Tissue& tissue = bundle.tissues[tissues[i]];
        swells_[i] = is_artery(bundle.labels[i].name)                     ? 1
                     : mechanics_of(tissue, bundle.labels[i].name).drains ? 2
                                                                          : 0;
        hard_[i] = physical ? tissue.kind == TissueKind::bone || tissue.kind == TissueKind::gas
                            : tissue.casts_shadow;
    }
}

void TruthVoxels::fill(TruthFrameRows& f, TruthFrameRows& region) const {
    volume_.fill(f);
    f.label_count = static_cast<std::int32_t>(bundle_->labels.size());
    f.swells = swells_.data();
    f.hard = hard_.data();
    f.region = nullptr;
    if (!region_) return;
    region_->fill(region);
    region.label_count = f.label_count;
    region.swells = f.swells;
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
