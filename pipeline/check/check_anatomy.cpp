// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <optional>

#include "pipeline/aim/case_labels.h"
#include "pipeline/anatomy/tissue_table.h"
#include "pipeline/check/check_case.h"

namespace sonocase::pipeline {
namespace {

struct NormalRange {
    const char* label;
    double low_ml, high_ml;  // adults, rounded; widened for bodies that a scan cuts off
};
// Organ volumes of adults on CT, from small women to large men (a). Colon with its contents: 203 +-
// 75, 198 +- 79 and 160 +- 86 ml in its ascending, transverse and descending parts, fasting
// (Pritchard 2014, doi 10.1111/nmo.12243); sigmoid and rectum come on top.
constexpr NormalRange kNormal[] = {
    {"liver", 800, 2600},         {"spleen", 60, 500},   {"kidney_left", 70, 330},
    {"kidney_right", 70, 330},    {"pancreas", 35, 180}, {"gallbladder", 3, 120},
    {"urinary_bladder", 15, 900}, {"aorta", 25, 400},    {"colon", 250, 1800},
    {"stomach", 30, 1500},        {"duodenum", 25, 250},
};

std::string text(const char* format, double a, double b = 0) {
    char out[160];
    std::snprintf(out, sizeof out, format, a, b);
    return out;
}

struct LabelSums {
    std::vector<double> count;
    std::vector<Vector3> middle;
    Box3 body;
};

LabelSums sums_of(const CaseBundle& bundle) {
    LabelSums sums;
    sums.count.assign(bundle.labels.size(), 0);
    sums.middle.assign(bundle.labels.size(), {});
    const Int3 size = bundle.grid.size;
    for (int k = 0; k < size.z; ++k)
        for (int j = 0; j < size.y; ++j)
            for (int i = 0; i < size.x; ++i) {
                const std::size_t l = bundle.label_bricks.at(i, j, k);
                if (l == 0) continue;
                sums.count[l] += 1;
                const Vector3 v{static_cast<double>(i), static_cast<double>(j),
                                static_cast<double>(k)};
                sums.middle[l] = sums.middle[l] + v;
                sums.body.include(Point3{} + v);
            }
    for (std::size_t l = 0; l < sums.count.size(); ++l)
        if (sums.count[l] > 0) sums.middle[l] = (1 / sums.count[l]) * sums.middle[l];
    return sums;
}

class Anatomy {
  public:
    Anatomy(const CaseBundle& bundle, CheckResult& result)
        : bundle_(bundle), labels_(bundle), sums_(sums_of(bundle)), result_(result) {}

    void check() {
        list_organs();
        missing();
        sides();
        units();
        vessels();
        ribs();
        strangers();
        names();
    }

  private:
    double ml(std::size_t label) const {
        return sums_.count[label] * bundle_.grid.voxel_volume_mm3() / 1000;
    }
    bool there(const std::string& name) const {
        const int label = labels_.find(name);
        return label > 0 && sums_.count[static_cast<std::size_t>(label)] > 0;
    }
    std::optional<Vector3> middle(const std::vector<std::string>& words) const {
        Vector3 sum;
        double count = 0;
        for (std::size_t l = 1; l < bundle_.labels.size(); ++l)
            for (const std::string& word : words)
                if (bundle_.labels[l].name.find(word) != std::string::npos && sums_.count[l] > 0) {
                    sum = sum + sums_.count[l] * sums_.middle[l];
                    count += sums_.count[l];
                    break;
                }
        if (count == 0) return std::nullopt;
        return (1 / count) * sum;
    }

    void list_organs() {
        for (std::size_t l = 1; l < bundle_.labels.size(); ++l) {
            OrganRow row{bundle_.labels[l].name, ml(l), 0, 0};
            for (const NormalRange& normal : kNormal)
                if (row.label == normal.label) {
                    row.low_ml = normal.low_ml;
                    row.high_ml = normal.high_ml;
                }
            result_.organs.push_back(row);
        }
    }

    // Organs of the upper belly come together: who has two of them has them all.
    void missing() {
        const std::array<const char*, 6> together{"liver",        "spleen", "kidney_left",
                                                  "kidney_right", "aorta",  "inferior_vena_cava"};
        int found = 0;
        for (const char* name : together) found += there(name);
        for (const char* name : together)
            if (found >= 2 && !there(name))
                result_.faults.push_back(
                    {"organ-missing",
                     std::string("there is no '") + name + "', although its neighbours are there",
                     "add it to the label map, or name its label so"});
        for (std::size_t l = 1; l < bundle_.labels.size(); ++l)
            if (sums_.count[l] == 0)
                result_.remarks.push_back("label '" + bundle_.labels[l].name + "' is empty");
    }

