// SPDX-License-Identifier: Apache-2.0

#include "pipeline/texture/matched_texture.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <complex>

#include "pipeline/base/counter_random.h"
#include "pipeline/base/periodic_volume.h"
#include "pipeline/texture/spectrum/fourier.h"
#include "pipeline/texture/spectrum/torus_spectrum.h"

namespace sonocase::pipeline {
namespace {

constexpr double kPi = 3.141592653589793238463;

// Standard normal quantile by Newton's method on erfc from a logistic start: 1e-12 in five steps.
double normal_quantile(double p) {
    double z = std::log(p / (1 - p)) / 1.702;
    for (int i = 0; i < 8; ++i) {
        const double density = std::exp(-0.5 * z * z) / std::sqrt(2 * kPi);
        const double step = (0.5 * std::erfc(-z / std::sqrt(2.0)) - p) / std::max(density, 1e-12);
        z -= std::clamp(step, -0.5, 0.5);
    }
    return z;
}

// R -> rho: inverts the correlation that grey has for a given correlation of the Gaussian field.
class GreyToGaussian {
  public:
    explicit GreyToGaussian(const std::vector<float>& sorted) {
        constexpr int kNodes = 1024, kTerms = 16;
        std::array<double, kTerms + 1> c{};
        double mean = 0, square = 0;
        for (int i = 0; i < kNodes; ++i) {
            const double p = (i + 0.5) / kNodes;
            const double q =
                sorted[static_cast<std::size_t>(p * static_cast<double>(sorted.size()))];
            mean += q / kNodes;
            square += q * q / kNodes;
            // normalised Hermite polynomials h_k = He_k / sqrt(k!)
            const double z = normal_quantile(p);
            double older = 0, old = 1;
            for (int k = 1; k <= kTerms; ++k) {
                const double h =
                    (z * old - std::sqrt(k - 1.0) * older) / std::sqrt(static_cast<double>(k));
                c[static_cast<std::size_t>(k)] += q * h / kNodes;
                older = old;
                old = h;
            }
        }
        const double variance = std::max(square - mean * mean, 1e-12);
        double carried = 0;
        for (int k = 1; k <= kTerms; ++k) carried += c[k] * c[k] / variance;
        for (int i = 0; i <= kSteps; ++i) {
            const double rho = 2.0 * i / kSteps - 1;
            double power = 1, sum = 0;
            for (int k = 1; k <= kTerms; ++k) {
                power *= rho;
                sum += c[k] * c[k] / variance * power;
            }
            // What the terms left out carry is correlated only at lag 0; spread it over the rest.
            table_[static_cast<std::size_t>(i)] = sum / carried;
        }
    }
    double operator()(double r) const {
        // rising from the middle; downwards it may flatten, where -1 is the best there is
        if (r >= 0) {
            int i = kSteps / 2;
            while (i < kSteps && at(i + 1) < r) ++i;
            if (i >= kSteps) return 1;
            const double t = (r - at(i)) / std::max(at(i + 1) - at(i), 1e-12);
            return 2.0 * (i + std::clamp(t, 0.0, 1.0)) / kSteps - 1;
        }
        int i = kSteps / 2;
        while (i > 0 && at(i - 1) > r && at(i - 1) < at(i)) --i;
        if (i == 0) return -1;
        const double t = (at(i) - r) / std::max(at(i) - at(i - 1), 1e-12);
        return 2.0 * (i - std::clamp(t, 0.0, 1.0)) / kSteps - 1;
    }

