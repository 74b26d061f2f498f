// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/label_map.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <numeric>

#include "formats/bundle/stage_files.h"
#include "formats/files/stage_file.h"
#include "formats/text/nearest_name.h"
#include "pipeline/anatomy/tissue_table.h"
#include "pipeline/base/plausible_size.h"
#include "pipeline/import/label_colour.h"
#include "pipeline/import/source/source_path.h"
#include "pipeline/import/structure_list.h"

namespace sonocase::pipeline {
namespace {

Status check_names(const std::vector<Structure>& structures, const std::string& path) {
    for (std::size_t i = 0; i < structures.size(); ++i) {
        const LabelTableEntry& a = structures[i].entry;
        for (std::size_t j = i + 1; j < structures.size(); ++j) {
            const LabelTableEntry& b = structures[j].entry;
            if (a.name == b.name)
                return Error{"two labels are named '" + a.name + "' (values " +
                                 std::to_string(a.value) + " and " + std::to_string(b.value) + ")",
                             path, "give each label its own name in the label table"};
        }
        if (a.name == "outside")
            return Error{"value " + std::to_string(a.value) + " is named 'outside'", path,
                         "that name is kept for 0; rename it in the label table"};
    }
    return Done{};
}

// The tissue of a structure: by the class in its table, else by its name. "fluid" says no more than
// what kind of tissue it is: the name says which one, if it names a fluid.
TissueChoice tissue_of(const LabelTableEntry& entry) {
    const TissueChoice by_name = tissue_for_label(entry.name);
    if (entry.tissue_class.empty()) return by_name;
    if (entry.tissue_class != "fluid") return tissue_for_label(entry.tissue_class);
    const Tissue* named = find_tissue(by_name.tissue);
    return named != nullptr && named->kind == TissueKind::fluid ? by_name
                                                                : TissueChoice{"cyst", true};
}

Status check_classes(const std::vector<Structure>& structures, const std::string& table) {
    std::vector<std::string> names;
    for (const Tissue& tissue : built_in_tissues()) names.push_back(tissue.name);
    for (const Structure& structure : structures) {
        const std::string& given = structure.entry.tissue_class;
        if (given.empty() || given == "fluid" || tissue_for_label(given).known) continue;
        return Error{"'" + structure.entry.name + "' has the unknown tissue_class '" + given + "'",
                     table, suggest_name(given, names)};
    }
    return Done{};
}

// A .labels file of this program's own import, unchanged.
Result<ImportedLabels> from_stage_file(const std::string& path) {
    auto file = load_label_file(path);
    if (!file) return file.error();
    if (file->frame != "ct")
        return Error{"labels are in the frame '" + file->frame + "'", path,
                     "expected labels of the patient, in the frame 'ct', as import writes them"};
    ImportedLabels result;
    result.labels = std::move(file->volume);
    if (!file->reports.empty()) result.report = file->reports.front();
    result.report.warnings.clear();  // they were reported when the file was made
    return result;
}

// Names structures that no table names after their value; warns of them. Returns their number.
int name_unnamed(std::vector<Structure>& structures, std::vector<std::string>& warnings) {
    std::string unnamed;
    int unnamed_count = 0;
    for (Structure& structure : structures) {
        if (!structure.entry.name.empty()) continue;
        structure.entry.name = "label_" + std::to_string(structure.entry.value);
        if (structure.entry.layer > 0)
            structure.entry.name += "_layer_" + std::to_string(structure.entry.layer);
        unnamed += (unnamed_count++ > 0 ? ", " : "") + std::to_string(structure.entry.value);
    }
    if (unnamed_count > 0)
        warnings.push_back("no table names the values " + unnamed +
                           ": they are taken as soft tissue; give a table of value,name");
    return unnamed_count;
}

// Appends each structure to the palette; warns of names that no rule gives a tissue. Returns their
// number.
int fill_palette(const std::vector<Structure>& structures,
                 LabelVolume& labels,
                 std::vector<std::string>& warnings) {
    std::string strangers;
    int stranger_count = 0;
    for (const Structure& structure : structures) {
        const LabelTableEntry& entry = structure.entry;
        const TissueChoice choice = tissue_of(entry);
        if (!choice.known && !entry.name.starts_with("label_"))
            strangers += (stranger_count++ > 0 ? ", " : "") + entry.name;
        labels.labels.push_back({entry.name, std::string(choice.tissue), entry.value,
                                 entry.colour.value_or(label_colour(entry.name))});
    }
    if (stranger_count > 0)
        warnings.push_back(
            "no rule knows what tissue these are, and they are taken as soft tissue: " + strangers +
            "; say so in the recipe's [labels]");
    return stranger_count;
}

struct PaintCount {
    std::uint64_t overlaps = 0;  // voxels of more than one structure
    std::uint64_t body_voxels = 0;
};

// Writes the structures' runs into the volume; where they overlap the smaller structure remains.
PaintCount paint(const std::vector<Structure>& structures, LabelVolume& labels) {
    // Large structures first, so that small ones end on top.
    std::vector<std::size_t> order(structures.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        return structures[a].voxels > structures[b].voxels;
    });
    labels.voxels.assign(labels.grid.voxel_count(), 0);
    PaintCount count;
    for (const std::size_t s : order) {
        for (const VoxelRun run : structures[s].runs) {
            for (std::uint32_t v = run.first; v < run.first + run.count; ++v) {
                if (labels.voxels[v] != 0)
                    ++count.overlaps;
                else
                    ++count.body_voxels;
                labels.voxels[v] = static_cast<std::uint8_t>(s + 1);
            }
        }
    }
    return count;
}

}  // namespace

