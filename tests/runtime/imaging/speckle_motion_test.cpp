// SPDX-License-Identifier: Apache-2.0

// Speckle that moves with the tissue. The limits come from a sweep over a real liver
// (docs/realism.md): correlation of 48 x 48 pixels of detail against movement of the scan plane.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "formats/machine/machine.h"
#include "imaging_support.h"
#include "support/hard_case.h"

namespace sonocase::runtime {
namespace {

using testing::HardCase;

using namespace sonocase::testing;

constexpr int kWidth = 764, kHeight = 617, kPatch = 48;

// A liver that fills the fan, as far as the probe moves.
const CaseBundle& liver() {
    static const CaseBundle bundle = liver_alone({-80, -20, -25}, {80, 20, 130}, 2);
    return bundle;
}

using Plane = std::vector<double>;

// The Gaussian mean of 12 pixels of a picture of `width` columns along its rows, turned over: rows
// of the picture become columns.
Plane row_means_turned(const Plane& in, std::size_t width, std::size_t height) {
    constexpr int kReach = 36;
    constexpr double kSigma = 12;
    double sum = 0;
    std::array<double, 2 * kReach + 1> taps;
    for (int j = -kReach; j <= kReach; ++j)
        sum += taps[static_cast<std::size_t>(j + kReach)] =
            std::exp(-0.5 * j * j / kSigma / kSigma);
    for (double& tap : taps) tap /= sum;
    Plane out(in.size()), mean(width), row(width + 2 * kReach);
    for (std::size_t y = 0; y < height; ++y) {
        const double* from = in.data() + y * width;
        std::fill_n(row.begin(), kReach, from[0]);
        std::copy_n(from, width, row.begin() + kReach);
        std::fill_n(row.end() - kReach, kReach, from[width - 1]);
        std::fill(mean.begin(), mean.end(), 0.0);
        for (std::size_t j = 0; j < taps.size(); ++j) {
            const double *shifted = row.data() + j, tap = taps[j];
            double* to = mean.data();
            for (std::size_t x = 0; x < width; ++x) to[x] += tap * shifted[x];
        }
        for (std::size_t x = 0; x < width; ++x) out[x * height + y] = mean[x];
    }
    return out;
}

// A picture less its Gaussian mean.
Plane detail_of(const std::vector<std::uint8_t>& pixels) {
    Plane grey(pixels.begin(), pixels.end());
    const Plane mean = row_means_turned(row_means_turned(grey, kWidth, kHeight), kHeight, kWidth);
    for (std::size_t i = 0; i < grey.size(); ++i) grey[i] -= mean[i];
    return grey;
}

class Sweep {
  public:
    explicit Sweep(RenderOptions options = {},
                   Exercise exercise = sweep_exercise(),
                   const CaseBundle& bundle = liver()) {
        options.width_px = kWidth;
        options.height_px = kHeight;
        probe_ = exercise.probe;
        renderer_.emplace(std::move(*Renderer::create(bundle, exercise, options)));
        pixels_.resize(kWidth * kHeight);
    }
    Plane detail(const Rigid& pose, double time_s = 0, std::uint32_t frame = 0) {
        FrameInput input;
        input.mannequin_from_probe = pose;
        input.time_s = time_s;
        input.frame = frame;
        renderer_->render(input, pixels_);
        return detail_of(pixels_);
    }
    const std::vector<std::uint8_t>& pixels() const { return pixels_; }
    // Mean of the best correlation of each patch whose middle lies so deep, the shift in the plane
    // searched about how far the probe moved along its face.
    double correlation(
        const Plane& a, const Plane& b, double from_mm, double to_mm, double moved_mm = 0) const {
        const auto layout = renderer_->layout();
        double sum = 0;
        int n = 0;
        for (int y = 0; y + kPatch < kHeight; y += kPatch / 2) {
            const double z = (y + kPatch / 2 - layout.origin_y_px) * layout.mm_per_px;
            for (int x = kPatch; x + 2 * kPatch < kWidth; x += kPatch) {
                const double across = (x + kPatch / 2 - layout.origin_x_px) * layout.mm_per_px;
                if (!within(across, z, from_mm, to_mm)) continue;
                sum += best_of(a, b, x, y, static_cast<int>(moved_mm / layout.mm_per_px));
                ++n;
            }
        }
        EXPECT_GT(n, 0);
        return sum / n;
    }

