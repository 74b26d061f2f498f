// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/anatomy_check.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <numeric>
#include <set>
#include <tuple>

#include "formats/text/excerpt.h"
#include "pipeline/anatomy/label_facts.h"
#include "pipeline/anatomy/label_table.h"
#include "pipeline/anatomy/torso_model.h"
#include "pipeline/base/text.h"

namespace sonocase::pipeline::inline anatomy {
namespace {

constexpr int kMinKnown = 4;

// Sizes are tried in steps of 15 %, from a 2500th to 2500 times an adult's.
constexpr double kStep = 0.15;
constexpr int kSteps = 52;                       // either way
constexpr int kSmallest = -7, kLargest = 2;      // of a human body: 0.35 to 1.35
constexpr double kSizeSpread = 0.12;             // of adults, ln
constexpr double kAxisSpread = 0.09;             // of an axis about the size of the body, ln
constexpr double kDiagonal = 0.06, kTilt = 0.2;  // of the map's matrix, per unit of size

// Densities of a label about which nothing is known, per axis and of its ln(volume).
const double kNoPlace = -std::log(600.0), kNoVolume = -std::log(10.0), kNoLength = -std::log(4.0);
const double kNothing = 3 * (kNoPlace + kNoLength) + kNoVolume;

// Student's t of eight degrees of freedom: logarithm of the density at z standard deviations.
constexpr double kFreedom = 8;
double student(double z2, double spread) {
    constexpr double kPeak = -0.9502;
    return kPeak - std::log(spread) - 0.5 * (kFreedom + 1) * std::log1p(z2 / kFreedom);
}

constexpr double kTogether = 0.6;      // correlation of the places of structures at one place
constexpr double kNeighbours_mm = 80;  // over which it fades
constexpr std::size_t kPairs = 6;      // of names that are tried exchanged

constexpr double kMuch = 0.35;  // share of a cut structure without which it says little

struct Seen {
    const LabelSummary* label = nullptr;
    bool cut = false;
    std::array<bool, 3> cut_low{}, cut_high{}, cut_axis{}, cut_both{};
    double ln_ml = 0;
    double lost = 0;  // share that the grid's faces may have taken, under the name given

    double lost_of(const ModelStructure& s, double size) const {
        if (!cut) return 0;
        const double whole = s.usual_ml * size * size * size;
        return std::clamp(1 - std::exp(ln_ml) / whole, 0.15, 1.0);
    }
    // Along axis r its middle is where the cut left it.
    bool says_nothing(const ModelStructure& s, int r) const {
        return cut_both[r] || (cut_axis[r] && std::max(lost, lost_of(s, 1)) >= kMuch);
    }
};
using Names = std::vector<const ModelStructure*>;  // # seen; null: no structure of the model

// Variance of a label's middle along axis r of the map, for a size of the body.
double variance(
    const Seen& seen, const ModelStructure& s, int r, int m, double size, double voxel) {
    const double spread = s.spread[m] * size;
    const double cut = (seen.cut_axis[r] ? 0.7 : 0.3) * seen.lost_of(s, size) * s.half_mm * size;
    return spread * spread + cut * cut + voxel * voxel / 12;
}

// Density of a label's middle, d from its place. Where the map's faces decide how near to each
// other labels lie, a smaller body gains nothing by it.
double place_density(
    const Seen& seen, const ModelStructure& s, int r, int m, double size, double voxel, double d) {
    if (seen.says_nothing(s, r)) return kNoPlace;
    const double v = variance(seen, s, r, m, size, voxel);
    const double norm = seen.cut && size < 1 ? variance(seen, s, r, m, 1, voxel) : v;
    return student(d * d / v, std::sqrt(norm));
}

double volume_density(const Seen& seen, const ModelStructure& s, double ln_scale) {
    const double z = (seen.ln_ml - std::log(s.usual_ml) - ln_scale) / s.spread_ln;
    double density = student(z * z, s.spread_ln);
    if (seen.ln_ml > std::log(s.max_ml) + ln_scale) density -= 4;  // nobody has that
    if (seen.lost < kMuch) return density;
    // Any part of the whole, but not more.
    return kNoVolume + (z < 0 ? 0 : density - student(0, s.spread_ln));
}

// x = shift + row . place
struct AxisFit {
    double score = 0;
    double shift = 0;
    Eigen::Vector3d row = Eigen::Vector3d::Zero();
    double size = 1;
    int m = 0;  // axis of the model

    double at(const Vector3& place) const {
        return shift + row[0] * place.x + row[1] * place.y + row[2] * place.z;
    }
};

// Density of a label's length along axis r of the map, ln.
double length_density(const Seen& seen, const ModelStructure& s, int r, const AxisFit& axis) {
    const double length = seen.label->length_mm[r];
    if (!(length > 0)) return kNoLength;
    // By the size of the body: the stretch of a fit is for places, whose middle it finds.
    double whole2 = 0;
    for (int c = 0; c < 3; ++c) whole2 += std::pow(axis.row[c] * s.length[c], 2);
    const double stretch = axis.row.norm() / axis.size;
    const double d = std::log(length * stretch) - 0.5 * std::log(whole2);
    const double lost = seen.cut ? std::max(seen.lost, seen.lost_of(s, axis.size)) : 0;
    const double spread = std::hypot(s.spread_ln / 3, s.shape_ln, 0.7 * lost);
    const double density = student(d * d / (spread * spread), spread);
    if (lost < kMuch) return density;
    // A part may be of any length, but not longer than the whole.
    return kNoLength + (d < 0 ? 0 : density - student(0, spread));
}

// Axes of the map as axes of the model: axis r of the map is axis m[r], with sign[r].
struct Orientation {
    std::array<int, 3> m{0, 1, 2}, sign{1, 1, 1};
};

struct Fit {
    double score = -INFINITY;
    std::array<int, 3> k{};  // steps of size along the axes of the map
    std::array<AxisFit, 3> axes;
};

// The labels of one map under one choice of names.
class Match {
  public:
    Match(const std::vector<Seen>& seen, const BodySummary& body, const Box3& skin, Names names)
        : seen_(seen), voxel_(body.voxel_mm), skin_(skin), names_(std::move(names)) {}

