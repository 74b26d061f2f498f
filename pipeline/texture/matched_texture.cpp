// SPDX-License-Identifier: Apache-2.0

#include "pipeline/texture/matched_texture.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <complex>
#include <cstddef>
#include <vector>

#include "formats/base/constants.h"
#include "pipeline/base/counter_random.h"
#include "pipeline/base/periodic_volume.h"
#include "pipeline/texture/autocorrelation.h"
#include "pipeline/texture/fourier.h"

namespace sonocase::pipeline::inline texture {

namespace {

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

// Finds the correlation of the Gaussian field behind grey values from theirs.
//
// Grey is q(g), an ascending function of a Gaussian field g. If two values of g have the
// correlation rho, their grey values have the correlation
//
//     R(rho) = sum_k c_k^2 rho^k / sum_k c_k^2,   c_k = E[q(g) h_k(g)]
//
// with the normalised Hermite polynomials h_k = He_k / sqrt(k!), k >= 1. This is the inverse of R.
// Source: translation of Gaussian fields (M. Grigoriu, Applied Non-Gaussian Processes, 1995).
class GreyToGaussian {
  public:
    // sorted: the grey values that q takes, ascending, not empty. 16 terms.
    explicit GreyToGaussian(const std::vector<float>& sorted);

    // rho of R in [-1, 1]; where R(rho) does not reach as far down, the nearest rho.
    double operator()(double r) const;

