// SPDX-License-Identifier: Apache-2.0

#include "opened_case.h"

#include <utility>

#include "formats/files/bundle_file.h"

namespace sonocase::python {

Result<std::shared_ptr<OpenedCase>> open_case(const std::string& path) {
    Result<StreamedBundle> bundle = open_bundle(path);
    if (!bundle) return bundle.error();
    auto opened = std::make_shared<OpenedCase>();
    opened->path = path;
    opened->bundle = std::move(*bundle);
    for (const EmbeddedExercise& embedded : opened->bundle->exercises) {
        Result<Exercise> exercise = parse_exercise(embedded.toml, path + ":" + embedded.name);
        if (!exercise) {
            opened->warnings.push_back(exercise.error().message());
            continue;
        }
        if (exercise->name.empty()) exercise->name = embedded.name;
        opened->exercises.push_back(std::move(*exercise));
    }
    return opened;
}

Status usable(const OpenedCase& opened) {
    if (opened.closed) return Error{"the case is closed", opened.path, "open it again"};
    const VoxelBlocks* blocks = opened.bundle.blocks();
    if (blocks != nullptr && blocks->damaged()) return blocks->status();
    return Done{};
}

Result<Exercise> exercise_named(const OpenedCase& opened, const std::string& name) {
    if (name.empty() && !opened.exercises.empty()) return opened.exercises.front();
    std::string names;
    for (const Exercise& exercise : opened.exercises) {
        if (exercise.name == name) return exercise;
        names += (names.empty() ? "" : ", ") + exercise.name;
    }
    if (name.empty()) {
        Exercise exercise;
        exercise.name = "free-scan";
        exercise.kind = "scan";
        return exercise;
    }
    return Error{"no exercise named " + name, opened.path,
                 names.empty() ? "this bundle holds none" : "this bundle holds: " + names};
}

}  // namespace sonocase::python