    const Names& names() const { return names_; }

    const AxisFit& axis(int r, int m, int sign, int k) {
        std::optional<AxisFit>& slot =
            fits_[((r * 3 + m) * 2 + (sign > 0)) * (2 * kSteps + 1) + k + kSteps];
        if (!slot) slot = fit(r, m, sign, std::exp(kStep * k));
        return *slot;
    }

    // A body of human size, times e^(kStep centre).
    Fit human(const Orientation& o, int centre = 0) {
        Fit best;
        for (int k0 = kSmallest; k0 <= kLargest; ++k0) {
            std::array<int, 3> k{};
            double score = size_prior(k0);
            for (int r = 0; r < 3; ++r) score += best_near(o, r, centre + k0, k[r]);
            consider(o, k, score, best);
        }
        return best;
    }

    // One axis of any size, the others of a human body.
    Fit one_axis_wrong(int wrong) {
        const Orientation o;
        Fit best;
        for (int k0 = kSmallest; k0 <= kLargest; ++k0) {
            std::array<int, 3> k{};
            double score = size_prior(k0);
            for (int r = 0; r < 3; ++r)
                if (r != wrong) score += best_near(o, r, k0, k[r]);
            for (int other = -kSteps; other <= kSteps; ++other) {
                if (std::abs(other - k0) < 3) continue;
                k[wrong] = other;
                consider(o, k, score + axis_score(o, wrong, other), best);
            }
        }
        return best;
    }

    // Logarithm of the density of label i as structure s of a fit; null: of no structure.
    double density(std::size_t i, const ModelStructure* s, const Fit& fit) const {
        if (s == nullptr) return kNothing;
        double sum = volume_density(seen_[i], *s, kStep * (fit.k[0] + fit.k[1] + fit.k[2]));
        for (int r = 0; r < 3; ++r) {
            const AxisFit& a = fit.axes[r];
            sum += place_density(seen_[i], *s, r, a.m, a.size, voxel_[r],
                                 seen_[i].label->centre[r] - a.at(s->at)) +
                   length_density(seen_[i], *s, r, a);
        }
        return sum;
    }

  private:
    static double size_prior(int k) {
        const double ln = kStep * k;
        const double adult =
            std::exp(-0.5 * ln * ln / (kSizeSpread * kSizeSpread)) / kSizeSpread / 2.5;
        const double child = ln > -1.1 && ln < 0 ? 1 / 1.1 : 1e-3;
        return std::log(0.9 * adult + 0.1 * child);
    }

    double axis_score(const Orientation& o, int r, int k) {
        double score = axis(r, o.m[r], o.sign[r], k).score;
        if (!skin_.empty() && o.m[r] < 2) {
            const double usual = o.m[r] == 0 ? 350 : 240;
            const double z = (std::log(skin_.extent()[r] / usual) - kStep * k) / 0.22;
            score += student(z * z, 0.22);
        }
        return score;
    }

    double best_near(const Orientation& o, int r, int k0, int& k) {
        double best = -INFINITY;
        for (int d = -2; d <= 2; ++d) {
            if (std::abs(k0 + d) > kSteps) continue;
            const double off = kStep * d / kAxisSpread;
            const double score = axis_score(o, r, k0 + d) - 0.5 * off * off;
            if (score > best) {
                best = score;
                k = k0 + d;
            }
        }
        return best;
    }

    void consider(const Orientation& o, const std::array<int, 3>& k, double score, Fit& best) {
        score += volumes(k[0] + k[1] + k[2]);
        if (!(score > best.score)) return;
        best.score = score;
        best.k = k;
        for (int r = 0; r < 3; ++r) best.axes[r] = axis(r, o.m[r], o.sign[r], k[r]);
    }

    double volumes(int k) {
        const auto known = volumes_.find(k);
        if (known != volumes_.end()) return known->second;
        double sum = 0;
        for (std::size_t i = 0; i < seen_.size(); ++i)
            sum +=
                names_[i] == nullptr ? kNoVolume : volume_density(seen_[i], *names_[i], kStep * k);
        return volumes_[k] = sum;
    }

    AxisFit fit(int r, int m, int sign, double size) const {
        AxisFit out;
        out.size = size;
        out.m = m;
        Eigen::Vector4d prior = Eigen::Vector4d::Zero(), precision = Eigen::Vector4d::Zero();
        for (int c = 0; c < 3; ++c) {
            const double spread = (c == m ? kDiagonal : kTilt) * size;
            precision[c + 1] = 1 / (spread * spread);
        }
        prior[m + 1] = sign * size;
        std::vector<double> variances(seen_.size());  // 0: the label says nothing
        for (std::size_t i = 0; i < seen_.size(); ++i)
            if (const ModelStructure* s = names_[i]; s != nullptr && !seen_[i].says_nothing(*s, r))
                variances[i] = variance(seen_[i], *s, r, m, size, voxel_[r]);
        Eigen::Vector4d b = prior;
        constexpr int kRounds = 7;
        for (int round = 0; round < kRounds; ++round) {
            Eigen::Matrix4d normal = precision.asDiagonal();
            Eigen::Vector4d right = precision.cwiseProduct(prior);
            for (std::size_t i = 0; i < seen_.size(); ++i) {
                const double v = variances[i];
                if (v == 0) continue;
                const Vector3 at = names_[i]->at;
                const Eigen::Vector4d u(1, at.x, at.y, at.z);
                const double x = seen_[i].label->centre[r];
                double w = 1 / v;
                if (round > 0) {
                    const double d = x - u.dot(b);
                    w *= (kFreedom + 1) / (kFreedom + d * d / v);
                }
                normal += w * u * u.transpose();
                right += w * x * u;
            }
            if (!(normal(0, 0) > 0)) break;
            const Eigen::Vector4d before = b;
            b = normal.ldlt().solve(right);
            if (round > 0 && std::abs(b[0] - before[0]) < 0.01 * size &&
                (b - before).tail<3>().cwiseAbs().maxCoeff() < 1e-4 * size)
                break;
        }
        out.shift = b[0];
        out.row = b.tail<3>();
        for (std::size_t i = 0; i < seen_.size(); ++i) {
            const ModelStructure* s = names_[i];
            if (s == nullptr) {
                out.score += kNoPlace + kNoLength;
                continue;
            }
            out.score += place_density(seen_[i], *s, r, m, size, voxel_[r],
                                       seen_[i].label->centre[r] - out.at(s->at)) +
                         length_density(seen_[i], *s, r, out);
        }
        for (int c = 1; c < 4; ++c)
            out.score -= 0.5 * precision[c] * (b[c] - prior[c]) * (b[c] - prior[c]);
        return out;
    }

