// SPDX-License-Identifier: Apache-2.0

// The exercise: what to do, where the needle is, how the attempt goes.
#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "runtime/player/ui/panel_parts.h"
#include "runtime/player/ui/panels.h"

namespace sonocase::runtime {
namespace {

void draw_task(const Exercise& exercise) {
    heading(exercise.title.empty() ? exercise.name.c_str() : exercise.title.c_str());
    char line[32];
    std::snprintf(line, sizeof line, "%s, difficulty %d of 5", exercise.kind.c_str(),
                  exercise.difficulty);
    small_dim(line);
    if (!exercise.description.empty()) ImGui::TextWrapped("%s", exercise.description.c_str());
}

void draw_targets(const ExercisePanelInput& input) {
    const FrameRecord& record = input.record;
    const Point3 tip = record.needle.mannequin_from_drawn * Point3{0, 0, 0};
    for (std::size_t i = 0; i < input.exercise.targets.size(); ++i) {
        const Target& target = input.exercise.targets[i];
        const std::string name =
            target.name.empty() ? "Target " + std::to_string(i + 1) : target.name;
        const bool reached = input.targets_reached[i];
        if (record.tools.has_needle) {
            row_distance((name + (reached ? ", reached" : ", tip at")).c_str(),
                         distance(tip, input.target_centres[i]), target.hit_radius_mm);
        } else {
            row(name.c_str(), reached ? "reached" : "to reach",
                reached ? colour::kGood : colour::kDim);
        }
    }
    if (record.tools.has_needle && record.needle.depth_mm > 0) {
        row("Needle depth", "%.0f mm", record.needle.depth_mm);
    } else {
        row("Needle", "not inserted", colour::kDim);
    }
}

// Those asked for so far, and a button for the next.
void draw_hints(const ExercisePanelInput& input, ExercisePanelRequest& request) {
    if (input.exercise.mode == ExerciseMode::exam) {
        small_dim("Exam: no hints, no targets shown.");
        return;
    }
    const int count = static_cast<int>(input.exercise.hints.size());
    for (int i = 0; i < std::min(input.hints_shown, count); ++i)
        ImGui::TextWrapped("%s", input.exercise.hints[static_cast<std::size_t>(i)].c_str());
    if (input.hints_shown <= count) {
        request.next_hint = ImGui::Button(
            input.hints_shown < count ? "Next hint (H)" : "Show the target (H)", {-1, 0});
    }
}

void draw_attempt(const AttemptView& view) {
    ImGui::Separator();
    char clock[32];
    std::snprintf(clock, sizeof clock, "%d:%04.1f", static_cast<int>(view.seconds) / 60,
                  std::fmod(view.seconds, 60.0));
    row("Recording", clock, colour::kBad);
    row("Insertions", "%.0f", static_cast<double>(view.insertions));
    if (view.depth_mm > 0) {
        row("Tip", view.tip_in_view ? "visible" : "not visible",
            view.tip_in_view ? colour::kGood : colour::kWarn);
    }
    if (view.in_no_go) coloured(colour::kBad, "The needle is in a structure to be spared.");
    for (const std::string& event : view.events) small_dim(event.c_str());
    if (!view.problem.empty()) coloured(colour::kBad, view.problem);
}

}  // namespace

ExercisePanelRequest draw_exercise_panel(const ExercisePanelInput& input) {
    ExercisePanelRequest request;
    draw_task(input.exercise);
    const float wide = ImGui::GetContentRegionAvail().x;
    request.toggle_attempt =
        coloured_button(input.attempt ? colour::rgba(150, 58, 54) : colour::rgba(32, 112, 92),
                        input.attempt ? "Finish (B)" : "Start attempt (B)", wide);
    if (input.shows_targets) draw_targets(input);
    if (input.attempt) {
        draw_hints(input, request);
        draw_attempt(input.attempt->view());
    } else if (input.score) {
        ImGui::Separator();
        if (!input.score->pass_marks.empty()) {
            coloured(input.score->passed ? colour::kGood : colour::kWarn,
                     input.score->passed ? "The last attempt passed."
                                         : "The last attempt did not pass yet.");
        }
        request.show_score = ImGui::Button("Show scores", {wide, 0});
    }
    if (input.mouse) {
        ImGui::Separator();
        request.toggle_needle = ImGui::Button(
            input.mouse->has_needle() ? "Withdraw needle (N)" : "Take needle (N)", {-1, 0});
    }
    return request;
}

}  // namespace sonocase::runtime
