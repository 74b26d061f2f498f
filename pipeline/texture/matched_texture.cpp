// SPDX-License-Identifier: Apache-2.0

#include "pipeline/texture/matched_texture.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <complex>

#include "pipeline/base/counter_random.h"
#include "pipeline/base/periodic_volume.h"
#include "pipeline/texture/grey_to_gaussian.h"
#include "pipeline/texture/spectrum/depth_spectrum.h"
#include "pipeline/texture/spectrum/fourier.h"
#include "pipeline/texture/spectrum/local_trend.h"
#include "pipeline/texture/spectrum/torus_spectrum.h"

namespace sonocase::pipeline {
namespace {

constexpr int kMostPixels = 4;  // per voxel

// Between autocorrelation and power spectrum on the torus, both real and even, # edge^2.
std::vector<double> torus_transform(const std::vector<double>& in, int edge, bool inverse) {
    std::vector<std::complex<double>> plane(in.begin(), in.end());
    fourier_plane(plane, edge, edge, inverse);
    std::vector<double> out(in.size());
    for (std::size_t i = 0; i < in.size(); ++i) out[i] = plane[i].real();
    return out;
}

// Cuts negative power off and brings the mean to 1.
void cut_negative(std::vector<double>& power) {
    double sum = 0;
    for (double& p : power) sum += p = std::max(p, 0.0);
    for (double& p : power) p *= static_cast<double>(power.size()) / sum;
}

// What the cube must show.
struct Wanted {
    std::vector<float> sorted;  // grey values, ascending
    int pixels_per_voxel = 1;
    std::vector<double> correlation;  // of grey on the torus, # edge^2
    CorrelationWidths widths;         // of the grain, voxels
};

// Pixels that a voxel must stand for, such that the grain fits along its length and is still 1.8
// voxels thick. grain: to kMostPixels times half an edge.
int pixels_per_voxel(const Autocorrelation& grain, int edge) {
    const CorrelationWidths full = correlation_widths(through_window(grain, grain));
    int pixels = 1;
    while (pixels < kMostPixels && full.along > 0.5 * edge * pixels &&
           full.across >= 1.8 * (pixels + 1)) {
        ++pixels;
    }
    return pixels;
}

Wanted measure(std::span<const ExampleImage> examples, int edge) {
    const int half = edge / 2;
    Wanted out;
    std::vector<ExampleImage> whole, local;
    for (const ExampleImage& image : examples) {
        const std::vector<float> grey = used_grey(image);
        out.sorted.insert(out.sorted.end(), grey.begin(), grey.end());
        local.push_back(without_local_trend(image, kGrainTrendPx));
    }
    std::sort(out.sorted.begin(), out.sorted.end());
    Autocorrelation grain = autocorrelation(local, kMostPixels * half);
    const int stride = out.pixels_per_voxel = pixels_per_voxel(grain, edge);

    // A texture that repeats cannot have shading longer than its period.
    double whole_power = 0, local_power = 0;
    for (std::size_t i = 0; i < examples.size(); ++i) {
        whole.push_back(without_local_trend(examples[i], half * stride));
        whole_power += grey_moments(whole.back()).squares;
        local_power += grey_moments(local[i]).squares;
    }
    grain = at_stride(grain, stride);
    const Autocorrelation grey = at_stride(autocorrelation(whole, half * stride), stride);
    out.widths = correlation_widths(through_window(grain, grain));
    const double share = whole_power > 0 ? local_power / whole_power : 0;
    out.correlation = torus_transform(
        fit_torus_spectrum(grey, grain, share, kGrainTrendPx / stride, edge), edge, true);
    return out;
}

// The Fourier transform of white noise with every amplitude set to 1. # edge^3
std::vector<std::complex<float>> random_phases(int edge, std::uint64_t seed) {
    const auto n = static_cast<std::size_t>(edge);
    std::vector<std::complex<float>> noise(n * n * n);
    const std::uint64_t stream = derive_seed(seed, 0x3A7C);
    for (std::size_t i = 0; i < noise.size(); i += 2) {
        const GaussianPair z = gaussian_pair_at(stream, i / 2);
        noise[i] = static_cast<float>(z.a);
        noise[i + 1] = static_cast<float>(z.b);
    }
    fourier_cube(noise, edge, false);
    for (std::complex<float>& f : noise) {
        const float size = std::sqrt(std::norm(f));
        f = size > 0 ? f / size : 1.f;
    }
    return noise;
}

// Moves the cube cyclically such that its outer faces are where neighbouring planes differ as they
// do on average; it wraps, and may be cut anywhere.
void cut_at_ordinary_planes(std::vector<float>& cube, int edge) {
    const auto n = static_cast<std::size_t>(edge);
    std::array<std::size_t, 3> first{};
    for (int axis = 0; axis < 3; ++axis) {
        const std::vector<double> step = steps_between_planes<float>(cube, edge, axis);
        double mean = 0;
        for (const double s : step) mean += s / static_cast<double>(n);
        std::size_t best = n - 1;
        for (std::size_t p = 0; p < n; ++p) {
            if (std::abs(step[p] - mean) < std::abs(step[best] - mean)) best = p;
        }
        first[static_cast<std::size_t>(axis)] = (best + 1) % n;
    }
    std::vector<float> moved(cube.size());
    for (std::size_t z = 0; z < n; ++z) {
        for (std::size_t y = 0; y < n; ++y) {
            const float* row = cube.data() + n * ((y + first[1]) % n + n * ((z + first[2]) % n));
            float* to = moved.data() + n * (y + n * z);
            std::copy(row + first[0], row + n, to);
            std::copy(row, row + first[0], to + (n - first[0]));
        }
    }
    cube.swap(moved);
}

}  // namespace

MatchedTexture synthesise_matched(std::span<const ExampleImage> examples,
                                  int edge,
                                  std::uint64_t seed,
                                  const MatchedOptions& options) {
    assert(!examples.empty() && edge >= 8 && edge <= 128 && (edge & (edge - 1)) == 0);
    const auto n = static_cast<std::size_t>(edge);
    const int half = edge / 2;
    const Wanted wanted = measure(examples, edge);
    const GreyToGaussian to_gaussian(wanted.sorted);
    std::vector<double> rho(wanted.correlation.size());
    for (std::size_t i = 0; i < rho.size(); ++i) rho[i] = to_gaussian(wanted.correlation[i]);
    const std::vector<float> depth_share =
        depth_spectrum(wanted.widths, options.third_axis == ThirdAxis::across, edge);
    const std::vector<std::complex<float>> phases = random_phases(edge, seed);

    MatchedTexture out;
    out.pixels_per_voxel = wanted.pixels_per_voxel;
    std::vector<float>& cube = out.grey;
    cube.resize(phases.size());
    std::vector<std::complex<float>> field(phases.size());
    for (int round = 0;; ++round) {
        std::vector<double> power = torus_transform(rho, edge, false);
        cut_negative(power);
        for (std::size_t z = 0; z < n; ++z) {
            for (std::size_t i = 0; i < n * n; ++i) {
                field[z * n * n + i] =
                    phases[z * n * n + i] *
                    std::sqrt(static_cast<float>(power[i]) * depth_share[z * n * n + i]);
            }
        }
        field[0] = 0;  // the histogram is matched by rank, and a mean would have no effect on it
        fourier_cube(field, edge, true);
        for (std::size_t i = 0; i < cube.size(); ++i) cube[i] = field[i].real();
        match_distribution(cube, wanted.sorted);
        if (round >= options.corrections) break;
        const Autocorrelation got = plane_autocorrelation(cube, edge, half);
        for (int y = -half; y < half; ++y) {
            for (int x = -half; x < half; ++x) {
                const std::size_t i = torus_index(x, y, edge);
                rho[i] = std::clamp(
                    rho[i] + to_gaussian(wanted.correlation[i]) - to_gaussian(got.at(x, y)), -0.999,
                    0.9999);
            }
        }
        rho[0] = 1;
    }
    cut_at_ordinary_planes(cube, edge);
    return out;
}

}  // namespace sonocase::pipeline