  private:
    static constexpr int kSteps = 400;
    double at(int i) const { return table_[static_cast<std::size_t>(i)]; }
    std::array<double, kSteps + 1> table_{};
};

// Between autocorrelation and power spectrum on the torus, both real and even, # edge^2.
std::vector<double> torus_transform(const std::vector<double>& in, int edge, bool inverse) {
    std::vector<std::complex<double>> plane(in.begin(), in.end());
    fourier_plane(plane, edge, edge, inverse);
    std::vector<double> out(in.size());
    for (std::size_t i = 0; i < in.size(); ++i) out[i] = plane[i].real();
    return out;
}

void cut_negative(std::vector<double>& power) {  // and mean 1
    double sum = 0;
    for (double& p : power) sum += p = std::max(p, 0.0);
    for (double& p : power) p *= static_cast<double>(power.size()) / sum;
}

// How the power of each wave in the picture is spread over waves out of the picture: a share for
// every (kx, ky, kz) whose sum over kz is edge, so that planes z = const keep the picture's
// autocorrelation exactly, whatever the shares are. Chosen so that the profile across (or along)
// the main direction and the depth look alike from any side: isotropic in that plane, with the tail
// of the Matern family of the profile's width (exponential for fibres, smoother for speckle). A
// mere product of profiles would weave a plaid.
std::vector<float> depth_spectrum(const CorrelationWidths& widths, bool across, int edge) {
    const auto n = static_cast<std::size_t>(edge);
    const double angle = widths.angle_rad + (across ? kPi / 2 : 0.0);
    // correlation length from the full width at half height: exp(-r / l), or (1 + r / l) exp(-r /
    // l)
    const double width = std::max(across ? widths.across : widths.along, 0.8);
    const double length = across ? width / 1.386 : width / 3.357;
    const auto lowest = static_cast<float>(1 / (length * length));
    std::vector<float> share(n * n * n);
    const auto wave = [&](std::size_t k) {
        const int signed_k = static_cast<int>(k) - (k > n / 2 ? edge : 0);
        return 2 * kPi * signed_k / edge;
    };
    std::vector<float> kz2(n);
    for (std::size_t z = 0; z < n; ++z) kz2[z] = static_cast<float>(wave(z) * wave(z));
    for (std::size_t i = 0; i < n * n; ++i) {
        const double k = wave(i % n) * std::cos(angle) + wave(i / n) * std::sin(angle);
        const float base = lowest + static_cast<float>(k * k);
        float sum = 0;
        for (std::size_t z = 0; z < n; ++z) {
            const float q = base + kz2[z];
            const float s = 1 / (q * (across ? 1.f : q) * std::sqrt(q));
            share[z * n * n + i] = s;
            sum += s;
        }
        const float scale = static_cast<float>(edge) / sum;
        for (std::size_t z = 0; z < n; ++z) share[z * n * n + i] *= scale;
    }
    return share;
}

// Moves the cube round so that its outer faces lie where neighbouring planes differ as they do on
// average. It tessellates, so it may be cut anywhere.
void cut_at_ordinary_planes(std::vector<float>& cube, int edge) {
    const auto n = static_cast<std::size_t>(edge);
    std::array<std::size_t, 3> first{};
    const std::size_t stride[3] = {1, n, n * n};
    for (int axis = 0; axis < 3; ++axis) {
        std::vector<double> step(n, 0);
        for (std::size_t i = 0; i < cube.size(); ++i) {
            const std::size_t p = i / stride[axis] % n;
            const std::size_t next = p + 1 < n ? i + stride[axis] : i - p * stride[axis];
            step[p] += std::abs(cube[i] - cube[next]);
        }
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

double power_of(const ExampleImage& image) {
    double count = 0, mean = 0, power = 0;
    for (std::size_t i = 0; i < image.count(); ++i) {
        if (image.used(i)) count += 1, mean += image.grey[i];
    }
    mean /= std::max(count, 1.0);
    for (std::size_t i = 0; i < image.count(); ++i) {
        if (image.used(i)) power += (image.grey[i] - mean) * (image.grey[i] - mean);
    }
    return power;
}

}  // namespace

MatchedTexture synthesise_matched(std::span<const ExampleImage> examples,
                                  int edge,
                                  std::uint64_t seed,
                                  const MatchedOptions& options) {
    assert(!examples.empty() && edge >= 8 && edge <= 128 && (edge & (edge - 1)) == 0);
    const auto n = static_cast<std::size_t>(edge);
    const int half = edge / 2;
    std::vector<float> sorted;
    for (const ExampleImage& image : examples) {
        for (std::size_t i = 0; i < image.count(); ++i) {
            if (image.used(i)) sorted.push_back(image.grey[i]);
        }
    }
    std::sort(sorted.begin(), sorted.end());

    // How many pixels a voxel must stand for.
    std::vector<ExampleImage> whole, local;
    for (const ExampleImage& image : examples) {
        local.push_back(without_local_trend(image, kGrainTrendPx));
    }
    constexpr int kMostPixels = 4;
    Autocorrelation grain = autocorrelation(local, kMostPixels * half);
    MatchedTexture out;
    // ... so that the grain fits along its length, and is still 1.8 voxels thick.
    const CorrelationWidths full = correlation_widths(through_window(grain, grain));
    while (out.pixels_per_voxel < kMostPixels && full.along > 0.5 * edge * out.pixels_per_voxel &&
           full.across >= 1.8 * (out.pixels_per_voxel + 1)) {
        ++out.pixels_per_voxel;
    }
    const int stride = out.pixels_per_voxel;

    // Shading longer than the period cannot be in a texture that repeats.
    double whole_power = 0, local_power = 0;
    for (std::size_t i = 0; i < examples.size(); ++i) {
        whole.push_back(without_local_trend(examples[i], half * stride));
        whole_power += power_of(whole.back());
        local_power += power_of(local[i]);
    }
    grain = at_stride(grain, stride);
    const Autocorrelation grey = at_stride(autocorrelation(whole, half * stride), stride);
    const CorrelationWidths widths = correlation_widths(through_window(grain, grain));
    const GreyToGaussian to_gaussian(sorted);
    const double share = whole_power > 0 ? local_power / whole_power : 0;
    const std::vector<double> wanted = torus_transform(
        fit_torus_spectrum(grey, grain, share, kGrainTrendPx / stride, edge), edge, true);
    std::vector<double> rho(wanted.size());
    for (std::size_t i = 0; i < rho.size(); ++i) rho[i] = to_gaussian(wanted[i]);

    const std::vector<float> depth_share =
        depth_spectrum(widths, options.third_axis == ThirdAxis::across, edge);

    // the phases of white noise
    const std::size_t count = n * n * n;
    std::vector<std::complex<float>> noise(count);
    const std::uint64_t stream = derive_seed(seed, 0x3A7C);
    for (std::size_t i = 0; i < count; i += 2) {
        const GaussianPair z = gaussian_pair_at(stream, i / 2);
        noise[i] = static_cast<float>(z.a);
        noise[i + 1] = static_cast<float>(z.b);
    }
    fourier_cube(noise, edge, false);
    for (std::complex<float>& f : noise) {
        const float size = std::sqrt(std::norm(f));
        f = size > 0 ? f / size : 1.f;
    }

    std::vector<float>& cube = out.grey;
    cube.resize(count);
    std::vector<std::complex<float>> field(count);
    for (int round = 0;; ++round) {
        std::vector<double> power = torus_transform(rho, edge, false);
        cut_negative(power);
        for (std::size_t z = 0; z < n; ++z) {
            for (std::size_t i = 0; i < n * n; ++i) {
                field[z * n * n + i] =
                    noise[z * n * n + i] *
                    std::sqrt(static_cast<float>(power[i]) * depth_share[z * n * n + i]);
            }
        }
        field[0] = 0;  // a mean has no place in a histogram that is matched by rank
        fourier_cube(field, edge, true);
        for (std::size_t i = 0; i < count; ++i) cube[i] = field[i].real();
        match_distribution(cube, sorted);
        if (round >= options.corrections) break;
        const Autocorrelation got = plane_autocorrelation(cube, edge, half);
        for (int y = -half; y < half; ++y) {
            for (int x = -half; x < half; ++x) {
                const std::size_t i = static_cast<std::size_t>((x + edge) % edge) +
                                      n * static_cast<std::size_t>((y + edge) % edge);
                rho[i] = std::clamp(rho[i] + to_gaussian(wanted[i]) - to_gaussian(got.at(x, y)),
                                    -0.999, 0.9999);
            }
        }
        rho[0] = 1;
    }
    cut_at_ordinary_planes(cube, edge);
    return out;
}

}  // namespace sonocase::pipeline
