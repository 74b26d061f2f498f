// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/snap_surfaces.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "formats/base/constants.h"
#include "formats/volume/boundary_record.h"
#include "formats/volume/surface_patch.h"
#include "pipeline/base/parallel.h"

namespace sonocase::pipeline::inline segmentation {
namespace {

struct Change {
    std::size_t bricks = 0, snapped = 0, missed = 0, labels = 0, records = 0;
    double distance_sum = 0, normal_sum = 0;  // of squares: voxels, radians
    void operator+=(const Change& o) {
        bricks += o.bricks;
        snapped += o.snapped;
        missed += o.missed;
        labels += o.labels;
        records += o.records;
        distance_sum += o.distance_sum;
        normal_sum += o.normal_sum;
    }
};

struct Brick {
    BrickLabels labels;
    BrickRecords records;
};

// The record as seen from label `side`: if the voxel has the other label, the same plane with the
// opposite orientation.
BoundaryRecord seen_from(std::uint8_t side, std::uint8_t own, std::uint32_t packed) {
    BoundaryRecord r = unpack_boundary(packed);
    if (own != side) {
        r.distance_vx = -r.distance_vx;
        r.normal = -r.normal;
    }
    return r;
}

// A brick as its patches reproduce it.
struct Attempt {
    std::vector<SurfacePatch> patches;
    Brick made;
    std::array<bool, kBrickVoxels> hit{};  // whether the voxel's record may be replaced
    bool labels_hit = true;                // whether all labels may be replaced
    std::size_t missed = 0;
    Change change;
};

class Snapper {
  public:
    // The patches are fitted again to the records that the last fit hit; most of the gain is in the
    // first repetition.
    static constexpr int kTurns = 3;

    explicit Snapper(const SnapOptions& options)
        : options_(options),
          reach_(static_cast<int>(std::lround(options.band_vx * kBoundaryStepsPerVoxel))),
          cosine_(std::cos(options.normal_deg / kDegPerRad)) {}

    // Returns the patches that the brick now follows; empty: the brick is unchanged.
    std::vector<SurfacePatch> operator()(Brick* brick, Change* change) const {
        Attempt best;
        best.missed = kBrickVoxels + 1;
        BrickRecords hits = brick->records;
        for (int turn = 0; turn < kTurns && best.missed > 0; ++turn) {
            std::vector<SurfacePatch> patches =
                fit_patches(brick->labels, hits, options_.patch_step);
            if (patches.empty()) break;
            Attempt now = attempt(*brick, std::move(patches));
            bool others = false;
            for (std::size_t v = 0; v < kBrickVoxels; ++v) {
                const std::uint32_t hit = now.hit[v] ? brick->records[v] : kNoBoundary;
                others = others || hit != hits[v];
                hits[v] = hit;
            }
            if (now.missed < best.missed) best = std::move(now);
            if (!others) break;
        }
        if (best.change.records == 0) return {};
        for (std::size_t v = 0; v < kBrickVoxels; ++v)
            if (best.hit[v]) brick->records[v] = best.made.records[v];
        brick->labels = best.made.labels;
        best.change.missed = best.missed;
        best.change.snapped = best.missed == 0;
        *change += best.change;
        return best.patches;
    }

  private:
    // Takes the labels from the sides of a single patch where all of them may be replaced.
    Attempt attempt(const Brick& brick, std::vector<SurfacePatch> patches) const {
        Attempt out;
        out.patches = std::move(patches);
        const SurfacePatch& one = out.patches.front();
        const auto parted = [&](std::uint8_t l) { return l == one.low || l == one.high; };
        out.made.labels = brick.labels;
        if (out.patches.size() == 1 &&
            std::all_of(brick.labels.begin(), brick.labels.end(), parted)) {
            labels_from_patch(one, out.made.labels.data());
            compare(brick, &out);
            if (out.labels_hit) return out;
            out.made.labels = brick.labels;
        }
        compare(brick, &out);
        return out;
    }

