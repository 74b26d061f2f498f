// SPDX-License-Identifier: Apache-2.0

// A case and its renderer as Python holds them. Nothing here knows Python.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "formats/bundle/case_bundle.h"
#include "formats/exercise/exercise.h"
#include "runtime/engine/scan_engine.h"
#include "runtime/engine/skin.h"
#include "runtime/imaging/doppler/doppler_picture.h"
#include "runtime/imaging/renderer.h"
#include "runtime/imaging/truth/frame_truth.h"

namespace sonocase::python {

// Stays in place and is shared by its renderers, so that closing it frees nothing that a frame on
// another thread still reads.
struct OpenedCase {
    std::string path;      // as given
    std::string absolute;  // as pickles hold it, for a process that stands elsewhere
    StreamedBundle bundle;
    std::vector<Exercise> exercises;    // those that could be read
    std::vector<std::string> warnings;  // whole sentences, about those that could not
    std::atomic<bool> closed{false};
};

// An exercise and the bundle that holds it: probe and needle may have changed since, nothing else.
struct CaseExercise : Exercise {
    std::string case_path;  // absolute
};

// From the folder in which the process stands now.
std::string absolute_path(const std::string& path);

// Errors: a file that cannot be read or is not a bundle.
Result<std::shared_ptr<OpenedCase>> open_case(const std::string& path);

// An Error once the case is closed, or once a part of it that was needed turned out to be damaged.
Status usable(const OpenedCase& opened);

// The exercise of that name; "" means the first, and where the bundle holds none, a free scan.
Result<Exercise> exercise_named(const OpenedCase& opened, const std::string& name);

// False where it is known to be another case's: of another file than this one.
bool is_of(const CaseExercise& exercise, const OpenedCase& opened);

// How far the skin is looked for, and over which ball its normal is averaged, unless said.
constexpr double kSkinReachMm = 60, kSkinRadiusMm = 12;

// Where one frame of a batch goes.
struct FrameTask {
    runtime::FrameInput input;
    std::span<std::uint8_t> pixels;  // # width * height
    runtime::FrameStatus status = runtime::FrameStatus::rendered;
    runtime::PressReport press;
    // Where truth is asked for.
    bool wants_truth = false;
    runtime::TruthPlanes planes;
    runtime::FrameTruth truth;
};

// Renders frames as `sonoplay --headless` does, one at a time or many on several threads.
class FrameRenderer {
  public:
    // Errors: those of ScanEngine::create.
    static Result<std::unique_ptr<FrameRenderer>> create(std::shared_ptr<OpenedCase> opened,
                                                         const Exercise& exercise,
                                                         const runtime::RenderOptions& options);

    void render(FrameTask& task);
    // Before the first frame with truth. Errors: those of TruthRenderer::create.
    Status prepare_truth();
    // The truth of a frame that was rendered before.
    void describe(FrameTask& task);
    // Renders all, with truth where tasks want it, on `threads` threads, the caller's included;
    // each has an engine of its own, which is kept for the next time. interrupted: asked by the
    // caller's thread every now and then; true ends the batch, and false is returned. Errors: an
    // engine cannot be made.
    Result<bool> render_all(std::span<FrameTask> tasks,
                            int threads,
                            const std::function<bool()>& interrupted);

    // Before the first frame of a Doppler mode. Errors: those of DopplerView::create.
    Status prepare_doppler();
    // Settings with box, gate and cursor on the widest vessel that this plane cuts, as sonoplay
    // places them; after prepare_doppler().
    runtime::DopplerSettings aimed(const Rigid& pose,
                                   const runtime::DopplerSettings& settings,
                                   bool steers) const;
    // The mode of a frame that was just rendered, in colour: rgb # 3 * width * doppler_rows().
    void show_doppler(const FrameTask& task, std::span<std::uint8_t> rgb);
    const runtime::DopplerView& doppler() const { return *doppler_; }

    const OpenedCase& opened() const { return *opened_; }
    const Exercise& exercise() const { return exercise_; }
    const runtime::RenderOptions& options() const { return options_; }
    const runtime::ScanEngine& engine() const { return workers_.front()->engine; }
    // That rendered the last frame, or the last one of a batch.
    const runtime::ScanEngine& last_engine() const { return workers_[last_worker_]->engine; }

  private:
    FrameRenderer(std::shared_ptr<OpenedCase> opened,
                  const Exercise& exercise,
                  const runtime::RenderOptions& options)
        : opened_(std::move(opened)), exercise_(exercise), options_(options) {}
    // A thread's own: a renderer is for one thread at a time.
    struct Worker {
        explicit Worker(runtime::ScanEngine e) : engine(std::move(e)) {}
        runtime::ScanEngine engine;
        std::unique_ptr<runtime::TruthRenderer> truth;  // null until asked for
    };
    Status add_worker();
    Status add_truth(Worker& worker);
    static void render_with(Worker& worker, FrameTask& task);
    static void describe_with(Worker& worker, FrameTask& task);

    std::shared_ptr<OpenedCase> opened_;
    Exercise exercise_;
    runtime::RenderOptions options_;
    std::vector<std::unique_ptr<Worker>> workers_;  // at least one
    std::size_t last_worker_ = 0;
    std::unique_ptr<runtime::DopplerView> doppler_;  // of the first; null until asked for
};

}  // namespace sonocase::python
