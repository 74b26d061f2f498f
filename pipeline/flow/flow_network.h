// SPDX-License-Identifier: Apache-2.0

// Finds the flow through a tree of vessels from what its ends take.
//
// Arteries and veins are rooted at their thickest end, the portal system at its thickest end in the
// liver. What each other end takes or gives, and what each vessel that the labels lack does (renal
// arteries and others: "taps" along the line), is found by weighted least squares,
//
//     min  sum_j ((Q_j - Qref_j) / sd_j)^2 + sum_i ((k_i Q_i / A_i - PSVref_i) / sd_i)^2,
//
// Q_i being the sum of the outlets beyond vessel i and k_i its peak over its mean velocity, which
// depends on the waveform and is computed again in each of six rounds. A parent's waveform is the
// sum of its children's, so that flow is conserved at every junction at every instant.
#pragma once

#include <string>
#include <vector>

#include "formats/flow/flow_field.h"
#include "pipeline/flow/flow_reference.h"
#include "pipeline/flow/vessel_course.h"

namespace sonocase::pipeline::inline flow {

// Where vessels leave or join that the labels lack; absent ones have no value. Frame of the labels.
struct Landmarks {
    struct Level {
        bool known = false;
        Point3 place;
        Vector3 axis;  // unit, along the spine: the level is at right angles to it
    };
    Level coeliac;  // top of the first lumbar vertebra
    Level renal;    // between the first and the second
};
Landmarks find_landmarks(const LabelVolume& labels);

struct NetworkOptions {
    double rate_per_min = 70;
    double scale = 1;           // of every flow
    double unknown_ml_min = 0;  // through vessels whose names say nothing; 0: by size
    std::string unknown_wave = "artery";
};

// Flows that arteries were given, for the veins that drain them; 0: no such artery.
struct SolvedOutlets {
    double ml_s[8] = {};
};

// Adds the vessels of a part to the field, in order from the root. `solved`: filled in by arteries,
// used by veins.
void add_network(const LabelVolume& labels,
                 const VesselPart& part,
                 const CentreTree& tree,
                 std::vector<VesselCourse> courses,
                 const Landmarks& landmarks,
                 const NetworkOptions& options,
                 SolvedOutlets& solved,
                 FlowField& field);

}  // namespace sonocase::pipeline::inline flow
