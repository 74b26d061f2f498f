// SPDX-License-Identifier: Apache-2.0

// Which label each node of a set of meshes becomes: a CSV of
// node,label,role[,tissue_class[,hole_mm2]], the last the largest section of a lumen.
//
//     # attribution: ...           shown with everything made from the meshes; may be given often
//     node,label,role,tissue_class
//     VH_F_skin,,body,             the skin: its inside is the body
//     VH_F_*_of_spleen,spleen,organ,
//     VH_F_renal_pyramid_L_*,kidney_left_medulla,part,kidney_cortex
//     VHF_*_vein,veins,lumen,blood a pipe with a wall: filled
//     VH_F_*ligament*,,skip,
//     VH_F_Vasculature.glb,y 50: 0.972 -8.2 1.071 -3.8 0.972 -48.6,frame,
// `*` stands for any letters. The first row that matches counts. A row of role `frame` is for a
// file: at that height along the axis of the file, in mm, each axis is scaled and shifted; between
// several heights the changes are blended, and beyond them the nearest one applies.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/base/result.h"

namespace sonocase::pipeline::inline import_mesh {

enum class NodeRole { body, organ, part, lumen, skip };

struct NodeRow {
    std::string pattern, label, tissue_class;
    NodeRole role = NodeRole::organ;
    double hole_mm2 = 0;  // largest section of a lumen; 0: as the options say
    int line = 0;
};

struct FrameRow {
    std::string pattern;  // of the file's name
    int axis = 1;
    double at_mm = 0;
    std::array<double, 6> change{1, 0, 1, 0, 1, 0};  // scale and shift of x, y, z
};

struct NodeTable {
    std::vector<NodeRow> rows;
    std::vector<FrameRow> frames;
    std::string attribution;

    const NodeRow* find(std::string_view node) const;  // null: no row matches
    // A point of a file in mm, its frame changed.
    Point3 placed(const std::string& file, Point3 p) const;
};

bool matches_pattern(std::string_view pattern, std::string_view name);

// Errors name the line: a role that does not exist, an organ without a label, numbers missing.
Result<NodeTable> parse_node_table(std::string_view csv, const std::string& where);

}  // namespace sonocase::pipeline::inline import_mesh
