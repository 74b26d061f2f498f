// SPDX-License-Identifier: Apache-2.0

// What the readers of label maps give to import_label_map: structures as runs of voxels.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/anatomy/label_table.h"
#include "pipeline/import/volume/volume_file.h"

namespace sonocase::pipeline {

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
    std::vector<std::string> warnings;
};

// A single file or a DICOM series.
Result<StructureList> read_label_file(const std::string& path, const std::string& table_path);
// A folder of binary masks; every value other than 0 is inside.
Result<StructureList> read_mask_folder(const std::string& folder, const std::string& table_path);
bool is_mask_folder(const std::string& path);

// Appends the runs of voxels whose index is `place`.
void append_runs(const std::vector<std::uint8_t>& voxels, std::uint8_t place, Structure& structure);

}  // namespace sonocase::pipeline
