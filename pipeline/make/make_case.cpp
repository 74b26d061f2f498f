// SPDX-License-Identifier: Apache-2.0

#include "pipeline/make/make_case.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>

#include "formats/base/digest.h"
#include "formats/bundle/case_bundle.h"
#include "formats/exercise/exercise.h"
#include "formats/files/atomic_file.h"
#include "formats/files/load_save.h"
#include "formats/files/thread_jobs.h"
#include "formats/text/excerpt.h"
#include "pipeline/anatomy/torso_model.h"
#include "pipeline/base/text.h"
#include "pipeline/check/check_case.h"
#include "pipeline/check/propose_exercises.h"
#include "pipeline/cook/cook_case.h"
#include "pipeline/cook/input_digests.h"
#include "pipeline/export/ultrasound_picture.h"
#include "pipeline/make/make_plan.h"
#include "pipeline/stages/read_recipe.h"
#include "pipeline/stages/roles.h"
#include "pipeline/stages/stage_runner.h"

namespace sonocase::pipeline::inline make {

namespace {

namespace fs = std::filesystem;

constexpr int kProposalsVersion = 2, kCheckVersion = 2;  // raised when they come out otherwise

// Where the whole stands when its parts begin: shares of the time on the shared CT.
constexpr double kCookAt = 0.02, kProposeAt = 0.55, kCookAgainAt = 0.72, kCheckAt = 0.84,
                 kDrawAt = 0.96, kPublishAt = 0.98;

// Progress of a part, as progress of the whole.
Progress between(const Progress& whole, double from, double to) {
    if (!whole) return {};
    return [&whole, from, to](double fraction, std::string_view doing) {
        report_progress(whole, from + (to - from) * fraction, doing);
    };
}

constexpr double kCovered = 0.5;

// The share of the surface of everything labelled that is skin, fat or unnamed body. Organs, bones
// and named muscles do not cover a body.
double covered_share(const LabelVolume& labels) {
    std::vector<bool> covers;
    for (const Label& label : labels.labels)
        covers.push_back(label.tissue == "skin" || label.tissue == "fat" ||
                         label.tissue == "soft_tissue");
    const Grid& grid = labels.grid;
    std::size_t faces = 0, covered = 0;
    const std::size_t steps[3] = {
        1, static_cast<std::size_t>(grid.size.x),
        static_cast<std::size_t>(grid.size.x) * static_cast<std::size_t>(grid.size.y)};
    for (int k = 0; k < grid.size.z; ++k)
        for (int j = 0; j < grid.size.y; ++j)
            for (int i = 0; i < grid.size.x; ++i) {
                const std::size_t n = grid.index(i, j, k);
                const Int3 at{i, j, k};
                for (int axis = 0; axis < 3; ++axis) {
                    if (at[axis] + 1 >= grid.size[axis]) continue;
                    const std::uint8_t a = labels.voxels[n],
                                       b = labels.voxels[n + steps[static_cast<std::size_t>(axis)]];
                    if ((a == 0) == (b == 0)) continue;
                    ++faces;
                    covered += covers[a | b];  // one of them is 0
                }
            }
    return faces == 0 ? 0 : static_cast<double>(covered) / static_cast<double>(faces);
}

// Names that exercises do not know. What the scan fills in counts as none.
std::string unknown_names(const std::vector<Label>& labels) {
    std::vector<std::string> names;
    for (const Label& label : labels) {
        if (label.tissue == "outside" || standard_name(label.name) == label.name ||
            label.name == "skin" || label.name == "gas_in_body" || label.name.starts_with("other_"))
            continue;
        names.push_back("'" + label.name + "'");
    }
    return excerpt(names);
}

class Maker {
  public:
    Maker(const MakeOptions& options,
          const Decided& decided,
          FoundInputs found,
          CaseFolder folder,
          const Progress& progress)
        : options_(options),
          decided_(decided),
          found_(std::move(found)),
          folder_(std::move(folder)),
          memo_(folder_.file("cache/digests")),
          progress_(progress) {
        made_.bundle = options.out;
        made_.folder = folder_.path();
    }