    // Up from pelvis to chest, forwards from the spine; right is forwards x up.
    void sides() {
        const auto low = middle({"hip", "femur", "sacrum", "bladder", "pelvis"});
        const auto high = middle({"liver", "lung", "heart", "spleen"});
        const auto back = middle({"vertebra", "spin", "sacrum"});
        const auto front = middle({"liver", "colon", "bowel", "stomach", "bladder"});
        if (!low || !high || !back || !front) return;
        const Vector3 up = normalized(*high - *low);
        Vector3 forwards = *front - *back;
        forwards = normalized(forwards - dot(forwards, up) * up);
        const Vector3 right = cross(forwards, up);
        result_.forwards = forwards;
        result_.up = up;
        int agree = 0, against = 0;
        std::string who;
        const auto compare = [&](std::optional<Vector3> r, std::optional<Vector3> l,
                                 const std::string& name) {
            if (!r || !l) return;
            const double off = dot(*r - *l, right) * labels_.voxel_mm();
            if (off > 10) ++agree;
            if (off < -10) {
                ++against;
                who += (who.empty() ? "" : ", ") + name;
            }
        };
        compare(middle({"liver"}), middle({"spleen"}), "liver and spleen");
        for (const Label& label : bundle_.labels) {
            const std::size_t at = label.name.find("_right");
            if (at == std::string::npos) continue;
            std::string other = label.name;
            other.replace(at, 6, "_left");
            const int r = labels_.find(label.name), l = labels_.find(other);
            if (l < 0 || sums_.count[static_cast<std::size_t>(l)] == 0 ||
                sums_.count[static_cast<std::size_t>(r)] == 0)
                continue;
            compare(sums_.middle[static_cast<std::size_t>(r)],
                    sums_.middle[static_cast<std::size_t>(l)], label.name);
        }
        if (against > 0)
            result_.faults.push_back(
                {"sides-swapped",
                 "right and left are exchanged: " + who + (agree > 0 ? " (others are right)" : ""),
                 "check the label map's axes and the names of its values"});
    }

    void units() {
        const Vector3 extent = labels_.voxel_mm() * sums_.body.extent();
        const double least = std::min({extent.x, extent.y, extent.z});
        const double most = std::max({extent.x, extent.y, extent.z});
        double body_l = 0;
        for (std::size_t l = 1; l < sums_.count.size(); ++l) body_l += ml(l) / 1000;
        int small = 0, large = 0;
        for (const OrganRow& organ : result_.organs) {
            if (organ.high_ml == 0 || organ.ml == 0) continue;
            if (organ.ml < organ.low_ml) {
                small += organ.ml < 0.6 * organ.low_ml;
                result_.remarks.push_back(
                    organ.label +
                    " is small: " + text("%.0f ml, normal from %.0f", organ.ml, organ.low_ml));
            }
            if (organ.ml > organ.high_ml) {
                large += organ.ml > 1.6 * organ.high_ml;
                result_.remarks.push_back(
                    organ.label +
                    " is large: " + text("%.0f ml, normal up to %.0f", organ.ml, organ.high_ml));
            }
        }
        if (least < 100 || most > 2200 || body_l < 4 || body_l > 250 || small >= 4 || large >= 4)
            result_.faults.push_back(
                {"wrong-unit",
                 text("the body has %.2f litres and is %.0f mm long", body_l, most) +
                     (small + large >= 4 ? "; its organs have volumes that no adult has" : ""),
                 "expected mm: check the unit of the label map and the mannequin (scale)"});
    }

    bool is_lesion(const std::string& name) const {
        for (const StageReport& report : bundle_.manifest.stages)
            for (const MeasureGroup& lesion : report.groups)
                if (report.stage == "pathology" &&
                    (name == lesion.name || name.starts_with(lesion.name + "_")))
                    return true;
        return false;
    }

    struct Piece {
        std::size_t count = 0;  // voxels of the label
        Vector3 middle;         // of all its voxels, in voxels
    };
    // The pieces of the wanted labels (26 neighbours), those with most of `label` first.
    std::vector<Piece> pieces(int label, const std::vector<bool>& wanted) const {
        const Int3 size = bundle_.grid.size;
        std::vector<std::uint8_t> seen(bundle_.grid.voxel_count(), 0);
        std::vector<Piece> found;
        std::vector<Int3> stack;
        for (int k = 0; k < size.z; ++k)
            for (int j = 0; j < size.y; ++j)
                for (int i = 0; i < size.x; ++i) {
                    if (!wanted[bundle_.label_bricks.at(i, j, k)] ||
                        seen[bundle_.grid.index(i, j, k)])
                        continue;
                    stack.assign(1, {i, j, k});
                    seen[bundle_.grid.index(i, j, k)] = 1;
                    Piece piece;
                    double all = 0;
                    while (!stack.empty()) {
                        const Int3 v = stack.back();
                        stack.pop_back();
                        piece.count += bundle_.label_bricks.at(v.x, v.y, v.z) == label;
                        piece.middle = piece.middle + Vector3{static_cast<double>(v.x),
                                                              static_cast<double>(v.y),
                                                              static_cast<double>(v.z)};
                        ++all;
                        for (int n = 0; n < 27; ++n) {
                            const Int3 o{v.x + n % 3 - 1, v.y + n / 3 % 3 - 1, v.z + n / 9 - 1};
                            if (!bundle_.grid.contains(o.x, o.y, o.z) ||
                                !wanted[bundle_.label_bricks.at(o.x, o.y, o.z)] ||
                                seen[bundle_.grid.index(o.x, o.y, o.z)])
                                continue;
                            seen[bundle_.grid.index(o.x, o.y, o.z)] = 1;
                            stack.push_back(o);
                        }
                    }
                    piece.middle = (1 / all) * piece.middle;
                    found.push_back(piece);
                }
        std::stable_sort(found.begin(), found.end(),
                         [](const Piece& a, const Piece& b) { return a.count > b.count; });
        return found;
    }