    const std::vector<Seen>& seen_;
    Vector3 voxel_;
    Box3 skin_;
    Names names_;
    std::vector<std::optional<AxisFit>> fits_ =
        std::vector<std::optional<AxisFit>>(18 * (2 * kSteps + 1));
    std::map<int, double> volumes_;
};

// Least total cost of giving each row a column of its own, rows <= columns: Kuhn and Munkres with
// potentials. Returns the column of each row.
std::vector<int> assignment(const Eigen::MatrixXd& cost) {
    const auto n = static_cast<int>(cost.rows()), m = static_cast<int>(cost.cols());
    std::vector<double> u(n + 1, 0), v(m + 1, 0);
    std::vector<int> row_of(m + 1, 0), way(m + 1, 0);
    for (int i = 1; i <= n; ++i) {
        row_of[0] = i;
        int column = 0;
        std::vector<double> least(m + 1, INFINITY);
        std::vector<char> used(m + 1, 0);
        do {
            used[column] = 1;
            const int row = row_of[column];
            double delta = INFINITY;
            int next = 0;
            for (int j = 1; j <= m; ++j) {
                if (used[j]) continue;
                const double c = cost(row - 1, j - 1) - u[row] - v[j];
                if (c < least[j]) {
                    least[j] = c;
                    way[j] = column;
                }
                if (least[j] < delta) {
                    delta = least[j];
                    next = j;
                }
            }
            for (int j = 0; j <= m; ++j) {
                if (used[j]) {
                    u[row_of[j]] += delta;
                    v[j] -= delta;
                } else {
                    least[j] -= delta;
                }
            }
            column = next;
        } while (row_of[column] != 0);
        for (; column != 0; column = way[column]) row_of[column] = row_of[way[column]];
    }
    std::vector<int> result(n, -1);
    for (int j = 1; j <= m; ++j)
        if (row_of[j] > 0) result[row_of[j] - 1] = j - 1;
    return result;
}

struct Hypothesis {
    AnatomyCause cause{};
    double score = -INFINITY;  // with its prior
    Fit fit;
    Names names;
    Orientation orientation;
    int axis = -1;
    double factor = 1;
    int shift = 0;
    int label = -1,
        second = -1;  // of two_in_one: the label, and the structure that it holds as well
};

class Check {
  public:
    Check(const BodySummary& body, const AnatomyOptions& options) : body_(body), options_(options) {
        for (std::size_t l = 0; l < body.labels.size(); ++l) {
            const LabelSummary& label = body.labels[l];
            if (is_body_name(label.name) && !label.cut_low[0] && !label.cut_high[0] &&
                !label.cut_low[1] && !label.cut_high[1])
                skin_ = label.box;
            const int s = model_structure(label.name);
            if (s < 0 || !(label.ml > 0)) continue;
            Seen seen;
            seen.label = &label;
            seen.ln_ml = std::log(label.ml);
            seen.cut_low = label.cut_low;
            seen.cut_high = label.cut_high;
            seen_.push_back(seen);
            label_of_.push_back(l);
            names_.push_back(&torso_model()[s]);
        }
        find_cut_planes();
        for (std::size_t i = 0; i < seen_.size(); ++i) {
            Seen& seen = seen_[i];
            for (int a = 0; a < 3; ++a) {
                seen.cut_axis[a] = seen.cut_low[a] || seen.cut_high[a];
                seen.cut_both[a] = seen.cut_low[a] && seen.cut_high[a];
                seen.cut = seen.cut || seen.cut_axis[a];
            }
            seen.lost = seen.lost_of(*names_[i], 1);
        }
    }

    int known() const { return static_cast<int>(seen_.size()); }

    std::optional<double> agreement() {
        if (known() < kMinKnown) return std::nullopt;
        const double none = known() * kNothing;
        return (match(names_).human({}).score - none) / known();
    }

    AnatomyReport run() {
        AnatomyReport report;
        report.known = known();
        report.checked = known() >= kMinKnown;
        if (report.checked) {
            Match as_is = match(names_);
            right_ = as_is.human({});
            orientations(as_is);
            units(as_is);
            sides();
            shifts();
            renamed();
            exchanged(as_is);
            two_in_one();
            if (best_.score - right_.score > options_.margin) report.findings.push_back(finding());
            if (report.findings.empty()) {
                out_of_place(report);
                unusual_size(report);
            }
            remarks(report);
        }
        volumes(report);
        return report;
    }

  private:
    Match match(Names names) const { return {seen_, body_, skin_, std::move(names)}; }

    // A height at which several structures end is a cut, wherever the grid ends.
    void find_cut_planes() {
        constexpr int kEnough = 4, a = 2;
        for (const bool high : {false, true}) {
            const auto end = [&](const Seen& seen) {
                return high ? seen.label->box.upper[a] : -seen.label->box.lower[a];
            };
            double last = -INFINITY;
            for (const Seen& seen : seen_) last = std::max(last, end(seen));
            const auto ends = [&](const Seen& seen) {
                return end(seen) > last - 0.6 * body_.voxel_mm[a];
            };
            if (std::count_if(seen_.begin(), seen_.end(), ends) < kEnough) continue;
            for (Seen& seen : seen_) {
                if (!ends(seen)) continue;
                (high ? seen.cut_high : seen.cut_low)[a] = true;
            }
        }
    }

    void offer(Hypothesis h) {
        if (h.score > best_.score) best_ = std::move(h);
    }