    // warnings: gets those of a case that could not be made.
    Result<MadeCase> run(std::vector<std::string>& warnings) {
        auto made = make();
        if (made) return made;
        warnings = std::move(made_.warnings);
        Error error = made.error();
        error.where = folder_.given(error.where);
        return error;
    }

  private:
    Result<MadeCase> make() {
        SONOCASE_TRY_DONE(write_recipe());
        SONOCASE_TRY_DONE(propose_all());
        SONOCASE_TRY_DONE(cook_with_exercises());
        SONOCASE_TRY_DONE(look_over());
        SONOCASE_TRY_DONE(memo_.save());
        SONOCASE_TRY_DONE(folder_.save());
        SONOCASE_TRY_DONE(refuse_faults());
        SONOCASE_TRY_DONE(put_online());
        report_progress(progress_, 1, "done");
        return std::move(made_);
    }

    RecipeOverrides overrides() const {
        RecipeOverrides overrides;
        overrides.preset = options_.preset;
        overrides.sets = options_.sets;
        return overrides;
    }

    Status write_recipe() {
        SONOCASE_TRY(const auto text, recipe_text(options_, found_, folder_, decided_));
        SONOCASE_TRY(const bool ours, folder_.propose("case.toml", text));
        if (!ours)
            decided_({"recipe: " + folder_.file("case.toml") + " was changed by hand and counts",
                      "remove it to have it written again"});
        return Done{};
    }

    // The plan key of a recipe's case: what its bundle depends on.
    Result<std::string> key_of(const Recipe& recipe) {
        SONOCASE_TRY(const auto inputs, digest_inputs(recipe, [&](const std::string& path) {
                         return memo_.digest(path);
                     }));
        return plan_stages(recipe, inputs).back().plan_key;
    }

    Result<CookResult> cook(const Recipe& recipe, double from, double to, const char* until = "") {
        CookOptions cook;
        cook.cache_folder = folder_.file("cache");
        cook.producer = options_.producer;
        cook.until = until;
        SONOCASE_TRY(auto cooked, cook_case(recipe, cook, between(progress_, from, to)));
        for (const StageRun& run : cooked.stages) {
            add_warnings(run.report);
            if (!run.from_cache && std::find(made_.cooked.begin(), made_.cooked.end(),
                                             run.report.stage) == made_.cooked.end())
                made_.cooked.push_back(run.report.stage);
        }
        return cooked;
    }

    void add_warnings(const StageReport& report) {
        for (const std::string& warning : report.warnings) {
            std::string whole = report.stage + ": " + warning;
            if (std::find(made_.warnings.begin(), made_.warnings.end(), whole) ==
                made_.warnings.end())
                made_.warnings.push_back(std::move(whole));
        }
    }

    // What cannot become a case is told before the work: names that no exercise knows, or organs
    // alone, without skin that a probe could lie on.
    Status expect_body(const Recipe& recipe) {
        SONOCASE_TRY(const auto inputs, digest_inputs(recipe, [&](const std::string& path) {
                         return memo_.digest(path);
                     }));
        const std::vector<PlannedStage> plan = plan_stages(recipe, inputs);
        const Progress progress = between(progress_, 0, kCookAt);
        StageRunner runner(recipe, plan, {folder_.file("cache"), 0, stage_names::kImport},
                           progress);
        SONOCASE_TRY_DONE(runner.run());
        for (const StageRun& run : runner.runs) {
            if (!run.from_cache) made_.cooked.push_back(run.report.stage);
            add_warnings(run.report);
            for (const Note& note : run.report.notes)
                if (note.name == "renamed") decided_({"names: " + note.text, "--table FILE"});
        }
        const StageValue imported = runner.result();
        const LabelVolume& labels = imported.as(kCtLabels).volume;
        if (const std::string why = why_none_fits(labels.labels);
            !why.empty() && folder_.exercises().empty())
            return no_exercise(why, unknown_names(labels.labels));
        const double share = covered_share(labels);
        if (share >= kCovered) return Done{};
        return Error{
            text("the labels are of organs alone: %.0f %% of their surface is skin, fat or "
                 "other cover of a body",
                 100 * share),
            options_.inputs.front(),
            "give the CT that they were drawn on as well (--scan PATH), or labels of the "
            "whole body, such as TotalSegmentator's task body"};
    }

