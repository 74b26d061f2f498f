// SPDX-License-Identifier: Apache-2.0

// sonocase tradeoff: measures what accuracy costs in time.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <thread>

#include "formats/files/atomic_file.h"
#include "pipeline/base/parallel.h"
#include "pipeline/cook/case_cost.h"
#include "pipeline/stages/read_recipe.h"
#include "pipeline/tradeoff/choose_settings.h"
#include "pipeline/tradeoff/suites.h"
#include "pipeline/tradeoff/sweep.h"
#include "pipeline/tradeoff/tradeoff_page.h"
#include "pipeline/verbs/verb_common.h"
#include "pipeline/verbs/verbs.h"

namespace sonocase::pipeline::inline verbs {
namespace {

struct TradeoffOptions {
    std::vector<std::string> suites;  // empty: all, or none if there is a recipe
    bool quick = false;
    bool fresh = false;
    int repeats = 0;
    std::string out;
    std::string recipe;
    std::string data;
    std::string markdown;
    std::string front;
    std::string picture;
    CommonOptions common;
};

std::string this_machine(int threads) {
    std::string model = "unknown processor";
    std::ifstream info("/proc/cpuinfo");
    for (std::string line; std::getline(info, line);) {
        const std::size_t colon = line.find(": ");
        if (line.rfind("model name", 0) == 0 && colon != std::string::npos) {
            model = line.substr(colon + 2);
            break;
        }
    }
    const unsigned cores = std::thread::hardware_concurrency();
    return model + ", " + std::to_string(threads > 0 ? threads : static_cast<int>(cores)) +
           " threads";
}

// The body whose seconds the measured front holds.
constexpr const char* kTimedBody = "demo-torso";

struct NamedSuite {
    const char* name;
    std::function<Suite()> make;
};

// Several bodies may share a name.
std::vector<NamedSuite> suites() {
    return {
        {"register", register_suite},
        {"elastic", elastic_suite},
        {"warp", warp_suite},
        {"smooth", smooth_suite},
        {"texture", texture_suite},
        {"calibrate", calibrate_suite},
        {"look", look_suite},
        {"render", render_suite},
        {"effects", effects_suite},
        {"linear", linear_suite},
        {"region", region_suite},
        {"pathology", pathology_suite},
        {"fluid", fluid_suite},
        {"cost", cost_suite},
        {"make", make_suite},
        {"publish", publish_suite},
        {"case", [] { return case_suite({}, kTimedBody); }},
        {"case", [] { return case_suite(*analytic_body("slender"), "slender"); }},
    };
}

int tradeoff(const TradeoffOptions& options) {
    const ThreadLimit limit(options.common.threads);
    std::vector<std::function<Suite()>> makers;
    const auto asked = [&](const char* name) {
        return std::find(options.suites.begin(), options.suites.end(), name) !=
               options.suites.end();
    };
    for (const NamedSuite& named : suites()) {
        const bool wanted =
            asked(named.name) || asked("all") || (options.suites.empty() && options.recipe.empty());
        if (wanted) makers.push_back(named.make);
    }
    // These need data or programs that packages lack, and run only where they are named.
    if (asked("colour")) makers.push_back(colour_suite);
    if (asked("spectrum")) makers.push_back(spectrum_suite);
    if (asked("camera")) makers.push_back(camera_suite);
    if (asked("press")) makers.push_back([data = options.data] { return press_suite(data); });
    if (!options.recipe.empty()) {
        RecipeOverrides overrides;
        overrides.data = options.data;
        auto recipe = load_recipe(options.recipe, overrides);
        if (!recipe) return fail("tradeoff", recipe.error());
        makers.push_back([r = *recipe] { return own_case_suite(r); });
    }

    std::error_code ignored;
    std::filesystem::create_directories(options.out, ignored);
    const std::string csv = options.out + "/tradeoff.csv";
    std::vector<Trial> done;
    if (!options.fresh && std::filesystem::exists(csv)) {
        const auto text = read_text_file(csv);
        if (!text) return fail("tradeoff", text.error());
        auto known = parse_trials_csv(*text, csv);
        if (!known) return fail("tradeoff", known.error());
        done = std::move(*known);
    }

    PageInput page;
    page.machine = this_machine(options.common.threads);
    SweepOptions sweep;
    sweep.quick = options.quick;
    sweep.repeats = options.repeats > 0 ? options.repeats : options.quick ? 1 : 3;
    Status written = Done{};
    {
        ProgressBar bar(options.common);
        const Progress progress = bar.progress();
        for (std::size_t i = 0; i < makers.size(); ++i) {
            report_progress(progress, static_cast<double>(i) / static_cast<double>(makers.size()),
                            "preparing");
            Suite suite = makers[i]();
            const Progress part = [&](double fraction, std::string_view doing) {
                report_progress(
                    progress,
                    (static_cast<double>(i) + fraction) / static_cast<double>(makers.size()),
                    doing);
            };
            const auto keep = [&](const Trial& trial) {
                done.push_back(trial);
                if (const Status s = write_file(csv, format_trials_csv(done)); !s && written)
                    written = s;
            };
            for (Trial& t : run_sweep(suite, plan_sweep(suite, sweep), done, sweep, keep, part)) {
                page.trials.push_back(std::move(t));
            }
            suite.measure = nullptr;  // what it prepared is no longer needed
            page.suites.push_back(std::move(suite));
        }
    }
    if (!written) return fail("tradeoff", written.error());
    if (const Status s = write_file(csv, format_trials_csv(done)); !s)
        return fail("tradeoff", s.error());
    if (const Status s =
            write_file(options.out + "/tradeoff.json", format_trials_json(page.trials));
        !s) {
        return fail("tradeoff", s.error());
    }
    if (const Status s = write_tradeoff_page(page, options.out); !s)
        return fail("tradeoff", s.error());
    if (!options.picture.empty())
        if (const Status s = write_overview_picture(page, options.picture); !s)
            return fail("tradeoff", s.error());
    if (!options.markdown.empty()) {
        const auto before = read_text_file(options.markdown);
        const Status s =
            write_file(options.markdown, format_accuracy_markdown(page, before ? *before : ""));
        if (!s) return fail("tradeoff", s.error());
    }
    if (!options.front.empty()) {
        const auto recipe = embedded_recipe();
        if (!recipe) return fail("tradeoff", recipe.error());
        const auto volume = cooked_volume_mm3(*recipe);
        if (!volume) return fail("tradeoff", volume.error());
        const Status s = write_file(
            options.front, format_front(page.trials, kTimedBody, *volume, probe_seconds()));
        if (!s) return fail("tradeoff", s.error());
    }
    std::printf("%s/index.html  %zu settings of %zu suites\n", options.out.c_str(),
                page.trials.size(), page.suites.size());
    return kDone;
}

}  // namespace

int verb_tradeoff(int argc, char** argv) {
    CLI::App app(
        "Sweep the knobs of every stage against known truth: error, seconds, plots, a page");
    TradeoffOptions options;
    std::vector<std::string> names{"all"};
    for (const NamedSuite& named : suites())
        if (names.back() != named.name) names.emplace_back(named.name);
    for (const char* name : {"press", "colour", "spectrum", "camera"}) names.emplace_back(name);
    app.add_option("--suite", options.suites,
                   "Which stage; may be repeated. All but the last four unless --case is given")
        ->allow_extra_args(false)
        ->check(CLI::IsMember(names));
    app.add_flag("--quick", options.quick,
                 "Fewer values, no pairs, one run each: minutes, not an hour");
    app.add_flag("--fresh", options.fresh, "Measure again what DIR already holds");
    app.add_option("--repeats", options.repeats, "Runs per setting; 3, or 1 with --quick")
        ->check(CLI::Range(1, 100))
        ->type_name("N");
    app.add_option("-o,--output", options.out,
                   "Folder for tradeoff.csv, tradeoff.json, plots, index.html")
        ->required()
        ->type_name("DIR");
    app.add_option("--case", options.recipe,
                   "Also sweep a case of your own, against its finest setting")
        ->type_name("RECIPE");
    app.add_option("--data", options.data, "Folder that the recipe's input paths start from")
        ->type_name("DIR");
    app.add_option("--markdown", options.markdown,
                   "Also write the tables as Markdown (docs/accuracy.md), in place of those of the "
                   "same suites")
        ->type_name("FILE");
    app.add_option("--picture", options.picture,
                   "Also draw what is at the head of docs/accuracy.md: error against seconds of "
                   "the paper, the presets and the front")
        ->type_name("FILE.png");
    app.add_option("--front", options.front,
                   "Also write the table that --tolerance-mm chooses from")
        ->type_name("FILE");
    add_common_options(app, options.common);
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    return tradeoff(options);
}

}  // namespace sonocase::pipeline::inline verbs
