// SPDX-License-Identifier: Apache-2.0

#include "pipeline/flow/flow_network.h"

#include "pipeline/flow/vessel_network.h"

namespace sonocase::pipeline {

void add_network(const LabelVolume& labels,
                 const VesselPart& part,
                 const CentreTree& tree,
                 std::vector<VesselCourse> courses,
                 const Landmarks& landmarks,
                 const NetworkOptions& options,
                 SolvedOutlets& solved,
                 FlowField& field) {
    VesselNetwork network(labels, part, tree, std::move(courses), options);
    if (network.empty()) return;
    network.root(landmarks);
    network.add_taps(landmarks);
    network.add_ends(solved);
    network.solve();
    if (part.kind == FlowKind::artery) network.remember(solved);
    network.write(field);
}

}  // namespace sonocase::pipeline
