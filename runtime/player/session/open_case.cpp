// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/session/open_case.h"

#include <algorithm>
#include <filesystem>
#include <new>
#include <thread>
#include <utility>

#include "formats/base/digest.h"
#include "formats/exercise/case_exercises.h"
#include "formats/files/atomic_file.h"
#include "formats/files/load_save.h"
#include "formats/scoring/anatomy.h"
#include "runtime/tracking/devices/make_tracker.h"
#include "runtime/workers/thread_host.h"

namespace sonocase::runtime::inline player_session {

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
            open.warnings.push_back({"{}.", {added.error().message()}});
    }
}

// Of an exercise that the bundle holds and that parses.
}  // namespace

ExerciseTexts texts_of(const OpenCase& open, int exercise, const std::string& language) {
    const auto at = static_cast<std::size_t>(exercise);
    static const std::vector<ExerciseTexts> kNone;
    return texts_in(open.exercises[at], at < open.texts.size() ? open.texts[at] : kNone, language);
}

Result<std::unique_ptr<OpenCase>> open_case(const std::string& path) {
    SONOCASE_TRY(StreamedBundle bundle, open_bundle(path));
    auto open = std::make_unique<OpenCase>();
    open->path = path;
    open->bundle = std::move(bundle);
    open->signature = signature_of(open->bundle.bytes());
    CaseExercises found = exercises_of(*open->bundle, path);
    open->exercises = std::move(found.exercises);
    open->warnings = std::move(found.warnings);
    open->exercise_digests = std::move(found.digests);
    const CaseSignature& by = open->signature;
    if (by.fit == SignatureFit::differs)
        open->warnings.push_back(
            {"The signature of {} (key {}) does not fit: the case was changed since, or the "
             "signature is that of another.",
             {by.name, fingerprint_of(by.key)}});
    if (by.fit == SignatureFit::unreadable)
        open->warnings.push_back({"The case has a signature that this program cannot read.", {}});
    for (const Exercise& exercise : open->exercises)
        open->texts.push_back(texts_of_exercise(*open->bundle, exercise.name));
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
    return Error{Message("no exercise named {}", {name}), open.path,
                 Message("this bundle holds: {}", {names})};
}

Result<int> choose_or_load_exercise(OpenCase& open, const std::string& name_or_file) {
    const std::string& file = name_or_file;
    if (file.size() < 5 || file.compare(file.size() - 5, 5, ".toml") != 0)
        return find_exercise(open, name_or_file);
    SONOCASE_TRY(const std::string text, read_text_file(file));
    SONOCASE_TRY(Exercise exercise, parse_exercise(text, file));
    SONOCASE_TRY(auto texts, parse_exercise_texts(text, file));
    const CaseAnatomy anatomy(open.bundle);
    for (const Target& target : exercise.targets) {
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
    while (at < open.exercises.size() && open.exercises[at].name != exercise.name) ++at;
    open.exercises.resize(std::max(open.exercises.size(), at + 1));
    open.exercise_digests.resize(open.exercises.size());
    open.exercises[at] = std::move(exercise);
    open.exercise_digests[at] = digest_of(text);
    open.exercise_files.resize(std::max(open.exercise_files.size(), at + 1));
    open.exercise_files[at] = file;
    open.texts.resize(std::max(open.texts.size(), at + 1));
    open.texts[at] = std::move(texts);
    return static_cast<int>(at);
}

Result<std::unique_ptr<OpenCase>> open_case_to_render(const std::string& path) {
    std::shared_ptr<const PhysicalTextures> textures;
    std::thread making([&textures] {
        try {
            textures = make_physical_textures();
        } catch (const std::bad_alloc&) {  // the renderer makes its own, or reports it
        }
    });
    Result<std::unique_ptr<OpenCase>> opened = open_case(path);
    making.join();
    if (opened) (*opened)->textures = std::move(textures);
    return opened;
}

ImageChoice initial_image(const PlayerArguments& arguments, const Exercise& exercise) {
    ImageChoice image;
    image.model = arguments.model.empty() ? exercise.model : arguments.model;
    image.machine = arguments.machine;
    image.effects = arguments.effects.empty() ? exercise.effects : arguments.effects;
    if (arguments.width_px > 0) {
        image.width_px = arguments.width_px;
        image.height_px = arguments.height_px;
    }
    return image;
}

Result<ScanEngine> make_engine(const OpenCase& open,
                               const Exercise& exercise,
                               const PlayerArguments& arguments,
                               const ImageChoice& image) {
    EngineOptions options;
    options.depth_mm = image.depth_mm;
    options.focus_mm = image.focus_mm;
    RenderOptions& render = options.render;
    render.width_px = image.width_px;
    render.height_px = image.height_px;
    render.model = image.model == "paper" ? ImageModel::paper : ImageModel::physical;
    render.kind = arguments.renderer == "reference" ? RendererKind::reference : RendererKind::fast;
    render.threads = arguments.threads;
    render.read_ahead = true;
    render.textures = open.textures;
    render.host = thread_host();
    render.scanlines = arguments.scanlines;
    render.samples = arguments.samples;
    render.looks = arguments.looks;
    render.effects = image.effects;
    if (!image.machine.empty()) {
        SONOCASE_TRY(Machine machine, load_machine(image.machine));
        render.machine = std::move(machine);
    }
    render.frame_budget_ms = image.frame_budget_ms;
    return ScanEngine::create(open.bundle, exercise, options);
}

Result<std::unique_ptr<Tracker>> make_case_tracker(const std::string& spec,
                                                   const Skin& skin,
                                                   const Exercise& exercise,
                                                   const Calibrations& calibrations,
                                                   const std::vector<std::string>& tools,
                                                   const SessionClock& clock) {
    TrackerContext context;
    SONOCASE_TRY(ToolNames names, parse_tool_names(tools));
    context.tools = std::move(names);
    context.skin = &skin;
    context.exercise = &exercise;
    context.clock = clock;
    context.loop = true;
    context.needle_lag_s = calibrations.needle_lag_s;
    return make_tracker(spec, context);
}

}  // namespace sonocase::runtime::inline player_session
