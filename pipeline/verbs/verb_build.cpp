// SPDX-License-Identifier: Apache-2.0

// sonocase build: cooks a recipe into a case bundle.
#include <sys/resource.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

#include "formats/base/build_facts.h"
#include "formats/base/digest.h"
#include "formats/files/atomic_file.h"
#include "formats/files/thread_jobs.h"
#include "pipeline/base/memory_limit.h"
#include "pipeline/base/parallel.h"
#include "pipeline/base/text.h"
#include "pipeline/cook/case_cost.h"
#include "pipeline/cook/cook_case.h"
#include "pipeline/export/error_budget.h"
#include "pipeline/segmentation/resample_labels.h"
#include "pipeline/stages/read_recipe.h"
#include "pipeline/tradeoff/boundary_error.h"
#include "pipeline/tradeoff/choose_settings.h"
#include "pipeline/tradeoff/suites.h"
#include "pipeline/verbs/verb_common.h"
#include "pipeline/verbs/verbs.h"

namespace sonocase::pipeline::inline verbs {
namespace {

struct BuildOptions {
    std::string recipe;
    std::string out;
    std::string cache;
    double cache_limit_mb = 0, memory_mb = 0;
    std::string until;
    std::string plan_key;
    std::string preview;
    bool list_options = false;
    std::vector<std::string> surfaces;
    AccuracyTarget target;
    RecipeOverrides overrides;
    CommonOptions common;
};

// Returns where --until may stop: "import, surface, ...".
std::string stage_names(const StageTable& table) {
    std::string names;
    for (const StageDescriptor& stage : table.stages)
        if (stage.reports) names += (names.empty() ? "" : ", ") + stage.name;
    return names;
}

std::string preset_names(const StageTable& table) {
    std::string names;
    for (const std::string& name : table.preset_names())
        names += (names.empty() ? "" : ", ") + name;
    return names;
}

// Returns the report as people see it, with what happened in the cache in this run.
StageReport with_cache_notes(const StageRun& run) {
    StageReport report = run.report;
    report.warnings.insert(report.warnings.end(), run.cache_notes.begin(), run.cache_notes.end());
    return report;
}

// What the stages of a case report up to its fit, with the settings of `recipe`. Everything that is
// made stays in the cache, where the build finds it.
Result<std::vector<StageReport>> fit_reports(const BuildOptions& options, const Recipe& recipe) {
    std::vector<StageReport> reports;
    for (const char* until : {stage_names::kImport, stage_names::kWarp}) {
        CookOptions cook;
        cook.cache_folder = options.cache;
        cook.cache_bytes = static_cast<std::uint64_t>(options.cache_limit_mb * 1e6);
        cook.producer = producer();
        cook.until = until;
        ProgressBar bar(options.common);
        SONOCASE_TRY(const auto made, cook_case(recipe, cook, bar.progress()));
        for (const StageRun& run : made.stages) reports.push_back(run.report);
    }
    return reports;
}

// The budget of a case that has been fitted and is then cooked with a voxel.
ErrorBudget budget_at(std::vector<StageReport> reports, double voxel_mm) {
    StageReport resample;
    resample.stage = stage_names::kResample;
    resample.measures = {{"voxel_mm", voxel_mm}};
    reports.push_back(resample);
    return error_budget(reports);
}

// The largest part of an error, in words; empty: there is none.
std::string largest_part(const ErrorBudget& budget) {
    const BudgetEntry* largest = nullptr;
    for (const BudgetEntry& e : budget.entries)
        if (std::isfinite(e.mm) && (largest == nullptr || e.mm > largest->mm)) largest = &e;
    return largest == nullptr
               ? ""
               : text("most of it, %.2g mm, is that of %s", largest->mm, largest->cause.c_str());
}

// Puts settings for the accuracy or the time that was asked for into the recipe. The case is fitted
// for it, once for each of the fits that the settings ask for.
Result<Choice> choose_for(const BuildOptions& options, Recipe& recipe, double speed) {
    if (auto size = cooked_volume_mm3(recipe); !size) return size.error();
    const CaseSize size = case_size(recipe);
    const double voxel_mm = recipe.settings.of<ResampleOptions>().voxel_mm;
    Recipe tried = recipe;
    const auto set = [&](const Settings& settings) {
        tried.settings = recipe.settings;
        return apply_settings(settings, tried.settings).has_value();
    };
    CaseFigures figures;
    figures.seconds = [&](const Settings& settings) {
        if (!set(settings)) return HUGE_VAL;
        return build_time(tried, size, voxel_mm, speed, options.common.threads).alone_s;
    };
    std::optional<Error> error;
    std::vector<std::string> advice;
    std::map<std::string, std::vector<StageReport>> fits;  // by what of the settings they depend on
    figures.error_mm = [&](const Settings& settings) {
        if (error || !set(settings)) return HUGE_VAL;
        std::string of_fit;
        for (const Setting& s : settings)
            if (!s.key.starts_with("resample.") && !s.key.starts_with("texture."))
                of_fit += s.key + "=" + s.value + " ";
        if (!fits.contains(of_fit)) {
            auto reports = fit_reports(options, tried);
            if (!reports) {
                error = reports.error();
                return HUGE_VAL;
            }
            fits[of_fit] = std::move(*reports);
        }
        const ErrorBudget budget =
            budget_at(fits[of_fit], tried.settings.of<ResampleOptions>().voxel_mm);
        advice = {largest_part(budget), landmark_advice(unknown_places(fits[of_fit]))};
        return budget.known_mm;
    };
    Choice choice = choose_settings(measured_front(), options.target, figures);
    if (error) return *error;
    (void)figures.error_mm(choice.settings);
    if (!choice.warning.empty() && options.target.tolerance_mm > 0)
        for (const std::string& words : advice)
            if (!words.empty()) choice.warning += "; " + words;
    if (const Status s = apply_settings(choice.settings, recipe.settings); !s) return s.error();
    return choice;
}

// Peak of this process so far, MB.
double peak_memory_mb() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return static_cast<double>(usage.ru_maxrss) * 1024 / 1e6;
}

// What a build is expected to take, before the work begins.
struct Expected {
    double memory_mb = 0;
    BuildTime time;
    bool said = false;
};

// What became of the accuracy or the time that was asked for.
struct Achieved {
    double known_mm = 0;            // by the reports of the stages
    std::optional<double> true_mm;  // of the surfaces, where the truth is known
    std::string missed;             // empty: nothing
};

Achieved achieved_by(const AccuracyTarget& target,
                     const CookResult& cooked,
                     const Recipe& recipe,
                     double seconds) {
    Achieved achieved;
    std::vector<StageReport> reports;
    for (const StageRun& run : cooked.stages) reports.push_back(run.report);
    const ErrorBudget budget = error_budget(reports);
    achieved.known_mm = budget.known_mm;
    if (recipe.inputs.analytic)
        achieved.true_mm = measure_boundary_error(cooked.bundle, recipe.inputs.torso).displaced_mm;
    const double error_mm = std::max(achieved.known_mm, achieved.true_mm.value_or(0));
    if (target.tolerance_mm > 0 && error_mm > target.tolerance_mm)
        achieved.missed = text("asked for %.2g mm, came to %.2g mm; %s", target.tolerance_mm,
                               error_mm, largest_part(budget).c_str());
    if (target.time_budget_s > 0 && seconds > target.time_budget_s)
        achieved.missed += (achieved.missed.empty() ? "" : "; ") +
                           text("asked for %.2g s, took %.2g s", target.time_budget_s, seconds);
    return achieved;
}

// Returns what a build reports: the stages as they ran, and which of them came from the cache.
std::string build_report(const CookResult& cooked,
                         const std::string& out,
                         const std::string& digest,
                         std::size_t bytes,
                         double seconds,
                         const Expected& expected,
                         const std::optional<Choice>& choice,
                         const Achieved& achieved) {
    nlohmann::ordered_json json;
    if (!out.empty()) json["bundle"] = out;
    json["digest"] = digest;
    if (bytes > 0) json["bytes"] = bytes;
    json["seconds"] = seconds;
    json["processor_seconds"] = processor_seconds();
    json["peak_mb"] = peak_memory_mb();
    if (expected.said)
        json["expected"] = {{"processor_seconds", expected.time.processor_s},
                            {"seconds_alone", expected.time.alone_s},
                            {"memory_mb", expected.memory_mb}};
    char host[64] = "";
    if (gethostname(host, sizeof host - 1) == 0) json["host"] = host;
    if (choice) {
        json["choice"] = {{"settings", settings_text(choice->settings)},
                          {"predicted_error_mm", choice->predicted_error_mm},
                          {"predicted_seconds", choice->predicted_seconds},
                          {"achieved_seconds", seconds},
                          {"known_error_mm", achieved.known_mm}};
        if (achieved.true_mm) json["choice"]["achieved_error_mm"] = *achieved.true_mm;
        if (!achieved.missed.empty()) json["choice"]["missed"] = achieved.missed;
    }
    json["stages"] = nlohmann::ordered_json::array();
    json["warnings"] = nlohmann::ordered_json::array();
    for (const StageRun& run : cooked.stages) {
        const StageReport report = with_cache_notes(run);
        auto stage = nlohmann::ordered_json::parse(report_json(report));
        stage["from_cache"] = run.from_cache;
        if (run.processor_seconds > 0) stage["processor_seconds"] = run.processor_seconds;
        if (!run.key.empty()) stage["key"] = run.key;
        json["stages"].push_back(stage);
        for (const std::string& warning : report.warnings)
            json["warnings"].push_back(report.stage + ": " + warning);
    }
    return json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

Result<std::optional<Choice>> choose(const BuildOptions& options, Recipe& recipe, double speed) {
    const AccuracyTarget& target = options.target;
    if (target.tolerance_mm <= 0 && target.time_budget_s <= 0) return std::optional<Choice>();
    auto choice = choose_for(options, recipe, speed);
    if (!choice) return choice.error();
    std::printf("chosen: %s, this case's error about %.2g mm, in %.2g s\n",
                settings_text(choice->settings).c_str(), choice->predicted_error_mm,
                choice->predicted_seconds);
    if (!choice->warning.empty())
        std::fprintf(stderr, "sonocase build: warning: %s\n", choice->warning.c_str());
    return std::optional<Choice>(std::move(*choice));
}

Result<CookResult> cook(const BuildOptions& options, const Recipe& recipe) {
    CookOptions cook;
    cook.cache_folder = options.cache;
    cook.cache_bytes = static_cast<std::uint64_t>(options.cache_limit_mb * 1e6);
    cook.producer = producer();
    cook.until = options.until;
    cook.plan_key = options.plan_key;
    ProgressBar bar(options.common);
    return cook_case(recipe, cook, bar.progress());
}

Status write_stage_report(const BuildOptions& options,
                          const CookResult& cooked,
                          const Expected& expected,
                          const std::optional<Choice>& choice,
                          double seconds) {
    if (options.common.report_path.empty()) return Done{};
    return write_file(options.common.report_path,
                      build_report(cooked, "", cooked.digest, 0, seconds, expected, choice, {}));
}

// Writes the bundle, its picture, and the report beside it, which inspect reads: seconds are not
// part of the bundle, whose bytes they would change from run to run.
Status write_case(const BuildOptions& options,
                  const std::string& out,
                  const CookResult& cooked,
                  const std::vector<std::uint8_t>& bytes,
                  const std::string& report) {
    if (auto status = write_file(out, bytes); !status) return status;
    if (!options.preview.empty())
        if (auto status = write_file(options.preview, cooked.bundle.preview_png); !status)
            return status;
    for (const std::string& path : {out + ".report.json", options.common.report_path})
        if (!path.empty())
            if (auto status = write_file(path, report); !status) return status;
    return Done{};
}

// A cache for this run alone where none was given: what is made to choose settings, or for the
// first of several mannequins, is not made twice.
Status open_own_cache(BuildOptions& options, const std::string& out) {
    if (!options.cache.empty()) return Done{};
    options.cache = out + ".cache-" + std::to_string(getpid());
    std::error_code code;
    std::filesystem::create_directories(options.cache, code);
    if (code) return Error{"folder cannot be made", options.cache, code.message()};
    return Done{};
}

int build_one(const BuildOptions& options) {
    const Stopwatch watch;
    auto recipe = options.recipe.empty() ? embedded_recipe(options.overrides)
                                         : load_recipe(options.recipe, options.overrides);
    if (!recipe) return fail("build", recipe.error());
    if (options.until.empty()) {
        const auto s =
            expect_writable(options.out.empty() ? recipe->name + ".sonocase" : options.out);
        if (!s) return fail("build", s.error());
    }
    const bool say = !options.common.quiet || options.target.tolerance_mm > 0 ||
                     options.target.time_budget_s > 0 || !options.common.report_path.empty();
    const double speed = say ? machine_speed(options.common.threads) : 1;
    const auto choice = choose(options, *recipe, speed);
    if (!choice) return fail("build", choice.error());
    const MemoryNeed need = memory_need(*recipe, options.memory_mb);
    if (const Status s = check_memory(need, options.memory_mb); !s) return fail("build", s.error());
    const Expected expected{
        need.mb,
        build_time(*recipe, need.size, recipe->settings.of<ResampleOptions>().voxel_mm, speed,
                   options.common.threads),
        say};
    if (!options.common.quiet && need.size.cooked_voxels > 0)  // 0: inputs that cannot be read
        std::printf(
            "to cook: %.1f million voxels, about %.0f MB (%s), %.2g s of processors, %.2g s on "
            "this machine with nothing else to do\n",
            need.size.cooked_voxels + need.size.region_voxels, need.mb, need.stage.c_str(),
            expected.time.processor_s, expected.time.alone_s);
    const auto cooked = cook(options, *recipe);
    if (!cooked) return fail("build", cooked.error());
    if (!cooked->digest.empty()) {  // stopped before the bundle
        auto status = write_stage_report(options, *cooked, expected, *choice, watch.seconds());
        if (!status) return fail("build", status.error());
        std::printf("%s of %s, %.1f s\n", options.until.c_str(), recipe->name.c_str(),
                    watch.seconds());
        return kDone;
    }
    const std::string out = options.out.empty() ? recipe->name + ".sonocase" : options.out;
    ThreadJobs jobs;
    const std::vector<std::uint8_t> bytes = write_bundle(cooked->bundle, jobs);
    const double seconds = watch.seconds();
    Achieved achieved;
    if (*choice) achieved = achieved_by(options.target, *cooked, *recipe, seconds);
    const std::string report = build_report(*cooked, out, digest_of(bytes), bytes.size(), seconds,
                                            expected, *choice, achieved);
    if (auto status = write_case(options, out, *cooked, bytes, report); !status)
        return fail("build", status.error());
    for (const StageRun& run : cooked->stages) {
        print_notes("build", run.report);
        print_warnings("build", with_cache_notes(run));
    }
    if (!achieved.missed.empty())
        std::fprintf(stderr, "sonocase build: warning: %s\n", achieved.missed.c_str());
    const Grid& grid = cooked->bundle.grid;
    std::printf("%s  %.1f MB, %d x %d x %d voxels of %g mm, %zu labels, %.1f s\n", out.c_str(),
                static_cast<double>(bytes.size()) / 1e6, grid.size.x, grid.size.y, grid.size.z,
                grid.spacing_mm.x, cooked->bundle.labels.size() - 1, watch.seconds());
    return kDone;
}

// Returns "OUT-STEM.sonocase": each of several mannequins has its own bundle.
std::string with_stem(const std::string& path, const std::string& stem) {
    const std::filesystem::path whole(path);
    return (whole.parent_path() / (whole.stem().string() + "-" + stem)).string() +
           whole.extension().string();
}

// Builds one bundle for each mannequin. What does not depend on the mannequin (import, skin,
// textures) is made once: results pass from one to the next through the cache, or through a folder
// of this run.
int build_several(const BuildOptions& options) {
    namespace fs = std::filesystem;
    std::vector<std::string> stems;
    for (const std::string& surface : options.surfaces) {
        const std::string stem = fs::path(surface).stem().string();
        if (std::find(stems.begin(), stems.end(), stem) != stems.end())
            return fail("build", Error{"two mannequins are called '" + stem + "'", "--surface",
                                       "their names become those of the bundles"});
        stems.push_back(stem);
    }
    if (!options.until.empty() || !options.plan_key.empty())
        return fail("build", Error{"several mannequins cannot stop half way", "--until",
                                   "build one mannequin at a time"});
    auto recipe = options.recipe.empty() ? embedded_recipe(options.overrides)
                                         : load_recipe(options.recipe, options.overrides);
    if (!recipe) return fail("build", recipe.error());
    const std::string out = options.out.empty() ? recipe->name + ".sonocase" : options.out;
    if (const Status s = expect_writable(out); !s) return fail("build", s.error());
    BuildOptions one = options;
    if (const Status s = open_own_cache(one, out); !s) return fail("build", s.error());
    int worst = kDone;
    for (std::size_t n = 0; n < stems.size(); ++n) {
        one.overrides.surface = options.surfaces[n];
        one.out = with_stem(out, stems[n]);
        if (!options.preview.empty()) one.preview = with_stem(options.preview, stems[n]);
        if (!options.common.report_path.empty())
            one.common.report_path = with_stem(options.common.report_path, stems[n]);
        worst = std::max(worst, build_one(one));
    }
    std::error_code code;
    if (options.cache.empty()) fs::remove_all(one.cache, code);
    return worst;
}

int build(BuildOptions& options) {
    const ThreadLimit limit(options.common.threads);
    const MemoryLimit memory(options.memory_mb);
    if (options.surfaces.size() > 1) return build_several(options);
    if (options.surfaces.size() == 1) options.overrides.surface = options.surfaces[0];
    if (options.target.tolerance_mm <= 0 && options.target.time_budget_s <= 0)
        return build_one(options);
    BuildOptions one = options;
    const std::string beside = options.out.empty() ? "sonocase" : options.out;
    if (const Status s = open_own_cache(one, beside); !s) return fail("build", s.error());
    const int status = build_one(one);
    std::error_code code;
    if (options.cache.empty()) std::filesystem::remove_all(one.cache, code);
    return status;
}

}  // namespace

int verb_build(int argc, char** argv) {
    CLI::App app("Cook a recipe into a case bundle");
    BuildOptions options;
    app.add_option(
        "RECIPE", options.recipe,
        "case.toml or its folder; without one the embedded demonstration torso is cooked");
    app.add_option("-o,--output", options.out, "Bundle to write; NAME.sonocase by default")
        ->type_name("OUT");
    app.add_option("--data", options.overrides.data,
                   "Folder that the recipe's input paths start from")
        ->type_name("DIR");
    app.add_option("--surface", options.surfaces,
                   "Mannequin in place of the recipe's; of several, one bundle OUT-NAME.sonocase "
                   "for each, and what they have in common is cooked once")
        ->type_name("FILE")
        ->expected(1, 100);
    app.add_option("--set", options.overrides.sets, "Set an option of a stage; may be repeated")
        ->type_name("SECTION.KEY=VALUE")
        ->allow_extra_args(false);
    app.add_option("--preset", options.overrides.preset,
                   "One of " + preset_names(built_in_stages()) + "; the recipe's own by default")
        ->type_name("NAME");
    app.add_option("--cache", options.cache, "Folder of finished stage results; may be shared")
        ->type_name("DIR");
    app.add_option("--cache-limit-mb", options.cache_limit_mb,
                   "Limit of the cache folder's size; 0 means none")
        ->check(CLI::Range(0.0, 1e9))
        ->type_name("MB");
    app.add_option(
           "--memory-mb", options.memory_mb,
           "Work within this where that only takes longer, and refuse a case that needs more;"
           " 0 means what this machine has")
        ->check(CLI::Range(0.0, 1e9))
        ->type_name("MB");
    app.add_option("--preview", options.preview, "Write the case's picture as well")
        ->type_name("FILE.png");
    app.add_option(
           "--until", options.until,
           "Stop at a stage, whose result stays in --cache: " + stage_names(built_in_stages()))
        ->type_name("STAGE");
    app.add_option("--plan-key", options.plan_key,
                   "Fail if recipe and inputs are not those of this key from plan.json")
        ->type_name("KEY");
    app.add_option("--tolerance-mm", options.target.tolerance_mm,
                   "Take the cheapest settings with which this case's own error is within X")
        ->check(CLI::Range(1e-3, 1e9))
        ->type_name("X");
    app.add_option("--time-budget-s", options.target.time_budget_s,
                   "Take the best settings that this machine manages in T seconds")
        ->check(CLI::Range(1e-3, 1e9))
        ->type_name("T");
    app.add_flag("--list-options", options.list_options,
                 "Print every option key with default and range");
    add_common_options(app, options.common);
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    if (options.list_options) {
        std::fputs(list_options(built_in_stages()).c_str(), stdout);
        return kDone;
    }
    return build(options);
}

}  // namespace sonocase::pipeline::inline verbs
