// SPDX-License-Identifier: Apache-2.0

// The image that the probe sees: bundle + pose in, grey pixels out.
//
// Part of the portable core: no files, no clock, no blocking, memory owned by the caller, and
// neither exceptions nor allocation in render().
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/bundle/streamed_bundle.h"
#include "formats/exercise/exercise.h"

namespace sonocase::runtime {

enum class ImageModel { paper, physical };
enum class RendererKind { fast, reference };

// The knobs of the machine's console; may change between frames.
struct ImageSettings {
    double gain_db = 0;
    double dynamic_range_db = 60;
    std::array<double, 8> tgc_db{};  // sliders, near to far
    bool flip_left_right = false;
};

struct RenderOptions {
    ImageModel model = ImageModel::physical;
    RendererKind kind = RendererKind::fast;
    int width_px = 512;
    int height_px = 512;
    int threads = 1;                           // >= 1; idle workers sleep
    std::vector<std::string> effects{"auto"};  // "auto", "all", or names
    std::uint32_t seed = 1;
    // Sampling; 0 takes the model's default (paper 512 x 512, physical 192 x 512).
    int scanlines = 0;
    int samples = 0;
    // Asked-for time of a frame; 0: none, full accuracy (recordings). See
    // runtime/imaging/governor.h.
    double frame_budget_ms = 0;
    // A bundle that is unpacked as it is needed is so by one more thread, and round the scan plane
    // too, so that the next frames find theirs. For a probe in somebody's hand; the same pixels.
    bool read_ahead = false;
};

// A straight needle as drawn: after calibration and bend constraint.
struct NeedlePose {
    Point3 tip;         // `mannequin` frame
    Vector3 direction;  // unit, hub to tip
};

struct FrameInput {
    Rigid mannequin_from_probe;
    bool has_needle = false;
    NeedlePose needle;
    double time_s = 0;        // injected; drives breathing, pulsation and noise
    std::uint32_t frame = 0;  // seeds the noise
    ImageSettings settings;
};

enum class FrameStatus : std::uint8_t {
    rendered,
    held_bad_pose,  // NaN, infinite, mirrored or not orthonormal: the pixels are left as they were
    no_contact,     // rendered, and the probe touches no skin
};

struct EffectCost {
    const char* name = "";
    double ms = 0;  // in the last frame
    bool ran = false;
    const char* skipped_because = "";  // "" where it ran
};

class Renderer {
  public:
    // Compiles the plan for this bundle and exercise. The bundle must outlive the renderer.
    static Result<Renderer> create(CaseView bundle,
                                   const Exercise& exercise,
                                   const RenderOptions& options);
    ~Renderer();
    Renderer(Renderer&&) noexcept;
    Renderer& operator=(Renderer&&) noexcept;

    // pixels: # width_px * height_px, row by row from the top, [0, 255].
    FrameStatus render(const FrameInput& input, std::span<std::uint8_t> pixels);

    // Of the last frame; # effects of the model, in order of execution.
    std::span<const EffectCost> costs() const;

    // What the governor gives up at present: level 0 is full accuracy. For the screen.
    struct Accuracy {
        int level = 0, levels = 1;
        int scanlines = 0, samples = 0;  // now
        int full_scanlines = 0, full_samples = 0;
    };
    Accuracy accuracy() const;

    // Millimetres a pixel and the pixel of the probe face's middle, for scales and measuring.
    struct Layout {
        double mm_per_px = 0;
        double origin_x_px = 0;
        double origin_y_px = 0;
    };
    Layout layout() const;

  private:
    struct Impl;
    explicit Renderer(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

// Names of the effects of a model, in order of execution.
std::span<const char* const> effect_names(ImageModel model);

}  // namespace sonocase::runtime
