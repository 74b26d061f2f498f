// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/volume/label_map.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

#include "formats/bundle/stage_files.h"
#include "formats/files/load_save.h"
#include "formats/text/nearest_name.h"
#include "pipeline/anatomy/label_table.h"
#include "pipeline/anatomy/tissue_table.h"
#include "pipeline/base/source_checks.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/import/volume/volume_file.h"
#include "pipeline/import/volume/volume_header.h"

namespace sonocase::pipeline::inline import_volume {
namespace {

namespace fs = std::filesystem;

// What the readers give to import_label_map: structures as runs of voxels.
struct VoxelRun {
    std::uint32_t first = 0;  // voxel number
    std::uint32_t count = 0;
};

struct Structure {
    LabelTableEntry entry;  // the name is empty if none was found
    std::vector<VoxelRun> runs;
    std::uint64_t voxels = 0;
};

struct StructureList {
    Grid grid;
    std::vector<Structure> structures;
    std::vector<Note> notes;
    std::vector<std::string> warnings;
};

const LabelTableEntry* entry_of(const LabelTable& table, int value) {
    for (const LabelTableEntry& entry : table)
        if (entry.value == value) return &entry;
    return nullptr;
}

// Refuses a table with two names for one value.
Status check_table(const LabelTable& table, const std::string& where) {
    for (std::size_t i = 0; i < table.size(); ++i)
        for (std::size_t j = i + 1; j < table.size(); ++j)
            if (table[i].value == table[j].value && table[i].layer == table[j].layer)
                return Error{"value " + std::to_string(table[i].value) + " has two names, '" +
                                 table[i].name + "' and '" + table[j].name + "'",
                             where, "give each value one row"};
    return Done{};
}

bool same_grid(const Grid& a, const Grid& b) {
    if (!(a.size == b.size)) return false;
    const Point3 last{a.size.x - 1.0, a.size.y - 1.0, a.size.z - 1.0};
    return distance(a.origin_mm, b.origin_mm) < 0.01 &&
           distance(a.point_from_voxel(last), b.point_from_voxel(last)) < 0.01;
}

std::string grid_text(const Grid& grid) {
    return std::to_string(grid.size.x) + " x " + std::to_string(grid.size.y) + " x " +
           std::to_string(grid.size.z);
}

Status check_size(const Grid& grid, const std::string& where) {
    if (grid.voxel_count() <= std::numeric_limits<std::uint32_t>::max()) return Done{};
    return Error{"volume of " + grid_text(grid) + " voxels", where,
                 "expected at most 4 thousand million"};
}

// Appends the runs of voxels whose index is `place`.
void append_runs(const std::vector<std::uint8_t>& voxels,
                 std::uint8_t place,
                 Structure& structure) {
    std::size_t i = 0;
    while (i < voxels.size()) {
        if (voxels[i] != place) {
            ++i;
            continue;
        }
        const std::size_t first = i;
        while (i < voxels.size() && voxels[i] == place) ++i;
        structure.runs.push_back(
            {static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(i - first)});
        structure.voxels += i - first;
    }
}

// Reads a single file or a DICOM series.
Result<StructureList> read_label_file(const std::string& path, const std::string& table_path) {
    SONOCASE_TRY(auto file, read_label_layers(path));
    SONOCASE_TRY_DONE(check_size(file.grid, path));

    // The tables in order of precedence; a value takes its name from the first table that has it.
    std::vector<LabelTable> tables;
    if (!table_path.empty()) {
        SONOCASE_TRY(auto table, load_label_csv(table_path));
        SONOCASE_TRY_DONE(check_table(table, table_path));
        tables.push_back(std::move(table));
    }
    SONOCASE_TRY(auto segments, segments_of_fields(file.fields, path));
    if (path.ends_with(".nii") || path.ends_with(".nii.gz")) {
        SONOCASE_TRY(auto table, load_nifti_label_table(path));
        SONOCASE_TRY_DONE(check_table(table, path));
        tables.push_back(std::move(table));
    }
    if (is_volume_file_name(path)) {
        const std::string side =
            (fs::path(path).parent_path() / (volume_stem(path) + ".csv")).string();
        std::error_code code;
        if (table_path.empty() && fs::exists(side, code)) {
            SONOCASE_TRY(auto table, load_label_csv(side));
            SONOCASE_TRY_DONE(check_table(table, side));
            tables.push_back(std::move(table));
        }
    }

    StructureList list;
    list.grid = file.grid;
    list.notes = std::move(file.notes);
    list.warnings = std::move(file.warnings);
    for (std::size_t layer = 0; layer < file.layers.size(); ++layer) {
        // One pass over the voxels: a run ends where the value changes.
        const std::vector<std::uint8_t>& voxels = file.layers[layer];
        std::vector<Structure> of_place(file.values.size());
        for (std::size_t i = 0; i < voxels.size();) {
            const std::uint8_t place = voxels[i];
            const std::size_t first = i;
            while (i < voxels.size() && voxels[i] == place) ++i;
            if (file.values[place] == 0) continue;
            of_place[place].runs.push_back(
                {static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(i - first)});
            of_place[place].voxels += i - first;
        }
        for (std::size_t place = 0; place < of_place.size(); ++place) {
            Structure& structure = of_place[place];
            if (structure.voxels == 0) continue;
            const int value = file.values[place];
            for (const LabelTableEntry& segment : segments)
                if (segment.value == value && segment.layer == static_cast<int>(layer))
                    structure.entry = segment;
            for (const LabelTable& table : tables) {
                if (!structure.entry.name.empty()) break;
                if (const LabelTableEntry* entry = entry_of(table, value)) structure.entry = *entry;
            }
            if (structure.entry.name.empty())
                structure.entry.name = std::string(totalsegmentator_name(value));
            structure.entry.value = value;
            structure.entry.layer = static_cast<int>(layer);
            list.structures.push_back(std::move(structure));
        }
    }
    return list;
}

bool is_mask_folder(const std::string& path) {
    std::error_code code;
    if (!fs::is_directory(path, code)) return false;
    for (const auto& entry : fs::directory_iterator(path, code))
        if (is_volume_file_name(entry.path().string())) return true;
    return false;
}

// Reads a folder of binary masks; every value other than 0 is inside.
Result<StructureList> read_mask_folder(const std::string& folder, const std::string& table_path) {
    std::vector<std::string> files;
    std::error_code code;
    for (const auto& entry : fs::directory_iterator(folder, code)) {
        const std::string name = entry.path().filename().string();
        if (!name.starts_with('.') && is_volume_file_name(name))
            files.push_back(entry.path().string());
    }
    std::sort(files.begin(), files.end());  // a folder lists its files in no fixed order
    LabelTable table;
    if (!table_path.empty()) {
        SONOCASE_TRY(auto loaded, load_label_csv(table_path));
        table = std::move(loaded);
    }
    StructureList list;
    for (const std::string& path : files) {
        SONOCASE_TRY(auto mask, read_label_layers(path));
        if (mask.layers.size() != 1 || mask.values.size() > 2)
            return Error{
                "mask holds " + std::to_string(mask.values.size()) + " different values", path,
                "expected 0 and one other value in each file of the folder; give a label map "
                "by its own path"};
        if (list.structures.empty()) {
            list.grid = mask.grid;
            SONOCASE_TRY_DONE(check_size(list.grid, path));
        } else if (!same_grid(list.grid, mask.grid)) {
            return Error{"mask of " + grid_text(mask.grid) + " voxels lies on another grid than " +
                             files[0] + " (" + grid_text(list.grid) + ")",
                         path, "resample all masks to one grid"};
        }
        Structure structure;
        structure.entry.name = volume_stem(path);
        for (const LabelTableEntry& entry : table)
            if (entry.name == structure.entry.name) structure.entry = entry;
        if (structure.entry.value == 0)
            structure.entry.value = totalsegmentator_value(structure.entry.name);
        for (std::size_t place = 0; place < mask.values.size(); ++place)
            if (mask.values[place] != 0)
                append_runs(mask.layers[0], static_cast<std::uint8_t>(place), structure);
        list.structures.push_back(std::move(structure));
    }
    // Names that TotalSegmentator does not define get values above its own.
    int next = 1001;
    for (Structure& structure : list.structures)
        if (structure.entry.value == 0) structure.entry.value = next++;
    return list;
}

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

// The tissue of a structure, by the class in its table, else by its name. The class "fluid" names
// only a kind of tissue: which fluid it is, the name says if it names one.
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
    SONOCASE_TRY(auto file, load_label_file(path));
    if (file.frame != "ct")
        return Error{"labels are in the frame '" + file.frame + "'", path,
                     "expected labels of the patient, in the frame 'ct', as import writes them"};
    ImportedLabels result;
    result.labels = std::move(file.volume);
    if (!file.reports.empty()) result.report = file.reports.front();
    result.report.warnings.clear();  // they were reported when the file was made
    return result;
}

// Gives structures that no table names a name made from their value, and warns of them. Returns
// their number.
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
    std::string unknown;
    int unknown_count = 0;
    for (const Structure& structure : structures) {
        const LabelTableEntry& entry = structure.entry;
        const TissueChoice choice = tissue_of(entry);
        if (!choice.known && !entry.name.starts_with("label_"))
            unknown += (unknown_count++ > 0 ? ", " : "") + entry.name;
        labels.labels.push_back({entry.name, std::string(choice.tissue), entry.value,
                                 entry.colour.value_or(label_colour(entry.name))});
    }
    if (unknown_count > 0)
        warnings.push_back(
            "no rule knows what tissue these are, and they are taken as soft tissue: " + unknown +
            "; say so in the recipe's [labels]");
    return unknown_count;
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
    const Stopwatch watch;
    std::error_code code;
    if (!std::filesystem::is_directory(path, code)) {
        SONOCASE_TRY_DONE(check_source_file(path, "expected a label map"));
    }
    if (path.ends_with(".labels")) return from_stage_file(path);
    report_progress(progress, 0, "reading labels");
    SONOCASE_TRY(auto list, is_mask_folder(path) ? read_mask_folder(path, options.table)
                                                 : read_label_file(path, options.table));
    std::vector<Structure>& structures = list.structures;
    std::erase_if(structures, [](const Structure& s) { return s.voxels == 0; });
    if (structures.empty())
        return Error{"label map holds no body: every voxel is 0", path,
                     "expected the segmentation of a torso; check that this is the right file"};
    if (structures.size() > kMaxLabels - 1)
        return Error{std::to_string(structures.size()) + " labels", path,
                     "expected at most 254 structures and 0 outside; merge or drop labels"};

