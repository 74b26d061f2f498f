// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/paper/paper_formation.h"

#include <cmath>
#include <utility>

#include "runtime/imaging/core/host.h"
#include "runtime/imaging/paper/paper_fast.h"
#include "runtime/imaging/paper/paper_reference.h"

namespace sonocase::runtime {
namespace {

class PaperFormation final : public ImageFormation {
  public:
    PaperFormation(PaperScene scene, const FormationInput& input)
        : exercise_(input.exercise),
          scene_(std::move(scene)),
          noise_(make_paper_noise(input.options.seed, input.scanlines)),
          seed_(input.options.seed),
          reference_(input.options.kind == RendererKind::reference),
          keep_all_(input.effects.keep_all),
          chosen_(switches_of<PaperEffects>(kPaperEffects, input.effects.on)),
          switches_(chosen_),
          context_(input.context) {}

    void add_level(const ScanGeometry& geometry, double) override {
        Level& level = levels_.emplace_back();
        level.row_gain.assign(geometry.samples, 1.0f);
        if (reference_) {
            geometry_ = geometry;
        } else {
            level.fast = std::make_unique<PaperFast>(scene_, geometry, noise_,
                                                     press::press_face(exercise_.probe), context_);
        }
    }

    FrameStatus render_fast(int level,
                            const FrameRequest& request,
                            std::span<std::uint8_t> pixels,
                            std::span<EffectCost> costs) override {
        Level& at = levels_[level];
        at.fast->render(frame_of(request, at.row_gain), request.input.settings.flip_left_right,
                        keep_all_, pixels);
        fill_costs(kPaperEffects, switches_, &at.fast->met(), at.fast->pass_ms(), costs);
        return FrameStatus::rendered;
    }

    void leave_out(int effect) override {
        switches_ = switches_without(kPaperEffects, chosen_, effect);
    }

    void render_reference(const FrameRequest& request,
                          std::span<std::uint8_t> pixels,
                          std::span<EffectCost> costs) override {
        PassTimer timer(context_.clock);
        render_paper_reference(scene_, geometry_, noise_,
                               frame_of(request, levels_.front().row_gain), pixels);
        PassTimes pass_ms{};
        pass_ms[static_cast<std::size_t>(Pass::beams)] = timer.lap_ms();
        fill_costs<PaperEffects, PaperMet>(kPaperEffects, switches_, nullptr, pass_ms, costs);
    }

    GainLaw gain_law() const override { return {}; }  // a factor of the grey

  private:
    struct Level {
        std::vector<float> row_gain;      // # samples
        std::unique_ptr<PaperFast> fast;  // null for the reference
    };

    PaperFrame frame_of(const FrameRequest& request, std::vector<float>& row_gain) const {
        for (std::size_t k = 0; k < row_gain.size(); ++k) {
            const float db = request.row_gain_db[k];
            row_gain[k] =
                db == 0 ? 1.0f : static_cast<float>(std::pow(10.0, static_cast<double>(db) / 20));
        }
        PaperFrame frame;
        frame.volume_from_probe = request.input.mannequin_from_probe;
        frame.needle = request.needle;
        frame.seed = seed_;
        frame.frame = request.input.frame;
        frame.row_gain = row_gain;
        frame.effects = switches_;
        frame.press = switches_.deformation ? request.press : nullptr;
        return frame;
    }

    const Exercise& exercise_;
    const PaperScene scene_;
    const std::vector<std::int8_t> noise_;
    const std::uint32_t seed_;
    const bool reference_, keep_all_;
    const PaperEffects chosen_;
    PaperEffects switches_;  // less what is left out
    const RenderContext context_;
    ScanGeometry geometry_;  // for the reference
    std::vector<Level> levels_;
};

Result<std::unique_ptr<ImageFormation>> create(const FormationInput& input) {
    SONOCASE_TRY(PaperScene scene, make_paper_scene(*input.bundle));
    return std::unique_ptr<ImageFormation>(
        std::make_unique<PaperFormation>(std::move(scene), input));
}

int beams_and_samples(const Exercise&, const RenderOptions&) {
    return 512;
}

constexpr auto kEffectNames = effect_names_of(kPaperEffects);

}  // namespace

const ImageModelInfo kPaperModel{beams_and_samples, beams_and_samples, kEffectNames,
                                 [](const Exercise&) { return 0.0; }, create};

}  // namespace sonocase::runtime