    void compare(const Brick& before, Attempt* out) const {
        records_from_patches(out->patches, out->made.labels.data(), reach_,
                             out->made.records.data());
        out->change = {};
        out->missed = 0;
        out->labels_hit = true;
        for (std::size_t v = 0; v < kBrickVoxels; ++v) {
            out->hit[v] = close(before, out->made, v, &out->change);
            out->missed += !out->hit[v];
            if (before.labels[v] == out->made.labels[v]) continue;
            // The last voxel of a label in the brick is kept.
            const bool stays = std::find(out->made.labels.begin(), out->made.labels.end(),
                                         before.labels[v]) != out->made.labels.end();
            out->labels_hit = out->labels_hit && out->hit[v] && stays;
            out->change.labels += 1;
        }
    }

    bool close(const Brick& a, const Brick& b, std::size_t v, Change* change) const {
        const double near_rim = options_.band_vx - options_.distance_vx;
        const bool was = a.records[v] != kNoBoundary, is = b.records[v] != kNoBoundary;
        if (!was || !is) {
            if (a.labels[v] != b.labels[v]) return false;
            // A record may appear or disappear only at the rim of the band.
            if (was) return unpack_boundary(a.records[v]).distance_vx >= near_rim;
            return !is || unpack_boundary(b.records[v]).distance_vx >= near_rim;
        }
        const BoundaryRecord old = seen_from(a.labels[v], a.labels[v], a.records[v]);
        if (a.labels[v] != b.labels[v] && old.second_label != b.labels[v]) return false;
        const BoundaryRecord now = seen_from(a.labels[v], b.labels[v], b.records[v]);
        const double moved = now.distance_vx - old.distance_vx;
        if (std::abs(moved) > options_.distance_vx) return false;
        if (a.labels[v] == b.labels[v] && now.second_label != old.second_label) return true;
        const double cosine = dot(now.normal, old.normal);
        if (cosine < cosine_) return false;
        change->records += 1;
        change->distance_sum += moved * moved;
        change->normal_sum += 2 * (1 - std::min(cosine, 1.0));  // angle squared, rad
        return true;
    }

