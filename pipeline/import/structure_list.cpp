// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/structure_list.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

namespace sonocase::pipeline {
namespace {

namespace fs = std::filesystem;

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

}  // namespace

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

Result<StructureList> read_label_file(const std::string& path, const std::string& table_path) {
    auto file = read_label_layers(path);
    if (!file) return file.error();
    if (auto status = check_size(file->grid, path); !status) return status.error();

    // The tables in order of precedence; a value takes its name from the first table that has it.
    std::vector<LabelTable> tables;
    if (!table_path.empty()) {
        auto table = load_label_csv(table_path);
        if (!table) return table.error();
        if (auto status = check_table(*table, table_path); !status) return status.error();
        tables.push_back(std::move(*table));
    }
    auto segments = segments_of_fields(file->fields, path);
    if (!segments) return segments.error();
    if (path.ends_with(".nii") || path.ends_with(".nii.gz")) {
        auto table = load_nifti_label_table(path);
        if (!table) return table.error();
        if (auto status = check_table(*table, path); !status) return status.error();
        tables.push_back(std::move(*table));
    }
    if (is_volume_file_name(path)) {
        const std::string side =
            (fs::path(path).parent_path() / (volume_stem(path) + ".csv")).string();
        std::error_code code;
        if (table_path.empty() && fs::exists(side, code)) {
            auto table = load_label_csv(side);
            if (!table) return table.error();
            if (auto status = check_table(*table, side); !status) return status.error();
            tables.push_back(std::move(*table));
        }
    }

    StructureList list;
    list.grid = file->grid;
    list.warnings = std::move(file->warnings);
    for (std::size_t layer = 0; layer < file->layers.size(); ++layer) {
        // One pass over the voxels: a run ends where the value changes.
        const std::vector<std::uint8_t>& voxels = file->layers[layer];
        std::vector<Structure> of_place(file->values.size());
        for (std::size_t i = 0; i < voxels.size();) {
            const std::uint8_t place = voxels[i];
            const std::size_t first = i;
            while (i < voxels.size() && voxels[i] == place) ++i;
            if (file->values[place] == 0) continue;
            of_place[place].runs.push_back(
                {static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(i - first)});
            of_place[place].voxels += i - first;
        }
        for (std::size_t place = 0; place < of_place.size(); ++place) {
            Structure& structure = of_place[place];
            if (structure.voxels == 0) continue;
            const int value = file->values[place];
            for (const LabelTableEntry& segment : *segments)
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
        auto loaded = load_label_csv(table_path);
        if (!loaded) return loaded.error();
        table = std::move(*loaded);
    }
    StructureList list;
    for (const std::string& path : files) {
        auto mask = read_label_layers(path);
        if (!mask) return mask.error();
        if (mask->layers.size() != 1 || mask->values.size() > 2)
            return Error{
                "mask holds " + std::to_string(mask->values.size()) + " different values", path,
                "expected 0 and one other value in each file of the folder; give a label map "
                "by its own path"};
        if (list.structures.empty()) {
            list.grid = mask->grid;
            if (auto status = check_size(list.grid, path); !status) return status.error();
        } else if (!same_grid(list.grid, mask->grid)) {
            return Error{"mask of " + grid_text(mask->grid) + " voxels lies on another grid than " +
                             files[0] + " (" + grid_text(list.grid) + ")",
                         path, "resample all masks to one grid"};
        }
        Structure structure;
        structure.entry.name = volume_stem(path);
        for (const LabelTableEntry& entry : table)
            if (entry.name == structure.entry.name) structure.entry = entry;
        if (structure.entry.value == 0)
            structure.entry.value = totalsegmentator_value(structure.entry.name);
        for (std::size_t place = 0; place < mask->values.size(); ++place)
            if (mask->values[place] != 0)
                append_runs(mask->layers[0], static_cast<std::uint8_t>(place), structure);
        list.structures.push_back(std::move(structure));
    }
    // Names that TotalSegmentator does not define get values above its own.
    int next = 1001;
    for (Structure& structure : list.structures)
        if (structure.entry.value == 0) structure.entry.value = next++;
    return list;
}

}  // namespace sonocase::pipeline
