// SPDX-License-Identifier: Apache-2.0

// What lies at a point of the volume and what a sample there sends back, for the reference
// renderer: labels, surfaces, scatterers, targets, the wall. Points are voxel coordinates.
#pragma once

#include <array>

#include "runtime/imaging/physical/model/physical_frame.h"
#include "runtime/imaging/physical/model/speckle_slice.h"
#include "runtime/imaging/physical/reference/reference_input.h"

namespace sonocase::runtime {

int nearest_integer(double x);

// Roughness of a surface at a point.
struct Roughness {
    double shift = 0;       // shift of the surface, in kRoughnessMm
    double log2_glint = 0;  // log2 of a factor of the echo's amplitude
    double re = 1, im = 0;  // the echo's phase
};
Roughness roughness_at(const PhysicalScene& scene, Point3 v);

// The label at a point, and the surface beside it if there is one.
struct Place {
    int label = 0;             // on the side of the surface where the point lies
    int own = 0, second = -1;  // labels on both sides; second < 0: no surface near
    double distance_mm = 0;    // > 0 on own's side
    Vector3 normal;
    Roughness rough;
};

// near: a random point less than a voxel away from v. Its voxel is looked up, and the plane that it
// stores is extended to v; where no plane is stored, the random step blends neighbouring voxels.
// Where v lies in the fine region, the step is the same number of the region's voxels.
Place place_at(const PhysicalScene& scene, const PhysicalFrame& frame, Point3 v, Point3 near);

// Echo offsets, dB: the baked one of the nearest voxel, and that of the label's fine structure.
double echo_offset_db(const PhysicalScene& scene, Point3 v);
double fine_offset_db(const PhysicalScene& scene, const PhysicalEffects& on, int label, Point3 v);

// Effect deformation: turns the surface near sample k of beam l with the pressed tissue, and shows
// the tissue around a collapsed lumen. point_on_beam() finds where a sample lies at rest. beam:
// unit, frame `mannequin`. Call it only where something is pressed.
void press_place(const ReferenceInput& in, int k, int l, Vector3 beam, Place& place);

// The scatterers of a sample, as physical/model/speckle_slice.h defines them.
struct SpeckleSample {
    std::array<double, physical::kMaxLooks> re{}, im{};  // one field per look
};

// place_mm: from the volume's origin. spacing_mm: distance of a column's scatterers along the
// normal.
SpeckleSample speckle_at(const physical::SpeckleSlice& slice,
                         Vector3 place_mm,
                         double cell_mm,
                         double spacing_mm,
                         int looks);

// A sample on its way through the effects.
struct Sample {
    const physical::Row& row;
    Vector3 from_origin{};    // mm from the volume's origin, before the slab's random step
    Point3 v{}, looked_up{};  // voxel coordinates: the sample, and the point that is looked up
    Place place{};
    int acoustics_index = 0;
    double re = 0, im = 0;                                           // echo of surfaces
    std::array<double, physical::kMaxLooks> field_re{}, field_im{};  // of scatterers, one per look
    double facing = 1;  // how squarely the beam meets the surface, 1 where there is none
    double loss = 0;    // log2 of amplitude that this sample takes
    double here = 0;    // amplitude of the light that arrives
};

// Adds the echo and the loss of the surface between two labels. beam: unit, frame `mannequin`.
void meet_surface(const ReferenceInput& in, Vector3 beam, Sample& p);
// Finds the target that the sample lies in, if any: the last one. Only soft tissue gives way to it.
void find_target(const ReferenceInput& in, Sample& p);
// Adds the surfaces of targets that are near.
void meet_targets(const ReferenceInput& in, Vector3 beam, Sample& p);

// Effect wall at a sample.
struct WallEcho {
    double amplitude = 0;  // before Row::interface_scale
    bool in_wall = false;  // above the organs
    double ground_db = 0;
};

// Echo of the wall's sheets at a sample. voxel: the sample's place in the middle of the slab;
// below, above: places half a node below and above it on the beam, node_mm apart.
WallEcho wall_echo(
    const ReferenceInput& input, Point3 above, Point3 voxel, Point3 below, double node_mm);

}  // namespace sonocase::runtime