  private:
    bool within(double across, double z, double from_mm, double to_mm) const {
        if (probe_.shape == ProbeShape::linear)
            return z >= from_mm && z <= to_mm && std::abs(across) < 0.35 * probe_.width_mm;
        const double radius = probe_.shape == ProbeShape::phased ? 0 : probe_.radius_mm;
        const double r = std::hypot(across, z + radius) - radius;
        return r >= from_mm && r <= to_mm && std::abs(across) <= 0.35 * (z + radius);
    }
    static double best_of(const Plane& a, const Plane& b, int x, int y, int moved_px) {
        constexpr double n = kPatch * kPatch;
        const auto at = [](const Plane& of, int column, int row) {
            return of.data() + row * kWidth + column;
        };
        const auto sum_of = [](const double* p) {
            double sum = 0;
            for (int j = 0; j < kPatch; ++j, p += kWidth) {
                for (int i = 0; i < kPatch; ++i) sum += p[i];
            }
            return sum;
        };
        const auto product_of = [](const double* p, const double* q) {
            double sum = 0;
            for (int j = 0; j < kPatch; ++j, p += kWidth, q += kWidth) {
                for (int i = 0; i < kPatch; ++i) sum += p[i] * q[i];
            }
            return sum;
        };
        const double* first = at(a, x, y);
        const double sa = sum_of(first), aa = product_of(first, first);
        double best = -1;
        for (int dy = -4; dy <= 4; ++dy) {
            for (int dx = -4 - moved_px; dx <= 4 - moved_px; ++dx) {
                const double* second = at(b, x + dx, y + dy);
                const double sb = sum_of(second), bb = product_of(second, second);
                best = std::max(best, (product_of(first, second) - sa * sb / n) /
                                          std::sqrt((aa - sa * sa / n) * (bb - sb * sb / n)));
            }
        }
        return best;
    }