    SnapOptions options_;
    int reach_;
    double cosine_;
};

// Results of one layer of bricks.
struct SnappedLayer {
    Change change;
    std::vector<std::uint32_t> entry;  // stored bricks that follow patches
    std::vector<std::uint8_t> count;   // patches of each
    std::vector<SurfacePatch> patches;
};

BrickPatches by_stored_brick(const std::vector<SnappedLayer>& layers, std::size_t stored) {
    BrickPatches out;
    out.first.assign(stored, 0);
    out.count.assign(stored, 0);
    for (const SnappedLayer& layer : layers) {
        auto first = static_cast<std::uint32_t>(out.patches.size());
        for (std::size_t n = 0; n < layer.entry.size(); ++n) {
            out.first[layer.entry[n]] = first;
            out.count[layer.entry[n]] = layer.count[n];
            first += layer.count[n];
        }
        out.patches.insert(out.patches.end(), layer.patches.begin(), layer.patches.end());
    }
    return out;
}

// Snaps the brick that begins at voxel `first`.
void snap_brick(const Snapper& snap,
                Int3 first,
                std::uint32_t entry,
                LabelVolume* volume,
                BoundaryBricks* boundary,
                SnappedLayer* out) {
    const auto voxels_of_row = [&](int r) {
        return volume->voxels.data() +
               volume->grid.index(first.x, first.y + r % 4, first.z + r / 4);
    };
    Brick brick;
    std::uint32_t* records = boundary->pool.data() + static_cast<std::size_t>(entry) * kBrickVoxels;
    std::copy_n(records, kBrickVoxels, brick.records.begin());
    for (int r = 0; r < 16; ++r) std::copy_n(voxels_of_row(r), 4, brick.labels.begin() + 4 * r);
    const std::vector<SurfacePatch> patches = snap(&brick, &out->change);
    if (patches.empty()) return;
    out->entry.push_back(entry);
    out->count.push_back(static_cast<std::uint8_t>(patches.size()));
    out->patches.insert(out->patches.end(), patches.begin(), patches.end());
    std::copy_n(brick.records.begin(), kBrickVoxels, records);
    for (int r = 0; r < 16; ++r) std::copy_n(brick.labels.begin() + 4 * r, 4, voxels_of_row(r));
}

void snap_layer(
    const Snapper& snap, int bz, LabelVolume* volume, BoundaryBricks* boundary, SnappedLayer* out) {
    const Int3 size = volume->grid.size, bricks = brick_count(size);
    for (int by = 0; by < bricks.y; ++by) {
        for (int bx = 0; bx < bricks.x; ++bx) {
            const std::size_t b =
                static_cast<std::size_t>(bx) +
                static_cast<std::size_t>(bricks.x) * (by + static_cast<std::size_t>(bricks.y) * bz);
            const std::uint32_t entry = boundary->table[b];
            if (entry & kUniformBrick) continue;
            ++out->change.bricks;
            const Int3 first{bx * kBrickEdge, by * kBrickEdge, bz * kBrickEdge};
            // The last bricks repeat the voxels at the border, and no quadric fits those.
            if (first.x + kBrickEdge > size.x || first.y + kBrickEdge > size.y ||
                first.z + kBrickEdge > size.z)
                continue;
            snap_brick(snap, first, entry, volume, boundary, out);
        }
    }
}

// The options for the volume's voxel size.
SnapOptions scaled(const SnapOptions& options, double voxel_mm) {
    SnapOptions out = options;
    if (voxel_mm < 1) {
        out.distance_vx =
            std::max(options.distance_vx, std::min(0.2, options.distance_vx / voxel_mm));
        if (voxel_mm <= 0.6) {
            // Doubling the quantisation step moves surfaces by less than half of that; and a plane
            // that is drawn half as large may be more oblique.
            out.patch_step = 2 * options.patch_step;
            out.normal_deg = 1.5 * options.normal_deg;
        }
    }
    return out;
}

}  // namespace

SnapReport snap_surfaces(LabelVolume* volume,
                         BoundaryBricks* boundary,
                         const SnapOptions& options) {
    const SnapOptions allowed = scaled(options, volume->grid.spacing_mm.x);
    const Snapper snap(allowed);
    std::vector<SnappedLayer> layers(brick_count(volume->grid.size).z);
    parallel_for(layers.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t bz = begin; bz < end; ++bz)
            snap_layer(snap, static_cast<int>(bz), volume, boundary, &layers[bz]);
    });
    Change sum;
    for (const SnappedLayer& layer : layers) sum += layer.change;
    boundary->patches = by_stored_brick(layers, boundary->pool.size() / kBrickVoxels);
    boundary->patches.step = allowed.patch_step;
    SnapReport report;
    report.bricks = sum.bricks;
    report.snapped = sum.snapped;
    report.missed = sum.missed;
    report.labels = sum.labels;
    const double n = static_cast<double>(std::max<std::size_t>(sum.records, 1));
    report.distance_rms_vx = std::sqrt(sum.distance_sum / n);
    report.normal_rms_deg = kDegPerRad * std::sqrt(sum.normal_sum / n);
    return report;
}

void add_measures(const SnapReport& snapped, StageReport* report) {
    report->measures.push_back({"record_bricks", static_cast<double>(snapped.bricks)});
    report->measures.push_back({"snapped_bricks", static_cast<double>(snapped.snapped)});
    report->measures.push_back({"snap_missed", static_cast<double>(snapped.missed)});
    report->measures.push_back({"snap_labels", static_cast<double>(snapped.labels)});
    report->measures.push_back({"snap_rms_vx", snapped.distance_rms_vx});
    report->measures.push_back({"snap_rms_deg", snapped.normal_rms_deg});
}

}  // namespace sonocase::pipeline::inline segmentation
