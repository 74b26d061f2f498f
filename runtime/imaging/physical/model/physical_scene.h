// SPDX-License-Identifier: Apache-2.0

// What model `physical` needs of a bundle and an exercise, laid out for the frame loop. Voxel pools
// are used where they lie in the bundle.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "formats/base/jobs.h"
#include "formats/base/result.h"
#include "formats/bundle/case_bundle.h"
#include "formats/exercise/exercise.h"
#include "formats/machine/machine.h"
#include "runtime/imaging/physical/model/brick_table.h"
#include "runtime/imaging/physical/model/fine_structure.h"
#include "runtime/imaging/physical/model/physical_model.h"
#include "runtime/imaging/physical/model/physical_textures.h"
#include "runtime/imaging/physical/model/region_look_up.h"
#include "runtime/imaging/physical/model/tissue_layers.h"

namespace sonocase::runtime {

// The echo of the surface between two labels.
struct PairEcho {
    double amplitude = 0;   // 60 R^0.85; 0: none
    double sigma_mm = 0.2;  // deviation of the reflecting layer
    double split_mm = 0;    // > 0: two layers, this far to either side of the surface
    bool diffuse = false;   // bone, gas or a wall in fibrous tissue: bright at most angles
    bool refracts = false;  // fluid on one side
    int pulse = 0;          // +1: the first label swells with the pulse, -1: the second
};

struct AcousticProperties {
    double echo_db = 0;
    double attenuation = 0;  // dB/cm/MHz
    TissueKind kind = TissueKind::outside;
    double wall_db = 0;  // added to echo_db by effect wall, whose sheets draw the skin
};

// A target or finding of the exercise, or a part of one: a ball or an ellipsoid in the anatomy. An
// ellipsoid is where f . shape f <= radius_mm^2, f from its centre in mm.
struct TargetBall {
    Point3 centre_vx;  // voxel coordinates
    double radius_mm = 5;
    double reach_mm = 5;  // half the longest axis
    bool round = true;    // shape is the identity
    Matrix3 shape;        // symmetric
    int acoustics = 0;    // index into PhysicalScene::acoustics
    double wall = 0;      // amplitude of its surface
    bool fluid = false;
    bool anywhere = false;  // shows in fluid as well
    bool covers = false;    // hides the surfaces of the tissue in it: a pool
    // Free fluid: it has no surface of its own, takes the place of this label alone, and ends at a
    // plane so far above the centre; up: unit vector in the volume.
    int only_label = -1;
    Vector3 level_up;
    double level_mm = 0;
    int lesion = -1;  // of the exercise's shown lesions; -1: what an act has put there
};

// Cells of the plates of organs (plate_kind()) from the volume's corner on, x fastest: 1 where the
// middle of a cell lies in parenchyma. Empty: none does, or the machine shows no plates.
struct PlateCells {
    Int3 size{0, 0, 0};
    std::vector<std::uint8_t> holds;
};

struct PhysicalScene {
    const CaseBundle* bundle = nullptr;
    Grid grid;
    double voxel_mm = 1;
    double roughness_mm = physical::kRoughnessMm;  // deviation of surfaces

    // Complete where the bundle is complete; otherwise each frame loads what it reads.
    BrickTable words;
    RegionLookUp region;                        // on smaller voxels; complete from the start
    std::vector<AcousticProperties> acoustics;  // # labels, then one per target
    std::vector<std::int32_t> is_vein;          // 256: 1 for draining lumens
    std::vector<std::int32_t> closed_label;     // 256: label that is shown of a collapsed lumen
    std::vector<PairEcho> pairs;                // # labels^2, [own * # labels + second]
    std::vector<bool> is_lung;                  // # labels
    bool has_gas = false;                       // some label is gas or lung
    bool has_hard = true;  // some label is bone or gas; if none, their kernels are left out

    std::shared_ptr<const PhysicalTextures> textures;
    FineStructure fine;
    // Limit of a baked offset, dB, # labels: plates draw the septa of muscle and fat, which voxels
    // show as grains. Empty: no limit.
    std::vector<double> max_structure_db;
    // Dead zone of a baked offset, dB, # labels. An offset of an organ as small as this is noise,
    // which the cube of parenchyma draws while that effect is on, and is left out; a larger one is
    // reduced by it. Empty: none.
    std::vector<double> structure_dead_db;
    bool has_parenchyma = false;  // some label has its cube
    PlateCells plate_cells;       // for effect streaks
    bool has_septa = false;       // some label is fat or muscle
    TissueLayers layers;

    std::vector<TargetBall> targets;
    bool has_acts = false;  // the exercise has a procedure
    // Acoustics of what acts put into the tissue; -1: none.
    int clear_pool = -1, blood_pool = -1;
    std::vector<TargetBall> free_fluids;  // without their levels

    int labels() const { return static_cast<int>(bundle->labels.size()); }
};

struct PhysicalSceneOptions {
    JobRunner* jobs = nullptr;                         // null: one job after the other
    std::shared_ptr<const PhysicalTextures> textures;  // null: made here
    std::map<std::string, double> tissue_db;           // echo of labels, instead of the bundle's
    MachineStructures structures;                      // structures that the machine shows
    bool fine = false;                                 // physical::shows_fine()
    bool speckle_reduction = true;                     // whether the machine has it
    bool acts = false;                                 // the exercise has a procedure
    std::vector<FreeFluid> free_fluids;                // of the exercise
};

// targets: those of the exercise, with its findings; those that only mark a place do not show in
// the tissue. Where two overlap, the later one shows. The bundle must outlive the scene. Errors: a
// bundle without labels; too little memory for the tables. Cost: some tens of ms for a torso at 1
// mm.
Result<PhysicalScene> make_physical_scene(CaseView view,
                                          const std::vector<Target>& targets = {},
                                          const PhysicalSceneOptions& options = {});

// The balls of a frame: the scene's, with the exercise's targets as large as they still are, and
// what acts have put between them. first_target: number of shown lesions before the targets.
// pushed_axes: the probe's axes, where pools have pushed tissue aside in its plane
// (formats/exercise/pool_shift.h), so that their fluid takes the place of what is left within them;
// null: they lie in place of the tissue.
// balls: cleared; allocates nothing within kMaxFrameBalls.
inline constexpr std::size_t kMaxFrameBalls =
    physical::kMaxTargets + SceneChange::kMaxPools + SceneChange::kMaxFluids;
void balls_of_frame(const PhysicalScene& scene,
                    const SceneChange& change,
                    int first_target,
                    const Matrix3* pushed_axes,
                    std::vector<TargetBall>& balls);

}  // namespace sonocase::runtime
