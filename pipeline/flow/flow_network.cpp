// SPDX-License-Identifier: Apache-2.0

#include "pipeline/flow/flow_network.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include <Eigen/Dense>

#include "formats/base/constants.h"
#include "formats/flow/flow_velocity.h"
#include "formats/volume/tissue.h"
#include "pipeline/flow/vessel_parts.h"

namespace sonocase::pipeline::inline flow {

namespace {

constexpr double kInternalIliacMm = 60, kInternalIliacMinMm = 90;  // below the bifurcation
constexpr double kPortalMm = 75, kPortalMinMm = 110;  // from the liver to the confluence
constexpr double kLevelMm = 5, kFromSpineMm = 120;    // of a node from a vertebra's level and place
constexpr double kInLiver = 0.4;                      // share of the places round an end
constexpr int kRounds = 6;

// Returns the area of the middle one of a course's sections, by size.
double median_area(const VesselCourse& course) {
    std::vector<double> areas;
    for (const FlowNode& node : course.nodes) areas.push_back(section_area_mm2(node.radius_mm));
    std::nth_element(areas.begin(), areas.begin() + areas.size() / 2, areas.end());
    return areas[areas.size() / 2];
}

double length_of(const VesselCourse& course) {
    double sum = 0;
    for (std::size_t i = 0; i + 1 < course.nodes.size(); ++i)
        sum += distance(course.nodes[i].centre, course.nodes[i + 1].centre);
    return sum;
}

// Returns the name with the next free number behind it where the field has the name already.
std::string numbered(const std::string& name, const FlowField& field) {
    int count = 1;
    for (const FlowVessel& v : field.vessels)
        if (v.name == name || v.name.rfind(name + " ", 0) == 0) ++count;
    return count == 1 ? name : name + " " + std::to_string(count);
}

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

// The vessels of one part as a network: edges with courses, joined at nodes, and the outlets at its
// ends and along it.
//
//     VesselNetwork network(labels, part, tree, courses, options);
//     network.root(landmarks);      // puts the vessels in order from the root
//     network.add_taps(landmarks);  // adds vessels that the labels lack
//     network.add_ends(solved);     // adds what the ends take or give
//     network.solve();              // finds flows and waveforms
//     network.write(field);
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
    bool tap_along(std::size_t e, double at_mm, double min_mm, Outlet what);
    void set_reference(const SolvedOutlets& solved, NetworkOutlet& o) const;
    void set_by_size(NetworkOutlet& o) const;
    void share_liver();
    void assign(const std::vector<double>& ml_s);
    bool has_reference(const NetworkEdge& e) const;
    FlowVessel vessel_of(const NetworkEdge& e) const;

