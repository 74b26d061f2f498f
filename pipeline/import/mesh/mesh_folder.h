// SPDX-License-Identifier: Apache-2.0

// Organ meshes as labels on a grid: a folder of them, or one file, and the table that says what
// each node is (node_table.h).
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/volume/label_volume.h"
#include "pipeline/base/progress.h"
#include "pipeline/base/source_checks.h"
#include "pipeline/import/mesh/mend_mesh.h"
#include "pipeline/import/mesh/solid_voxels.h"

namespace sonocase::pipeline::inline import_mesh {

struct MeshOptions {
    double voxel_mm = 1.5;                // of the grid, [0.3, 10]
    double scale = 1;                     // mm per unit of the file; GLB: metres per unit
    double low_mm = -1e9, high_mm = 1e9;  // heights (z) between which the body is kept
    double weld_mm = 0.01;
    double cap_mm = 400;  // a longer cap is an error, unless
    bool allow_long_caps = false;
    double hole_mm2 = 900;     // of a lumen's slices
    double accuracy = 2;       // of the winding numbers of open meshes
    Axes axes = Axes::unsaid;  // of every file, told by hand; unsaid: as each says
};

struct MeshSolid {
    std::string label, tissue_class;
    bool is_body = false;  // the skin's inside
    VoxelMask mask;
};

struct MeshBody {
    Grid grid;                      // RAS+ mm, direction the identity
    std::vector<MeshSolid> solids;  // in the order of their labels' first rows
    std::string attribution;
    StageReport report;  // measures: nodes, caps, ...; groups: volume_ml by label; warnings
};

bool is_mesh_source(const std::string& path);  // a mesh file, or a folder with one

// What is known of read_meshes before anything is mended or filled.
struct MeshExtent {
    Grid grid;
    // Faces of voxels at the organs' triangles between the heights that are kept, caps left out,
    // and at those of the body.
    double organ_faces = 0, body_faces = 0;
};

// Errors: those of reading.
Result<MeshExtent> mesh_extent(const std::string& path,
                               const std::string& table_path,
                               const MeshOptions& options);

// GLB is in metres, y to the head, z to the front, x to the patient's left; everything else is in
// mm, RAS+ or LPS+ as its header says, RAS+ if none says anything; the report's note "axes" says
// which. Nodes of one label are one solid. Errors: what the readers refuse; nodes without a row,
// listed; files of which some say their axes and some do not; a label that two files give as
// organs; a cap longer than allowed; no body. Warnings: loops that do not close, components that
// faced inwards, volumes of voxels and mesh that differ by more than 3 %, lumens that leaked.
Result<MeshBody> read_meshes(const std::string& path,
                             const std::string& table_path,
                             const MeshOptions& options,
                             const Progress& progress = {});

}  // namespace sonocase::pipeline::inline import_mesh