Box3 body_box(const LabelVolume& labels) {
    const Grid& grid = labels.grid;
    Int3 low{grid.size.x, grid.size.y, grid.size.z}, high{-1, -1, -1};
    std::size_t number = 0;
    for (int k = 0; k < grid.size.z; ++k) {
        for (int j = 0; j < grid.size.y; ++j) {
            for (int i = 0; i < grid.size.x; ++i, ++number) {
                if (labels.voxels[number] == 0) continue;
                low = {std::min(low.x, i), std::min(low.y, j), std::min(low.z, k)};
                high = {std::max(high.x, i), std::max(high.y, j), std::max(high.z, k)};
            }
        }
    }
    Box3 box;
    if (high.x < 0) return box;
    for (int corner = 0; corner < 8; ++corner)
        box.include(grid.point_from_voxel({(corner & 1) ? high.x + 0.5 : low.x - 0.5,
                                           (corner & 2) ? high.y + 0.5 : low.y - 0.5,
                                           (corner & 4) ? high.z + 0.5 : low.z - 0.5}));
    return box;
}

Result<ImportedLabels> import_label_map(const std::string& path,
                                        const ImportOptions& options,
                                        const Progress& progress) {
    const auto start = std::chrono::steady_clock::now();
    std::error_code code;
    if (!std::filesystem::is_directory(path, code)) {
        if (auto status = check_source_file(path, "expected a label map"); !status)
            return status.error();
    }
    if (path.ends_with(".labels")) return from_stage_file(path);
    report_progress(progress, 0, "reading labels");
    auto list = is_mask_folder(path) ? read_mask_folder(path, options.table)
                                     : read_label_file(path, options.table);
    if (!list) return list.error();
    std::vector<Structure>& structures = list->structures;
    std::erase_if(structures, [](const Structure& s) { return s.voxels == 0; });
    if (structures.empty())
        return Error{"label map holds no body: every voxel is 0", path,
                     "expected the segmentation of a torso; check that this is the right file"};
    if (structures.size() > kMaxLabels - 1)
        return Error{std::to_string(structures.size()) + " labels", path,
                     "expected at most 254 structures and 0 outside; merge or drop labels"};

    ImportedLabels result;
    StageReport& report = result.report;
    report.stage = "import";
    report.version = kImportVersion;
    report.warnings = std::move(list->warnings);
    const int unnamed_count = name_unnamed(structures, report.warnings);
    std::stable_sort(
        structures.begin(), structures.end(),
        [](const Structure& a, const Structure& b) { return a.entry.value < b.entry.value; });
    if (auto status = check_names(structures, path); !status) return status.error();
    const std::string& table = options.table.empty() ? path : options.table;
    if (auto status = check_classes(structures, table); !status) return status.error();

    report_progress(progress, 0.6, "painting labels");
    LabelVolume& labels = result.labels;
    labels.grid = list->grid;
    if (options.scale != 1) {
        labels.grid.spacing_mm = options.scale * labels.grid.spacing_mm;
        for (int axis = 0; axis < 3; ++axis) labels.grid.origin_mm[axis] *= options.scale;
    }
    labels.labels.push_back({"outside", "outside", 0, {0, 0, 0}});
    const int stranger_count = fill_palette(structures, labels, report.warnings);
    const PaintCount painted = paint(structures, labels);
    if (painted.overlaps > 0)
        report.warnings.push_back(
            std::to_string(painted.overlaps) +
            " voxels lie in more than one structure and went to the smaller one");
    const Box3 box = body_box(labels);
    if (const auto error = check_torso_extent(box.extent(), "body", path, "--scale")) return *error;

    const double voxel_ml = labels.grid.voxel_volume_mm3() / 1000;
    report.measures = {
        {"labels", static_cast<double>(structures.size())},
        {"unnamed_labels", static_cast<double>(unnamed_count)},
        {"unknown_tissues", static_cast<double>(unnamed_count + stranger_count)},
        {"overlapping_voxels", static_cast<double>(painted.overlaps)},
        {"voxel_volume_mm3", labels.grid.voxel_volume_mm3()},
        {"body_width_mm", box.extent().x},
        {"body_depth_mm", box.extent().y},
        {"body_height_mm", box.extent().z},
        {"body_volume_ml", static_cast<double>(painted.body_voxels) * voxel_ml},
    };
    report.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    report_progress(progress, 1, "labels read");
    return result;
}

}  // namespace sonocase::pipeline
