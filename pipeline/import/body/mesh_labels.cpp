// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/body/mesh_labels.h"

#include <algorithm>
#include <numeric>

#include "pipeline/anatomy/tissue_table.h"
#include "pipeline/base/stopwatch.h"

namespace sonocase::pipeline::inline import_body {
namespace {

// Large solids first, so that small ones end on top; the body is below all.
void paint_solids(const MeshBody& body, LabelVolume& labels) {
    std::vector<std::size_t> order(body.solids.size()), count;
    std::iota(order.begin(), order.end(), std::size_t{0});
    for (const MeshSolid& solid : body.solids)
        count.push_back(solid.is_body ? SIZE_MAX : solid.mask.count());
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return count[a] > count[b]; });
    for (const std::size_t s : order) {
        const VoxelMask& mask = body.solids[s].mask;
        for (int k = 0; k < mask.size.z; ++k)
            for (int j = 0; j < mask.size.y; ++j)
                for (int i = 0; i < mask.size.x; ++i)
                    if (mask.inside[mask.index(i, j, k)])
                        labels.voxels[labels.grid.index(mask.first.x + i, mask.first.y + j,
                                                        mask.first.z + k)] =
                            static_cast<std::uint8_t>(s + 1);
    }
}

// Drops labels without a voxel (beyond the crop), keeping the order of the others.
void drop_empty(LabelVolume& labels, StageReport& report) {
    std::vector<std::size_t> count(labels.labels.size(), 0);
    for (const std::uint8_t v : labels.voxels) ++count[v];
    std::vector<std::uint8_t> renamed(labels.labels.size(), 0);
    std::vector<Label> kept;
    int dropped = 0;
    for (std::size_t l = 0; l < labels.labels.size(); ++l) {
        if (l > 0 && count[l] == 0) {
            ++dropped;
            continue;
        }
        renamed[l] = static_cast<std::uint8_t>(kept.size());
        kept.push_back(labels.labels[l]);
        kept.back().source_value = static_cast<int>(kept.size()) - 1;
    }
    for (std::uint8_t& v : labels.voxels) v = renamed[v];
    labels.labels = std::move(kept);
    report.measures.push_back({"labels_cropped_away", static_cast<double>(dropped)});
}

}  // namespace

Result<ImportedLabels> import_meshes(const std::string& path,
                                     const std::string& table,
                                     const MeshImportOptions& options,
                                     const Progress& progress) {
    const Stopwatch watch;
    SONOCASE_TRY(auto body, read_meshes(path, table, options.mesh, progress));
    if (body.solids.size() + kMaxBodyLabels > kMaxLabels - 1)
        return Error{std::to_string(body.solids.size()) + " labels", table,
                     "expected fewer: give parts of one organ one label"};
    ImportedLabels result;
    result.report = std::move(body.report);
    result.report.stage = stage_names::kImport;
    result.report.version = kMeshImportVersion;
    LabelVolume& labels = result.labels;
    labels.grid = body.grid;
    labels.voxels.assign(labels.grid.voxel_count(), 0);
    labels.labels.push_back({"outside", "outside", 0, {0, 0, 0}});
    std::string unknown;
    for (const MeshSolid& solid : body.solids) {
        const std::string& given = solid.tissue_class;
        if (!given.empty() && find_tissue(given) == nullptr)
            return Error{"unknown tissue_class '" + given + "'", table,
                         "expected a tissue of docs/textures.md"};
        const TissueChoice choice = tissue_for_label(given.empty() ? solid.label : given);
        if (!choice.known) unknown += (unknown.empty() ? "" : ", ") + solid.label;
        labels.labels.push_back(
            {solid.label, std::string(choice.tissue), 0, label_colour(solid.label)});
    }
    if (!unknown.empty())
        result.report.warnings.push_back(
            "no rule knows what tissue these are, and they are taken "
            "as soft tissue: " +
            unknown + "; give them a tissue_class in the table");
    paint_solids(body, labels);
    body.solids.clear();
    report_progress(progress, 0.6, "filling in what the meshes lack");
    fill_body(labels, options.body, result.report, [&](double share, std::string_view what) {
        report_progress(progress, 0.6 + 0.4 * share, what);
    });
    drop_empty(labels, result.report);
    if (!body.attribution.empty()) result.report.notes.push_back({"attribution", body.attribution});
    result.report.measures.push_back({"labels", static_cast<double>(labels.labels.size() - 1)});
    const Box3 box = body_box(labels);
    if (box.empty())
        return Error{"no body: nothing is inside the meshes", path,
                     "expected solids, and one node of role body"};
    result.report.measures.push_back({"body_width_mm", box.extent().x});
    result.report.measures.push_back({"body_depth_mm", box.extent().y});
    result.report.measures.push_back({"body_height_mm", box.extent().z});
    result.report.seconds = watch.seconds();
    return result;
}

}  // namespace sonocase::pipeline::inline import_body
