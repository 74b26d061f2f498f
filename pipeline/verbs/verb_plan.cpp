// SPDX-License-Identifier: Apache-2.0

// sonocase plan and cache: what a build farm asks before and after its jobs.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "formats/files/atomic_file.h"
#include "pipeline/cook/plan_cases.h"
#include "pipeline/stages/stage_cache.h"
#include "pipeline/verbs/verb_common.h"
#include "pipeline/verbs/verbs.h"

namespace sonocase::pipeline::inline verbs {

int verb_plan(int argc, char** argv) {
    CLI::App app(
        "Find out which stages of which cases a build farm has to run, by content alone; see "
        "docs/farm.md");
    std::vector<std::string> recipes;
    std::string folder;
    RecipeOverrides overrides;
    bool dry = false;
    app.add_option("RECIPE", recipes, "case.toml or its folder")->required();
    app.add_option("-o,--output", folder, "The farm's folder; plan.json is written there")
        ->type_name("DIR")
        ->required();
    app.add_option("--data", overrides.data, "Folder that the recipes' input paths start from")
        ->type_name("DIR");
    app.add_option("--set", overrides.sets, "Set an option of a stage; may be repeated")
        ->type_name("SECTION.KEY=VALUE")
        ->allow_extra_args(false);
    app.add_option("--preset", overrides.preset, "draft, balanced or accurate")->type_name("NAME");
    app.add_flag("--dry-run", dry,
                 "Write nothing: say what is stale and why, and what it will take");
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    if (!overrides.data.empty()) overrides.data = std::filesystem::absolute(overrides.data);
    if (!dry) remove_leftovers(folder);
    auto plans = plan_cases(recipes, overrides, folder, {.dry = dry});
    if (!plans) return fail("plan", plans.error());
    if (dry) {
        std::printf("%s", plan_text(*plans).c_str());
    } else {
        const std::string path = (std::filesystem::path(folder) / "plan.json").string();
        if (auto status = write_file(path, plan_json(*plans, overrides)); !status)
            return fail("plan", status.error());
    }
    double processor_s = 0;
    int memory_mb = 0;
    std::size_t bad = 0, waiting = 0;
    for (const CasePlan& plan : *plans) {
        if (plan.error.empty())
            waiting += plan.done ? 0 : 1;
        else
            ++bad;
        processor_s += plan.processor_s();
        memory_mb = std::max(memory_mb, plan.memory_mb());
        if (!plan.error.empty() && !dry)
            std::fprintf(stderr, "sonocase plan: warning: case %s is left out: %s\n",
                         plan.name.c_str(), plan.error.c_str());
    }
    std::printf("%zu cases: %zu done, %zu to build, %zu left out", plans->size(),
                plans->size() - waiting - bad, waiting, bad);
    if (waiting > 0)
        std::printf("; about %.0f s of processors, %d MB in the largest job", processor_s,
                    memory_mb);
    std::printf("\n");
    return kDone;
}

int verb_cache(int argc, char** argv) {
    CLI::App app("Tidy a folder of finished stage results; other programs may be using it");
    std::string folder;
    double limit_mb = 0;
    double longest_days = 0;
    bool verify = false;
    app.add_option("DIR", folder, "The folder given to build as --cache")
        ->required()
        ->check(CLI::ExistingDirectory);
    app.add_option("--limit-mb", limit_mb,
                   "Remove what has not been used for longest; 0 means no limit")
        ->check(CLI::Range(0.0, 1e9))
        ->type_name("MB");
    app.add_option("--older-than", longest_days,
                   "Remove what has not been used for so many days; 0 means any time")
        ->check(CLI::Range(0.0, 1e9))
        ->type_name("DAYS");
    app.add_flag("--verify", verify, "Read every entry and remove the damaged ones");
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    const StageCache cache(folder, static_cast<std::uint64_t>(limit_mb * 1e6));
    const CacheSummary summary = cache.tidy(verify, longest_days);
    std::printf("%zu entries, %.1f MB; removed: %zu over the limit, %zu left by killed writers",
                summary.entries, static_cast<double>(summary.bytes) / 1e6, summary.evicted,
                summary.leftovers);
    if (longest_days > 0) std::printf(", %zu not used for %g days", summary.old, longest_days);
    if (verify) std::printf(", %zu damaged", summary.damaged);
    std::printf("\n");
    return kDone;
}

}  // namespace sonocase::pipeline::inline verbs
