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
    if (const Status added = renderer->add_engine(); !added) return added.error();
    return renderer;
}

Status FrameRenderer::add_engine() {
    runtime::EngineOptions options;
    options.render = options_;
    auto engine = runtime::ScanEngine::create(opened_->bundle, exercise_, options);
    if (!engine) return engine.error();
    engines_.push_back(std::make_unique<runtime::ScanEngine>(std::move(*engine)));
    return Done{};
}

void FrameRenderer::render_with(runtime::ScanEngine& engine, FrameTask& task) {
    runtime::FrameRecord record;
    record.input = task.input;
    task.status = engine.frame_again(record, task.pixels);
}

void FrameRenderer::render(FrameTask& task) {
    render_with(*engines_.front(), task);
}

Result<bool> FrameRenderer::render_all(std::span<FrameTask> tasks,
                                       int threads,
                                       const std::function<bool()>& interrupted) {
    const std::size_t wanted =
        std::clamp<std::size_t>(static_cast<std::size_t>(threads), 1, std::max<std::size_t>(tasks.size(), 1));
    while (engines_.size() < wanted) {
        if (const Status added = add_engine(); !added) return added.error();
    }
    std::atomic<std::size_t> next{0};
    std::atomic<bool> stop{false};
    const auto work = [&](std::size_t part, bool asks) {
        for (std::size_t done = 0;; ++done) {
            if (asks && done % 8 == 7 && interrupted()) stop = true;
            const std::size_t n = stop ? tasks.size() : next++;
            if (n >= tasks.size()) return;
            render_with(*engines_[part], tasks[n]);
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