    Probe probe_;
    std::optional<Renderer> renderer_;
    std::vector<std::uint8_t> pixels_;
};

// Movement along the probe's own axes.
Rigid moved(const Rigid& pose, Vector3 by_mm) {
    return {pose.rotation, pose.translation + pose.rotation * by_mm};
}

Rigid turned(Vector3 axis, double degrees) {
    return {rotation_about(normalized(axis), degrees * kRadPerDeg), {0, 0, 0}};
}

TEST(SpeckleMotion, AcrossTheSliceItFadesAsALivingLiverDoes) {
    Sweep sweep;
    // Level, and where two axes of the scatterers' lattice share the tissue.
    for (const Rigid& pose : {Rigid{}, turned({0, 0, 1}, 20), turned({0.3, 0.2, 1}, 27)}) {
        const Plane still = sweep.detail(pose);
        const struct {
            double mm, least;
        } limits[] = {{0.2, 0.85}, {0.4, 0.75}, {0.6, 0.65}, {0.9, 0.50}, {1.5, 0.25}};
        double half_mm = 0;
        for (const auto& limit : limits) {
            for (const double depth : {35, 52, 70}) {
                const double c = sweep.correlation(
                    still, sweep.detail(moved(pose, {0, limit.mm, 0})), depth, depth + 18);
                std::printf("%.1f mm across the slice, %2.0f mm deep: %.2f\n", limit.mm, depth, c);
                EXPECT_GE(c, limit.least);
                if (c > 0.5) half_mm = std::max(half_mm, limit.mm);
            }
        }
        EXPECT_GE(half_mm, 0.8);
        EXPECT_LT(sweep.correlation(still, sweep.detail(moved(pose, {0, 2.2, 0})), 35, 88), 0.5);
        EXPECT_LT(sweep.correlation(still, sweep.detail(moved(pose, {0, 6, 0})), 35, 88), 0.3);
    }
}

TEST(SpeckleMotion, AlongTheFaceAndInDepthAFractionOfABeamKeepsIt) {
    Sweep sweep;
    for (const Rigid& pose : {Rigid{}, turned({0, 1, 0}, 30), turned({0.3, 0.2, 1}, 27),
                              turned({0, 0, 1}, 90), turned({1, 1, 0}, 25)}) {
        const Plane still = sweep.detail(pose);
        const struct {
            Vector3 by_mm;
            double least;
        } limits[] = {
            {{0.2, 0, 0}, 0.85}, {{0.4, 0, 0}, 0.80}, {{0, 0, 0.1}, 0.85}, {{0, 0, 0.175}, 0.75}};
        for (const auto& limit : limits) {
            const double c =
                sweep.correlation(still, sweep.detail(moved(pose, limit.by_mm)), 35, 88);
            std::printf("%.2f mm along the face, %.2f in depth: %.2f\n", limit.by_mm.x,
                        limit.by_mm.z, c);
            EXPECT_GE(c, limit.least);
        }
    }
}

// The deeper a picture reaches, the farther apart its beams are at its lower edge: there a fan once
// skipped scatterers. A picture ends 20 mm below the depth that is looked at.
TEST(SpeckleMotion, AtEveryDepthOfEveryProbeItMovesAlongTheFace) {
    const CaseBundle deep = liver_alone({-150, -12, -25}, {150, 12, 275}, 2.5);
    const struct {
        const char* name;
        ProbeShape shape;
        double frequency_mhz;
    } probes[] = {{"curved", ProbeShape::curvilinear, 3.5},
                  {"linear", ProbeShape::linear, 7.5},
                  {"phased", ProbeShape::phased, 2.5}};
    const struct {
        double mm, least;
    } limits[] = {{0.2, 0.85}, {0.4, 0.80}, {0.6, 0.75}, {1.0, 0.65}};
    for (const auto& probe : probes) {
        for (const double depth : {60.0, 90.0, 120.0, 180.0, 240.0}) {
            Exercise exercise = sweep_exercise();
            exercise.probe.shape = probe.shape;
            exercise.probe.frequency_mhz = probe.frequency_mhz;
            exercise.probe.depth_mm = depth + 20;
            if (probe.shape == ProbeShape::phased) exercise.probe.field_of_view_rad = 1.5;
            Sweep sweep({}, exercise, deep);
            const Plane still = sweep.detail({});
            std::printf("%s, %3.0f mm:", probe.name, depth);
            for (const auto& limit : limits) {
                const Plane now = sweep.detail(moved({}, {limit.mm, 0, 0}));
                const double c = sweep.correlation(still, now, depth - 12, depth + 12, limit.mm);
                std::printf(" %.2f", c);
                EXPECT_GE(c, limit.least) << probe.name << ", " << depth << " mm";
            }
            std::printf("\n");
        }
    }
}

// Rotated in place about the beam, a point 40 mm beside the middle moves 0.35 mm per half degree:
// no step may redraw the picture, also where the lattice's axes pass.
TEST(SpeckleMotion, ASlowTurnNeverJumps) {
    HardCase step("correlation from step to step of 0.25 degrees", HardCase::at_least, 0.7, "");
    Sweep sweep;
    for (const Vector3 axis : {Vector3{0, 0, 1}, Vector3{1, 0, 0}}) {
        std::vector<double> steps;
        Plane before = sweep.detail({});
        for (double degrees = 0.25; degrees <= 45; degrees += 0.25) {
            Plane now = sweep.detail(turned(axis, degrees));
            // A tilt about the face's own line moves tissue at 35 to 60 mm by 0.15 to 0.26 mm a
            // step.
            steps.push_back(sweep.correlation(before, now, 35, 60));
            before = std::move(now);
        }
        const double least = *std::min_element(steps.begin(), steps.end());
        std::printf("least correlation of two steps: %.2f\n", least);
        step.see(least);
    }
}

TEST(SpeckleMotion, OfAProbeHeldStillOnlyTheNoiseMoves) {
    for (const char* name : {"modern", "classic"}) {
        RenderOptions options;
        options.machine = *built_in_machine(name);
        Sweep sweep(options);
        const Plane first = sweep.detail({}, 0, 0), later = sweep.detail({}, 0, 100);
        if (options.machine->noise.reject) {
            EXPECT_TRUE(first == later);
        } else {
            EXPECT_GT(sweep.correlation(first, later, 35, 88), 0.98);
        }
    }
}

// The anatomy moves past a probe that is held still: the same as a probe that moves.
TEST(SpeckleMotion, BreathingTakesItAlong) {
    Exercise exercise = sweep_exercise();
    exercise.breathing.amplitude_mm = 8;
    Sweep sweep({}, exercise);
    const Plane rest = sweep.detail({}, 0);
    double before = 1;
    for (const double time_s : {0.05, 0.1, 0.2}) {
        const double c = sweep.correlation(rest, sweep.detail({}, time_s), 35, 60);
        std::printf("%.2f s of breathing: %.2f\n", time_s, c);
        EXPECT_LE(c, before + 0.02);
        before = c;
    }
    EXPECT_GT(sweep.correlation(rest, sweep.detail({}, 0.05), 35, 60), 0.85);
}

// Cells, looks and levels come from the probe and not from the volume.
TEST(SpeckleMotion, VolumesOfFineAndCoarseVoxelsLookAlike) {
    const auto statistics = [](double voxel_mm) {
        PhantomOptions o;
        o.ribs = o.gas = o.vessels = o.kidney = o.layers = o.structure = false;
        o.lower = {-60, -8, -15};
        o.upper = {60, 8, 90};
        o.voxel_mm = voxel_mm;
        Exercise e = phantom_exercise();
        e.probe.depth_mm = 80;
        RenderOptions options;
        options.width_px = options.height_px = 256;
        const auto pixels = draw(e, options, {}, Phantom(o).bundle());
        double sum = 0, square = 0, n = 0;
        for (int y = 110; y < 190; ++y) {
            for (int x = 98; x < 158; ++x, ++n) {
                const double v = pixels[static_cast<std::size_t>(y * 256 + x)];
                sum += v;
                square += v * v;
            }
        }
        return std::pair{sum / n, std::sqrt(square / n - sum / n * sum / n)};
    };
    HardCase level("mean grey of liver, voxels of 0.5 and 2 mm, off that of 1 mm",
                   HardCase::at_most, 3, "grey");
    const auto [mean, sd] = statistics(1);
    for (const double voxel_mm : {0.5, 2.0}) {
        const auto [other, other_sd] = statistics(voxel_mm);
        std::printf("%.1f mm: %.1f +- %.1f, 1 mm: %.1f +- %.1f\n", voxel_mm, other, other_sd, mean,
                    sd);
        // The lattice begins at the volume's corner: other draws of some 300 grains.
        level.see(std::abs(other - mean));
        EXPECT_NEAR(other_sd / sd, 1, 0.2);
    }
}

}  // namespace
}  // namespace sonocase::runtime
