// SPDX-License-Identifier: Apache-2.0

// Courses of vessels: smooth, evenly spaced nodes with sections, made from centrelines in voxels.
#pragma once

#include <vector>

#include "formats/flow/flow_field.h"
#include "pipeline/flow/centreline.h"

namespace sonocase::pipeline::inline flow {

// A vessel of the tree, in the order of its line; which way blood runs is not known yet.
struct VesselCourse {
    int first = -1, last = -1;  // nodes of the tree
    std::vector<FlowNode> nodes;
    int label = 0;                               // palette index that most of it lies in
    double max_radius_mm = 40;                   // of a section
    double fork_first_mm = 0, fork_last_mm = 0;  // within a fork at either end
};

struct CourseOptions {
    double node_mm = 3;    // between nodes
    double smooth_mm = 5;  // of the line, standard deviation
};

// Sections are measured in `labels` itself, where the part may be coarser: 16 rays across to where
// a trilinear blend of the voxels of that kind falls to one half, at most 1.5 times their median,
// since rays escape into other vessels at forks. Within a fork a vessel keeps its next section.
// Free ends are straightened: a line in voxels bends into a corner of the end face. # tree.lines; a
// line too short to have a course has no nodes. Cost: 1 ms per 100 nodes.
std::vector<VesselCourse> vessel_courses(const LabelVolume& labels,
                                         const VesselPart& part,
                                         const CentreTree& tree,
                                         const CourseOptions& options = {});

// Measures the sections again, from centres and directions, after a course was reversed or cut:
// rays are counted from a direction that the first node gives.
void measure_sections(const LabelVolume& labels, FlowKind kind, VesselCourse& course);

// Makes the course start at its other end; sections are measured again.
void reverse_course(const LabelVolume& labels, FlowKind kind, VesselCourse& course);

}  // namespace sonocase::pipeline::inline flow
