// SPDX-License-Identifier: Apache-2.0

// sonocase look: measures how a real machine draws.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>

#include "formats/files/atomic_file.h"
#include "formats/machine/machine.h"
#include "formats/text/number_text.h"
#include "pipeline/base/parallel.h"
#include "pipeline/look/look_page.h"
#include "pipeline/verbs/verb_common.h"
#include "pipeline/verbs/verbs.h"

namespace sonocase::pipeline::inline verbs {
namespace {

struct LookArguments {
    LookInput input;
    LookOptions options;
    std::vector<std::string> rectangles;
    std::string out, page;
    bool json = false;
    CommonOptions common;
};

// x,y,width,height or x,y,width,height=TISSUE.
Result<LookRectangle> parse_rectangle(const std::string& text) {
    const Error wrong{"'" + text + "' is not a rectangle", "--rectangle",
                      "expected x,y,width,height in pixels, or x,y,width,height=TISSUE"};
    LookRectangle r;
    const std::size_t equals = text.find('=');
    if (equals != text.npos) r.tissue = text.substr(equals + 1);
    if (equals != text.npos && r.tissue.empty()) return wrong;
    std::string_view rest = std::string_view(text).substr(0, equals);
    int* const parts[] = {&r.x, &r.y, &r.width, &r.height};
    for (std::size_t i = 0; i < 4; ++i) {
        const std::size_t comma = rest.find(',');
        if ((comma == rest.npos) != (i == 3)) return wrong;
        std::int64_t value = 0;
        if (!parse_number(rest.substr(0, comma), value) || value < 0 || value > 100000)
            return wrong;
        *parts[i] = static_cast<int>(value);
        if (comma != rest.npos) rest.remove_prefix(comma + 1);
    }
    if (r.width < 1 || r.height < 1) return wrong;
    return r;
}

std::string page_path(const std::string& given) {
    const std::string ending = std::filesystem::path(given).extension().string();
    return ending == ".html" || ending == ".htm" ? given : given + "/look.html";
}

int look(LookArguments& a) {
    for (const std::string& text : a.rectangles) {
        const auto rectangle = parse_rectangle(text);
        if (!rectangle) return wrong_usage("look", rectangle.error().message());
        a.input.rectangles.push_back(*rectangle);
    }
    const ThreadLimit limit(a.common.threads);
    if (a.options.name.empty()) a.options.name = std::filesystem::path(a.out).stem().string();
    const auto result = [&] {
        ProgressBar bar(a.common);
        return measure_look_of(a.input, a.options, bar.progress());
    }();
    if (!result) return fail("look", result.error());
    print_warnings("look", result->report);
    const std::string toml = machine_toml(result->fit.machine);
    if (auto s = write_file(a.out, toml); !s) return fail("look", s.error());
    if (!a.page.empty()) {
        if (auto s = write_file(page_path(a.page), look_page(*result)); !s)
            return fail("look", s.error());
    }
    if (a.json) {
        std::fputs(look_json(*result).c_str(), stdout);
    } else {
        for (const LookScore& score : result->scores) {
            if (!std::isfinite(score.real)) continue;
            std::printf("%-40s %8.3g", std::string(score.limits.title).c_str(), score.real);
            if (score.limited)
                std::printf("   %g to %g%s", score.limits.low, score.limits.high,
                            score.limits.holds(score.real) ? "" : "   outside");
            std::printf("\n");
        }
    }
    if (auto s = write_report(a.common, result->report); !s) return fail("look", s.error());
    return kDone;
}

}  // namespace

int verb_look(int argc, char** argv) {
    CLI::App app(
        "Measure how a real machine draws, from frames of a clip, and write a machine that draws\n"
        "like it: grey map, point spread, looks, near field, gain. See docs/look.md");
    LookArguments a;
    a.options.name.clear();
    app.add_option("FRAMES", a.input.frames, "PNG files, or folders of them")->required();
    app.add_option("-o,--output", a.out, "Where to write the machine")
        ->type_name("NAME.toml")
        ->required();
    app.add_option("--geometry", a.input.geometry_path,
                   "Where the scan lies in the picture; else it is found in the pixels")
        ->type_name("FILE.json");
    app.add_option("--depth-mm", a.options.depth_mm,
                   "Depth of the scan, where the geometry is found in the pixels")
        ->check(CLI::Range(5, 500))
        ->type_name("MM");
    app.add_option("--rectangle", a.rectangles,
                   "A place of known tissue, in pixels; without TISSUE, or with liver, it is where "
                   "texture is measured. May be given again")
        ->type_name("x,y,w,h[=TISSUE]")
        ->take_all();
    app.add_option("--name", a.options.name, "Name of the machine; default: that of the file");
    app.add_option("--title", a.options.title, "Title that people see");
    app.add_option("--base", a.options.base,
                   "Machine that gives what stills do not show; default: modern, or modern-linear")
        ->check(CLI::IsMember(machine_names()));
    app.add_option("--frames", a.options.frames, "Measure at most so many, evenly spread")
        ->check(CLI::Range(1, 10000))
        ->capture_default_str()
        ->type_name("N");
    app.add_option("--seed", a.options.seed, "Of the stand-ins")->capture_default_str();
    app.add_option("--page", a.page, "Also write a page: real and fitted side by side, all scores")
        ->type_name("DIR|FILE.html");
    app.add_flag("--json", a.json, "Print scores and geometry as JSON");
    add_common_options(app, a.common);
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    return look(a);
}

}  // namespace sonocase::pipeline::inline verbs
