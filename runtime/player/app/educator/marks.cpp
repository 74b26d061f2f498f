// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/educator/marks.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <sstream>

#include "formats/exercise/metric_table.h"
#include "formats/files/atomic_file.h"
#include "formats/text/number_text.h"
#include "runtime/player/app/case_steps.h"
#include "runtime/player/app/educator/new_target.h"

namespace sonocase::runtime {
namespace {

// As it is written: in a file of its own, or in the case. Empty: in neither.
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

void begin_marks(App& app) {
    if (!app.loaded.open) return;
    app.view.marks =
        app.loaded.open->exercises[static_cast<std::size_t>(app.loaded.exercise_index)].pass_marks;
    app.view.dialog = Dialog::marks;
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

void save_marks(App& app) {
    CaseState& loaded = app.loaded;
    if (!loaded.open) return;
    if (app.scan.attempt) {
        app.view.notices.warning("Finish the attempt first, then change the marks.");
        return;
    }
    const std::string toml = written_exercise(loaded);
    if (toml.empty()) {
        app.view.notices.warning("This exercise is written nowhere: make one with New target.");
        return;
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
    if (const Status saved = write_file(file, toml_with_marks(toml, app.view.marks)); !saved) {
        app.view.notices.error(saved.error().message());
        return;
    }
    const Result<int> chosen = choose_or_load_exercise(*loaded.open, file);
    if (!chosen) {
        app.view.notices.error(chosen.error().message());
        return;
    }
    app.view.dialog = Dialog::none;
    choose_exercise(app, *chosen);
    app.view.notices.news("Saved as " + file + ".");
}

}  // namespace sonocase::runtime