    void orientations(Match& as_is) {
        std::array<int, 3> m{0, 1, 2};
        do {
            for (int signs = 0; signs < 8; ++signs) {
                const Orientation o{m,
                                    {signs & 1 ? -1 : 1, signs & 2 ? -1 : 1, signs & 4 ? -1 : 1}};
                const bool straight = m == std::array<int, 3>{0, 1, 2};
                if (straight && signs == 0) continue;
                constexpr AnatomyCause kOfSigns[] = {{},
                                                     AnatomyCause::mirrored,
                                                     AnatomyCause::front_and_back,
                                                     AnatomyCause::turned_about_z,
                                                     AnatomyCause::upside_down,
                                                     AnatomyCause::turned_about_y,
                                                     AnatomyCause::turned_about_x,
                                                     AnatomyCause::all_turned};
                Hypothesis h;
                h.cause = straight ? kOfSigns[signs] : AnatomyCause::axes_exchanged;
                h.fit = as_is.human(o);
                h.score = h.fit.score - (straight ? (signs == 1 || signs == 3 ? 2.5 : 4) : 6);
                h.names = names_;
                h.orientation = o;
                offer(h);
            }
        } while (std::next_permutation(m.begin(), m.end()));
    }

    void units(Match& as_is) {
        for (const double unit : {10.0, 0.1, 1000.0, 0.001, 25.4, 1 / 25.4, 100.0, 0.01}) {
            Hypothesis h;
            h.cause = AnatomyCause::unit;
            h.fit = as_is.human({}, static_cast<int>(std::lround(std::log(unit) / kStep)));
            h.score = h.fit.score - 3 - std::log(8.0);
            h.names = names_;
            h.factor = unit;
            offer(h);
        }
        for (int axis = 0; axis < 3; ++axis) {
            Hypothesis h;
            h.cause = AnatomyCause::spacing;
            h.fit = as_is.one_axis_wrong(axis);
            h.score = h.fit.score - 3 - std::log(3.0);
            h.names = names_;
            h.axis = axis;
            const double others = 0.5 * (h.fit.k[(axis + 1) % 3] + h.fit.k[(axis + 2) % 3]);
            h.factor = std::exp(kStep * (h.fit.k[axis] - others));
            offer(h);
        }
    }

    // Names with a side as those of the other side.
    void sides() {
        Names exchanged = names_;
        int sided = 0;
        for (const ModelStructure*& s : exchanged)
            if (s->other >= 0) {
                s = &torso_model()[s->other];
                ++sided;
            }
        if (sided == 0) return;
        Match match = this->match(exchanged);
        Hypothesis h;
        h.cause = AnatomyCause::sides_of_names;
        h.names = exchanged;
        h.fit = match.human({});
        h.score = h.fit.score - 3;
        offer(h);
        h.cause = AnatomyCause::situs_inversus;
        h.orientation.sign = {-1, 1, 1};
        h.fit = match.human(h.orientation);
        h.score = h.fit.score - 4;
        offer(h);
    }

    // Each label has the name of one a few rows on, among those of the map or of TotalSegmentator.
    void shifts() {
        std::vector<int> order(body_.labels.size());
        std::iota(order.begin(), order.end(), 0);
        std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
            return body_.labels[a].value < body_.labels[b].value;
        });
        std::vector<int> place(order.size());
        for (std::size_t n = 0; n < order.size(); ++n) place[order[n]] = static_cast<int>(n);
        for (const int by : {-3, -2, -1, 1, 2, 3}) {
            Names of_map, of_table;
            for (std::size_t i = 0; i < seen_.size(); ++i) {
                const int n = place[label_of_[i]] + by;
                int s = -1;
                if (n >= 0 && n < static_cast<int>(order.size()))
                    s = model_structure(body_.labels[order[n]].name);
                of_map.push_back(s < 0 ? nullptr : &torso_model()[s]);
                const int value = totalsegmentator_value(seen_[i].label->name);
                s = value > 0 ? model_structure(totalsegmentator_name(value + by)) : -1;
                of_table.push_back(s < 0 ? nullptr : &torso_model()[s]);
            }
            for (const Names& names : {of_map, of_table}) {
                Hypothesis h;
                h.cause = AnatomyCause::names_shifted;
                h.names = names;
                h.shift = by;
                h.fit = match(names).human({});
                h.score = h.fit.score - 3 - std::abs(by);
                offer(h);
            }
        }
    }

    // How much likelier another name of a label must be.
    double change_cost(std::size_t i, const ModelStructure& to) const {
        const ModelStructure& from = *names_[i];
        double cost = from.family == to.family ? 0.7 : 0.9;
        if (seen_[i].cut) cost += 1.5;              // a part can look like anything
        if (norm(from.at - to.at) < 25) cost += 3;  // little harm, and little to tell them apart by
        return cost;
    }

