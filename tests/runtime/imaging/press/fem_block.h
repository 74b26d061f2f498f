// SPDX-License-Identifier: Apache-2.0

// A block of tissue with the displacements that a nonlinear 3-D finite element model gives it under
// a flat face, and how far the press field is from them. Form of a folder:
// ../shared/data/deformation.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/base/result.h"
#include "runtime/imaging/press/press_field.h"

namespace sonocase::testing {

struct FemState {
    double pressed_mm = 0;
    double force_n = 0;
    std::vector<float> shift_mm;  // x, y, z of every node; empty: the force alone is known
};

struct FemBlock {
    Int3 nodes;  // x fastest
    Vector3 spacing_mm;
    Point3 origin_mm;                     // of node (0, 0, 0); z 0 at the face before pressing
    bool mirrored = false;                // only y >= 0 is stored
    std::vector<std::uint8_t> materials;  // of elements: index into tissues
    std::vector<runtime::press::PressTissue> tissues;
    int vein = -1, artery = -1;  // index of the material, if there is one
    std::vector<FemState> states;
    runtime::press::PressFace face;

    std::uint8_t material(Point3 rest) const;  // below and beside the block it goes on
    Vector3 shift(const FemState& state, int i, int j, int k) const;
    int middle_row() const;  // of nodes with y = 0
};

// Reads block.json and the volumes it names. The face is `half_face_mm` of block.json [along x,
// along y] where that is given; else the smaller one of 40 x 8 and 50 x 12 mm that holds every node
// that the states press. A state without a file has its force alone.
Result<FemBlock> read_fem_block(const std::string& folder);

struct BlockError {
    double pressed_mm = 0;
    double mean_mm = 0, p95_mm = 0;           // in the scan plane, within 40 mm under the face
    double off_plane_mean_mm = 0;             // at y = 10 mm
    double moved_mm = 0;                      // by the finite elements, mean
    double vein_area = -1, artery_area = -1;  // over that at rest; -1: there is none
    double fem_vein_area = -1, fem_artery_area = -1;  // the same of the finite elements
    double force_n = 0, fem_force_n = 0;
};

// The press field at the depth of a state, compared with it: the distance between where a node was
// and what pull_back says of where it is; areas of what the picture shows, by counting.
BlockError compare(const FemBlock& block,
                   const FemState& state,
                   runtime::press::PressField& field,
                   const runtime::press::PressOptions& options = {});

// The look-up of a block under a face that is pressed by `pressed_mm`.
struct PressedFemBlock {
    const FemBlock* block;
    double pressed_mm;
    std::uint8_t operator()(Point3 probe) const {
        return block->material({probe.x, probe.y, probe.z + pressed_mm});
    }
};

}  // namespace sonocase::testing
