// SPDX-License-Identifier: Apache-2.0

#include "pipeline/flow/vessel_network.h"

#include <algorithm>
#include <cmath>

#include "formats/flow/flow_at.h"

namespace sonocase::pipeline {
namespace {

constexpr double kPi = 3.14159265358979323846;

bool contains(const std::string& text, const char* word) {
    return text.find(word) != std::string::npos;
}

std::string numbered(const std::string& name, const FlowField& field) {
    int count = 1;
    for (const FlowVessel& v : field.vessels)
        if (v.name == name || v.name.rfind(name + " ", 0) == 0) ++count;
    return count == 1 ? name : name + " " + std::to_string(count);
}

}  // namespace

double median_area(const VesselCourse& course) {
    std::vector<double> areas;
    for (const FlowNode& node : course.nodes) areas.push_back(section_area_mm2(node.radius_mm));
    std::nth_element(areas.begin(), areas.begin() + static_cast<std::ptrdiff_t>(areas.size() / 2),
                     areas.end());
    return areas[areas.size() / 2];
}

VesselNetwork::VesselNetwork(const LabelVolume& labels,
                             const VesselPart& part,
                             const CentreTree& tree,
                             std::vector<VesselCourse> courses,
                             const NetworkOptions& options)
    : labels_(labels),
      kind_(part.kind),
      options_(options),
      nodes_(static_cast<int>(tree.nodes.size())) {
    for (VesselCourse& course : courses) {
        if (course.nodes.size() < 3) continue;
        NetworkEdge edge;
        edge.course = std::move(course);
        edges_.push_back(std::move(edge));
    }
}

void VesselNetwork::root(const Landmarks& landmarks) {
    std::map<int, int> degree = degrees();
    // The thickest end, of a trunk the one towards the heart; of the portal system the one in the
    // liver.
    double best = -1;
    for (const NetworkEdge& e : edges_) {
        for (const bool last : {false, true}) {
            const int node = last ? e.course.last : e.course.first;
            if (degree[node] != 1) continue;
            const double score =
                median_area(e.course) * (kind_ == FlowKind::portal
                                             ? 0.01 + liver_share(e.course, last)
                                             : trunk_first(e.course, last, landmarks.renal));
            if (score > best) {
                best = score;
                root_ = node;
            }
        }
    }
    // Edges in order from the root, each with its first node nearer to it.
    std::vector<NetworkEdge> ordered;
    std::vector<int> open{root_};
    std::vector<bool> used(edges_.size(), false);
    for (std::size_t i = 0; i < open.size(); ++i) {
        for (std::size_t e = 0; e < edges_.size(); ++e) {
            VesselCourse& c = edges_[e].course;
            if (used[e] || (c.first != open[i] && c.last != open[i])) continue;
            used[e] = true;
            if (c.last == open[i]) turn_round(labels_, kind_, c);
            open.push_back(c.last);
            ordered.push_back(std::move(edges_[e]));
        }
    }
    edges_ = std::move(ordered);
}

int VesselNetwork::cut(std::size_t e, std::size_t i) {
    const int node = nodes_++;
    NetworkEdge beyond;
    VesselCourse &near = edges_[e].course, &far = beyond.course;
    far = near;
    far.nodes.assign(near.nodes.begin() + static_cast<std::ptrdiff_t>(i), near.nodes.end());
    near.nodes.resize(i + 1);
    far.first = node;
    far.fork_first_mm = 0;
    near.last = node;
    near.fork_last_mm = 0;
    measure_sections(labels_, kind_, near);
    measure_sections(labels_, kind_, far);
    edges_.insert(edges_.begin() + static_cast<std::ptrdiff_t>(e) + 1, std::move(beyond));
    return node;
}

std::map<int, int> VesselNetwork::degrees() const {
    std::map<int, int> degree;
    for (const NetworkEdge& e : edges_) {
        ++degree[e.course.first];
        ++degree[e.course.last];
    }
    return degree;
}

std::string VesselNetwork::name_of(const NetworkEdge& e) const {
    return labels_.labels[static_cast<std::size_t>(e.course.label)].name;
}

// How much an end of a trunk is preferred; renal: its level parts the heart's side from the legs'.
double VesselNetwork::trunk_first(const VesselCourse& c,
                                  bool last,
                                  const Landmarks::Level& renal) const {
    const std::string& name = labels_.labels[static_cast<std::size_t>(c.label)].name;
    if (!contains(name, "aorta") && !contains(name, "cava")) return 1;
    if (!renal.known) return 4;
    const Point3 end = last ? c.nodes.back().centre : c.nodes.front().centre;
    return dot(end - renal.place, renal.axis) > 0 ? 16 : 4;
}

// Share of the places round an end of a vessel that lie in the liver.
double VesselNetwork::liver_share(const VesselCourse& c, bool last) const {
    const FlowNode& node = last ? c.nodes.back() : c.nodes.front();
    const double r = std::sqrt(section_area_mm2(node.radius_mm) / kPi) + 4;
    int liver = 0, count = 0;
    for (int i = -2; i <= 2; ++i)
        for (int j = -2; j <= 2; ++j)
            for (int k = -2; k <= 2; ++k) {
                const Vector3 d{0.5 * i, 0.5 * j, 0.5 * k};
                if (norm(d) < 0.9) continue;
                const Point3 v = labels_.grid.voxel_from_point(node.centre + (r / norm(d)) * d);
                const int x = static_cast<int>(std::lround(v.x)),
                          y = static_cast<int>(std::lround(v.y)),
                          z = static_cast<int>(std::lround(v.z));
                ++count;
                if (!labels_.grid.contains(x, y, z)) continue;
                const auto label = labels_.voxels[labels_.grid.index(x, y, z)];
                liver += contains(labels_.labels[label].name, "liver");
            }
    return static_cast<double>(liver) / count;
}

std::vector<int> VesselNetwork::beyond(int node) const {
    std::vector<int> out;
    for (std::size_t j = 0; j < outlets_.size(); ++j)
        if (outlets_[j].node == node) out.push_back(static_cast<int>(j));
    for (const NetworkEdge& e : edges_)
        if (e.course.first == node) {
            const auto further = beyond(e.course.last);
            out.insert(out.end(), further.begin(), further.end());
        }
    return out;
}

void VesselNetwork::write(FlowField& field) {
    std::map<int, int> degree = degrees(), junction;
    const auto junction_of = [&](int node) {
        if (degree[node] < 2) return -1;
        const auto [at, fresh] = junction.try_emplace(node, field.junctions);
        if (fresh) ++field.junctions;
        return at->second;
    };
    for (NetworkEdge& e : edges_) {
        // Arteries run from the root, veins to it.
        bool towards_root = kind_ != FlowKind::artery;
        if (e.ml_s < 0) towards_root = !towards_root;
        if (towards_root) turn_round(labels_, kind_, e.course);
        FlowVessel v = vessel_of(e);
        v.name = numbered(name_of(e), field);
        v.from = junction_of(e.course.first);
        v.to = junction_of(e.course.last);
        v.first_node = static_cast<int>(field.nodes.size());
        v.nodes = static_cast<int>(e.course.nodes.size());
        field.nodes.insert(field.nodes.end(), e.course.nodes.begin(), e.course.nodes.end());
        field.vessels.push_back(std::move(v));
    }
    for (const NetworkOutlet& o : outlets_) {
        if (o.course) continue;
        FlowVessel v;
        v.name = std::string(outlet_reference(o.what).name) +
                 (kind_ == FlowKind::artery ? " arteries" : " veins") + " (not labelled)";
        v.kind = kind_;
        (kind_ == FlowKind::artery ? v.from : v.to) = junction_of(o.node);
        v.mean_ml_s = o.ml_s;
        v.wave = o.wave;
        v.breathing = static_cast<float>(o.breathing);
        field.vessels.push_back(std::move(v));
    }
}

}  // namespace sonocase::pipeline