    // The best names for the labels, whatever they are called.
    void renamed() {
        const auto model = torso_model();
        const auto rows = static_cast<Eigen::Index>(seen_.size());
        const auto columns = static_cast<Eigen::Index>(model.size());
        // Under exchanged names the middle of all labels is that of all places; under right ones
        // the fit is better.
        Fit middle;
        middle.score = 0;
        for (int r = 0; r < 3; ++r) {
            AxisFit& axis = middle.axes[r];
            axis.m = r;
            axis.row[r] = 1;
            for (std::size_t i = 0; i < seen_.size(); ++i)
                axis.shift += (seen_[i].label->centre[r] - names_[i]->at[r]) /
                              static_cast<double>(seen_.size());
        }
        // No label of a body with a uterus is a prostate, and the other way round.
        const auto named = [&](std::string_view family) {
            return std::any_of(names_.begin(), names_.end(),
                               [&](const ModelStructure* s) { return s->family == family; });
        };
        const bool woman = named("uterus") || named("ovary"), man = named("prostate");
        const auto possible = [&](const ModelStructure& s) {
            return !(woman && s.family == "prostate") &&
                   !(man && (s.family == "uterus" || s.family == "ovary"));
        };
        for (const Fit& start : {right_, middle}) {
            Fit fit = start;
            for (int round = 0; round < 3; ++round) {
                Match scorer = match(names_);
                Eigen::MatrixXd cost(rows, columns + rows);
                for (Eigen::Index i = 0; i < rows; ++i) {
                    for (Eigen::Index j = 0; j < columns; ++j) {
                        const bool own = &model[j] == names_[i];
                        if (!own && !possible(model[j])) {
                            cost(i, j) = 1e6;
                            continue;
                        }
                        cost(i, j) = -scorer.density(i, &model[j], fit) +
                                     (own ? 0 : change_cost(static_cast<std::size_t>(i), model[j]));
                    }
                    for (Eigen::Index j = 0; j < rows; ++j)
                        cost(i, columns + j) = -scorer.density(i, nullptr, fit) + 2;
                }
                const std::vector<int> column = assignment(cost);
                Hypothesis h;
                h.cause = AnatomyCause::names_exchanged;
                double changes = 0;
                int changed = 0;
                for (Eigen::Index i = 0; i < rows; ++i) {
                    const ModelStructure* s =
                        column[i] < static_cast<int>(columns) ? &model[column[i]] : nullptr;
                    h.names.push_back(s);
                    if (s != names_[i])
                        changes += s == nullptr ? 2 : change_cost(static_cast<std::size_t>(i), *s);
                }
                h.fit = match(h.names).human({});
                // One label alone is more often an odd organ than a wrong name.
                h.score = h.fit.score - (changed > 1 ? 0.5 : 3) - changes;
                fit = h.fit;
                // A label alone that fits no name is an odd organ, which the fit allows for.
                bool other_name = false;
                for (std::size_t i = 0; i < seen_.size(); ++i)
                    other_name = other_name || (h.names[i] != nullptr && h.names[i] != names_[i]);
                if (other_name) offer(h);
            }
        }
    }

    // Log of how much likelier the way from label i to label j is if their names are exchanged,
    // beside what their places say: neighbours move together, so that it varies less than they do.
    double way_gain(std::size_t i, std::size_t j) const {
        const ModelStructure &a = *names_[i], &b = *names_[j];
        const double near = norm(a.at - b.at) / kNeighbours_mm;
        const double together = kTogether * std::exp(-near * near);
        double gain = 0;
        for (int r = 0; r < 3; ++r) {
            if (seen_[i].says_nothing(a, r) || seen_[j].says_nothing(b, r)) continue;
            const double seen = seen_[j].label->centre[r] - seen_[i].label->centre[r];
            const double usual = right_.axes[r].at(b.at) - right_.axes[r].at(a.at);
            const double v = variance(seen_[i], a, r, r, right_.axes[r].size, body_.voxel_mm[r]) +
                             variance(seen_[j], b, r, r, right_.axes[r].size, body_.voxel_mm[r]);
            const auto exchanged_against_right = [&](double spread2) {
                return student((seen + usual) * (seen + usual) / spread2, 1) -
                       student((seen - usual) * (seen - usual) / spread2, 1);
            };
            gain += exchanged_against_right(v * (1 - together)) - exchanged_against_right(v);
        }
        return gain;
    }

    // The names of two labels exchanged, for the few pairs that gain most by it.
    void exchanged(Match& as_is) {
        struct Pair {
            double gain;
            std::size_t i, j;
        };
        std::vector<Pair> pairs;
        std::vector<double> own;
        for (std::size_t i = 0; i < seen_.size(); ++i)
            own.push_back(as_is.density(i, names_[i], right_));
        for (std::size_t i = 0; i < seen_.size(); ++i)
            for (std::size_t j = i + 1; j < seen_.size(); ++j) {
                if (names_[i] == names_[j]) continue;
                const double gain = as_is.density(i, names_[j], right_) - own[i] +
                                    as_is.density(j, names_[i], right_) - own[j] + way_gain(i, j) -
                                    change_cost(i, *names_[j]) - change_cost(j, *names_[i]);
                pairs.push_back({gain, i, j});
            }
        const std::size_t few = std::min<std::size_t>(kPairs, pairs.size());
        std::partial_sort(pairs.begin(), pairs.begin() + static_cast<std::ptrdiff_t>(few),
                          pairs.end(), [](const Pair& a, const Pair& b) {
                              return std::tie(b.gain, a.i, a.j) < std::tie(a.gain, b.i, b.j);
                          });
        for (std::size_t n = 0; n < few; ++n) {
            const auto& [gain, i, j] = pairs[n];
            Hypothesis h;
            h.cause = AnatomyCause::names_exchanged;
            h.names = names_;
            std::swap(h.names[i], h.names[j]);
            h.fit = match(h.names).human({});
            h.score = h.fit.score + way_gain(i, j) - 0.5 - change_cost(i, *names_[j]) -
                      change_cost(j, *names_[i]);
            offer(h);
        }
    }

    // One name for a structure and its missing partner on the other side: the box holds both
    // places, as that of one alone never does, and its middle lies between them.
    void two_in_one() {
        const std::set<const ModelStructure*> there(names_.begin(), names_.end());
        for (std::size_t i = 0; i < seen_.size(); ++i) {
            const ModelStructure& own = *names_[i];
            if (own.other < 0) continue;
            const ModelStructure& second = torso_model()[own.other];
            if (there.contains(&second)) continue;
            const Box3& box = seen_[i].label->box;
            bool holds = true;
            for (int r = 0; r < 3; ++r)
                for (const Vector3& at : {own.at, second.at}) {
                    const double x = right_.axes[r].at(at), near = 15 + own.spread[r];
                    if (r > 0 && seen_[i].says_nothing(own, r)) continue;
                    holds = holds && x > box.lower[r] - near && x < box.upper[r] + near;
                }
            if (!holds) continue;
            ModelStructure both = own;
            both.at = 0.5 * (own.at + second.at);
            both.spread = 1.3 * own.spread;
            both.half_mm += std::abs(own.at.x);
            both.length.x = std::hypot(own.length.x, std::sqrt(12.0) * own.at.x);
            both.usual_ml *= 2;
            Names names = names_;
            names[i] = &both;
            Hypothesis h;
            h.cause = AnatomyCause::two_in_one;
            h.names = names_;
            h.label = static_cast<int>(i);
            h.second = own.other;
            h.fit = match(std::move(names)).human({});
            h.score = h.fit.score + 5;
            offer(h);
        }
    }

