// SPDX-License-Identifier: Apache-2.0

// What model `physical` needs of a bundle, laid out for the frame loop. Voxel pools are used where
// they lie in the bundle.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "formats/base/result.h"
#include "formats/bundle/streamed_bundle.h"
#include "formats/exercise/exercise.h"
#include "runtime/imaging/physical/model/brick_table.h"
#include "runtime/imaging/physical/model/fine_structure.h"

namespace sonocase::runtime {

// The echo of the surface between two labels.
struct PairEcho {
    double amplitude = 0;   // 60 R^0.85; 0: none
    double sigma_mm = 0.2;  // of the reflecting layer
    double split_mm = 0;    // of two layers, to either side of the surface; 0: one
    bool hard = false;      // bone or gas on one side
    bool refracts = false;  // fluid on one side
    int pulse = 0;          // +1: the first label swells with the pulse, -1: the second
};

struct AcousticProperties {
    double echo_db = 0;
    double attenuation = 0;  // dB/cm/MHz
    TissueKind kind = TissueKind::outside;
};

// A ball of the exercise, put into the anatomy.
struct TargetBall {
    Point3 centre_vx;  // voxel coordinates
    double radius_mm = 5;
    int look = 0;     // index into looks
    double wall = 0;  // amplitude of its surface
    bool fluid = false;
};

struct PhysicalScene {
    const CaseBundle* bundle = nullptr;
    Grid grid;
    double voxel_mm = 1;

    // All filled in where all of the bundle is there; else to be asked for what a frame reads.
    BrickTable words;
    std::vector<AcousticProperties> looks;  // # labels
    std::vector<PairEcho> pairs;            // # labels^2, [own * # labels + second]
    bool has_hard = true;  // some label is bone or gas: what plans for scenes without go by

    std::span<const std::uint32_t> rough;  // rough_surfaces()
    std::vector<std::int8_t> speckle;      // pairs, edge 2^kSpeckleLog2
    FineStructure fine;

    std::vector<TargetBall> targets;

    int labels() const { return static_cast<int>(bundle->labels.size()); }
};

// Boundary roughness and glint, kRoughEdge^3: byte 0 roughness (/ 32), byte 1 log2 of the glint (/
// 32), bytes 2 and 3 cosine and sine of its phase (/ 127); all signed. It depends on nothing: made
// once, by whoever asks first.
const std::vector<std::uint32_t>& rough_surfaces();

// targets: of the exercise; those that only mark a place leave no trace in the tissue.
Result<PhysicalScene> make_physical_scene(CaseView view, const std::vector<Target>& targets = {});

}  // namespace sonocase::runtime
