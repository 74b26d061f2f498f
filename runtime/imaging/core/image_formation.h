// SPDX-License-Identifier: Apache-2.0

// What every image model does for the renderer: it is created from a bundle and an exercise, gets a
// geometry for each level of accuracy, and then renders frames, quickly or by its reference.
//
// To add a model: implement ImageFormation, describe it in an ImageModelInfo, and put that into the
// list at the top of runtime/imaging/renderer.cpp.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>

#include "formats/base/jobs.h"
#include "formats/base/result.h"
#include "formats/bundle/case_bundle.h"
#include "formats/exercise/exercise.h"
#include "runtime/imaging/core/effect_table.h"
#include "runtime/imaging/core/frame_input.h"
#include "runtime/imaging/core/host.h"
#include "runtime/imaging/core/needle_chord.h"
#include "runtime/imaging/core/render_options.h"
#include "runtime/imaging/core/scan_geometry.h"
#include "runtime/imaging/core/simd_target.h"

namespace sonocase::runtime {

namespace press {
class PressField;
class PressView;
class ProbePress;
}  // namespace press

// What does the work of a renderer. Workers and jobs outlive whatever they are given to.
struct RenderContext {
    Workers& workers;       // for frames
    JobRunner& jobs;        // for tables, while a renderer is created
    SimdTarget simd;        // for the kernels
    Clock clock = nullptr;  // null: passes take 0 ms
};

// What a model is created from. Everything referred to outlives the model.
struct FormationInput {
    CaseView bundle;
    const Exercise& exercise;
    const RenderOptions& options;
    const EffectChoice& effects;
    int scanlines = 0;  // at the finest level
    RenderContext context;
};

// A frame as both renderers of a model get it: checked, and in the probe's frame.
struct FrameRequest {
    const FrameInput& input;
    const NeedleShape* needle = nullptr;  // probe frame; null: none
    // How the probe presses; the input's pose is where bone holds the face. Null: it does not.
    const press::PressField* press = nullptr;
    std::span<const float> row_gain_db;  // # samples of the level: console gain and TGC sliders
};

// What a renderer found on its way to its last frame, at full accuracy: whoever describes that
// frame need not find it again. It holds until the renderer does anything else.
struct RenderedFrame {
    const press::ProbePress* probe = nullptr;      // null: the effect is off
    const press::PressView* press_view = nullptr;  // null: nothing moves, or the model keeps none
    // Effect contact: # scanlines, as pressed; negative: air. Empty: the effect is off.
    std::span<const float> gaps_mm;
    int touching = 0;  // beams in contact
};

class ImageFormation {
  public:
    virtual ~ImageFormation() = default;

    // Prepares one more level of accuracy, finest first; all levels come before the first frame.
    // looks: share of the looks that the machine averages.
    virtual void add_level(const ScanGeometry& geometry, double looks) = 0;

    // pixels: # width * height of the geometry. costs: one per effect, to be filled in. Neither
    // allocates nor throws.
    virtual FrameStatus render_fast(int level,
                                    const FrameRequest& request,
                                    std::span<std::uint8_t> pixels,
                                    std::span<EffectCost> costs) = 0;
    // Pools of fluid that the model draws, which push tissue aside where effect deformation is on:
    // where they are in this frame, `mannequin`. Returns their number.
    using Pools = std::array<SceneChange::Pool, SceneChange::kMaxPools>;
    virtual std::size_t pools_of(const FrameInput&, Pools&) const { return 0; }
    virtual GainLaw gain_law() const = 0;
    // Fills in what the model found for its last frame.
    virtual void describe(RenderedFrame&) const {}
    // Row of the effect that frames leave out from now on, although it is on; -1: none.
    virtual void leave_out(int effect) = 0;
    // Renders the same picture by the slow, obvious renderer at level 0; never flipped.
    virtual void render_reference(const FrameRequest& request,
                                  std::span<std::uint8_t> pixels,
                                  std::span<EffectCost> costs) = 0;
};

// A model before it is created.
struct ImageModelInfo {
    // Numbers at full accuracy, unless the options say otherwise.
    int (*scanlines)(const Exercise& exercise, const RenderOptions& options);
    int (*samples)(const Exercise& exercise, const RenderOptions& options);
    std::span<const char* const> effects;  // names, in order of execution
    // Thickness of the slab in which the needle shows, mm; 0: the needle's own.
    double (*needle_slab_mm)(const Exercise& exercise);
    Result<std::unique_ptr<ImageFormation>> (*create)(const FormationInput& input);
};

}  // namespace sonocase::runtime
