// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/own_exercises.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <sstream>

#include "formats/base/constants.h"
#include "formats/exercise/metric_table.h"
#include "formats/files/atomic_file.h"
#include "formats/scoring/anatomy.h"
#include "formats/text/number_text.h"
#include "runtime/player/app/attempt_steps.h"
#include "runtime/player/app/case_steps.h"

namespace sonocase::runtime::inline player_app {

namespace {

// A basic string of TOML: quotes, backslashes and control characters are escaped.
std::string quoted(const std::string& text) {
    std::string out = "\"";
    for (const char c : text) {
        if (c == '"' || c == '\\') {
            out += '\\';
            out += c;
        } else if (static_cast<unsigned char>(c) < 32 || c == 127) {
            out += ' ';
        } else {
            out += c;
        }
    }
    return out + "\"";
}

std::string line(const char* format, double a, double b = 0, double c = 0) {
    char words[160];
    std::snprintf(words, sizeof words, format, a, b, c);
    return words;
}

}  // namespace

std::string exercise_name(const std::string& title) {
    std::string name;
    for (const char c : title) {
        const bool letter = (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9');
        const bool capital = c >= 'A' && c <= 'Z';
        if (letter || capital) {
            name += capital ? static_cast<char>(c - 'A' + 'a') : c;
        } else if (!name.empty() && name.back() != '-') {
            name += '-';
        }
    }
    while (!name.empty() && name.back() == '-') name.pop_back();
    return name.empty() ? "own-target" : name.substr(0, 48);
}

std::string exercise_toml(const Exercise& base,
                          const std::string& title,
                          Point3 centre,
                          double radius_mm,
                          const Rigid& mannequin_from_probe) {
    const Probe& probe = base.probe;
    const Point3 start = mannequin_from_probe * Point3{0, 0, 0};
    const Vector3 beam = mannequin_from_probe.rotation.column(2),
                  lateral = mannequin_from_probe.rotation.column(0);
    std::string out = "name = " + quoted(exercise_name(title)) + "\ntitle = " + quoted(title) +
                      "\nkind = " + quoted(base.kind) + "\nmodel = " + quoted(base.model) + "\n";
    out += line("start_probe = [%.2f, %.2f, %.2f]\n", start.x, start.y, start.z);
    out += line("start_beam = [%.5f, %.5f, %.5f]\n", beam.x, beam.y, beam.z);
    out += line("start_lateral = [%.5f, %.5f, %.5f]\n", lateral.x, lateral.y, lateral.z);
    out += "start_spread_mm = 30\n";
    if (!base.no_go.empty()) {
        out += "no_go = [";
        for (std::size_t i = 0; i < base.no_go.size(); ++i)
            out += (i ? ", " : "") + quoted(base.no_go[i]);
        out += "]\n";
    }
    out += std::string("\n[probe]\nshape = \"") + probe_shape_name(probe.shape) + "\"\n";
    if (probe.shape == ProbeShape::curvilinear) out += line("radius_mm = %.4g\n", probe.radius_mm);
    if (probe.shape != ProbeShape::linear)
        out += line("field_of_view_deg = %.6g\n", probe.field_of_view_rad * kDegPerRad);
    if (probe.shape != ProbeShape::curvilinear) out += line("width_mm = %.4g\n", probe.width_mm);
    out += line("depth_mm = %.5g\nfrequency_mhz = %.4g\nfocus_mm = %.5g\n", probe.depth_mm,
                probe.frequency_mhz, probe.focus_mm);
    const NeedleModel& needle = base.needle;
    out += std::string("\n[needle]\nmake = \"") + needle.make->name + "\"\n";
    out += needle.diameter_mm > 0 ? line("diameter_mm = %.4g\n", needle.diameter_mm)
                                  : line("gauge = %.4g\n", needle.gauge);
    out += line("length_mm = %.5g\n", needle.length_mm);
    out += "\n[[targets]]\nname = " + quoted(title) + "\n";
    out += line("centre = [%.2f, %.2f, %.2f]\n", centre.x, centre.y, centre.z);
    out += line("radius_mm = %.3g\nhit_radius_mm = %.3g\nlook = \"lesion\"\n", radius_mm,
                std::max(radius_mm, 4.0));
    const auto mark = [&](const char* metric, const char* limit, double value) {
        out += std::string("\n[[pass_marks]]\nmetric = \"") + metric + "\"\n" + limit +
               line(" = %.3g\n", value);
    };
    mark("final_tip_to_target_mm", "at_most", std::max(radius_mm, 4.0));
    mark("insertions", "at_most", 2);
    if (!base.no_go.empty()) mark("no_go_contacts", "at_most", 0);
    mark("tip_in_view_at_advance_fraction", "at_least", 0.5);
    return out;
}

void begin_new_target(Notices& notices,
                      const Training& training,
                      Educator& educator,
                      Screen& screen) {
    if (training.attempt) {
        notices.warning("Finish the attempt first, then place a new target.");
        return;
    }
    educator.new_target = {};
    educator.new_target.placing = true;
    screen.dialog = Dialog::none;
    screen.page = Page::scan;
}

void set_new_target(
    Notices& notices, const CaseState& loaded, NewTarget& target, double x_mm, double z_mm) {
    const Point3 centre = loaded.frame().record.tools.mannequin_from_probe * Point3{x_mm, 0, z_mm};
    const CaseAnatomy anatomy(loaded.open->bundle);
    if (anatomy.label(centre) == 0) {
        notices.warning("That place is outside the body; click inside the picture.");
        return;
    }
    target.centre = centre;
    target.placing = false;
    target.placed = true;
}

std::optional<int> save_new_target(Notices& notices, CaseState& loaded, NewTarget& target) {
    if (!target.placed || !loaded.open) return std::nullopt;
    const std::string folder = loaded.open->path + ".exercises";
    std::error_code failed;  // a file that cannot be written says so below
    std::filesystem::create_directories(folder, failed);
    const std::string file = folder + "/" + exercise_name(target.title) + ".toml";
    if (std::filesystem::exists(file, failed)) {
        notices.warning("There is an exercise of that name; choose another.");
        return std::nullopt;
    }
    const std::string toml =
        exercise_toml(loaded.exercise(), target.title, target.centre, target.radius_mm,
                      loaded.frame().record.tools.mannequin_from_probe);
    if (const Status saved = write_file(file, toml); !saved) {
        notices.error(saved.error().message());
        return std::nullopt;
    }
    const Result<int> index = choose_or_load_exercise(*loaded.open, file);
    if (!index) {
        notices.error(index.error().message());
        return std::nullopt;
    }
    target = {};
    notices.news({"Saved as {}.", {file}});
    return *index;
}

namespace {

// The exercise's text, from a file of its own or from the case. Empty: neither has it.
std::string written_exercise(const CaseState& loaded) {
    const auto index = static_cast<std::size_t>(loaded.exercise_index);
    const OpenCase& open = *loaded.open;
    if (index < open.exercise_files.size() && !open.exercise_files[index].empty()) {
        const auto text = read_text_file(open.exercise_files[index]);
        return text ? *text : "";
    }
    for (const EmbeddedExercise& embedded : open.bundle->exercises) {
        if (embedded.name == open.exercises[index].name) return embedded.toml;
    }
    return "";
}

}  // namespace

void begin_marks(const CaseState& loaded, Educator& educator, Screen& screen) {
    if (!loaded.open) return;
    educator.marks = loaded.open->exercises[loaded.exercise_index].pass_marks;
    screen.dialog = Dialog::marks;
}

void step_mark(Exercise::PassMark& mark, int steps) {
    const std::string unit = metric_unit(mark.metric);
    const std::string range = metric_range(mark.metric);
    const bool share = range.find("0 to 1") != std::string::npos;
    const double step = share ? 0.05 : unit == "s" ? 10 : 1;
    for (double* limit : {&mark.at_most, &mark.at_least}) {
        if (!std::isfinite(*limit)) continue;
        *limit = std::clamp((std::round(*limit / step) + steps) * step, 0.0, share ? 1.0 : 1e6);
    }
}

std::string toml_with_marks(const std::string& toml, const std::vector<Exercise::PassMark>& marks) {
    std::string out;
    bool inside = false;
    std::istringstream lines(toml);
    for (std::string line; std::getline(lines, line);) {
        const std::size_t first = line.find_first_not_of(" \t\r");
        if (first != std::string::npos && line[first] == '[')
            inside = line.compare(first, 14, "[[pass_marks]]") == 0;
        if (!inside) out += line + "\n";
    }
    for (const Exercise::PassMark& mark : marks) {
        out += "\n[[pass_marks]]\nmetric = \"" + mark.metric + "\"\n";
        if (std::isfinite(mark.at_most)) out += "at_most = " + number_text(mark.at_most) + "\n";
        if (std::isfinite(mark.at_least)) out += "at_least = " + number_text(mark.at_least) + "\n";
    }
    return out;
}

std::optional<int> save_marks(Notices& notices,
                              CaseState& loaded,
                              const Training& training,
                              const std::vector<Exercise::PassMark>& marks) {
    if (!loaded.open) return std::nullopt;
    if (training.attempt) {
        notices.warning("Finish the attempt first, then change the marks.");
        return std::nullopt;
    }
    const std::string toml = written_exercise(loaded);
    if (toml.empty()) {
        notices.warning("This exercise is written nowhere: make one with New target.");
        return std::nullopt;
    }
    const std::string folder = loaded.open->path + ".exercises";
    std::error_code failed;  // a file that cannot be written says so below
    std::filesystem::create_directories(folder, failed);
    const auto index = static_cast<std::size_t>(loaded.exercise_index);
    const bool own =
        index < loaded.open->exercise_files.size() && !loaded.open->exercise_files[index].empty();
    const std::string file =
        own ? loaded.open->exercise_files[index]
            : folder + "/" + exercise_name(loaded.open->exercises[index].name) + ".toml";
    if (const Status saved = write_file(file, toml_with_marks(toml, marks)); !saved) {
        notices.error(saved.error().message());
        return std::nullopt;
    }
    const Result<int> chosen = choose_or_load_exercise(*loaded.open, file);
    if (!chosen) {
        notices.error(chosen.error().message());
        return std::nullopt;
    }
    notices.news({"Saved as {}.", {file}});
    return *chosen;
}

}  // namespace sonocase::runtime::inline player_app
