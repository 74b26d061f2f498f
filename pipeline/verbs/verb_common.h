// SPDX-License-Identifier: Apache-2.0

// What the verbs of sonocase share: common options, one-line errors, progress, reports.
//
// Standard output holds what was asked for, standard error everything else. Exit status: 0 done,
// 1 failed with one line on standard error, 2 wrong usage.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "pipeline/base/progress.h"
#include "pipeline/base/stopwatch.h"

namespace CLI {
class App;
}

namespace sonocase::pipeline::inline verbs {

enum ExitStatus : int { kDone = 0, kFailed = 1, kWrongUsage = 2 };

struct CommonOptions {
    std::string report_path;  // --report FILE.json; empty: none
    int threads = 0;          // --threads N; 0: all cores
    bool quiet = false;       // --quiet: no progress, even on a terminal
};

// Adds --report, --threads and --quiet.
void add_common_options(CLI::App& app, CommonOptions& options);

// Parses. Returns an exit status when the verb is over: help was asked for, or the usage is wrong.
// A switch may be followed by `true` or `false`, as its option in a recipe. A folder that does not
// exist yet and that a file is to be written into is named on standard error, at once: it will be
// created, and may be a typing error.
std::optional<int> parse_command_line(CLI::App& app, int argc, char** argv);

// Prints "sonocase VERB: message" to standard error and returns kFailed.
int fail(const char* verb, const Error& error);
// Prints what is wrong with the usage and where help is, and returns kWrongUsage.
int wrong_usage(const char* verb, const std::string& what);
// Prints "sonocase VERB: axes: ..." where the report says what the axes or the unit were taken for.
void print_notes(const char* verb, const StageReport& report);
// Prints "sonocase VERB: warning: ..." for each warning.
void print_warnings(const char* verb, const StageReport& report);

// A bar on standard error if that is a terminal; silent in a pipe. Redraws at most ten times per
// second, and clears its line when it goes out of scope.
class ProgressBar {
  public:
    // tells_time  says how long it will go on, as the share that is done takes as long as it did;
    //             for work whose shares were measured
    explicit ProgressBar(const CommonOptions& options, bool tells_time = false);
    ~ProgressBar();
    ProgressBar(const ProgressBar&) = delete;
    ProgressBar& operator=(const ProgressBar&) = delete;
    Progress progress();  // valid while the bar lives

  private:
    struct State;
    std::unique_ptr<State> state_;
};

// One stage as JSON: {"stage", "version", "seconds", MEASURE..., "warnings": [...]}, the measures
// under their own names beside the others.
std::string report_json(const StageReport& report);
// Writes the report to the file of --report; does nothing without one.
Status write_report(const CommonOptions& options, const StageReport& report);

}  // namespace sonocase::pipeline::inline verbs
