// SPDX-License-Identifier: Apache-2.0

#include "pipeline/check/check_case.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string_view>

#include "formats/exercise/exercise.h"
#include "formats/exercise/metric_table.h"
#include "formats/text/excerpt.h"
#include "formats/text/json_reader.h"
#include "formats/text/nearest_name.h"
#include "pipeline/anatomy/anatomy_check.h"
#include "pipeline/anatomy/tissue_table.h"
#include "pipeline/anatomy/torso_model.h"
#include "pipeline/base/parallel.h"
#include "pipeline/base/text.h"
#include "pipeline/check/aim.h"
#include "pipeline/check/case_labels.h"
#include "pipeline/check/scripted_expert.h"
#include "pipeline/export/inspect_case.h"

namespace sonocase::pipeline::inline check {

namespace {

struct NormalRange {
    const char* label;
    double low_ml, high_ml;  // adults, rounded; widened for bodies that a scan cuts off
};
// Organ volumes of adults on CT, from small women to large men (assumed). The colon with its
// contents has 203 +- 75, 198 +- 79 and 160 +- 86 ml in its ascending, transverse and descending
// parts, fasting (Pritchard 2014, doi 10.1111/nmo.12243), plus sigmoid and rectum.
constexpr NormalRange kNormal[] = {
    {"liver", 800, 2600},         {"spleen", 60, 500},   {"kidney_left", 70, 330},
    {"kidney_right", 70, 330},    {"pancreas", 35, 180}, {"gallbladder", 3, 120},
    {"urinary_bladder", 15, 900}, {"aorta", 25, 400},    {"colon", 250, 1800},
    {"stomach", 30, 1500},        {"duodenum", 25, 250},
};

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
        misnamed_organs();
        names();
        places();
    }

  private:
    double ml(std::size_t label) const {
        return sums_.count[label] * bundle_.grid.voxel_volume_mm3() / 1000;
    }
    bool has(const std::string& name) const {
        for (std::size_t l = 1; l < bundle_.labels.size(); ++l) {
            const std::string& label = bundle_.labels[l].name;
            if (sums_.count[l] > 0 && (label == name || standard_name(label) == name)) return true;
        }
        return false;
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

    // A body in which two of these organs are found should contain all of them.
    void missing() {
        const std::array<const char*, 6> together{"liver",        "spleen", "kidney_left",
                                                  "kidney_right", "aorta",  "inferior_vena_cava"};
        int found = 0;
        for (const char* name : together) found += has(name);
        for (const char* name : together)
            if (found >= 2 && !has(name))
                result_.faults.push_back(
                    {"organ-missing",
                     std::string("there is no '") + name + "', although its neighbours are there",
                     "add it to the label map, or name its label so"});
        for (std::size_t l = 1; l < bundle_.labels.size(); ++l)
            if (sums_.count[l] == 0)
                result_.remarks.push_back("label '" + bundle_.labels[l].name + "' is empty");
    }

    // The patient's axes are judged by organs: up from pelvis to chest, forwards from the spine,
    // right as the product of both.
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
        int agree = 0;
        std::vector<std::string> swapped;
        const auto compare = [&](std::optional<Vector3> r, std::optional<Vector3> l,
                                 const std::string& name) {
            if (!r || !l) return;
            const double off = dot(*r - *l, right) * labels_.voxel_mm();
            if (off > 10) ++agree;
            if (off < -10) swapped.push_back(name);
        };
        compare(middle({"liver"}), middle({"spleen"}), "liver and spleen");
        for (const Label& label : bundle_.labels) {
            const std::size_t at = label.name.find("_right");
            if (at == std::string::npos) continue;
            std::string other = label.name;
            other.replace(at, 6, "_left");
            const int r = labels_.find(label.name), l = labels_.find(other);
            if (l < 0 || sums_.count[l] == 0 || sums_.count[r] == 0) continue;
            compare(sums_.middle[r], sums_.middle[l], label.name);
        }
        if (!swapped.empty())
            result_.faults.push_back({"sides-swapped",
                                      "right and left are exchanged: " + excerpt(swapped) +
                                          (agree > 0 ? " (others are right)" : ""),
                                      "check the label map's axes and the names of its values"});
    }

