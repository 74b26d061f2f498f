// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/session/effect_trials.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <ctime>
#include <limits>

#include "runtime/imaging/core/scan_geometry.h"

namespace sonocase::runtime::inline player_session {
namespace {

// Of the whole process, so that a busy machine does not count, and all threads of a frame do.
double processor_ms() {
    return 1e3 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

// Fastest frame of each input, in two halves of the turns.
class Fastest {
  public:
    explicit Fastest(std::size_t inputs)
        : ms_(2 * inputs, std::numeric_limits<double>::infinity()) {}
    void add(std::size_t input, int turn, double ms) {
        double& best = ms_[2 * input + static_cast<std::size_t>(turn % 2)];
        best = std::min(best, ms);
    }
    double half(std::size_t which) const {
        double sum = 0;
        for (std::size_t i = which; i < ms_.size(); i += 2) sum += ms_[i];
        return 2 * sum / static_cast<double>(ms_.size());
    }
    double both() const {
        double sum = 0;
        for (std::size_t i = 0; i < ms_.size(); i += 2) sum += std::min(ms_[i], ms_[i + 1]);
        return 2 * sum / static_cast<double>(ms_.size());
    }

  private:
    std::vector<double> ms_;
};

class Trial {
  public:
    Trial(Renderer& renderer,
          std::span<const FrameInput> inputs,
          std::size_t pixels,
          double scanned)
        : renderer_(renderer), inputs_(inputs), pixels_(pixels), scanned_(scanned) {}

    // Every input once, in order, so that the probe moves from frame to frame.
    void draw(int left_out, int turn, Fastest& fastest, std::vector<Picture>* keep) {
        renderer_.leave_out(left_out);
        for (std::size_t i = 0; i < inputs_.size(); ++i) {
            const double before_ms = processor_ms();
            renderer_.render(inputs_[i], pixels_);
            fastest.add(i, turn, processor_ms() - before_ms);
            if (keep != nullptr) (*keep)[i] = pixels_;
        }
    }

    EffectTrial of(int effect, int turns, const std::vector<Picture>& with, double& frame_ms) {
        Fastest on(inputs_.size()), off(inputs_.size());
        std::vector<Picture> without(inputs_.size());
        for (int turn = 0; turn < turns; ++turn) {
            // Who goes first finds colder caches: by turns, two by two.
            const bool first = turn / 2 % 2 == 0;
            if (first) draw(-1, turn, on, nullptr);
            draw(effect, turn, off, turn == 0 ? &without : nullptr);
            if (!first) draw(-1, turn, on, nullptr);
        }
        EffectTrial trial;
        trial.tried = true;
        trial.ms = on.both() - off.both();
        trial.noise_ms = std::abs((on.half(0) - off.half(0)) - (on.half(1) - off.half(1)));
        const PictureChange change = change_of(with, without, scanned_);
        trial.changed_part = change.part;
        trial.rms_grey = change.rms_grey;
        frame_ms = std::min(frame_ms, on.both());
        return trial;
    }

  private:
    Renderer& renderer_;
    std::span<const FrameInput> inputs_;
    Picture pixels_;
    double scanned_;
};

}  // namespace

double scanned_pixels(const Probe& probe, int width_px, int height_px) {
    const ScanGeometry geometry = make_scan_geometry(probe, 2, 2, width_px, height_px);
    double count = 0, line = 0, sample = 0;
    for (int row = 0; row < height_px; ++row)
        for (int column = 0; column < width_px; ++column)
            count += geometry.locate(geometry.pixel_centre(column, row), line, sample) ? 1 : 0;
    return std::max(count, 1.0);
}

PictureChange change_of(std::span<const Picture> with,
                        std::span<const Picture> without,
                        double scanned_pixels) {
    double changed = 0, squares = 0;
    for (std::size_t i = 0; i < with.size(); ++i) {
        for (std::size_t p = 0; p < with[i].size(); ++p) {
            const int difference = with[i][p] - without[i][p];
            changed += difference != 0 ? 1 : 0;
            squares += difference * difference;
        }
    }
    const double all = scanned_pixels * static_cast<double>(with.size());
    return {std::min(changed / all, 1.0), std::sqrt(squares / all)};
}

Result<EffectTrials> try_effects(CaseView bundle,
                                 const Exercise& exercise,
                                 const RenderOptions& options,
                                 std::span<const FrameInput> inputs,
                                 int turns) {
    SONOCASE_TRY(Renderer renderer, Renderer::create(bundle, exercise, options));
    std::vector<FrameInput> tried;
    const std::size_t count = std::min(inputs.size(), kTriedFrames);
    for (std::size_t i = 0; i < count; ++i) tried.push_back(inputs[i * inputs.size() / count]);
    EffectTrials trials;
    trials.frames = static_cast<int>(count);
    trials.effects.resize(renderer.costs().size());
    if (count == 0) return trials;

    Trial trial(
        renderer, tried,
        static_cast<std::size_t>(options.width_px) * static_cast<std::size_t>(options.height_px),
        scanned_pixels(exercise.probe, options.width_px, options.height_px));
    std::vector<Picture> with(count);
    std::vector<bool> ran(trials.effects.size(), false);
    // Also fills the caches, and finds which effects the frames call for.
    for (std::size_t i = 0; i < count; ++i) {
        with[i].resize(static_cast<std::size_t>(options.width_px) *
                       static_cast<std::size_t>(options.height_px));
        renderer.render(tried[i], with[i]);
        for (std::size_t e = 0; e < ran.size(); ++e)
            ran[e] = ran[e] || (renderer.costs()[e].ran && renderer.costs()[e].can_be_left_out);
    }
    trials.frame_ms = std::numeric_limits<double>::infinity();
    for (std::size_t e = 0; e < ran.size(); ++e)
        if (ran[e])
            trials.effects[e] =
                trial.of(static_cast<int>(e), std::max(turns, 2), with, trials.frame_ms);
    return trials;
}

}  // namespace sonocase::runtime::inline player_session
