// SPDX-License-Identifier: Apache-2.0

#include "formats/exercise/case_exercises.h"

#include <utility>

#include "formats/base/digest.h"
#include "formats/text/toml_reader.h"

namespace sonocase {

CaseExercises exercises_of(const CaseBundle& bundle, const std::string& where) {
    CaseExercises out;
    for (const EmbeddedExercise& embedded : bundle.exercises) {
        Result<Exercise> exercise = parse_exercise(embedded.toml, where + ":" + embedded.name);
        if (!exercise) {
            out.warnings.push_back(exercise.error().message());
            continue;
        }
        if (exercise->name.empty()) exercise->name = embedded.name;
        out.exercises.push_back(std::move(*exercise));
        out.digests.push_back(digest_of(embedded.toml));
    }
    if (out.exercises.empty()) out.exercises.push_back(free_scan(bundle));
    return out;
}

std::vector<ExerciseTexts> texts_of_exercise(const CaseBundle& bundle,
                                             const std::string& exercise) {
    for (const EmbeddedExercise& embedded : bundle.exercises) {
        if (embedded.name != exercise) continue;
        if (auto texts = parse_exercise_texts(embedded.toml, embedded.name))
            return std::move(*texts);
    }
    return {};
}

std::string case_title(const CaseManifest& manifest) {
    std::string title;
    if (const auto recipe = TomlTable::parse(manifest.recipe, manifest.case_name))
        recipe->text("title", title);
    return title.empty() ? manifest.case_name : title;
}

Exercise free_scan(const CaseBundle& bundle) {
    Exercise exercise;
    exercise.name = "free-scan";
    exercise.title = "Free scan";
    exercise.description = "Look around: slide, rock and fan the probe and name what you see.";
    exercise.kind = "scan";
    const Box3 box = bundle.grid.bounds();
    exercise.start_probe = box.centre();
    exercise.start_probe.y = box.upper.y;
    exercise.start_beam = {0, -1, 0};
    // The front of the body faces +y or +z, depending on the mannequin: the shorter way through the
    // body wins.
    if (box.extent().z < box.extent().y) {
        exercise.start_probe = box.centre();
        exercise.start_probe.z = box.upper.z;
        exercise.start_beam = {0, 0, -1};
    }
    return exercise;
}

}  // namespace sonocase