    void units() {
        const Vector3 extent = labels_.voxel_mm() * sums_.body.extent();
        const double shortest = std::min({extent.x, extent.y, extent.z});
        const double longest = std::max({extent.x, extent.y, extent.z});
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
        // A neck alone, known by its jugular veins, has a litre or two.
        const bool neck =
            std::any_of(bundle_.labels.begin(), bundle_.labels.end(),
                        [](const Label& l) { return l.name.find("jugular") != std::string::npos; });
        if (shortest < 100 || longest > 2200 || body_l < (neck ? 0.8 : 4) || body_l > 250 ||
            small >= 4 || large >= 4)
            result_.faults.push_back(
                {"wrong-unit",
                 text("the body has %.2f litres and is %.0f mm long", body_l, longest) +
                     (small + large >= 4 ? "; its organs have volumes that no adult has" : ""),
                 "expected mm: check the unit of the label map and the mannequin (scale)"});
    }

    // Places, names and sizes against the model of a torso, in the axes that organs show. What
    // import warned of is said by its report.
    void places() {
        if (!(norm(result_.up) > 0)) return;
        for (const StageReport& report : bundle_.manifest.stages)
            for (const std::string& warning : report.warnings)
                if (warning.starts_with("anatomy: ")) return;
        const Vector3 right = cross(result_.forwards, result_.up);
        const Matrix3 ct_from_grid =
            transpose(Matrix3::from_columns(right, result_.forwards, result_.up));
        LabelVolume volume{bundle_.grid, {}, bundle_.labels};
        volume.voxels.reserve(bundle_.grid.voxel_count());
        for (int k = 0; k < bundle_.grid.size.z; ++k)
            for (int j = 0; j < bundle_.grid.size.y; ++j)
                for (int i = 0; i < bundle_.grid.size.x; ++i)
                    volume.voxels.push_back(bundle_.label_bricks.at(i, j, k));
        // The map bends the body, and a part that the label map's face cut off an organ can no
        // longer be told from another organ: names are import's to check.
        AnatomyOptions options;
        options.margin = 10;
        const AnatomyReport report = check_anatomy(summarise_body(volume, ct_from_grid), options);
        for (const AnatomyFinding& f : report.findings)
            if (f.cause != AnatomyCause::names_exchanged && f.cause != AnatomyCause::two_in_one)
                result_.remarks.push_back("anatomy: " + f.text);
    }

