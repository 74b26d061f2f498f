// SPDX-License-Identifier: Apache-2.0

// VesselNetwork: what leaves or enters at the ends, and along the way.
#include <cmath>

#include "formats/volume/tissue_mechanics.h"
#include "pipeline/flow/vessel_network.h"

namespace sonocase::pipeline {
namespace {

constexpr double kInternalIliacMm = 60, kInternalIliacLeastMm = 90;  // below the bifurcation
constexpr double kPortalMm = 75, kPortalLeastMm = 110;  // from the liver to the confluence
constexpr double kLevelMm = 5, kFromSpineMm = 120;  // of a node from a vertebra's level and place
constexpr double kInLiver = 0.4;                    // share of the places round an end

bool contains(const std::string& text, const char* word) {
    return text.find(word) != std::string::npos;
}

double length_of(const VesselCourse& course) {
    double sum = 0;
    for (std::size_t i = 0; i + 1 < course.nodes.size(); ++i)
        sum += distance(course.nodes[i].centre, course.nodes[i + 1].centre);
    return sum;
}

}  // namespace

void VesselNetwork::add_tap(int node, Outlet what) {
    NetworkOutlet tap;
    tap.node = node;
    tap.what = what;
    tap.course = false;
    outlets_.push_back(tap);
}

int VesselNetwork::cut_at(const char* word, const Landmarks::Level& level) {
    std::size_t best_edge = 0, best_node = 0;
    double nearest = kLevelMm;
    for (std::size_t e = 0; e < edges_.size(); ++e) {
        if (!contains(name_of(edges_[e]), word)) continue;
        const auto& nodes = edges_[e].course.nodes;
        for (std::size_t i = 0; i < nodes.size(); ++i) {
            const double away = std::abs(dot(nodes[i].centre - level.place, level.axis));
            if (away >= nearest || distance(nodes[i].centre, level.place) > kFromSpineMm) continue;
            nearest = away;
            best_edge = e;
            best_node = i;
        }
    }
    if (nearest >= kLevelMm) return -1;
    const std::size_t n = edges_[best_edge].course.nodes.size();
    if (best_node < 2 || best_node + 2 >= n) return -1;  // beyond the map, or at a fork
    return cut(best_edge, best_node);
}

bool VesselNetwork::tap_along(std::size_t e, double at_mm, double least_mm, Outlet what) {
    if (length_of(edges_[e].course) < least_mm) return false;
    const auto& nodes = edges_[e].course.nodes;
    double sum = 0;
    std::size_t i = 0;
    while (i + 3 < nodes.size() && sum < at_mm) {
        sum += distance(nodes[i].centre, nodes[i + 1].centre);
        ++i;
    }
    add_tap(cut(e, std::max<std::size_t>(i, 2)), what);
    return true;
}

void VesselNetwork::add_taps(const Landmarks& landmarks) {
    if (kind_ == FlowKind::portal) {
        // The splenic vein alone: the mesenteric one joins it where the portal vein begins.
        const auto degree = degrees();
        std::vector<std::size_t> sources;
        for (std::size_t e = 0; e < edges_.size(); ++e)
            if (degree.at(edges_[e].course.last) == 1 &&
                liver_share(edges_[e].course, true) <= kInLiver)
                sources.push_back(e);
        if (sources.size() == 1)
            tap_along(sources[0], kPortalMm, kPortalLeastMm, Outlet::mesenteric);
        return;
    }
    const char* trunk = kind_ == FlowKind::artery ? "aorta" : "cava";
    if (kind_ == FlowKind::artery && landmarks.coeliac.known) {
        if (const int node = cut_at(trunk, landmarks.coeliac); node >= 0) {
            add_tap(node, Outlet::coeliac);
            add_tap(node, Outlet::mesenteric);
        }
    }
    if (landmarks.renal.known) {
        if (const int node = cut_at(trunk, landmarks.renal); node >= 0) {
            add_tap(node, Outlet::renal);
            add_tap(node, Outlet::lumbar);
        }
    }
    for (std::size_t e = 0; e < edges_.size(); ++e)
        if (contains(name_of(edges_[e]), "iliac"))
            if (tap_along(e, kInternalIliacMm, kInternalIliacLeastMm, Outlet::internal_iliac))
                ++e;  // the part beyond the cut is no common iliac
}

void VesselNetwork::add_ends(const SolvedOutlets& solved) {
    std::map<int, int> degree = degrees();
    for (const NetworkEdge& e : edges_) {
        if (degree[e.course.last] != 1) continue;
        NetworkOutlet end;
        end.node = e.course.last;
        const std::string name = name_of(e);
        if (contains(name, "iliac") || contains(name, "femor")) end.what = Outlet::leg;
        if (kind_ == FlowKind::portal) {
            if (liver_share(e.course, true) > kInLiver)
                end.sign = -1;
            else
                end.what = contains(name, "splenic") && !splenic_given_ ? Outlet::splenic
                                                                        : Outlet::mesenteric;
            splenic_given_ |= end.what == Outlet::splenic;
        }
        outlets_.push_back(end);
    }
    for (NetworkOutlet& outlet : outlets_) set_reference(solved, outlet);
    if (kind_ == FlowKind::portal) share_liver();
    for (NetworkEdge& e : edges_) {
        e.area_mm2 = median_area(e.course);
        e.outlets = beyond(e.course.last);
    }
}

void VesselNetwork::set_reference(const SolvedOutlets& solved, NetworkOutlet& o) const {
    const OutletReference& reference = outlet_reference(o.what);
    o.usual_ml_s = reference.ml_s;
    o.sd_ml_s = reference.sd_ml_s;
    o.wave = kind_ == FlowKind::artery ? reference.artery : vein_wave(kind_);
    o.breathing = kind_ == FlowKind::artery ? 0 : reference.breathing;
    if (kind_ == FlowKind::portal) {
        // 864 +- 188 mL/min in all.
        const double share = o.what == Outlet::splenic ? 0.4 : 0.6;
        if (o.what == Outlet::splenic || o.what == Outlet::mesenteric) o.usual_ml_s = share * 14.4;
        o.sd_ml_s = std::sqrt(share) * 3.1;
    }
    if (o.what == Outlet::unknown) set_by_size(o);
    o.usual_ml_s *= options_.scale;
    o.sd_ml_s *= options_.scale;
    // What arteries bring, veins take away.
    if (kind_ == FlowKind::vein && solved.ml_s[static_cast<std::size_t>(o.what)] > 0)
        o.usual_ml_s = solved.ml_s[static_cast<std::size_t>(o.what)];
}

void VesselNetwork::set_by_size(NetworkOutlet& o) const {
    for (const NetworkEdge& e : edges_) {
        if (e.course.last != o.node) continue;
        const bool nameless =
            vessel_of_label(name_of(e)) == Vessel::unknown && options_.unknown_ml_min > 0;
        o.usual_ml_s = nameless ? options_.unknown_ml_min / 60
                                : usual_mean_mm_s(kind_) * median_area(e.course) / 1000;
        o.sd_ml_s = nameless ? 1e-6 : 0.5 * o.usual_ml_s;
        if (vessel_of_label(name_of(e)) == Vessel::unknown) {
            o.wave = named_wave(options_.unknown_wave);
            o.breathing = 0;
        }
    }
}

// What reaches the liver is shared among its branches by Murray's law, the cube of the radius.
void VesselNetwork::share_liver() {
    double brought = 0, cubes = 0;
    for (const NetworkOutlet& o : outlets_)
        if (o.sign > 0) brought += o.usual_ml_s;
    const auto cube = [&](const NetworkEdge& e) { return std::pow(median_area(e.course), 1.5); };
    for (const NetworkEdge& e : edges_) {
        if (e.course.first == root_) cubes += cube(e);
        for (const NetworkOutlet& o : outlets_)
            if (o.sign < 0 && o.node == e.course.last) cubes += cube(e);
    }
    for (NetworkOutlet& o : outlets_)
        for (const NetworkEdge& e : edges_)
            if (o.sign < 0 && o.node == e.course.last) o.usual_ml_s = brought * cube(e) / cubes;
}

}  // namespace sonocase::pipeline
