// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/session/case_set_up.h"

#include <new>
#include <thread>
#include <utility>

#include "formats/files/machine_file.h"
#include "runtime/tracking/factory/make_tracker.h"
#include "runtime/workers/thread_host.h"

namespace sonocase::runtime {

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
        Result<Machine> machine = load_machine(image.machine);
        if (!machine) return machine.error();
        render.machine = std::move(*machine);
    }
    render.frame_budget_ms = image.frame_budget_ms;
    return ScanEngine::create(open.bundle, exercise, options);
}

Result<std::unique_ptr<Tracker>> make_case_tracker(const std::string& spec,
                                                   const Skin& skin,
                                                   const Exercise& exercise,
                                                   const Calibrations& calibrations,
                                                   const SessionClock& clock) {
    TrackerContext context;
    context.skin = &skin;
    context.exercise = &exercise;
    context.clock = clock;
    context.loop = true;
    context.needle_lag_s = calibrations.needle_lag_s;
    return make_tracker(spec, context);
}

}  // namespace sonocase::runtime
