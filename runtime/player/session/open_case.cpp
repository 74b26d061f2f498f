// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/session/open_case.h"

#include <algorithm>
#include <utility>

#include "formats/files/bundle_file.h"

namespace sonocase::runtime {

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

Result<std::unique_ptr<OpenCase>> open_case(const std::string& path) {
    Result<StreamedBundle> bundle = open_bundle(path);
    if (!bundle) return bundle.error();
    auto open = std::make_unique<OpenCase>();
    open->path = path;
    open->bundle = std::move(*bundle);
    for (const EmbeddedExercise& embedded : open->bundle->exercises) {
        Result<Exercise> exercise = parse_exercise(embedded.toml, path + ":" + embedded.name);
        if (!exercise) {
            open->warnings.push_back(exercise.error().message());
            continue;
        }
        if (exercise->name.empty()) exercise->name = embedded.name;
        open->exercises.push_back(std::move(*exercise));
    }
    if (open->exercises.empty()) open->exercises.push_back(free_scan(*open->bundle));
    return open;
}

Status bundle_health(const OpenCase& open) {
    const VoxelBlocks* blocks = open.bundle.blocks();
    if (blocks && blocks->damaged()) return blocks->status();
    return Done{};
}

Result<int> find_exercise(const OpenCase& open, const std::string& name) {
    if (name.empty()) return 0;
    std::string names;
    for (std::size_t i = 0; i < open.exercises.size(); ++i) {
        if (open.exercises[i].name == name) return static_cast<int>(i);
        names += (i ? ", " : "") + open.exercises[i].name;
    }
    return Error{"no exercise named " + name, open.path, "this bundle holds: " + names};
}

}  // namespace sonocase::runtime
