// SPDX-License-Identifier: Apache-2.0

// What a renderer is created with.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "formats/machine/machine.h"
#include "runtime/imaging/core/host.h"

namespace sonocase::runtime {

enum class ImageModel { paper, physical };
enum class RendererKind { fast, reference };

struct PhysicalTextures;  // see make_physical_textures() in renderer.h

struct RenderOptions {
    ImageModel model = ImageModel::physical;
    RendererKind kind = RendererKind::fast;
    int width_px = 512;   // [1, 8192]
    int height_px = 512;  // [1, 8192]
    int threads = 1;      // [1, 256], the caller's included; see Host
    // The machine that model physical imitates; none: `modern`, or `modern-linear` for a linear
    // probe.
    std::optional<Machine> machine;
    int looks = 0;  // averaged at all depths, [0, 16]; 0: the machine's numbers
    std::vector<std::string> effects{"auto"};  // "auto", "all", "none", NAME or -NAME
    std::uint32_t seed = 1;
    // Beams [0, 4096] and samples per beam [0, 8192]; 0 takes the model's own number (paper 512 x
    // 512; physical the machine's beams x 384 to 512, 1.85 samples to the point spread's width).
    int scanlines = 0;
    int samples = 0;
    // Longest time that a frame should take; 0: no limit, full accuracy (recordings). Needs
    // host.clock. See runtime/imaging/core/governor.h.
    double frame_budget_ms = 0;
    // True: a bundle that is unpacked block by block is also unpacked around the scan plane, by one
    // more thread, so that the next frames find their blocks. For a probe in somebody's hand; the
    // pixels are the same. Needs host.make_background.
    bool read_ahead = false;
    // Instruction set of the vectorised kernels, one of simd_targets(); "": the best. The pixels
    // are the same.
    std::string simd;
    // Null: made where the model needs them.
    std::shared_ptr<const PhysicalTextures> textures;
    Host host;
};

}  // namespace sonocase::runtime