    bool is_lesion(const std::string& name) const {
        for (const StageReport& report : bundle_.manifest.stages)
            for (const MeasureGroup& lesion : report.groups)
                if (report.stage == stage_names::kPathology &&
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
            wanted[one] = true;
            const Vector3 right = cross(result_.forwards, result_.up);
            const auto body = middle({"vertebra", "spin", "sacrum"});
            constexpr double kMinMl = 0.5, kMidlineMm = 25;
            for (const Piece& piece : pieces(one, wanted)) {
                if (static_cast<double>(piece.count) * bundle_.grid.voxel_volume_mm3() <
                    1000 * kMinMl)
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
            wanted[label] = true;
            for (std::size_t l = 1; l < wanted.size(); ++l)
                if (is_lesion(bundle_.labels[l].name)) wanted[l] = true;
            const std::vector<Piece> found = pieces(label, wanted);
            const double all = sums_.count[label];
            if (found.size() < 2 || static_cast<double>(found[1].count) < 0.05 * all) continue;
            result_.faults.push_back(
                {"vessel-broken",
                 std::string("'") + name + "' is in pieces: the second has " +
                     text("%.1f ml", static_cast<double>(found[1].count) *
                                         bundle_.grid.voxel_volume_mm3() / 1000),
                 "mend the label map where it is interrupted"});
        }
    }

    // An organ is not found under its name, while a label of an unknown name is made of its tissue.
    void misnamed_organs() {
        for (const char* organ : {"liver", "spleen"}) {
            if (has(organ)) continue;
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

    // Labels whose names leave no doubt about their tissue must have that tissue.
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

namespace {

constexpr double kNearSkinMm = 30;  // a probe farther from the body than this touches nothing

// Whether the body begins within reach of a probe, along its beam either way.
bool meets_body(const CaseLabels& labels, Point3 probe, Vector3 beam) {
    for (double t = -kNearSkinMm; t <= kNearSkinMm; t += 1)
        if (labels.label(probe + t * beam) != 0) return true;
    return false;
}

class Exercises {
  public:
    Exercises(const CaseBundle& bundle, CheckResult& result)
        : bundle_(bundle), labels_(bundle), result_(result) {
        for (const Label& label : bundle.labels) names_.push_back(label.name);
    }

    void check(const EmbeddedExercise& embedded) {
        const auto exercise = parse_exercise(embedded.toml, embedded.name);
        if (!exercise) return;  // not-valid says so
        for (const std::string& name : exercise->no_go) expect_label(embedded.name, name);
        for (const sonocase::Finding& finding : exercise->findings)
            expect_label(embedded.name, finding.lesion.inside);
        windows_.clear();
        for (const Target& target : exercise->targets) check_target(*exercise, target);
        play(*exercise);
        for (const Sweep& sweep : exercise->sweeps) check_sweep(*exercise, sweep);
    }

  private:
    void expect_label(const std::string& exercise, const std::string& name) {
        if (name.empty() || labels_.find(name) >= 0) return;
        result_.faults.push_back(
            {"label-renamed", exercise + " speaks of the label '" + name + "', which is not there",
             suggest_name(name, names_)});
    }

    void check_target(const Exercise& exercise, const Target& target) {
        expect_label(exercise.name, target.inside);
        const int label = labels_.label(target.centre);
        if (labels_.kind(label) == TissueKind::bone && target.inside != labels_.name(label)) {
            result_.faults.push_back({"target-in-bone",
                                      exercise.name + ": target '" + target.name + "' lies in '" +
                                          labels_.name(label) + "'",
                                      "move it"});
            return;
        }
        if (labels_.find(target.inside) >= 0 && label != labels_.find(target.inside))
            result_.faults.push_back({"target-elsewhere",
                                      exercise.name + ": target '" + target.name + "' lies in '" +
                                          labels_.name(label) + "' and not in '" + target.inside +
                                          "'",
                                      "move it, or say inside = \"" + labels_.name(label) + "\""});
        AimOptions options = aim_options(exercise);
        options.windows = 3;
        const AimResult aimed = aim(
            labels_, {target.name, target.centre, target.radius_mm, exercise.name, target.inside},
            options);
        TargetRow row{exercise.name, target.name, target.inside};
        row.windows = static_cast<int>(aimed.windows.size());
        if (!aimed.windows.empty()) {
            row.depth_mm = aimed.windows[0].depth_mm;
            row.blocked = aimed.windows[0].blocked;
            row.needle = aimed.windows[0].needle;
            row.visible = aimed.windows[0].visible;
            windows_.push_back(aimed.windows[0]);
        }
        result_.targets.push_back(row);
        if (label == 0 || !row.needle)
            result_.faults.push_back(
                {"unreachable",
                 exercise.name + ": " +
                     (label == 0         ? "target '" + target.name + "' lies outside the body"
                      : row.windows == 0 ? "no window on the skin sees '" + target.name + "'"
                                         : "no needle reaches '" + target.name +
                                               "' without bone, gas, vessels or no-go labels"),
                 "move the target; `sonocase aim` shows what is in the way"});
    }

    // Plays the exercise through the first window of each target, to see whether it can be passed.
    void play(const Exercise& exercise) {
        ExerciseRow row{exercise.name, false, {}};
        const bool reached =
            windows_.size() == exercise.targets.size() &&
            std::all_of(windows_.begin(), windows_.end(), [](const auto& w) { return w.needle; });
        if (!windows_.empty() && reached) {
            row.played = true;
            row.missed = play_as_expert(bundle_, exercise, windows_).missed;
        }
        if (exercise.targets.empty())
            for (const Exercise::PassMark& mark : exercise.pass_marks)
                if (const MetricInfo* metric = find_metric(mark.metric);
                    metric != nullptr && std::string_view(metric->group) == "targets")
                    row.missed.push_back(mark.metric + " (there is no target)");
        if (!row.missed.empty()) {
            std::string marks;
            for (const std::string& mark : row.missed) marks += (marks.empty() ? "" : ", ") + mark;
            result_.faults.push_back(
                {"not-passable", exercise.name + ": a scripted expert misses " + marks,
                 "ease the pass marks, or move the target to where a window shows more"});
        }
        result_.exercises.push_back(std::move(row));
    }

    void check_sweep(const Exercise& exercise, const Sweep& sweep) {
        std::size_t away = 0;
        bool needle = false, enters = false;
        for (const SweepKey& key : sweep.keys) {
            away += !meets_body(labels_, key.probe, key.beam);
            needle = needle || key.has_needle;
            enters = enters || (key.has_needle && labels_.label(key.needle_tip) != 0);
        }
        if (2 * away > sweep.keys.size())
            result_.faults.push_back({"sweep-in-air",
                                      exercise.name + ": sweep '" + sweep.name +
                                          "' runs through air at " + std::to_string(away) + " of " +
                                          std::to_string(sweep.keys.size()) + " poses",
                                      "check its frame (ct or mannequin) and positions"});
        else if (needle && !enters)
            result_.faults.push_back(
                {"sweep-in-air",
                 exercise.name + ": the needle of sweep '" + sweep.name + "' never enters the body",
                 "check its positions"});
    }

    const CaseBundle& bundle_;
    CaseLabels labels_;
    CheckResult& result_;
    std::vector<std::string> names_;
    std::vector<AimWindow> windows_;  // the first of each target of this exercise
};

}  // namespace

void check_exercises(const CaseBundle& bundle, CheckResult& result) {
    std::vector<CheckResult> each(bundle.exercises.size());
    parallel_for(each.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t n = begin; n < end; ++n)
            Exercises(bundle, each[n]).check(bundle.exercises[n]);
    });
    const auto append = [](auto& all, auto& part) {
        all.insert(all.end(), part.begin(), part.end());
    };
    for (CheckResult& one : each) {
        append(result.faults, one.faults);
        append(result.remarks, one.remarks);
        append(result.targets, one.targets);
        append(result.exercises, one.exercises);
    }
}

namespace {

using detail::Json;

void check_fit(const CaseBundle& bundle, CheckResult& result) {
    for (const StageReport& report : bundle.manifest.stages) {
        for (const Measure& m : report.measures)
            if (m.name == "min_det_jacobian" && !(m.value > 0))
                result.faults.push_back({"fold",
                                         "the fitted map may turn tissue inside out (det J "
                                         "of at least " +
                                             std::to_string(m.value) + ")",
                                         "fit again: look at the pose, give landmarks"});
        for (const std::string& warning : report.warnings)
            result.remarks.push_back(report.stage + ": " + warning);
    }
}

void check_textures(const CaseBundle& bundle, CheckResult& result) {
    for (const Tissue* tissue : tissues_without_texture(bundle)) {
        result.faults.push_back({"texture-missing",
                                 "tissue '" + tissue->name + "' asks for the texture '" +
                                     tissue->texture + "', which is not there",
                                 "cook the textures of this case again"});
    }
}

void check_validity(const CaseBundle& bundle, CheckResult& result) {
    for (const Finding& finding : validate_case(bundle)) {
        if (finding.text.find("missing texture") != std::string::npos) continue;  // named above
        if (finding.error)
            result.faults.push_back({"not-valid", finding.text, "cook the case again"});
        else
            result.remarks.push_back(finding.text);
    }
}

}  // namespace

CheckResult check_case(const CaseBundle& bundle) {
    CheckResult result;
    check_anatomy(bundle, result);
    check_fit(bundle, result);
    check_textures(bundle, result);
    check_exercises(bundle, result);
    check_validity(bundle, result);
    return result;
}

std::string check_json(const CaseBundle& bundle, const CheckResult& result) {
    Json out = Json::object();
    out["case"] = bundle.manifest.case_name;
    out["faults"] = Json::array();
    for (const Fault& fault : result.faults) {
        Json item = Json::object();
        item["name"] = fault.name;
        item["what"] = fault.what;
        item["remedy"] = fault.remedy;
        out["faults"].push_back(std::move(item));
    }
    out["remarks"] = result.remarks;
    out["organs"] = Json::array();
    for (const OrganRow& organ : result.organs) {
        Json item = Json::object();
        item["label"] = organ.label;
        item["ml"] = organ.ml;
        if (organ.high_ml > 0) item["normal_ml"] = Json::array({organ.low_ml, organ.high_ml});
        out["organs"].push_back(std::move(item));
    }
    out["targets"] = Json::array();
    for (const TargetRow& target : result.targets) {
        Json item = Json::object();
        item["exercise"] = target.exercise;
        item["target"] = target.target;
        item["windows"] = target.windows;
        item["depth_mm"] = target.depth_mm;
        item["blocked"] = target.blocked;
        item["needle"] = target.needle;
        item["visible"] = target.visible;
        out["targets"].push_back(std::move(item));
    }
    out["exercises"] = Json::array();
    for (const ExerciseRow& exercise : result.exercises) {
        Json item = Json::object();
        item["exercise"] = exercise.exercise;
        item["played"] = exercise.played;
        item["missed"] = exercise.missed;
        out["exercises"].push_back(std::move(item));
    }
    out["ribs"] = Json::object();
    out["ribs"]["right"] = result.ribs_right;
    out["ribs"]["left"] = result.ribs_left;
    return detail::json_text(out, true);
}

}  // namespace sonocase::pipeline::inline check