    Error no_exercise(const std::string& why, const std::string& unknown = "") const {
        return Error{"none of the exercises fits this anatomy: " + why +
                         (unknown.empty() ? "" : "; unknown names: " + unknown),
                     options_.inputs.front(),
                     "expected an abdomen or pelvis whose organs have TotalSegmentator's names" +
                         std::string(unknown.empty() ? "" : " (--table FILE gives them)") +
                         "; an exercise of your own may lie in " + folder_.path()};
    }

    Status propose_all() {
        SONOCASE_TRY(auto recipe, load_recipe(folder_.path(), overrides()));
        recipe.exercises.clear();
        recipe.text.clear();  // comments in it change nothing that is proposed
        recipe.inputs.own_skin = true;
        recipe.inputs.surface.clear();
        SONOCASE_TRY(auto key, key_of(recipe));
        key += " " + std::to_string(kProposalsVersion);
        if (folder_.key("proposals") == key) return Done{};
        SONOCASE_TRY_DONE(expect_body(recipe));
        SONOCASE_TRY(const auto cooked, cook(recipe, kCookAt, kProposeAt));
        const auto proposals = propose_exercises(cooked.bundle, [&](double share) {
            report_progress(progress_, kProposeAt + (kCookAgainAt - kProposeAt) * share,
                            "aiming at targets");
        });
        std::vector<std::string> names;
        std::string none;  // why there are no exercises
        for (const Proposal& proposal : proposals) {
            const std::string file = proposal.name + ".toml";
            if (proposal.toml.empty()) {
                none += (none.empty() ? "" : "; ") + proposal.name + ": " + proposal.why;
                decided_({"no exercise " + proposal.name + ": " + proposal.why,
                          "write " + folder_.file(file)});
                continue;
            }
            SONOCASE_TRY(const bool ours, folder_.propose(file, proposal.toml));
            decided_({"exercise " + proposal.name + ": " +
                          (ours ? proposal.why : "was changed by hand and counts"),
                      ours ? "edit " + folder_.file(file) : "remove it to have it written again"});
            names.push_back(file);
        }
        SONOCASE_TRY_DONE(folder_.withdraw_others(names));
        folder_.set_key("proposals", key);
        folder_.set_key("none", none);
        // What was cooked is in the cache, and what was proposed is written: a run that is broken
        // off begins here.
        return folder_.save();
    }

    Status cook_with_exercises() {
        SONOCASE_TRY(const auto recipe, load_recipe(folder_.path(), overrides()));
        made_.exercises = recipe.exercises.size();
        if (recipe.exercises.empty()) return no_exercise(folder_.key("none"));
        SONOCASE_TRY(const auto key, key_of(recipe));
        std::error_code code;
        if (folder_.key("bundle") == key && fs::exists(options_.out, code)) {
            const auto digest = digest_of_file(options_.out);
            if (digest && *digest == folder_.key("bundle digest")) return Done{};
        }
        SONOCASE_TRY(auto cooked, cook(recipe, kCookAgainAt, kCheckAt));
        ThreadJobs jobs;
        const std::vector<std::uint8_t> bytes = write_bundle(cooked.bundle, jobs);
        SONOCASE_TRY_DONE(write_file(options_.out, std::span<const std::uint8_t>(bytes)));
        folder_.set_key("bundle", key);
        folder_.set_key("bundle digest", digest_of(bytes));
        bundle_ = std::move(cooked.bundle);
        return Done{};
    }

