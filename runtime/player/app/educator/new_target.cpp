// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/educator/new_target.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "formats/files/atomic_file.h"
#include "formats/scoring/anatomy.h"
#include "runtime/player/app/attempt_steps.h"
#include "runtime/player/app/case_steps.h"

namespace sonocase::runtime {
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

const char* shape_key(ProbeShape shape) {
    switch (shape) {
        case ProbeShape::linear: return "linear";
        case ProbeShape::curvilinear: return "curvilinear";
        case ProbeShape::phased: return "phased";
    }
    return "";
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
    constexpr double kDegrees = 180 / 3.14159265358979323846;
    const Probe& probe = base.probe;
    const Point3 start = mannequin_from_probe * Point3{0, 0, 0};
    const Vector3 beam = mannequin_from_probe.rotation * Vector3{0, 0, 1};
    std::string out = "name = " + quoted(exercise_name(title)) + "\ntitle = " + quoted(title) +
                      "\nkind = " + quoted(base.kind) + "\nmodel = " + quoted(base.model) + "\n";
    out += line("start_probe = [%.2f, %.2f, %.2f]\n", start.x, start.y, start.z);
    out += line("start_beam = [%.5f, %.5f, %.5f]\n", beam.x, beam.y, beam.z);
    out += "start_spread_mm = 30\n";
    if (!base.no_go.empty()) {
        out += "no_go = [";
        for (std::size_t i = 0; i < base.no_go.size(); ++i)
            out += (i ? ", " : "") + quoted(base.no_go[i]);
        out += "]\n";
    }
    out += std::string("\n[probe]\nshape = \"") + shape_key(probe.shape) + "\"\n";
    if (probe.shape == ProbeShape::curvilinear) out += line("radius_mm = %.4g\n", probe.radius_mm);
    if (probe.shape != ProbeShape::linear)
        out += line("field_of_view_deg = %.6g\n", probe.field_of_view_rad * kDegrees);
    if (probe.shape != ProbeShape::curvilinear) out += line("width_mm = %.4g\n", probe.width_mm);
    out += line("depth_mm = %.5g\nfrequency_mhz = %.4g\nfocus_mm = %.5g\n", probe.depth_mm,
                probe.frequency_mhz, probe.focus_mm);
    out += line("\n[needle]\ngauge = %.4g\nlength_mm = %.5g\n", base.needle.gauge,
                base.needle.length_mm);
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

void begin_new_target(App& app) {
    if (app.scan.attempt) {
        app.view.notices.warning("Finish the attempt first, then place a new target.");
        return;
    }
    app.view.new_target = {};
    app.view.new_target.placing = true;
    app.view.dialog = Dialog::none;
    app.view.page = Page::scan;
}

void set_new_target(App& app, double x_mm, double z_mm) {
    NewTarget& target = app.view.new_target;
    const Point3 centre =
        app.loaded.frame().record.tools.mannequin_from_probe * Point3{x_mm, 0, z_mm};
    const CaseAnatomy anatomy(app.loaded.open->bundle);
    if (anatomy.label(centre) == 0) {
        app.view.notices.warning("That place is outside the body; click inside the picture.");
        return;
    }
    target.centre = centre;
    target.placing = false;
    target.placed = true;
    app.view.dialog = Dialog::new_target;
}

void save_new_target(App& app) {
    NewTarget& target = app.view.new_target;
    CaseState& loaded = app.loaded;
    if (!target.placed || !loaded.open) return;
    const std::string folder = loaded.open->path + ".exercises";
    std::error_code failed;  // a file that cannot be written says so below
    std::filesystem::create_directories(folder, failed);
    const std::string file = folder + "/" + exercise_name(target.title) + ".toml";
    if (std::filesystem::exists(file, failed)) {
        app.view.notices.warning("There is an exercise of that name; choose another.");
        return;
    }
    const std::string toml =
        exercise_toml(loaded.exercise(), target.title, target.centre, target.radius_mm,
                      loaded.frame().record.tools.mannequin_from_probe);
    if (const Status saved = write_file(file, toml); !saved) {
        app.view.notices.error(saved.error().message());
        return;
    }
    const Result<int> index = choose_or_load_exercise(*loaded.open, file);
    if (!index) {
        app.view.notices.error(index.error().message());
        return;
    }
    app.view.dialog = Dialog::none;
    target = {};
    choose_exercise(app, *index);
    app.view.notices.news("Saved as " + file + ".");
}

}  // namespace sonocase::runtime