  private:
    static constexpr int kSteps = 400;
    double at(int i) const { return table_[i]; }
    std::array<double, kSteps + 1> table_{};  // R at rho = 2 i / kSteps - 1
};

GreyToGaussian::GreyToGaussian(const std::vector<float>& sorted) {
    constexpr int kNodes = 1024, kTerms = 16;
    std::array<double, kTerms + 1> c{};
    double mean = 0, square = 0;
    for (int i = 0; i < kNodes; ++i) {
        const double p = (i + 0.5) / kNodes;
        const double q = sorted[static_cast<std::size_t>(p * static_cast<double>(sorted.size()))];
        mean += q / kNodes;
        square += q * q / kNodes;
        // normalised Hermite polynomials h_k = He_k / sqrt(k!)
        const double z = normal_quantile(p);
        double older = 0, old = 1;
        for (int k = 1; k <= kTerms; ++k) {
            const double h =
                (z * old - std::sqrt(k - 1.0) * older) / std::sqrt(static_cast<double>(k));
            c[k] += q * h / kNodes;
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
        // Variance of the terms left out is correlated only at lag 0; it is spread over the others.
        table_[i] = sum / carried;
    }
}

double GreyToGaussian::operator()(double r) const {
    // Ascending from the middle. Downwards R may become flat, and then rho = -1 is the nearest.
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

// Returns the shares that extend the spectrum of a picture to a cube.
//
// The power of each wave in the picture is spread over waves out of the picture: a share for every
// (kx, ky, kz). The shares of a (kx, ky) add up to `edge`, and planes z = const therefore keep the
// picture's autocorrelation exactly, whatever the shares are. They are chosen such that the profile
// across (or along) the main direction and the profile in depth look alike from any side: isotropic
// in that plane, with the tail of the Matern family of the profile's width (exponential for fibres,
// smoother for speckle). A product of two profiles would look woven.
//
// widths: in voxels. across: depth looks like the profile across the main direction, else along it.
// Returns # edge^3, x fastest.
std::vector<float> depth_spectrum(const CorrelationWidths& widths, bool across, int edge) {
    const std::size_t n = edge;
    const double angle = widths.angle_rad + (across ? kPi / 2 : 0.0);
    // Correlation length from the full width at half height: of exp(-r / l), or of
    // (1 + r / l) exp(-r / l).
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

constexpr double kContour = 7;   // extra weight of lags near the half-height contour
constexpr double kZeroLag = 60;  // weight of lag 0

struct Term {
    std::vector<double> wanted, weight;  // # edge^2: per lag on the torus
};

Term term_of(const Autocorrelation& wanted, double scale, double strength, int edge) {
    const std::size_t n = edge;
    const int half = edge / 2;
    const CorrelationWidths widths = correlation_widths(wanted);
    const double radius = std::clamp(0.75 * widths.along + 2, 3.0, 0.95 * half);
    Term term{std::vector<double>(n * n), std::vector<double>(n * n)};
    for (int y = -half; y < half; ++y) {
        for (int x = -half; x < half; ++x) {
            const std::size_t i = torus_index(x, y, edge);
            const bool known = std::abs(x) <= wanted.reach && std::abs(y) <= wanted.reach;
            term.wanted[i] = known ? scale * wanted.at(x, y) : 0;
            const double r = std::hypot(x, y) / radius;
            // Weighted by the example's window, like the widths, which are read from the
            // half-height contour.
            const double window = known ? wanted.window(x, y) : 0;
            const double near_half = known ? (window * wanted.at(x, y) - 0.5) / 0.1 : 9;
            const double contour = 1 + kContour * std::exp(-near_half * near_half);
            term.weight[i] = strength * std::max(window * window, 0.003) *
                             (r < 1 ? contour : std::max(std::exp(-4 * (r - 1) * (r - 1)), 0.02));
        }
    }
    // Variance added as white noise would affect this lag alone, but lower all correlations.
    term.weight[0] = strength * kZeroLag;
    return term;
}

// Returns the power spectrum of a square that wraps whose autocorrelation comes nearest to a given
// one.
//
// An autocorrelation estimated from a finite patch is in general not that of any texture that
// wraps: cut off at half the period, its spectrum has negative values. This finds the nearest
// spectrum S >= 0:
//
//     minimise  0.3 |W (A S - whole)|^2 + 3 |W' (A G S - share * local)|^2,   S >= 0
//
// A      inverse Fourier transform, from spectrum to autocorrelation on the torus
// G      power gain of removing the local trend of standard deviation trend_vx; with it the grain
//        comes out right both with and without the shading of the patch
// W, W'  1 within the width of the grain, decreasing beyond, where an estimate is mostly noise
// share  variance of the local image over that of the whole image
//
// The problem is convex and solved by accelerated projected gradients (FISTA), `iterations` >= 1.
// Returns S, # edge^2, x fastest, of mean 1 (variance 1). Cost: 64 x 64, 200 iterations 50 ms.
std::vector<double> fit_torus_spectrum(const Autocorrelation& whole,
                                       const Autocorrelation& local,
                                       double share,
                                       double trend_vx,
                                       int edge,
                                       int iterations = 200) {
    const std::size_t n = edge;
    const std::size_t count = n * n;
    const Term a = term_of(whole, 1, 0.03, edge);
    const Term b = term_of(local, share, 3, edge);
    std::vector<double> gain = local_trend_gain(edge, trend_vx);  // of amplitudes
    for (double& g : gain) g *= g;
    // Both terms in one transform: `whole` in the real part, `local` in the imaginary part. Their
    // spectra are even: the autocorrelations are real, and so are the transforms of the residuals.
    std::vector<double> s(count, 1), before = s, leap = s;
    std::vector<std::complex<double>> plane(count);
    double momentum = 1;
    const double step = 1.0 / (3.03 * kZeroLag);  // 1 / (largest weight of a + that of b)
    for (int iteration = 0; iteration < iterations; ++iteration) {
        for (std::size_t i = 0; i < count; ++i) plane[i] = {leap[i], leap[i] * gain[i]};
        fourier_plane(plane, edge, edge, true);
        for (std::size_t i = 0; i < count; ++i) {
            plane[i] = {a.weight[i] * (plane[i].real() - a.wanted[i]),
                        b.weight[i] * (plane[i].imag() - b.wanted[i])};
        }
        fourier_plane(plane, edge, edge, false);
        before.swap(s);
        for (std::size_t i = 0; i < count; ++i) {
            s[i] = std::max(leap[i] - step * (plane[i].real() + gain[i] * plane[i].imag()), 0.0);
        }
        const double next = 0.5 * (1 + std::sqrt(1 + 4 * momentum * momentum));
        for (std::size_t i = 0; i < count; ++i) {
            leap[i] = s[i] + (momentum - 1) / next * (s[i] - before[i]);
        }
        momentum = next;
    }
    double sum = 0;
    for (const double v : s) sum += v;
    for (double& v : s) v *= static_cast<double>(count) / sum;
    return s;
}

constexpr int kMaxPixels = 4;  // per voxel

// Transforms between autocorrelation and power spectrum on the torus, both real and even, # edge^2.
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

// Returns the pixels that a voxel must stand for, such that the grain fits along its length and is
// still 1.8 voxels thick. grain: to kMaxPixels times half an edge.
int pixels_per_voxel(const Autocorrelation& grain, int edge) {
    const CorrelationWidths full = correlation_widths(through_window(grain, grain));
    int pixels = 1;
    while (pixels < kMaxPixels && full.along > 0.5 * edge * pixels &&
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
    Autocorrelation grain = autocorrelation(local, kMaxPixels * half);
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

// Returns the Fourier transform of white noise with every amplitude set to 1. # edge^3
std::vector<std::complex<float>> random_phases(int edge, std::uint64_t seed) {
    const std::size_t n = edge;
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
    const std::size_t n = edge;
    std::array<std::size_t, 3> first{};
    for (int axis = 0; axis < 3; ++axis) {
        const std::vector<double> step = steps_between_planes<float>(cube, edge, axis);
        double mean = 0;
        for (const double s : step) mean += s / static_cast<double>(n);
        std::size_t best = n - 1;
        for (std::size_t p = 0; p < n; ++p) {
            if (std::abs(step[p] - mean) < std::abs(step[best] - mean)) best = p;
        }
        first[axis] = (best + 1) % n;
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
    const std::size_t n = edge;
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
    for (int pass = 0;; ++pass) {
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
        if (pass >= options.corrections) break;
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

}  // namespace sonocase::pipeline::inline texture
