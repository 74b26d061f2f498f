// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/session/open_case.h"

#include <utility>

#include "formats/exercise/case_exercises.h"
#include "formats/files/bundle_file.h"

namespace sonocase::runtime {

Result<std::unique_ptr<OpenCase>> open_case(const std::string& path) {
    Result<StreamedBundle> bundle = open_bundle(path);
    if (!bundle) return bundle.error();
    auto open = std::make_unique<OpenCase>();
    open->path = path;
    open->bundle = std::move(*bundle);
    CaseExercises found = exercises_of(*open->bundle, path);
    open->exercises = std::move(found.exercises);
    open->warnings = std::move(found.warnings);
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
