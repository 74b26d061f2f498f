// SPDX-License-Identifier: Apache-2.0

#include "frame_renderer.h"

#include <algorithm>
#include <atomic>
#include <system_error>
#include <thread>
#include <utility>

namespace sonocase::python {

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
    if (const Status added = renderer->add_worker(); !added) return added.error();
    return renderer;
}

Status FrameRenderer::add_worker() {
    runtime::EngineOptions options;
    options.render = options_;
    auto engine = runtime::ScanEngine::create(opened_->bundle, exercise_, options);
    if (!engine) return engine.error();
    workers_.push_back(std::make_unique<Worker>(std::move(*engine)));
    return Done{};
}

Status FrameRenderer::add_truth(Worker& worker) {
    if (worker.truth != nullptr) return Done{};
    auto truth = runtime::TruthRenderer::create(opened_->bundle, exercise_, options_);
    if (!truth) return truth.error();
    worker.truth = std::make_unique<runtime::TruthRenderer>(std::move(*truth));
    return Done{};
}

Status FrameRenderer::prepare_truth() {
    return add_truth(*workers_.front());
}

Status FrameRenderer::prepare_doppler() {
    if (doppler_ != nullptr) return Done{};
    auto view = runtime::DopplerView::create(opened_->bundle, exercise_, options_);
    if (!view) return view.error();
    doppler_ = std::make_unique<runtime::DopplerView>(std::move(*view));
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
    if (task.wants_truth) task.truth = worker.truth->render(task.input, task.planes);
}

void FrameRenderer::render(FrameTask& task) {
    render_with(*workers_.front(), task);
}

void FrameRenderer::describe(FrameTask& task) {
    task.truth = workers_.front()->truth->render(task.input, task.planes);
}

Result<bool> FrameRenderer::render_all(std::span<FrameTask> tasks,
                                       int threads,
                                       const std::function<bool()>& interrupted) {
    const std::size_t wanted = std::clamp<std::size_t>(static_cast<std::size_t>(threads), 1,
                                                       std::max<std::size_t>(tasks.size(), 1));
    while (workers_.size() < wanted) {
        if (const Status added = add_worker(); !added) return added.error();
    }
    if (!tasks.empty() && tasks.front().wants_truth) {
        for (std::size_t part = 0; part < wanted; ++part) {
            if (const Status added = add_truth(*workers_[part]); !added) return added.error();
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
