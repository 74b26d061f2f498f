// SPDX-License-Identifier: Apache-2.0

// The image that the probe sees: bundle and pose in, grey pixels out. This is the one header of
// runtime/imaging for the rest of the program.
//
// Part of the portable core: no files, no clock and no thread of its own (the program lends them,
// see Host), memory owned by the caller; render() neither throws, allocates nor blocks.
// Frames: `mannequin` is the bundle's own; see docs/frames-and-units.md. What each image model
// does: docs/effects.md.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/bundle/case_bundle.h"
#include "formats/exercise/exercise.h"
#include "runtime/imaging/core/frame_input.h"
#include "runtime/imaging/core/render_options.h"

namespace sonocase::runtime {

struct RenderedFrame;  // runtime/imaging/core/image_formation.h

class Renderer {
  public:
    // Lays out the bundle for this exercise and these options. The bundle must outlive the
    // renderer. Errors: options out of range, a probe that scans no area, an unknown effect or
    // instruction set, a bundle without what the model needs. Cost: some tens of ms.
    static Result<Renderer> create(CaseView bundle,
                                   const Exercise& exercise,
                                   const RenderOptions& options);
    ~Renderer();
    Renderer(Renderer&&) noexcept;
    Renderer& operator=(Renderer&&) noexcept;

    // pixels: # width_px * height_px, row by row from the top, [0, 255]. Cost: 0.5 to 2 ms at
    // 512 x 512 pixels; the reference renderer takes seconds.
    FrameStatus render(const FrameInput& input, std::span<std::uint8_t> pixels);

    // Presses the probe as render() of this input will, so that at_rest(), current_position(),
    // closed() and press() already describe that frame: a needle finds its layers before it is
    // drawn. render() does not solve again. A pose that is not rigid changes nothing.
    void press_probe(const FrameInput& input);

    // From the next frame on, the effect of this row of effect_names() is left out although it is
    // on; -1: none is. So a picture with and one without it come from the same memory.
    void leave_out(int effect);

    // Costs of the last frame: one per effect of the model, in order of execution.
    std::span<const EffectCost> costs() const;

    // What the probe did to the tissue in the last frame.
    const PressReport& press() const;
    // For the last frame, in the frame `mannequin`: where the tissue that is at a place lies at
    // rest, where tissue from a place at rest is now, and whether a place at rest lies in a
    // collapsed vein. Without pressing: the place itself, and false. Cost: 2 us, 80 us, 1 us.
    Point3 at_rest(Point3 now) const;
    Point3 current_position(Point3 rest) const;
    bool closed(Point3 rest) const;
    // The depth of pressing, [0, 40] mm, at which the force on a face at this pose is `force_n`:
    // force rises with depth. start_mm: a first guess. Solves at most six times: 2 ms. Returns 0
    // without the effect.
    double press_mm_for(const Rigid& mannequin_from_probe, double force_n, double start_mm);

    // Pose of the face in the last frame: the input's pose, pressed, and held back by bone.
    const Rigid& shown_pose() const;

    // What it found for the last frame, for the truth of that frame; nothing unless that frame was
    // of this input at full accuracy. Pools are left to the truth, which places them itself.
    std::optional<RenderedFrame> rendered(const FrameInput& input) const;

    // What a frame budget gives up at present; level 0 is full accuracy.
    struct Accuracy {
        int level = 0, levels = 1;
        int scanlines = 0, samples = 0;  // now
        int full_scanlines = 0, full_samples = 0;
    };
    Accuracy accuracy() const;

    // Millimetres per pixel and the pixel of the middle of the probe's face, for scales and
    // measuring.
    struct Layout {
        double mm_per_px = 0;
        double origin_x_px = 0;
        double origin_y_px = 0;
    };
    Layout layout() const;
    GainLaw gain_law() const;

  private:
    struct Impl;
    explicit Renderer(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

// Names of the effects of a model, in order of execution.
std::span<const char* const> effect_names(ImageModel model);

// Names of the instruction sets that this machine and this build have, best first.
std::vector<std::string> simd_targets();

// The textures of model `physical` that depend on nothing: roughness of surfaces, strands of
// muscle, septa of fat. Give the same ones to every renderer that is created, or have them made on
// another thread while a bundle is being read. Cost: about 20 ms.
std::shared_ptr<const PhysicalTextures> make_physical_textures();

}  // namespace sonocase::runtime
