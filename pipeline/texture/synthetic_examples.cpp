// SPDX-License-Identifier: Apache-2.0

#include "pipeline/texture/synthetic_examples.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <complex>
#include <vector>

#include "pipeline/base/counter_random.h"

namespace sonocase::pipeline::inline texture {
namespace {

struct Appearance {
    std::string_view texture;
    double mean = 100, sd = 15;                     // grey
    double axial = 2.8, lateral = 8;                // full widths at half height of the grain, px
    double slant_rad = 0;                           // of the fibres against the horizontal
    double fibre = 0;                               // share of the contrast due to fibres
    double fibre_length = 20, fibre_thickness = 4;  // full widths, px
    double fibre_skew = 1;                          // how sparse and bright they are
};

// Widths and grey of the real patches; a name without a patch has those of a similar tissue.
// Columns: texture, mean, sd, axial, lateral, slant, fibre, its length, thickness and skew.
constexpr Appearance kAppearances[] = {
    {"liver", 110, 16, 2.8, 8.2},
    {"spleen", 101, 13, 2.4, 6.0},
    {"kidney_cortex", 80, 16, 3.0, 7.6},
    {"pancreas", 114, 22, 3.2, 6.4},
    {"gland", 92, 16, 2.8, 7.0},
    {"bowel", 98, 26, 3.4, 7.0},
    {"soft_tissue", 88, 20, 3.0, 7.4},
    {"cartilage", 66, 10, 2.2, 5.0},
    {"fluid", 15, 6, 2.0, 3.0},
    {"gas", 60, 22, 5.0, 20.0},
    {"bone", 180, 34, 3.0, 12.0},
    {"muscle", 84, 32, 3.0, 6.0, 0.16, 0.85, 20, 4.6, 1.3},
    {"fat", 86, 34, 3.0, 7.0, 0.02, 0.8, 34, 4.8, 1.2},
    {"skin", 140, 24, 3.0, 8.0, 0.0, 0.5, 26, 4.0, 0.6},
    {"fascia", 175, 36, 3.0, 10.0, 0.03, 0.8, 40, 6.0, 0.2},
    {"kidney_sinus", 135, 28, 3.2, 8.0, 0.3, 0.4, 14, 5.0, 0.6},
};

// Makes a complex Gaussian field with correlation widths along and across a direction: white noise
// on the pixels, smoothed by a Gaussian. The autocorrelation of a kernel of standard deviation s
// has the width 3.33 s.
std::vector<std::complex<double>> smooth_field(int width,
                                               int height,
                                               double along_width,
                                               double across_width,
                                               double slant_rad,
                                               std::uint64_t seed) {
    const double sa = along_width / 3.33, sc = across_width / 3.33;
    const double c = std::cos(slant_rad), s = std::sin(slant_rad);
    const int reach = static_cast<int>(std::ceil(3 * std::max(sa, sc)));
    struct Tap {
        int x, y;
        double weight;
    };
    std::vector<Tap> taps;
    double power = 0;
    for (int y = -reach; y <= reach; ++y) {
        for (int x = -reach; x <= reach; ++x) {
            const double a = (c * x + s * y) / sa, b = (c * y - s * x) / sc;
            const double w = std::exp(-0.5 * (a * a + b * b));
            if (w < 5e-3) continue;
            taps.push_back({x, y, w});
            power += w * w;
        }
    }
    const int row = width + 2 * reach;
    std::vector<std::complex<double>> noise(static_cast<std::size_t>(row) * (height + 2 * reach));
    for (std::size_t i = 0; i < noise.size(); ++i) {
        const GaussianPair z = gaussian_pair_at(seed, i);
        noise[i] = {z.a, z.b};
    }
    std::vector<std::complex<double>> field(static_cast<std::size_t>(width) * height);
    for (const Tap& tap : taps) {
        const double w = tap.weight / std::sqrt(power);
        for (int y = 0; y < height; ++y) {
            const auto* from =
                noise.data() + static_cast<std::size_t>(y + reach + tap.y) * row + (reach + tap.x);
            auto* to = field.data() + static_cast<std::size_t>(y) * width;
            for (int x = 0; x < width; ++x) to[x] += w * from[x];
        }
    }
    return field;
}

// FNV-1a, because std::hash differs between standard libraries.
std::uint64_t name_hash(std::string_view name) {
    std::uint64_t hash = 0xCBF29CE484222325ull;
    for (const char c : name) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001B3ull;
    return hash;
}

}  // namespace

ExampleImage synthetic_example(std::string_view texture,
                               int width,
                               int height,
                               std::uint64_t seed) {
    assert(width >= 8 && height >= 8);
    Appearance appearance = {texture};
    for (const Appearance& known : kAppearances) {
        if (known.texture == texture) appearance = known;
    }
    const std::uint64_t own = derive_seed(seed, name_hash(texture));
    const auto speckle =
        smooth_field(width, height, appearance.lateral, appearance.axial, 0, derive_seed(own, 1));
    std::vector<std::complex<double>> fibres;
    if (appearance.fibre > 0) {
        fibres = smooth_field(width, height, appearance.fibre_length, appearance.fibre_thickness,
                              appearance.slant_rad, derive_seed(own, 2));
    }

    ExampleImage image;
    image.name = "synthetic " + std::string(texture);
    image.width = width;
    image.height = height;
    image.grey.resize(image.count());
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            // Logarithm of a Rayleigh envelope, standardised: mean -2.51 dB, sd 5.57 dB re its
            // power.
            const double db = 10 * std::log10(0.5 * std::norm(speckle[image.index(x, y)]) + 1e-4);
            double value = std::max((db + 2.51) / 5.57, -3.0);
            if (appearance.fibre > 0) {
                const double g = fibres[image.index(x, y)].real();
                // Exponential of a Gaussian, standardised: bright fibres on a dark ground.
                const double k = appearance.fibre_skew * 0.45;
                const double f = (std::exp(k * g) - std::exp(k * k / 2)) /
                                 std::sqrt((std::exp(k * k) - 1) * std::exp(k * k));
                value = std::sqrt(1 - appearance.fibre * appearance.fibre) * value +
                        appearance.fibre * f;
            }
            image.grey[image.index(x, y)] = static_cast<float>(
                std::clamp(std::round(appearance.mean + appearance.sd * value), 0.0, 255.0));
        }
    }
    return image;
}

}  // namespace sonocase::pipeline::inline texture
