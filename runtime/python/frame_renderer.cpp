// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <system_error>
#include <thread>
#include <utility>

#include "formats/files/load_save.h"
#include "frame_renderer.h"

namespace sonocase::python {

std::string absolute_path(const std::string& path) {
    std::error_code failed;
    const std::filesystem::path absolute = std::filesystem::absolute(path, failed);
    return failed ? path : absolute.string();
}

Result<std::shared_ptr<OpenedCase>> open_case(const std::string& path) {
    SONOCASE_TRY(StreamedBundle bundle, open_bundle(path));
    auto opened = std::make_shared<OpenedCase>();
    opened->path = path;
    opened->absolute = absolute_path(path);
    opened->bundle = std::move(bundle);
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

bool is_of(const CaseExercise& exercise, const OpenedCase& opened) {
    if (exercise.case_path == opened.absolute) return true;
    std::error_code failed;  // a file that has gone: nobody knows
    const bool same = std::filesystem::equivalent(exercise.case_path, opened.absolute, failed);
    return same || failed;
}

Result<std::unique_ptr<FrameRenderer>> FrameRenderer::create(
    std::shared_ptr<OpenedCase> opened,
    const Exercise& exercise,
    const runtime::RenderOptions& options) {
    std::unique_ptr<FrameRenderer> renderer(
        new FrameRenderer(std::move(opened), exercise, options));
    if (renderer->options_.textures == nullptr) {
        // The same for every case: made once in a process.
        static const auto textures = runtime::make_physical_textures();
        renderer->options_.textures = textures;
    }
    SONOCASE_TRY_DONE(renderer->add_worker());
    return renderer;
}

Status FrameRenderer::add_worker() {
    runtime::EngineOptions options;
    options.render = options_;
    SONOCASE_TRY(auto engine, runtime::ScanEngine::create(opened_->bundle, exercise_, options));
    workers_.push_back(std::make_unique<Worker>(std::move(engine)));
    return Done{};
}

Status FrameRenderer::add_truth(Worker& worker) {
    if (worker.truth != nullptr) return Done{};
    SONOCASE_TRY(auto truth, runtime::TruthRenderer::create(opened_->bundle, exercise_, options_));
    worker.truth = std::make_unique<runtime::TruthRenderer>(std::move(truth));
    return Done{};
}

Status FrameRenderer::prepare_truth() {
    return add_truth(*workers_.front());
}

Status FrameRenderer::prepare_doppler() {
    if (doppler_ != nullptr) return Done{};
    SONOCASE_TRY(auto view, runtime::DopplerView::create(opened_->bundle, exercise_, options_));
    doppler_ = std::make_unique<runtime::DopplerView>(std::move(view));
    return Done{};
}

runtime::DopplerSettings FrameRenderer::aimed(const Rigid& pose,
                                              const runtime::DopplerSettings& settings,
                                              bool steers) const {
    runtime::FrameInput input;
    input.mannequin_from_probe = pose;
    return doppler_->aimed(input, settings, steers);
}

void FrameRenderer::show_doppler(const FrameTask& task, std::span<std::uint8_t> rgb) {
    doppler_->frame(task.input, workers_.front()->engine.renderer(), task.pixels);
    runtime::draw_doppler(*doppler_, task.input.settings.doppler.mode, task.pixels,
                          options_.width_px, options_.height_px, rgb);
}

void FrameRenderer::render_with(Worker& worker, FrameTask& task) {
    runtime::FrameRecord record;
    record.input = task.input;
    task.status = worker.engine.frame_again(record, task.pixels);
    task.press = worker.engine.renderer().press();
    if (task.wants_truth) describe_with(worker, task);
}

void FrameRenderer::render(FrameTask& task) {
    last_worker_ = 0;
    render_with(*workers_.front(), task);
}

void FrameRenderer::describe_with(Worker& worker, FrameTask& task) {
    task.truth = worker.truth->render(task.input, task.planes, &worker.engine.renderer());
}

void FrameRenderer::describe(FrameTask& task) {
    describe_with(*workers_.front(), task);
}

Result<bool> FrameRenderer::render_all(std::span<FrameTask> tasks,
                                       int threads,
                                       const std::function<bool()>& interrupted) {
    const std::size_t wanted =
        std::clamp<std::size_t>(threads, 1, std::max<std::size_t>(tasks.size(), 1));
    while (workers_.size() < wanted) {
        SONOCASE_TRY_DONE(add_worker());
    }
    if (!tasks.empty() && tasks.front().wants_truth) {
        for (std::size_t part = 0; part < wanted; ++part) {
            SONOCASE_TRY_DONE(add_truth(*workers_[part]));
        }
    }
    std::atomic<std::size_t> next{0};
    std::atomic<bool> stop{false};
    const auto work = [&](std::size_t part, bool asks) {
        for (std::size_t done = 0;; ++done) {
            if (asks && done % 8 == 7 && interrupted()) stop = true;
            const std::size_t n = stop ? tasks.size() : next++;
            if (n >= tasks.size()) return;
            render_with(*workers_[part], tasks[n]);
            if (n + 1 == tasks.size()) last_worker_ = part;
        }
    };
    std::vector<std::thread> helpers;
    try {
        for (std::size_t part = 1; part < wanted; ++part) helpers.emplace_back(work, part, false);
    } catch (const std::system_error&) {  // fewer threads do the work
    }
    work(0, true);
    for (std::thread& helper : helpers) helper.join();
    return !stop;
}

}  // namespace sonocase::python
