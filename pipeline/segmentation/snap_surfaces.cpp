#include "pipeline/segmentation/snap_surfaces.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "formats/boundary_record.h"
#include "formats/surface_patch.h"
#include "pipeline/parallel.h"

namespace sonocase::pipeline {
namespace {

struct Change {
    std::size_t bricks = 0, snapped = 0, labels = 0, records = 0;
    double distance_sum = 0, normal_sum = 0;  // squares
    void operator+=(const Change& o) {
        bricks += o.bricks;
        snapped += o.snapped;
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

// As seen from `side`: a record read by the voxel's other label is the same plane turned round.
BoundaryRecord seen_from(std::uint8_t side, std::uint8_t own, std::uint32_t packed) {
    BoundaryRecord r = unpack_boundary(packed);
    if (own != side) {
        r.distance_vx = -r.distance_vx;
        r.normal = -r.normal;
    }
    return r;
}

class Snapper {
  public:
    // Only what is found again from the records can be kept short: nearly all is at once.
    static constexpr int kTurns = 3;

    explicit Snapper(const SnapOptions& options)
        : options_(options),
          reach_(static_cast<int>(std::lround(options.band_vx * kBoundaryStepsPerVoxel))),
          cosine_(std::cos(options.normal_deg / 57.29577951308232)) {}

    // True and `brick` replaced where patches say nearly the same.
    bool operator()(Brick* brick, Change* change) const {
        std::vector<SurfacePatch> patches = fit_patches(brick->labels, brick->records);
        for (int turn = 0; turn < kTurns && !patches.empty(); ++turn) {
            Brick out;
            apply(*brick, patches, &out);
            Change made;
            if (!close(*brick, out, &made)) return false;
            if (!find_patches(out.labels, out.records, reach_).empty()) {
                *brick = out;
                *change += made;
                return true;
            }
            patches = fit_patches(out.labels, out.records);
        }
        return false;
    }

  private:
    void apply(const Brick& from, const std::vector<SurfacePatch>& patches, Brick* out) const {
        const auto parted = [&](std::uint8_t l) {
            return l == patches[0].low || l == patches[0].high;
        };
        out->labels = from.labels;
        if (patches.size() == 1 && std::all_of(from.labels.begin(), from.labels.end(), parted))
            labels_from_patch(patches[0], out->labels.data());
        records_from_patches(patches, out->labels.data(), reach_, out->records.data());
    }

    bool close(const Brick& a, const Brick& b, Change* change) const {
        const double near_rim = options_.band_vx - options_.distance_vx;
        for (std::size_t v = 0; v < kBrickVoxels; ++v) {
            const bool was = a.records[v] != kNoBoundary, is = b.records[v] != kNoBoundary;
            if (!was || !is) {
                if (a.labels[v] != b.labels[v]) return false;
                // A record may come or go at the rim of the band alone.
                if (was && unpack_boundary(a.records[v]).distance_vx < near_rim) return false;
                if (is && unpack_boundary(b.records[v]).distance_vx < near_rim) return false;
                continue;
            }
            const BoundaryRecord old = seen_from(a.labels[v], a.labels[v], a.records[v]);
            if (a.labels[v] != b.labels[v] && old.second_label != b.labels[v]) return false;
            const BoundaryRecord now = seen_from(a.labels[v], b.labels[v], b.records[v]);
            const double moved = now.distance_vx - old.distance_vx;
            if (std::abs(moved) > options_.distance_vx) return false;
            if (a.labels[v] == b.labels[v] && now.second_label != old.second_label) continue;
            const double cosine = dot(now.normal, old.normal);
            if (cosine < cosine_) return false;
            // The last voxel of a label in its brick stays.
            if (a.labels[v] != b.labels[v] &&
                std::find(b.labels.begin(), b.labels.end(), a.labels[v]) == b.labels.end())
                return false;
            change->labels += a.labels[v] != b.labels[v];
            change->records += 1;
            change->distance_sum += moved * moved;
            change->normal_sum += 2 * (1 - std::min(cosine, 1.0));  // angle squared, rad
        }
        return true;
    }

    SnapOptions options_;
    int reach_;
    double cosine_;
};

}  // namespace

SnapReport snap_surfaces(LabelVolume* volume,
                         BrickVolume<std::uint32_t>* boundary,
                         const SnapOptions& options) {
    const Grid& g = volume->grid;
    const Int3 bricks = brick_count(g.size);
    SnapOptions allowed = options;
    if (g.spacing_mm.x < 1) {
        allowed.distance_vx =
            std::max(options.distance_vx, std::min(0.2, options.distance_vx / g.spacing_mm.x));
    }
    const Snapper snap(allowed);
    std::vector<Change> changes(static_cast<std::size_t>(bricks.z));
    parallel_for(changes.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t bz = begin; bz < end; ++bz) {
            Change& change = changes[bz];
            const int k = static_cast<int>(bz) * kBrickEdge;
            for (int by = 0; by < bricks.y; ++by) {
                for (int bx = 0; bx < bricks.x; ++bx) {
                    const std::size_t b =
                        static_cast<std::size_t>(bx) +
                        static_cast<std::size_t>(bricks.x) *
                            (static_cast<std::size_t>(by) + static_cast<std::size_t>(bricks.y) * bz);
                    const std::uint32_t entry = boundary->table[b];
                    if (entry & kUniformBrick) continue;
                    ++change.bricks;
                    const int i = bx * kBrickEdge, j = by * kBrickEdge;
                    // The last bricks repeat what is inside; no quadric does.
                    if (i + kBrickEdge > g.size.x || j + kBrickEdge > g.size.y ||
                        k + kBrickEdge > g.size.z)
                        continue;
                    Brick brick;
                    std::uint32_t* records =
                        boundary->pool.data() + static_cast<std::size_t>(entry) * kBrickVoxels;
                    std::copy_n(records, kBrickVoxels, brick.records.begin());
                    for (int r = 0; r < 16; ++r) {
                        std::copy_n(volume->voxels.data() + g.index(i, j + r % 4, k + r / 4), 4,
                                    brick.labels.begin() + 4 * r);
                    }
                    if (!snap(&brick, &change)) continue;
                    ++change.snapped;
                    std::copy_n(brick.records.begin(), kBrickVoxels, records);
                    for (int r = 0; r < 16; ++r) {
                        std::copy_n(brick.labels.begin() + 4 * r, 4,
                                    volume->voxels.data() + g.index(i, j + r % 4, k + r / 4));
                    }
                }
            }
        }
    });
    Change sum;
    for (const Change& change : changes) sum += change;
    SnapReport report;
    report.bricks = sum.bricks;
    report.snapped = sum.snapped;
    report.labels = sum.labels;
    const double n = static_cast<double>(std::max<std::size_t>(sum.records, 1));
    report.distance_rms_vx = std::sqrt(sum.distance_sum / n);
    report.normal_rms_deg = 57.29577951308232 * std::sqrt(sum.normal_sum / n);
    return report;
}

void add_measures(const SnapReport& snapped, StageReport* report) {
    report->measures.push_back({"record_bricks", static_cast<double>(snapped.bricks)});
    report->measures.push_back({"snapped_bricks", static_cast<double>(snapped.snapped)});
    report->measures.push_back({"snap_labels", static_cast<double>(snapped.labels)});
    report->measures.push_back({"snap_rms_vx", snapped.distance_rms_vx});
    report->measures.push_back({"snap_rms_deg", snapped.normal_rms_deg});
}

}  // namespace sonocase::pipeline