    ImportedLabels result;
    StageReport& report = result.report;
    report.stage = stage_names::kImport;
    report.version = kImportVersion;
    report.notes = std::move(list.notes);
    report.warnings = std::move(list.warnings);
    const int unnamed_count = name_unnamed(structures, report.warnings);
    std::stable_sort(
        structures.begin(), structures.end(),
        [](const Structure& a, const Structure& b) { return a.entry.value < b.entry.value; });
    SONOCASE_TRY_DONE(check_names(structures, path));
    const std::string& table = options.table.empty() ? path : options.table;
    SONOCASE_TRY_DONE(check_classes(structures, table));

    report_progress(progress, 0.6, "painting labels");
    LabelVolume& labels = result.labels;
    labels.grid = list.grid;
    if (options.scale != 1) {
        labels.grid.spacing_mm = options.scale * labels.grid.spacing_mm;
        for (int axis = 0; axis < 3; ++axis) labels.grid.origin_mm[axis] *= options.scale;
    }
    labels.labels.push_back({"outside", "outside", 0, {0, 0, 0}});
    const int unknown_count = fill_palette(structures, labels, report.warnings);
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
        {"unknown_tissues", static_cast<double>(unnamed_count + unknown_count)},
        {"overlapping_voxels", static_cast<double>(painted.overlaps)},
        {"voxel_volume_mm3", labels.grid.voxel_volume_mm3()},
        {"body_width_mm", box.extent().x},
        {"body_depth_mm", box.extent().y},
        {"body_height_mm", box.extent().z},
        {"body_volume_ml", static_cast<double>(painted.body_voxels) * voxel_ml},
    };
    report.seconds = watch.seconds();
    report_progress(progress, 1, "labels read");
    return result;
}

}  // namespace sonocase::pipeline::inline import_volume