    // Labels that the winning hypothesis explains best against the map as it is: "liver lies ...".
    std::string evidence() const {
        const Match scorer = match(names_);
        std::vector<std::pair<double, std::string>> gains;
        for (std::size_t i = 0; i < seen_.size(); ++i) {
            const double gain =
                scorer.density(i, best_.names[i], best_.fit) - scorer.density(i, names_[i], right_);
            Vector3 off;
            for (int r = 0; r < 3; ++r)
                off[r] = seen_[i].label->centre[r] - right_.axes[r].at(names_[i]->at);
            gains.emplace_back(-gain, text("%s %.0f mm", seen_[i].label->name.c_str(), norm(off)));
        }
        std::stable_sort(gains.begin(), gains.end(),
                         [](const auto& a, const auto& b) { return a.first < b.first; });
        std::string list;
        for (std::size_t n = 0; n < std::min<std::size_t>(3, gains.size()); ++n)
            list += (n > 0 ? ", " : "") + gains[n].second;
        return " (off their usual places: " + list + ")";
    }

    std::string exchanged_names() const {
        std::vector<std::string> list;
        for (std::size_t i = 0; i < seen_.size(); ++i) {
            const ModelStructure* s = best_.names[i];
            if (s != names_[i] && s != nullptr)
                list.push_back("'" + seen_[i].label->name + "' is like " + s->name);
        }
        return excerpt(list);
    }

    AnatomyFinding finding() const {
        AnatomyFinding f;
        f.cause = best_.cause;
        f.axis = best_.axis;
        f.factor = best_.factor;
        f.margin = best_.score - right_.score;
        for (std::size_t i = 0; i < best_.names.size() && i < names_.size(); ++i)
            f.renamed += best_.names[i] != nullptr && best_.names[i] != names_[i];
        const std::string turn =
            options_.mesh
                ? "; give --axes lps or ras if the file holds one of them, else turn it in the "
                  "program that made it (x to the right, y to the front, z to the head)"
                : "; where the header has two transforms give the other, --orientation sform or "
                  "qform, else write the file again from the program that made it";
        constexpr const char* kAxes[] = {"left to right", "back to front", "feet to head"};
        switch (f.cause) {
            case AnatomyCause::mirrored:
                f.text = "left and right are exchanged" + evidence() + turn +
                         " (or situs inversus with all names exchanged: then go on)";
                break;
            case AnatomyCause::front_and_back:
                f.text = "front and back are exchanged" + evidence() + turn;
                break;
            case AnatomyCause::upside_down:
                f.text = "head and feet are exchanged" + evidence() + turn;
                break;
            case AnatomyCause::turned_about_x:
                f.text =
                    "the body is turned by 180 degrees about the axis from left to right: "
                    "upside down" +
                    evidence() + turn + " (or a phantom that was scanned so: then go on)";
                break;
            case AnatomyCause::turned_about_y:
                f.text =
                    "the body is turned by 180 degrees about the axis from back to front: "
                    "upside down" +
                    evidence() + turn + " (or a phantom that was scanned so: then go on)";
                break;
            case AnatomyCause::turned_about_z:
                f.text =
                    "left and right as well as front and back are exchanged, as where LPS is "
                    "read as RAS" +
                    evidence() + turn;
                break;
            case AnatomyCause::all_turned:
                f.text = "all three axes are turned round" + evidence() + turn;
                break;
            case AnatomyCause::axes_exchanged:
                f.text = "axes of the map are exchanged: what runs ";
                for (int r = 0; r < 3; ++r)
                    if (best_.orientation.m[r] != r)
                        f.text += (f.text.back() == ' ' ? "" : ", ") + std::string(kAxes[r]) +
                                  " is the body's " + kAxes[best_.orientation.m[r]];
                f.text += evidence() + turn;
                break;
            case AnatomyCause::situs_inversus:
                f.text =
                    "organs are mirrored and names with a side are not: situs inversus, or a "
                    "map that is mirrored and whose names were exchanged as well" +
                    evidence() + "; if it is situs inversus go on, else" + turn.substr(1);
                break;
            case AnatomyCause::sides_of_names:
                f.text =
                    "names with left and right are exchanged, organs without a side are "
                    "not" +
                    evidence() + "; give a --table with the right names";
                break;
            case AnatomyCause::unit:
                f.text = text("everything is about %.4g times as large as in a body", f.factor) +
                         evidence() + text("; give --scale %.4g", 1 / f.factor);
                break;
            case AnatomyCause::spacing:
                f.text = text("the body is about %.2g times as long from ", f.factor) +
                         kAxes[f.axis] +
                         " as along its other axes: the spacing of voxels or slices along it is "
                         "wrong" +
                         evidence() + "; correct it in the header";
                break;
            case AnatomyCause::names_shifted:
                f.text = text("names are shifted by %d: ", best_.shift) + exchanged_names() +
                         "; give the --table that belongs to the map, or --names none";
                break;
            case AnatomyCause::names_exchanged:
                f.text = "names do not fit what they name: " + exchanged_names() +
                         "; give the --table that belongs to the map, or --names none";
                break;
            case AnatomyCause::two_in_one:
                f.text = "'" + seen_[best_.label].label->name + "' seems to hold " +
                         torso_model()[best_.second].name +
                         " as well; give each a label of its own";
                break;
            case AnatomyCause::volumes:
            case AnatomyCause::out_of_place: break;
        }
        return f;
    }