    std::map<int, int> degrees() const;  // edges at each node
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
    // The root is the thickest end: for a trunk the one towards the heart, for the portal system
    // the one in the liver.
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
            if (c.last == open[i]) reverse_course(labels_, kind_, c);
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
    far.nodes.assign(near.nodes.begin() + i, near.nodes.end());
    near.nodes.resize(i + 1);
    far.first = node;
    far.fork_first_mm = 0;
    near.last = node;
    near.fork_last_mm = 0;
    measure_sections(labels_, kind_, near);
    measure_sections(labels_, kind_, far);
    edges_.insert(edges_.begin() + e + 1, std::move(beyond));
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
    return labels_.labels[e.course.label].name;
}

// Returns how much an end of a trunk is preferred as the root. The renal level parts the heart's
// side from the legs'.
double VesselNetwork::trunk_first(const VesselCourse& c,
                                  bool last,
                                  const Landmarks::Level& renal) const {
    const std::string& name = labels_.labels[c.label].name;
    if (!holds_word(name, "aorta") && !holds_word(name, "cava")) return 1;
    if (!renal.known) return 4;
    const Point3 end = last ? c.nodes.back().centre : c.nodes.front().centre;
    return dot(end - renal.place, renal.axis) > 0 ? 16 : 4;
}

// Returns the share of the places round an end of a vessel that lie in the liver.
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
                liver += holds_word(labels_.labels[label].name, "liver");
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
        if (towards_root) reverse_course(labels_, kind_, e.course);
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
        if (!holds_word(name_of(edges_[e]), word)) continue;
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

bool VesselNetwork::tap_along(std::size_t e, double at_mm, double min_mm, Outlet what) {
    if (length_of(edges_[e].course) < min_mm) return false;
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
        // Where the splenic vein is labelled alone, the mesenteric one joins it where the portal
        // vein begins.
        const auto degree = degrees();
        std::vector<std::size_t> sources;
        for (std::size_t e = 0; e < edges_.size(); ++e)
            if (degree.at(edges_[e].course.last) == 1 &&
                liver_share(edges_[e].course, true) <= kInLiver)
                sources.push_back(e);
        if (sources.size() == 1) tap_along(sources[0], kPortalMm, kPortalMinMm, Outlet::mesenteric);
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
        if (holds_word(name_of(edges_[e]), "iliac"))
            if (tap_along(e, kInternalIliacMm, kInternalIliacMinMm, Outlet::internal_iliac))
                ++e;  // the part beyond the cut is not a common iliac
}

void VesselNetwork::add_ends(const SolvedOutlets& solved) {
    std::map<int, int> degree = degrees();
    for (const NetworkEdge& e : edges_) {
        if (degree[e.course.last] != 1) continue;
        NetworkOutlet end;
        end.node = e.course.last;
        const std::string name = name_of(e);
        if (holds_word(name, "iliac") || holds_word(name, "femor")) end.what = Outlet::leg;
        if (kind_ == FlowKind::portal) {
            if (liver_share(e.course, true) > kInLiver)
                end.sign = -1;
            else
                end.what = holds_word(name, "splenic") && !splenic_given_ ? Outlet::splenic
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
        // The sources bring 864 +- 188 mL/min together.
        const double share = o.what == Outlet::splenic ? 0.4 : 0.6;
        if (o.what == Outlet::splenic || o.what == Outlet::mesenteric) o.usual_ml_s = share * 14.4;
        o.sd_ml_s = std::sqrt(share) * 3.1;
    }
    if (o.what == Outlet::unknown) set_by_size(o);
    o.usual_ml_s *= options_.scale;
    o.sd_ml_s *= options_.scale;
    // What arteries bring, veins take away.
    const double brought_ml_s = solved.ml_s[static_cast<std::size_t>(o.what)];
    if (kind_ == FlowKind::vein && brought_ml_s > 0) o.usual_ml_s = brought_ml_s;
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

FlowVessel VesselNetwork::vessel_of(const NetworkEdge& e) const {
    FlowVessel v;
    v.kind = kind_;
    const std::string name = name_of(e);
    const bool nameless = vessel_of_label(name) == Vessel::unknown;
    v.exponent = nameless ? 2.0f : static_cast<float>(vessel_reference(name, kind_).exponent);
    double total = 0, breathing = 0;
    std::array<double, 2 * kFlowHarmonics> sum{};
    for (const int j : e.outlets) {
        const NetworkOutlet& o = outlets_[j];
        const double q = o.sign * o.ml_s;
        total += q;
        breathing += q * o.breathing;
        for (std::size_t h = 0; h < kFlowHarmonics; ++h) {
            sum[2 * h] += q * static_cast<double>(o.wave[h].re);
            sum[2 * h + 1] += q * static_cast<double>(o.wave[h].im);
        }
    }
    v.mean_ml_s = std::abs(total);
    if (std::abs(total) < 1e-9) return v;
    v.breathing = static_cast<float>(breathing / total);
    for (std::size_t h = 0; h < kFlowHarmonics; ++h)
        v.wave[h] = {static_cast<float>(sum[2 * h] / total),
                     static_cast<float>(sum[2 * h + 1] / total)};
    return v;
}

// Gives the outlets these flows, and each vessel the sum of those beyond it.
void VesselNetwork::assign(const std::vector<double>& ml_s) {
    for (std::size_t j = 0; j < outlets_.size(); ++j) outlets_[j].ml_s = ml_s[j];
    for (NetworkEdge& e : edges_) {
        e.ml_s = 0;
        for (const int j : e.outlets) e.ml_s += outlets_[j].sign * outlets_[j].ml_s;
        const FlowVessel v = vessel_of(e);
        if (kind_ == FlowKind::vein || !(v.mean_ml_s > 0)) continue;
        const VelocityRange range = velocity_range(v, e.area_mm2, 60 / options_.rate_per_min);
        e.peak_factor = range.peak / range.mean;
    }
}

// In the portal system only vessels that carry the blood of both its sources have a known velocity.
bool VesselNetwork::has_reference(const NetworkEdge& e) const {
    if (kind_ != FlowKind::portal) return true;
    bool splenic = false, mesenteric = false;
    for (const int j : e.outlets) {
        splenic |= outlets_[j].what == Outlet::splenic;
        mesenteric |= outlets_[j].what == Outlet::mesenteric;
    }
    return splenic && mesenteric;
}

void VesselNetwork::solve() {
    const auto n = static_cast<Eigen::Index>(outlets_.size());
    Eigen::VectorXd x(n);
    for (Eigen::Index j = 0; j < n; ++j) x[j] = outlets_[j].usual_ml_s;
    const bool peaks = kind_ != FlowKind::vein;
    for (int pass = 0; pass < (peaks ? kRounds : 1); ++pass) {
        assign(std::vector<double>(x.begin(), x.end()));
        if (!peaks) break;
        std::vector<std::pair<std::size_t, VesselReference>> known;
        for (std::size_t e = 0; e < edges_.size(); ++e) {
            const VesselReference reference = vessel_reference(name_of(edges_[e]), kind_);
            if (reference.peak_mm_s > 0 && has_reference(edges_[e]))
                known.emplace_back(e, reference);
        }
        Eigen::MatrixXd a = Eigen::MatrixXd::Zero(n + static_cast<Eigen::Index>(known.size()), n);
        Eigen::VectorXd b = Eigen::VectorXd::Zero(a.rows());
        for (Eigen::Index j = 0; j < n; ++j) {
            const NetworkOutlet& o = outlets_[j];
            a(j, j) = 1 / o.sd_ml_s;
            b[j] = o.usual_ml_s / o.sd_ml_s;
        }
        Eigen::Index row = n;
        for (const auto& [e, reference] : known) {
            const NetworkEdge& edge = edges_[e];
            for (const int j : edge.outlets)
                a(row, j) =
                    outlets_[j].sign * edge.peak_factor * 1000 / edge.area_mm2 / reference.sd_mm_s;
            b[row++] = reference.peak_mm_s / reference.sd_mm_s;
        }
        x = a.colPivHouseholderQr().solve(b);
        for (Eigen::Index j = 0; j < n; ++j) x[j] = std::max(x[j], 0.2 * outlets_[j].usual_ml_s);
    }
    assign(std::vector<double>(x.begin(), x.end()));
}

void VesselNetwork::remember(SolvedOutlets& solved) const {
    std::array<int, 8> count{};
    for (const NetworkOutlet& o : outlets_) {
        if (o.what == Outlet::unknown) continue;  // nothing says which vein drains it
        const auto w = static_cast<std::size_t>(o.what);
        solved.ml_s[w] = (solved.ml_s[w] * count[w] + o.ml_s) / (count[w] + 1);
        ++count[w];
    }
}

}  // namespace

Landmarks find_landmarks(const LabelVolume& labels) {
    std::array<int, 256> which{};
    for (std::size_t l = 1; l < labels.labels.size(); ++l) {
        const std::string& name = labels.labels[l].name;
        which[l] = holds_word(name, "vertebrae_T12")  ? 1
                   : holds_word(name, "vertebrae_L1") ? 2
                   : holds_word(name, "vertebrae_L2") ? 3
                                                      : 0;
    }
    std::array<Vector3, 4> sum{};
    std::array<double, 4> count{};
    const Int3 n = labels.grid.size;
    std::size_t at = 0;
    for (int k = 0; k < n.z; ++k)
        for (int j = 0; j < n.y; ++j)
            for (int i = 0; i < n.x; ++i, ++at) {
                const int w = which[labels.voxels[at]];
                if (w == 0) continue;
                sum[w] = sum[w] + Vector3{double(i), double(j), double(k)};
                count[w] += 1;
            }
    const auto centre = [&](std::size_t w) {
        return labels.grid.point_from_voxel(Point3{} + sum[w] / count[w]);
    };
    Landmarks marks;
    if (count[2] > 0 && count[3] > 0) {
        const Point3 one = centre(2), two = centre(3);
        const Point3 above = count[1] > 0 ? centre(1) : one + (one - two);
        // A vertebra at the border of the map is cut, and its middle lies too low.
        const double step = std::clamp(norm(above - one), 0.8 * norm(two - one), norm(two - one));
        const Vector3 up = normalized(one - two);
        marks.coeliac = {true, one + 0.5 * step * up, up};
        marks.renal = {true, one + 0.5 * (two - one), up};
    }
    return marks;
}

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

}  // namespace sonocase::pipeline::inline flow
