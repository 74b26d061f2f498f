// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <cmath>
#include <optional>

#include "formats/exercise/exercise.h"
#include "formats/text/nearest_name.h"
#include "pipeline/aim/aim.h"
#include "pipeline/aim/scripted_expert.h"
#include "pipeline/check/check_case.h"

namespace sonocase::pipeline {
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

    void check() {
        for (const EmbeddedExercise& embedded : bundle_.exercises) {
            const auto exercise = parse_exercise(embedded.toml, embedded.name);
            if (!exercise) continue;  // not-valid says so
            for (const std::string& name : exercise->no_go) expect_label(embedded.name, name);
            for (const Finding& finding : exercise->findings)
                expect_label(embedded.name, finding.lesion.inside);
            windows_.clear();
            for (const Target& target : exercise->targets) check_target(*exercise, target);
            play(*exercise);
            for (const Sweep& sweep : exercise->sweeps) check_sweep(*exercise, sweep);
        }
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

    // Whether the exercise can be passed: through the first window of each target.
    void play(const Exercise& exercise) {
        ExerciseRow row{exercise.name, false, {}};
        const bool reached =
            windows_.size() == exercise.targets.size() &&
            std::all_of(windows_.begin(), windows_.end(), [](const auto& w) { return w.needle; });
        if (!windows_.empty() && reached) {
            row.played = true;
            row.missed = play_as_expert(bundle_, exercise, windows_).missed;
        }
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
    Exercises(bundle, result).check();
}

}  // namespace sonocase::pipeline