    // Volumes that nobody has. Cut organs count where they are too large.
    void volumes(AnatomyReport& report) const {
        std::vector<std::string> large, small;
        bool far = false;
        for (std::size_t i = 0; i < seen_.size(); ++i) {
            const double ml = seen_[i].label->ml;
            const std::string one =
                text(ml < 10 ? "%s of %.2g ml" : "%s of %.0f ml", seen_[i].label->name.c_str(), ml);
            if (ml > names_[i]->max_ml) {
                far = far || ml > 2 * names_[i]->max_ml;
                large.push_back(one);
            }
            if (!seen_[i].cut && ml < names_[i]->min_ml) small.push_back(one);
        }
        const bool impossible = far || large.size() >= 2;
        const int too_small = static_cast<int>(small.size());
        AnatomyFinding* unit = nullptr;
        for (AnatomyFinding& f : report.findings)
            if (f.cause == AnatomyCause::unit || f.cause == AnatomyCause::spacing) unit = &f;
        if (unit != nullptr) {
            unit->error = impossible || 2 * too_small > known();
            return;
        }
        if (!large.empty()) {
            AnatomyFinding f;
            f.cause = AnatomyCause::volumes;
            f.error = impossible;
            f.text = "larger than in any body: " + excerpt(large) +
                     "; the names are another table's, or the unit is wrong: give the --table that "
                     "belongs to the map, --names none, or --scale";
            report.findings.push_back(f);
        } else if (3 * too_small > known() && too_small >= 2) {
            AnatomyFinding f;
            f.cause = AnatomyCause::volumes;
            f.text = "these are smaller than in a newborn: " + excerpt(small) +
                     "; check names and unit, --table and --scale";
            report.findings.push_back(f);
        }
    }

    // Organs that lie far from where all others say, as a mask that was flipped or moved alone. Of
    // many the fit is wrong, and nothing is said of one.
    void out_of_place(AnatomyReport& report) const {
        constexpr double kFar_mm = 80, kFarSpreads = 5;
        std::string list;
        int count = 0;
        for (std::size_t i = 0; i < seen_.size(); ++i) {
            if (names_[i] == nullptr || seen_[i].cut) continue;
            double spreads2 = 0;
            Vector3 off;
            for (int r = 0; r < 3; ++r) {
                const AxisFit& a = right_.axes[r];
                off[r] = seen_[i].label->centre[r] - a.at(names_[i]->at);
                spreads2 += off[r] * off[r] /
                            variance(seen_[i], *names_[i], r, a.m, a.size, body_.voxel_mm[r]);
            }
            if (norm(off) < kFar_mm || spreads2 < kFarSpreads * kFarSpreads) continue;
            list += text("%s'%s' lies %.0f mm", count++ > 0 ? " and " : "",
                         seen_[i].label->name.c_str(), norm(off));
        }
        if (count == 0 || count > 2 || 4 * count > known()) return;
        AnatomyFinding f;
        f.cause = AnatomyCause::out_of_place;
        f.text = list +
                 " from its usual place among the others: its mask was flipped or moved alone, or "
                 "the name is another structure's; look at it, and give a --table with the right "
                 "names if it is the name";
        report.findings.push_back(f);
    }

    void unusual_size(AnatomyReport& report) const {
        constexpr double kSmall = 0.65, kLarge = 1.28;  // of an adult, at steps of 15 %
        const double size = std::exp(kStep * (right_.k[0] + right_.k[1] + right_.k[2]) / 3.0);
        if (size < kSmall)
            report.size = text(
                "the body is about %.2g times as large as an adult's: a small child, or "
                "voxels that are larger than the file says; compare its width with the "
                "scan's, and give --scale if they differ",
                size);
        else if (size > kLarge)
            report.size = text(
                "the body is about %.2g times as large as an adult's: a very large person, or "
                "voxels that are smaller than the file says; compare its width with the "
                "scan's, and give --scale if they differ",
                size);
    }

    void remarks(AnatomyReport& report) const {
        constexpr int kMany = 8;
        if (known() >= kMany && report.findings.empty() && !body_.field.empty()) {
            std::set<std::string> there;
            for (const ModelStructure* s : names_) there.insert(s->name);
            for (const char* core : {"liver", "spleen", "kidney_right", "kidney_left", "aorta"}) {
                if (there.contains(core)) continue;
                const ModelStructure& s = torso_model()[model_structure(core)];
                bool within = true;
                for (int r = 0; r < 3; ++r) {
                    const double at = right_.axes[r].at(s.at);
                    within =
                        within && at > body_.field.lower[r] + 20 && at < body_.field.upper[r] - 20;
                }
                if (within)
                    report.remarks.push_back(std::string("there is no '") + core +
                                             "' although its place lies in the map");
            }
        }
        const double tall = body_.field.empty() ? 1000 : body_.field.extent().z + body_.voxel_mm.z;
        if (tall < 80)
            report.remarks.push_back(
                text("the map is %.0f mm tall: places along the body say little", tall));
    }

    const BodySummary& body_;
    AnatomyOptions options_;
    std::vector<Seen> seen_;
    std::vector<std::size_t> label_of_;  // # seen: index into the body's labels
    Names names_;
    Box3 skin_;
    Fit right_;
    Hypothesis best_;
};

}  // namespace