    // Ribs on either side: labels of their own, or the pieces of one label.
    void ribs() {
        for (std::size_t l = 1; l < bundle_.labels.size(); ++l) {
            const std::string& name = bundle_.labels[l].name;
            if (!name.starts_with("rib_") || sums_.count[l] == 0) continue;
            result_.ribs_right += name.find("right") != std::string::npos;
            result_.ribs_left += name.find("left") != std::string::npos;
        }
        const int one = labels_.find("ribs");
        if (one > 0 && result_.ribs_right + result_.ribs_left == 0 && norm(result_.up) > 0) {
            std::vector<bool> wanted(bundle_.labels.size(), false);
            wanted[static_cast<std::size_t>(one)] = true;
            const Vector3 right = cross(result_.forwards, result_.up);
            const auto body = middle({"vertebra", "spin", "sacrum"});
            constexpr double kLeastMl = 0.5, kMidlineMm = 25;
            for (const Piece& piece : pieces(one, wanted)) {
                if (static_cast<double>(piece.count) * bundle_.grid.voxel_volume_mm3() <
                    1000 * kLeastMl)
                    continue;
                const double off = body ? dot(piece.middle - *body, right) * labels_.voxel_mm() : 0;
                result_.ribs_right += off > -kMidlineMm;  // a piece across the midline is two ribs
                result_.ribs_left += off < kMidlineMm;
            }
        }
        const int more = std::max(result_.ribs_right, result_.ribs_left);
        if (std::abs(result_.ribs_right - result_.ribs_left) > 1 || more > 12)
            result_.remarks.push_back("there are " + std::to_string(result_.ribs_right) +
                                      " ribs on the right and " +
                                      std::to_string(result_.ribs_left) + " on the left");
    }

    void vessels() {
        for (const char* name : {"aorta", "inferior_vena_cava"}) {
            const int label = labels_.find(name);
            if (label <= 0) continue;
            // A clot or an aneurysm that was put in continues the vessel.
            std::vector<bool> wanted(bundle_.labels.size(), false);
            wanted[static_cast<std::size_t>(label)] = true;
            for (std::size_t l = 1; l < wanted.size(); ++l)
                if (is_lesion(bundle_.labels[l].name)) wanted[l] = true;
            const std::vector<Piece> found = pieces(label, wanted);
            const double all = sums_.count[static_cast<std::size_t>(label)];
            if (found.size() < 2 || static_cast<double>(found[1].count) < 0.05 * all) continue;
            result_.faults.push_back(
                {"vessel-broken",
                 std::string("'") + name + "' is in pieces: the second has " +
                     text("%.1f ml", static_cast<double>(found[1].count) *
                                         bundle_.grid.voxel_volume_mm3() / 1000),
                 "mend the label map where it is interrupted"});
        }
    }

    // An organ that is not there under its name, while a label that no rule knows is made of it.
    void strangers() {
        for (const char* organ : {"liver", "spleen"}) {
            if (there(organ)) continue;
            for (std::size_t l = 1; l < bundle_.labels.size(); ++l) {
                const Label& label = bundle_.labels[l];
                if (label.tissue != organ || tissue_for_label(label.name).known ||
                    is_lesion(label.name) || sums_.count[l] == 0)
                    continue;
                result_.faults.push_back({"label-renamed",
                                          "label '" + label.name + "' is made of '" + organ +
                                              "', and there is no '" + organ + "'",
                                          "name it '" + std::string(organ) + "'"});
            }
        }
    }

    // A name whose tissue is known beyond doubt must have that tissue.
    void names() {
        for (std::size_t l = 1; l < bundle_.labels.size(); ++l) {
            const Label& label = bundle_.labels[l];
            for (const char* plain : {"liver", "spleen", "aorta", "urinary_bladder"}) {
                if (label.name != plain) continue;
                const TissueChoice choice = tissue_for_label(label.name);
                if (choice.known && choice.tissue != label.tissue &&
                    find_tissue(label.tissue) != nullptr)
                    result_.faults.push_back(
                        {"label-renamed",
                         "label '" + label.name + "' is made of '" + label.tissue + "'",
                         "check the names of the label map's values"});
            }
        }
    }

    const CaseBundle& bundle_;
    CaseLabels labels_;
    LabelSums sums_;
    CheckResult& result_;
};

}  // namespace

void check_anatomy(const CaseBundle& bundle, CheckResult& result) {
    Anatomy(bundle, result).check();
}

}  // namespace sonocase::pipeline
