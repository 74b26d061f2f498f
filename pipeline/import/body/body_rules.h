// SPDX-License-Identifier: Apache-2.0

// Turns organs and a skin into a whole body: rules for what an atlas of organs lacks.
//
// Every voxel that only the skin encloses (label "body") is given a label here, in the order below;
// a structure that the meshes have is never painted over. Frame: RAS+ mm, x to the right, y to the
// front, z to the head; the patient stands or lies straight. All figures are those of an adult and
// assumptions unless a source is named. The report says what share of the body came from meshes.
#pragma once

#include <array>
#include <string>

#include "formats/base/stage_report.h"
#include "formats/volume/label_volume.h"
#include "pipeline/base/progress.h"

namespace sonocase::pipeline::inline import_body {

struct BodyOptions {
    bool enabled = true;       // false: the rest stays "body", soft tissue
    double arms_off_mm = 110;  // small parts of a slice beyond this from the midline go; 0: none
    double skin_mm = 2;
    double fat_mm = 14;          // under the skin, between flank and belly
    double cavity_mm = 30;       // organs are closed by this into one cavity
    double muscle_mm = 12;       // wall of belly and chest
    double back_muscle_mm = 40;  // about the spine, pelvis and thigh bones
    bool spine = true;
    double disc_pitch_mm = 34;  // lumbar; thoracic ones are 0.7 of it
    bool ribs = true;
    double rib_mm = 11;  // height of a rib
    double rib_pitch_mm = 25;
    bool lungs = true;
    double diaphragm_mm = 4;
    bool stomach = true;
    double stomach_gas = 0.35;  // share of its height
    bool psoas = true;
    bool rectus = true;
    bool leg_vessels = true;  // iliac and femoral arteries and veins
    double artery_mm = 8;     // diameter of the common iliac artery
    bool gall_bladder = true;
    double bladder_ml = 150;  // the bladder is filled to this; 0: as it is
};

inline constexpr std::size_t kMaxBodyLabels = 28;  // that the rules may add

// Fills the body in place and adds its measures and warnings to `report`. Cost: some 12 distance
// fields and passes over the voxels, 20 s for 25 M voxels.
void fill_body(LabelVolume& labels,
               const BodyOptions& options,
               StageReport& report,
               const Progress& progress = {});

}  // namespace sonocase::pipeline::inline import_body