BodySummary summarise_body(const LabelVolume& labels, const Matrix3& ct_from_grid) {
    static const Tissue kPlain{};
    const std::vector<const Tissue*> tissues(labels.labels.size(), &kPlain);
    const std::vector<LabelFacts> facts = label_facts(labels, tissues);
    const Grid& grid = labels.grid;
    const Matrix3 axes = ct_from_grid * grid.direction;
    // The axis of the frame that each axis of the grid is nearest to.
    std::array<int, 3> axis_of{};
    BodySummary body;
    for (int g = 0; g < 3; ++g) {
        const Vector3 a = axes.column(g);
        for (int r = 1; r < 3; ++r)
            if (std::abs(a[r]) > std::abs(a[axis_of[g]])) axis_of[g] = r;
        body.voxel_mm[axis_of[g]] = grid.spacing_mm[g];
    }
    const auto place = [&](double i, double j, double k) {
        return Point3{} + ct_from_grid * (grid.point_from_voxel({i, j, k}) - Point3{});
    };
    const auto box = [&](const Int3& low, const Int3& high) {
        Box3 b;
        for (int c = 0; c < 8; ++c)
            b.include(
                place(c & 1 ? high.x : low.x, c & 2 ? high.y : low.y, c & 4 ? high.z : low.z));
        return b;
    };
    body.field = box({0, 0, 0}, {grid.size.x - 1, grid.size.y - 1, grid.size.z - 1});
    for (std::size_t l = 1; l < facts.size(); ++l) {
        const LabelFacts& f = facts[l];
        if (f.count == 0) continue;
        LabelSummary s;
        s.name = labels.labels[l].name;
        s.value = labels.labels[l].source_value;
        s.ml = static_cast<double>(f.count) * grid.voxel_volume_mm3() / 1000;
        s.centre = place(f.mean.x, f.mean.y, f.mean.z);
        s.box = box(f.lower, f.upper);
        for (int r = 0; r < 3; ++r) {
            double variance = 0;
            for (int p = 0; p < 3; ++p) {
                double along = 0;  // of the principal axis p, per voxel
                for (int g = 0; g < 3; ++g) along += axes(r, g) * grid.spacing_mm[g] * f.axes(g, p);
                variance += std::pow(along * f.spread[p], 2);
            }
            s.length_mm[r] = std::sqrt(12 * variance + std::pow(body.voxel_mm[r], 2));
        }
        for (int g = 0; g < 3; ++g) {
            const int r = axis_of[g];
            const bool up = axes(r, g) > 0;
            const bool low = f.lower[g] == 0, high = f.upper[g] == grid.size[g] - 1;
            s.cut_low[r] = s.cut_low[r] || (up ? low : high);
            s.cut_high[r] = s.cut_high[r] || (up ? high : low);
        }
        body.labels.push_back(std::move(s));
    }
    return body;
}

AnatomyReport check_anatomy(const BodySummary& body, const AnatomyOptions& options) {
    return Check(body, options).run();
}

namespace {

constexpr double kLongest = 6;          // times half of a structure's usual extent
constexpr double kOrderMargin_mm = 10;  // structures of one height may lie in either order
constexpr double kOrderSpread = 3.5;    // standard deviations off the usual distance

// What takes up most of a body: less than this is another structure, ml. The model has no places
// for them.
constexpr std::pair<const char*, double> kLeastMl[] = {
    {"body_trunc", 1000}, {"subcutaneous_fat", 200}, {"torso_fat", 50}, {"skeletal_muscle", 200}};

double longest(const LabelSummary& label) {
    return std::max({label.length_mm.x, label.length_mm.y, label.length_mm.z});
}

std::string would_be(const LabelSummary& label) {
    return std::to_string(label.value) + " would be " + label.name;
}

// "3 would be spleen to the right of 5, liver" for each pair that lies the other way round.
void find_orders(const std::vector<std::pair<int, const LabelSummary*>>& known, NamesFit& fit) {
    const char* beyond[3] = {"to the right of", "in front of", "above"};
    for (std::size_t i = 0; i < known.size(); ++i)
        for (std::size_t j = i + 1; j < known.size(); ++j)
            for (int axis = 0; axis < 3; ++axis) {
                const ModelStructure &a = torso_model()[static_cast<std::size_t>(known[i].first)],
                                     &b = torso_model()[static_cast<std::size_t>(known[j].first)];
                const LabelSummary *first = known[i].second, *second = known[j].second;
                double usual = a.at[axis] - b.at[axis];
                if (usual < 0) {
                    std::swap(first, second);
                    usual = -usual;
                }
                const double wrong = second->centre[axis] - first->centre[axis];
                if (wrong > kOrderMargin_mm &&
                    usual + wrong > kOrderSpread * std::hypot(a.spread[axis], b.spread[axis]))
                    fit.misfits.push_back(would_be(*second) + " " + beyond[axis] + " " +
                                          std::to_string(first->value) + ", " + first->name);
            }
}

}  // namespace

NamesFit names_fit(const BodySummary& body) {
    NamesFit fit;
    fit.agreement = Check(body, {}).agreement();
    std::vector<std::pair<int, const LabelSummary*>> known;
    std::vector<std::string> volumes;
    for (const LabelSummary& label : body.labels) {
        for (const auto& [name, least] : kLeastMl)
            if (label.name == name && label.ml < least)
                volumes.push_back(would_be(label) + text(" of %.0f ml", label.ml));
        const int s = model_structure(label.name);
        if (s < 0) continue;
        known.emplace_back(s, &label);
        const ModelStructure& structure = torso_model()[static_cast<std::size_t>(s)];
        if (label.ml > structure.max_ml)
            volumes.push_back(would_be(label) + text(" of %.0f ml", label.ml));
        else if (longest(label) > kLongest * structure.half_mm)
            fit.misfits.push_back(would_be(label) + text(" %.0f mm long", longest(label)));
    }
    fit.gross = !volumes.empty();
    fit.misfits.insert(fit.misfits.begin(), volumes.begin(), volumes.end());
    std::stable_sort(known.begin(), known.end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    find_orders(known, fit);
    return fit;
}

bool NamesFit::agrees() const {
    return misfits.empty() && agreement && *agreement > kNamesAgree;
}

bool is_known_structure(std::string_view name) {
    return model_structure(name) >= 0;
}

std::string AnatomyReport::verdict() const {
    std::string out;
    for (const AnatomyFinding& f : findings) out += (out.empty() ? "" : "; ") + f.text;
    if (findings.empty())
        out = checked ? "agrees: " + std::to_string(known) + " named organs"
                      : "not checked: only " + std::to_string(known) + " named organs";
    if (!size.empty()) out += "; " + size;
    for (const std::string& remark : remarks) out += "; " + remark;
    return out;
}

std::optional<std::string> report_anatomy(const LabelVolume& labels,
                                          const AnatomyOptions& options,
                                          StageReport& report) {
    const AnatomyReport anatomy = check_anatomy(summarise_body(labels), options);
    std::erase_if(report.notes, [](const Note& note) { return note.name == "anatomy"; });
    report.notes.push_back({"anatomy", anatomy.verdict()});
    std::optional<std::string> error;
    for (const AnatomyFinding& f : anatomy.findings) {
        report.warnings.push_back("anatomy: " + f.text);
        if (f.error && !error) error = f.text;
    }
    if (!anatomy.size.empty()) report.warnings.push_back("anatomy: " + anatomy.size);
    return error;
}

}  // namespace sonocase::pipeline::inline anatomy
