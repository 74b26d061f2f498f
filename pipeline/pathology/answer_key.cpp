// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pathology/answer_key.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <string_view>

#include "formats/base/digest.h"
#include "pipeline/pathology/label_canvas.h"
#include "pipeline/segmentation/distance/marked_distance.h"

namespace sonocase::pipeline::inline pathology {
namespace {

constexpr double kDepthReachMm = 150, kVesselReachMm = 40;

// The distance from some voxels to the nearest voxel of these labels, mm, and which label that is;
// limit_mm and 0 if there is none within limit_mm. The search widens step by step; beyond 24 mm it
// runs on a coarser grid.
struct Nearest {
    double mm = 0;
    std::uint8_t label = 0;
};
Nearest nearest(const LabelVolume& volume,
                const LabelSet& labels,
                const VoxelRange& tight,
                const std::vector<Int3>& voxels,
                double limit_mm) {
    const double mm = volume.grid.spacing_mm.x;
    for (const double reach_mm : {12.0, 24.0, 48.0, 150.0}) {
        const double reach = std::min(reach_mm, limit_mm);
        const int step = std::max(1, static_cast<int>(reach / 24 / mm));
        const int margin = static_cast<int>(std::ceil(reach / mm)) + step;
        VoxelRange wide = tight;
        for (int axis = 0; axis < 3; ++axis) {
            wide.low[axis] = std::max(0, tight.low[axis] - margin);
            wide.high[axis] = std::min(volume.grid.size[axis] - 1, tight.high[axis] + margin);
        }
        // Distances are taken from the lesion outwards, so that the label found is known.
        const Int3 size{(wide.high.x - wide.low.x) / step + 1,
                        (wide.high.y - wide.low.y) / step + 1,
                        (wide.high.z - wide.low.z) / step + 1};
        const auto index = [&](int i, int j, int k) {
            return i +
                   static_cast<std::size_t>(size.x) * (j + static_cast<std::size_t>(size.y) * k);
        };
        std::vector<std::uint8_t> marked(static_cast<std::size_t>(size.x) * size.y * size.z);
        for (const Int3 v : voxels)
            marked[index((v.x - wide.low.x) / step, (v.y - wide.low.y) / step,
                         (v.z - wide.low.z) / step)] = 1;
        const std::vector<float> from = distance_to_marked(marked, size);
        Nearest best{limit_mm, 0};
        for (int k = 0; k < size.z; ++k)
            for (int j = 0; j < size.y; ++j)
                for (int i = 0; i < size.x; ++i) {
                    const std::uint8_t label = volume.voxels[volume.grid.index(
                        wide.low.x + step * i, wide.low.y + step * j, wide.low.z + step * k)];
                    const double d = mm * (step * static_cast<double>(from[index(i, j, k)]) - 1);
                    if (labels[label] && d < best.mm) best = {std::max(0.0, d), label};
                }
        if (best.mm <= reach - mm || reach >= limit_mm) return best;
    }
    return {limit_mm, 0};
}

Vector3 diameters_mm(const std::vector<Int3>& voxels, Vector3 mean, double voxel_mm) {
    Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
    for (const Int3 v : voxels) {
        const Vector3 d = as_vector(v) - mean;
        const Eigen::Vector3d e(d.x, d.y, d.z);
        moments += e * e.transpose();
    }
    moments /= static_cast<double>(voxels.size());
    if (voxels.size() < 30) moments += Eigen::Matrix3d::Identity() / 12;  // of a voxel itself
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(moments);
    const auto diameter = [&](int n) {
        return 2 * voxel_mm * std::sqrt(5 * std::max(0.0, solver.eigenvalues()[n]));
    };
    return {diameter(2), diameter(1), diameter(0)};
}

constexpr std::string_view kMeasures[] = {
    "centre_x_mm",   "centre_y_mm",   "centre_z_mm", "volume_ml", "diameter_1_mm",
    "diameter_2_mm", "diameter_3_mm", "depth_mm",    "vessel_mm", "seed"};

}  // namespace

void measure_lesion(const LabelVolume& volume,
                    const VoxelRange& range,
                    const LabelSet& inside,
                    const LabelSet& vessels,
                    PathologyEntry& entry) {
    const Grid& grid = volume.grid;
    const double voxel_mm = grid.spacing_mm.x;
    std::vector<Int3> voxels;
    Vector3 sum;
    VoxelRange tight{range.high, range.low};
    std::vector<std::uint64_t> indices;
    for (int k = range.low.z; k <= range.high.z; ++k)
        for (int j = range.low.y; j <= range.high.y; ++j)
            for (int i = range.low.x; i <= range.high.x; ++i) {
                const std::size_t index = grid.index(i, j, k);
                if (!inside[volume.voxels[index]]) continue;
                const Int3 v{i, j, k};
                voxels.push_back(v);
                indices.push_back(index);
                sum = sum + as_vector(v);
                for (int axis = 0; axis < 3; ++axis) {
                    tight.low[axis] = std::min(tight.low[axis], v[axis]);
                    tight.high[axis] = std::max(tight.high[axis], v[axis]);
                }
            }
    if (voxels.empty()) return;
    const Vector3 mean = (1 / static_cast<double>(voxels.size())) * sum;
    Vector3 centre = mean;
    const Int3 middle{static_cast<int>(std::lround(mean.x)), static_cast<int>(std::lround(mean.y)),
                      static_cast<int>(std::lround(mean.z))};
    if (!inside[volume.voxels[grid.index(middle.x, middle.y, middle.z)]])
        centre = as_vector(*std::min_element(voxels.begin(), voxels.end(), [&](Int3 a, Int3 b) {
            return norm(as_vector(a) - mean) < norm(as_vector(b) - mean);
        }));
    entry.centre = grid.point_from_voxel(Point3{} + centre);
    entry.volume_ml = static_cast<double>(voxels.size()) * grid.voxel_volume_mm3() / 1000;
    entry.diameters_mm = diameters_mm(voxels, mean, voxel_mm);
    entry.depth_mm = nearest(volume, LabelSet{}.set(0), tight, voxels, kDepthReachMm).mm;
    const Nearest vessel = nearest(volume, vessels, tight, voxels, kVesselReachMm);
    entry.vessel_mm = vessel.mm;
    if (vessel.label != 0) entry.vessel = volume.labels[vessel.label].name;
    Digest digest;
    for (const std::uint64_t index : indices) digest.add(static_cast<std::int64_t>(index));
    entry.digest = digest.hex();
}

void add_key(const std::vector<PathologyEntry>& key, StageReport& report) {
    for (const PathologyEntry& e : key) {
        const double values[] = {e.centre.x,       e.centre.y,
                                 e.centre.z,       e.volume_ml,
                                 e.diameters_mm.x, e.diameters_mm.y,
                                 e.diameters_mm.z, e.depth_mm,
                                 e.vessel_mm,      static_cast<double>(e.seed)};
        MeasureGroup group{e.name, {}};
        for (std::size_t n = 0; n < std::size(kMeasures); ++n)
            group.values.push_back({std::string(kMeasures[n]), values[n]});
        report.groups.push_back(std::move(group));
        report.notes.push_back({e.name + ".kind", e.kind});
        report.notes.push_back({e.name + ".host", e.host});
        report.notes.push_back({e.name + ".vessel", e.vessel});
        report.notes.push_back({e.name + ".digest", e.digest});
    }
}

std::vector<PathologyEntry> key_of(const StageReport& report) {
    std::vector<PathologyEntry> key;
    for (const MeasureGroup& group : report.groups) {
        PathologyEntry e;
        e.name = group.name;
        const auto value = [&](std::size_t n) {
            for (const Measure& m : group.values)
                if (m.name == kMeasures[n]) return m.value;
            return 0.0;
        };
        const auto note = [&](const std::string& name) -> std::string {
            for (const Note& n : report.notes)
                if (n.name == group.name + name) return n.text;
            return {};
        };
        e.kind = note(".kind");
        e.host = note(".host");
        e.vessel = note(".vessel");
        e.digest = note(".digest");
        e.centre = {value(0), value(1), value(2)};
        e.volume_ml = value(3);
        e.diameters_mm = {value(4), value(5), value(6)};
        e.depth_mm = value(7);
        e.vessel_mm = value(8);
        e.seed = static_cast<std::int64_t>(value(9));
        if (!e.kind.empty()) key.push_back(std::move(e));
    }
    return key;
}

}  // namespace sonocase::pipeline::inline pathology
