// SPDX-License-Identifier: Apache-2.0

// What fewer beams and samples save and cost: the points from which runtime/imaging/governor.h
// takes its levels.
//   Accuracy/LINESxSAMPLES   time: a frame of model `physical`; error_grey: root mean square
//                            difference of the picture to one of 384 x 1024, both smoothed over
//                            grain (4 mm), since speckle of another sampling is another draw;
//                            lost_detail_grey: what the picture lost of the finer one's detail, as
//                            the fall of its deviation from its own smoothed self
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "bench_scene.h"

namespace sonocase::bench {
namespace {

constexpr int kSize = 512;
using Picture = std::vector<double>;

// Running means over 2 * reach + 1 pixels, twice in each direction.
Picture smoothed(Picture p) {
    constexpr int kReach = 4;
    for (int pass = 0; pass < 4; ++pass) {
        const int along = pass % 2 == 0 ? 1 : kSize, across = kSize + 1 - along;
        Picture out(p.size());
        for (int row = 0; row < kSize; ++row) {
            for (int i = 0; i < kSize; ++i) {
                double sum = 0;
                for (int j = i - kReach; j <= i + kReach; ++j)
                    sum += p[static_cast<std::size_t>(row * across +
                                                      std::clamp(j, 0, kSize - 1) * along)];
                out[static_cast<std::size_t>(row * across + i * along)] = sum / (2 * kReach + 1);
            }
        }
        p = std::move(out);
    }
    return p;
}

double rms(const Picture& a, const Picture& b) {
    double sum = 0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
    return std::sqrt(sum / static_cast<double>(a.size()));
}

struct Look {
    Picture smooth;
    double detail = 0;
};

constexpr std::size_t kPoses = 12;

std::vector<Look> looks(runtime::Renderer& renderer) {
    std::vector<Look> out;
    std::vector<std::uint8_t> pixels(kSize * kSize);
    for (std::size_t i = 0; i < kPoses; ++i) {
        renderer.render(input_of(i, true), pixels);
        const Picture raw(pixels.begin(), pixels.end());
        Look look{smoothed(raw), 0};
        look.detail = rms(raw, look.smooth);
        out.push_back(std::move(look));
    }
    return out;
}

runtime::Renderer renderer_of(int lines, int samples) {
    RenderOptions options = options_of(ImageModel::physical);
    options.scanlines = lines;
    options.samples = samples;
    return std::move(*runtime::Renderer::create(bench_bundle(), bench_exercise(), options));
}

void accuracy(benchmark::State& state, int lines, int samples) {
    static const std::vector<Look> fine = [] {
        auto renderer = renderer_of(384, 1024);
        return looks(renderer);
    }();
    auto renderer = renderer_of(lines, samples);
    const std::vector<Look> own = looks(renderer);
    double error = 0, lost = 0;
    for (std::size_t i = 0; i < kPoses; ++i) {
        error += rms(own[i].smooth, fine[i].smooth) / kPoses;
        lost += (fine[i].detail - own[i].detail) / kPoses;
    }
    std::vector<std::uint8_t> pixels(kSize * kSize);
    std::vector<double> fastest(bench_poses().size(), 1e9);
    std::size_t i = 0;
    for (auto _ : state) {
        const auto start = std::chrono::steady_clock::now();
        renderer.render(input_of(i, true), pixels);
        const std::chrono::duration<double, std::milli> ms =
            std::chrono::steady_clock::now() - start;
        double& best = fastest[i++ % fastest.size()];
        best = std::min(best, ms.count());
    }
    double quiet = 0;
    for (const double ms : fastest) quiet += ms / static_cast<double>(fastest.size());
    state.counters["quiet_ms"] = quiet;
    state.counters["error_grey"] = error;
    state.counters["lost_detail_grey"] = lost;
    state.SetLabel(bench_bundle_name());
}

[[maybe_unused]] const bool kRegistered = [] {
    for (const int lines : {192, 160, 128, 96}) {
        for (const int samples : {512, 448, 384, 256}) {
            const std::string name =
                "Accuracy/" + std::to_string(lines) + "x" + std::to_string(samples);
            benchmark::RegisterBenchmark(
                name.c_str(),
                [lines, samples](benchmark::State& s) { accuracy(s, lines, samples); })
                ->Unit(benchmark::kMillisecond)
                ->Iterations(61 * 12);
        }
    }
    return true;
}();

}  // namespace
}  // namespace sonocase::bench
