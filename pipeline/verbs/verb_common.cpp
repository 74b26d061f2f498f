// SPDX-License-Identifier: Apache-2.0

#include "pipeline/verbs/verb_common.h"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <span>
#include <vector>

#include <unistd.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "formats/files/atomic_file.h"
#include "formats/text/nearest_name.h"

namespace sonocase::pipeline::inline verbs {

namespace {

using Json = nlohmann::ordered_json;

// A --report file: each measure is a key beside the others.
Json flat_json(const StageReport& report) {
    Json json;
    json["stage"] = report.stage;
    json["version"] = report.version;
    json["seconds"] = report.seconds;
    for (const Measure& measure : report.measures) json[measure.name] = measure.value;
    for (const Note& note : report.notes) json[note.name] = note.text;
    for (const MeasureGroup& group : report.groups) {
        json[group.name] = Json::object();
        for (const Measure& value : group.values) json[group.name][value.name] = value.value;
    }
    json["warnings"] = report.warnings;
    return json;
}

// A message from a library may hold several lines; people and scripts get one.
std::string one_line(std::string text) {
    for (char& c : text)
        if (c == '\n' || c == '\r') c = ' ';
    while (!text.empty() && text.back() == ' ') text.pop_back();
    return text;
}

// "--switch false" as "--switch=false", which is how CLI11 reads it.
std::vector<std::string> with_switches_joined(const CLI::App& app, int argc, char** argv) {
    std::vector<std::string> words(argv, argv + argc);
    for (std::size_t i = 1; i + 1 < words.size(); ++i) {
        if (!words[i].starts_with("--") || (words[i + 1] != "true" && words[i + 1] != "false"))
            continue;
        const CLI::Option* option = app.get_option_no_throw(words[i]);
        if (option == nullptr || option->get_items_expected_max() != 0) continue;
        words[i] += "=" + words[i + 1];
        words.erase(words.begin() + i + 1);
    }
    return words;
}

// Flags that name a file to write; -o may name a folder instead, which is the verb's own to create.
constexpr const char* kOutputFiles[] = {"--output",   "--report", "--preview",
                                        "--markdown", "--front",  "--csv"};

void note_new_folders(const std::string& verb, const CLI::App& app) {
    for (const char* name : kOutputFiles) {
        const CLI::Option* option = app.get_option_no_throw(name);
        if (option == nullptr || option->count() == 0 || option->get_type_name() == "DIR") continue;
        const auto folder = std::filesystem::path(option->results().back()).parent_path();
        std::error_code code;
        if (!folder.empty() && !std::filesystem::exists(folder, code))
            std::fprintf(stderr,
                         "sonocase %s: note: folder %s does not exist and will be created\n",
                         verb.c_str(), one_line(folder.string()).c_str());
    }
}

}  // namespace

void add_common_options(CLI::App& app, CommonOptions& options) {
    app.add_option("--report", options.report_path, "Write the run's report as JSON")
        ->type_name("FILE.json")
        ->group("Common");
    app.add_option("--threads", options.threads, "Threads to use; 0 means all cores")
        ->type_name("N")
        ->check(CLI::Range(0, 1024))
        ->capture_default_str()
        ->group("Common");
    app.add_flag("--quiet", options.quiet, "Show no progress")->group("Common");
}

std::optional<int> parse_command_line(CLI::App& app, int argc, char** argv) {
    const std::string verb = argc > 0 ? argv[0] : "";
    app.name("sonocase " + verb);
    app.get_help_ptr()->group("Common");
    app.get_formatter()->column_width(34);
    std::vector<std::string> words = with_switches_joined(app, argc, argv);
    std::vector<const char*> pointers;
    for (const std::string& word : words) pointers.push_back(word.c_str());
    try {
        app.parse(static_cast<int>(pointers.size()), pointers.data());
    } catch (const CLI::CallForHelp& call) {
        return app.exit(call);
    } catch (const CLI::CallForAllHelp& call) {
        return app.exit(call);
    } catch (const CLI::ParseError& error) {
        std::vector<std::string> known;
        for (const CLI::Option* option : app.get_options())
            for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
        const std::string unknown = unknown_option(std::span(words).subspan(1), known);
        return wrong_usage(verb.c_str(), unknown.empty() ? error.what() : unknown);
    }
    note_new_folders(verb, app);
    return std::nullopt;
}

int fail(const char* verb, const Error& error) {
    std::fprintf(stderr, "sonocase %s: %s\n", verb, one_line(error.message().text()).c_str());
    return kFailed;
}

int wrong_usage(const char* verb, const std::string& what) {
    std::fprintf(stderr, "sonocase %s: %s; see: sonocase %s --help\n", verb, one_line(what).c_str(),
                 verb);
    return kWrongUsage;
}

void print_notes(const char* verb, const StageReport& report) {
    for (const Note& note : report.notes)
        if (note.name == "axes" || note.name == "unit" || note.name == "surface_axes" ||
            note.name == "surface_unit" || note.name == "table" || note.name == "renamed")
            std::fprintf(stderr, "sonocase %s: %s: %s\n", verb, note.name.c_str(),
                         one_line(note.text).c_str());
}

void print_warnings(const char* verb, const StageReport& report) {
    for (const std::string& warning : report.warnings)
        std::fprintf(stderr, "sonocase %s: warning: %s\n", verb, one_line(warning).c_str());
}

struct ProgressBar::State {
    using Clock = std::chrono::steady_clock;
    bool shown = false;
    bool tells_time = false;
    const Clock::time_point began = Clock::now();
    bool drawn = false;
    Clock::time_point last{};

    void draw(double fraction, std::string_view doing) {
        const auto now = Clock::now();
        if (drawn && now - last < std::chrono::milliseconds(100)) return;
        last = now;
        drawn = true;
        constexpr int kWidth = 28;
        const double clamped = fraction < 0 ? 0 : fraction > 1 ? 1 : fraction;
        const int full = static_cast<int>(clamped * kWidth);
        std::string bar(full, '#');
        bar.resize(kWidth, ' ');
        std::string left;
        const double seconds = std::chrono::duration<double>(now - began).count();
        if (tells_time && seconds > 2 && clamped > 0.02)
            left =
                ", about " + std::to_string(std::lround(seconds * (1 / clamped - 1))) + " s left";
        std::fprintf(
            stderr, "\r[%s] %3d%% %.*s%s\x1b[K", bar.c_str(), static_cast<int>(clamped * 100),
            static_cast<int>(std::min<std::size_t>(doing.size(), 44)), doing.data(), left.c_str());
        std::fflush(stderr);
    }
};

ProgressBar::ProgressBar(const CommonOptions& options, bool tells_time)
    : state_(std::make_unique<State>()) {
    state_->tells_time = tells_time;
    state_->shown = !options.quiet && isatty(STDERR_FILENO) != 0;
}

ProgressBar::~ProgressBar() {
    if (state_->drawn) std::fputs("\r\x1b[K", stderr);
}

Progress ProgressBar::progress() {
    if (!state_->shown) return {};
    return [state = state_.get()](double fraction, std::string_view doing) {
        state->draw(fraction, doing);
    };
}

std::string report_json(const StageReport& report) {
    return flat_json(report).dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

Status write_report(const CommonOptions& options, const StageReport& report) {
    if (options.report_path.empty()) return Done{};
    return write_file(options.report_path, report_json(report));
}

}  // namespace sonocase::pipeline::inline verbs
