// SPDX-License-Identifier: Apache-2.0

// The vessels of one part as a network: edges with courses, joined at nodes, and the outlets at its
// ends and along it. Private to this room; flow_network.h is its door.
//
//     VesselNetwork network(labels, part, tree, courses, options);
//     network.root(landmarks);      // in order from the root            vessel_network.cpp
//     network.add_taps(landmarks);  // vessels that the labels lack      network_outlets.cpp
//     network.add_ends(solved);     // what the ends take or give
//     network.solve();              // flows, waveforms                  network_flow.cpp
//     network.write(field);
#pragma once

#include <map>
#include <string>
#include <vector>

#include "pipeline/flow/flow_network.h"

namespace sonocase::pipeline {

struct NetworkEdge {
    VesselCourse course;  // first and last: nodes; the first is nearer to the root once rooted
    double area_mm2 = 0;
    std::vector<int> outlets;  // beyond it
    double ml_s = 0;
    double peak_factor = 1;
};

struct NetworkOutlet {
    int node = -1;
    Outlet what = Outlet::unknown;
    bool course = true;  // the end of a vessel; false: a tap
    double usual_ml_s = 0, sd_ml_s = 1;
    double ml_s = 0;  // found
    double sign = 1;  // -1: flows the other way than those of the root's other side
    FlowWave wave{};
    double breathing = 0;
};

class VesselNetwork {
  public:
    VesselNetwork(const LabelVolume& labels,
                  const VesselPart& part,
                  const CentreTree& tree,
                  std::vector<VesselCourse> courses,
                  const NetworkOptions& options);

    bool empty() const { return edges_.empty(); }
    void root(const Landmarks& landmarks);
    void add_taps(const Landmarks& landmarks);
    void add_ends(const SolvedOutlets& solved);
    void solve();
    void remember(SolvedOutlets& solved) const;
    void write(FlowField& field);

  private:
    // Cuts edge e at its node i; returns the new node of the network.
    int cut(std::size_t e, std::size_t i);
    // Cuts the vessel whose label holds `word` where it passes the level; -1: it does not reach it.
    int cut_at(const char* word, const Landmarks::Level& level);
    void add_tap(int node, Outlet what);
    bool tap_along(std::size_t e, double at_mm, double least_mm, Outlet what);
    void set_reference(const SolvedOutlets& solved, NetworkOutlet& o) const;
    void set_by_size(NetworkOutlet& o) const;
    void share_liver();
    void assign(const std::vector<double>& ml_s);
    bool has_reference(const NetworkEdge& e) const;
    FlowVessel vessel_of(const NetworkEdge& e) const;

    std::map<int, int> degrees() const;  // of the nodes
    std::vector<int> beyond(int node) const;
    std::string name_of(const NetworkEdge& e) const;
    double trunk_first(const VesselCourse& c, bool last, const Landmarks::Level& renal) const;
    double liver_share(const VesselCourse& c, bool last) const;

    const LabelVolume& labels_;
    FlowKind kind_;
    const NetworkOptions& options_;
    std::vector<NetworkEdge> edges_;
    std::vector<NetworkOutlet> outlets_;
    int root_ = -1, nodes_ = 0;
    bool splenic_given_ = false;
};

// Of the middle one of a course's sections.
double median_area(const VesselCourse& course);

}  // namespace sonocase::pipeline
