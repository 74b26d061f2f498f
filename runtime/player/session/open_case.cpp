// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/session/open_case.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "formats/base/digest.h"
#include "formats/exercise/case_exercises.h"
#include "formats/files/atomic_file.h"
#include "formats/files/bundle_file.h"
#include "formats/scoring/anatomy.h"

namespace sonocase::runtime {
namespace {

void add_own_exercises(OpenCase& open) {
    std::error_code failed;
    std::vector<std::string> files;
    for (std::filesystem::directory_iterator it(open.path + ".exercises", failed), end;
         !failed && it != end; it.increment(failed)) {
        if (it->path().extension() == ".toml") files.push_back(it->path().string());
    }
    std::sort(files.begin(), files.end());
    for (const std::string& file : files) {
        if (const auto added = choose_or_load_exercise(open, file); !added)
            open.warnings.push_back(added.error().message() + ".");
    }
}

}  // namespace

Result<std::unique_ptr<OpenCase>> open_case(const std::string& path) {
    Result<StreamedBundle> bundle = open_bundle(path);
    if (!bundle) return bundle.error();
    auto open = std::make_unique<OpenCase>();
    open->path = path;
    open->bundle = std::move(*bundle);
    CaseExercises found = exercises_of(*open->bundle, path);
    open->exercises = std::move(found.exercises);
    open->warnings = std::move(found.warnings);
    open->exercise_digests = std::move(found.digests);
    add_own_exercises(*open);
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

Result<int> choose_or_load_exercise(OpenCase& open, const std::string& name_or_file) {
    const std::string& file = name_or_file;
    if (file.size() < 5 || file.compare(file.size() - 5, 5, ".toml") != 0)
        return find_exercise(open, name_or_file);
    const Result<std::string> text = read_text_file(file);
    if (!text) return text.error();
    Result<Exercise> exercise = parse_exercise(*text, file);
    if (!exercise) return exercise.error();
    const CaseAnatomy anatomy(open.bundle);
    for (const Target& target : exercise->targets) {
        const auto label = static_cast<std::size_t>(anatomy.label(target.centre));
        const std::string found =
            label == 0 ? "outside the body" : "in '" + open.bundle->labels[label].name + "'";
        if (label == 0 ||
            (!target.inside.empty() && target.inside != open.bundle->labels[label].name))
            return Error{"target '" + target.name + "' lies " + found, file,
                         label == 0 ? "a place inside, in the frame mannequin"
                                    : "it is to lie in '" + target.inside + "'"};
    }
    open.exercise_digests.resize(open.exercises.size());
    std::size_t at = 0;
    while (at < open.exercises.size() && open.exercises[at].name != exercise->name) ++at;
    open.exercises.resize(std::max(open.exercises.size(), at + 1));
    open.exercise_digests.resize(open.exercises.size());
    open.exercises[at] = std::move(*exercise);
    open.exercise_digests[at] = digest_of(*text);
    open.exercise_files.resize(std::max(open.exercise_files.size(), at + 1));
    open.exercise_files[at] = file;
    return static_cast<int>(at);
}

}  // namespace sonocase::runtime
