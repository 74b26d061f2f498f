// SPDX-License-Identifier: Apache-2.0

// The exercise, options and inputs that all frame benchmarks share.
#pragma once

#include <string>
#include <vector>

#include "bench_bundle.h"
#include "runtime/imaging/renderer.h"
#include "runtime/workers/thread_host.h"

namespace sonocase::bench {

using runtime::ImageModel;
using runtime::RendererKind;
using runtime::RenderOptions;

inline Exercise bench_exercise() {
    Exercise e;
    e.name = "bench";
    e.probe.depth_mm = 150;
    e.needle.gauge = 18;
    return e;
}

inline RenderOptions options_of(ImageModel model,
                                std::vector<std::string> effects = {"auto"},
                                int threads = 1,
                                int size = 512) {
    RenderOptions o;
    o.model = model;
    o.effects = std::move(effects);
    o.threads = threads;
    o.width_px = o.height_px = size;
    static const auto textures = runtime::make_physical_textures();  // as the player has them
    o.textures = textures;
    o.host = runtime::thread_host();
    return o;
}

inline runtime::FrameInput input_of(std::size_t i, bool needle) {
    runtime::FrameInput input;
    input.mannequin_from_probe = bench_poses()[i % bench_poses().size()];
    input.frame = static_cast<std::uint32_t>(i);
    input.time_s = static_cast<double>(i) / 60;
    if (needle) {  // in the plane, slanting across it
        input.has_needle = true;
        input.needle.tip = input.mannequin_from_probe * Point3{15, 0, 70};
        input.needle.direction =
            input.mannequin_from_probe.rotation * normalized(Vector3{0.7, 0, 0.7});
    }
    return input;
}

}  // namespace sonocase::bench