    Status look_over() {
        const std::string key = folder_.key("bundle digest") + " " + std::to_string(kCheckVersion);
        std::error_code code;
        if (folder_.key("check") == key && fs::exists(folder_.file("check.html"), code) &&
            fs::exists(folder_.file("pictures.png"), code)) {
            for (std::size_t n = 0; !folder_.key("fault " + std::to_string(n)).empty(); ++n)
                made_.faults.push_back(folder_.key("fault " + std::to_string(n)));
            return Done{};
        }
        if (!bundle_) {
            SONOCASE_TRY(bundle_, load_bundle(options_.out));
        }
        report_progress(progress_, kCheckAt, "checking the case");
        const CheckResult result = check_case(*bundle_);
        SONOCASE_TRY_DONE(
            write_file(folder_.file("check.html"), std::string_view(check_page(*bundle_, result))));
        report_progress(progress_, kDrawAt, "drawing pictures");
        const std::vector<std::uint8_t> sheet =
            case_sheet(*bundle_, result, ultrasound_of_exercises());
        SONOCASE_TRY_DONE(
            write_file(folder_.file("pictures.png"), std::span<const std::uint8_t>(sheet)));
        for (const Fault& fault : result.faults)
            made_.faults.push_back(fault.name + ": " + fault.what + "; " + fault.remedy);
        made_.checked_anew = true;
        for (std::size_t n = 0; n <= made_.faults.size(); ++n)  // one empty behind the last
            folder_.set_key("fault " + std::to_string(n),
                            n < made_.faults.size() ? made_.faults[n] : "");
        folder_.set_key("check", key);
        return Done{};
    }

    // What the player shows where each exercise's first sweep begins, for the sheet.
    std::map<std::string, std::vector<std::uint8_t>> ultrasound_of_exercises() {
        std::map<std::string, std::vector<std::uint8_t>> pictures;
        const std::size_t count = bundle_->exercises.size();
        for (std::size_t n = 0; n < count; ++n) {
            const EmbeddedExercise& embedded = bundle_->exercises[n];
            const auto exercise = parse_exercise(embedded.toml, embedded.name);
            if (!exercise || exercise->sweeps.empty()) continue;
            report_progress(progress_,
                            kDrawAt + (kPublishAt - kDrawAt) * static_cast<double>(n) /
                                          static_cast<double>(count),
                            "drawing pictures");
            auto picture = ultrasound_png(
                options_.out,
                {embedded.name, "sweep:" + exercise->sweeps.front().name, kSheetPx, kSheetPx});
            if (!picture) {
                made_.warnings.push_back("pictures.png shows no ultrasound: " +
                                         picture.error().message());
                return {};
            }
            pictures[embedded.name] = std::move(*picture);
        }
        return pictures;
    }

    Status refuse_faults() const {
        if (made_.faults.empty() || options_.accept_faults) return Done{};
        const std::size_t more = made_.faults.size() - 1;
        return Error{"the check finds " + made_.faults.front() +
                         (more == 0 ? "" : text(" (and %zu more)", more)),
                     folder_.file("check.html"), "mend it, or go on with --accept-faults"};
    }

    Status put_online() {
        if (options_.site.empty()) return Done{};
        report_progress(progress_, kPublishAt, "publishing");
        SONOCASE_TRY(const auto published,
                     publish({options_.out}, options_.site, options_.publish));
        made_.warnings.insert(made_.warnings.end(), published.warnings.begin(),
                              published.warnings.end());
        made_.site = options_.site;
        return Done{};
    }

    const MakeOptions& options_;
    const Decided& decided_;
    FoundInputs found_;
    CaseFolder folder_;
    DigestMemo memo_;
    const Progress& progress_;
    MadeCase made_;
    std::optional<CaseBundle> bundle_;
};

}  // namespace

Result<MadeCase> make_case(const MakeOptions& options,
                           const Decided& decided,
                           const Progress& progress,
                           std::vector<std::string>* warnings) {
    report_progress(progress, 0, "looking at the inputs");
    SONOCASE_TRY(auto found, find_inputs(options, decided));
    SONOCASE_TRY(auto folder, CaseFolder::open(options.out));
    std::vector<std::string> of_failure;
    auto made =
        Maker(options, decided, std::move(found), std::move(folder), progress).run(of_failure);
    if (warnings != nullptr) *warnings = std::move(of_failure);
    return made;
}

}  // namespace sonocase::pipeline::inline make
