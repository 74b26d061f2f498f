// SPDX-License-Identifier: Apache-2.0

#include "pipeline/export/export_level_sets.h"

#include <openvdb/openvdb.h>
#include <openvdb/tools/SignedFloodFill.h>

#include <algorithm>
#include <cmath>

#include "formats/files/atomic_file.h"
#include "formats/text/nearest_name.h"
#include "pipeline/segmentation/distance/label_distance.h"

namespace sonocase::pipeline::inline exporting {
namespace {

constexpr int kHalfWidth = 3;  // voxels, OpenVDB's own default

openvdb::FloatGrid::Ptr level_set(const LabelDistance& distance,
                                  std::uint8_t label,
                                  float voxel_mm) {
    const float background = kHalfWidth * voxel_mm;
    auto grid = openvdb::FloatGrid::create(background);
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    std::vector<float> phi;
    LabelDistance::Scratch work;
    const VoxelBox box = distance.distance(one_label(label), &phi, &work);
    auto accessor = grid->getAccessor();
    for (int k = 0; k < box.size.z; ++k) {
        for (int j = 0; j < box.size.y; ++j) {
            for (int i = 0; i < box.size.x; ++i) {
                const float d = phi[box.index(i, j, k)];
                if (std::abs(d) >= background) continue;
                accessor.setValue({box.first.x + i, box.first.y + j, box.first.z + k}, d);
            }
        }
    }
    openvdb::tools::signedFloodFill(grid->tree());
    return grid;
}

}  // namespace

Status export_level_sets(const LabelVolume& volume,
                         const std::string& path,
                         const LevelSetExportOptions& options,
                         const Progress& progress) {
    const Grid& g = volume.grid;
    const Vector3 h = g.spacing_mm;
    if (std::max({h.x, h.y, h.z}) > 1.001 * std::min({h.x, h.y, h.z})) {
        return Error{"the voxels are not cubic", path, "resample before exporting level sets"};
    }
    std::vector<std::size_t> wanted;
    std::vector<std::string> names;
    for (const Label& label : volume.labels) names.push_back(label.name);
    if (options.labels.empty()) {
        for (std::size_t l = 1; l < names.size(); ++l) wanted.push_back(l);
    }
    for (const std::string& name : options.labels) {
        const auto at = std::find(names.begin(), names.end(), name);
        if (at == names.end()) {
            return Error{"no label '" + name + "'", path, suggest_name(name, names)};
        }
        wanted.push_back(static_cast<std::size_t>(at - names.begin()));
    }
    try {
        openvdb::initialize();
        const LabelDistance distance(volume, {.sigma_vx = options.sigma_vx});
        // Columns of direction times spacing carry an index to the frame; OpenVDB multiplies rows.
        openvdb::Mat4d index_to_world = openvdb::Mat4d::identity();
        for (int a = 0; a < 3; ++a) {
            for (int r = 0; r < 3; ++r) index_to_world(a, r) = h[a] * g.direction(r, a);
            index_to_world(3, a) = g.origin_mm[a];
        }
        openvdb::GridPtrVec grids;
        for (std::size_t n = 0; n < wanted.size(); ++n) {
            report_progress(progress, static_cast<double>(n) / static_cast<double>(wanted.size()),
                            "level sets");
            const std::size_t l = wanted[n];
            auto grid = level_set(distance, static_cast<std::uint8_t>(l), static_cast<float>(h.x));
            grid->setTransform(openvdb::math::Transform::createLinearTransform(index_to_world));
            grid->setName(volume.labels[l].name);
            grid->insertMeta("tissue", openvdb::StringMetadata(volume.labels[l].tissue));
            grids.push_back(grid);
        }
        OutputFile out(path);
        openvdb::io::File file(out.temporary());
        file.write(grids);
        file.close();
        return out.commit();
    } catch (const std::exception& exception) {
        return Error{exception.what(), path, "a folder that can be written"};
    }
}

}  // namespace sonocase::pipeline::inline exporting
