// SPDX-License-Identifier: Apache-2.0

// What physics and phantoms say of the picture, whatever the machine: statistics of one look,
// growth of the beam, bone, fascia, fluid, gas. Homogeneous or simple phantoms with exact surfaces,
// so that each test is of one thing. What a living body's pictures look like: realism_test.cpp.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numeric>

#include "block_bench.h"

namespace sonocase::runtime {
namespace {

using namespace sonocase::testing;

struct OwnCase {
    CaseBundle own;
};

// The renderer over a phantom of its own.
struct Bench : OwnCase, BeamBench {
    Bench(CaseBundle b, const Exercise& e, const std::string& machine = "classic")
        : OwnCase{std::move(b)}, BeamBench(own, e, machine, 512) {
        // What organs and the wall add would blur the measures of the physics.
        frame.effects.parenchyma = frame.effects.streaks = frame.effects.wall = false;
    }
};

CaseBundle homogeneous() {
    PhantomOptions o;
    o.ribs = o.gas = o.vessels = o.kidney = o.layers = o.structure = false;
    o.lower = {-110, -12, -25};
    o.upper = {110, 12, 160};
    o.voxel_mm = 2;
    return Phantom(o).bundle();
}

struct Moments {
    double snr = 0, nakagami = 0;
};

// Over patches of 40 rows: each is scaled by its own mean power, so that attenuation does not
// count.
Moments moments(const Bench& b, double from_mm, double to_mm) {
    double sum = 0, square = 0, fourth = 0;
    int n = 0;
    for (int k0 = b.row_of(from_mm); k0 + 40 < b.row_of(to_mm); k0 += 40) {
        double power = 0;
        for (int k = k0; k < k0 + 40; ++k) {
            for (int l = 16; l < 176; ++l)
                power += static_cast<double>(b.renderer->power_row(k)[l]);
        }
        power /= 40 * 160;
        for (int k = k0; k < k0 + 40; ++k) {
            for (int l = 16; l < 176; ++l) {
                const double p = static_cast<double>(b.renderer->power_row(k)[l]) / power;
                sum += std::sqrt(p);
                square += p;
                fourth += p * p;
                ++n;
            }
        }
    }
    sum /= n;
    square /= n;
    fourth /= n;
    return {sum / std::sqrt(square - sum * sum), square * square / (fourth - square * square)};
}

TEST(PhantomPhysics, SpeckleOfHomogeneousTissueIsRayleigh) {
    for (const bool linear : {false, true}) {
        Bench b(homogeneous(), linear ? phantom_linear_exercise() : phantom_exercise());
        b.run();
        const Moments m = linear ? moments(b, 12, 40) : moments(b, 25, 125);
        std::printf("%s: envelope SNR %.3f, Nakagami m %.3f\n", linear ? "linear" : "curvilinear",
                    m.snr, m.nakagami);
        EXPECT_NEAR(m.snr, 1.91, 0.10);
        EXPECT_GT(m.nakagami, 0.85);
        EXPECT_LT(m.nakagami, 1.10);
    }
}

// Full width at half height of the autocorrelation of the grey picture in beam space, mm.
struct Grain {
    double axial_mm = 0, lateral_mm = 0, sd = 0, skew = 0, mean = 0;
};

Grain grain(const Bench& b, double from_mm, double to_mm) {
    const int k0 = b.row_of(from_mm), k1 = b.row_of(to_mm), l0 = 24, l1 = 168;
    std::vector<std::vector<double>> g;
    for (int k = k0; k < k1; ++k) {
        g.emplace_back();
        double mean = 0;
        for (int l = l0; l < l1; ++l) mean += b.renderer->shade(k, l);
        mean /= l1 - l0;
        for (int l = l0; l < l1; ++l)
            g.back().push_back(b.renderer->shade(k, l) - mean);  // depth trend off
    }
    Grain out;
    double n = 0, m2 = 0, m3 = 0;
    for (const auto& row : g) {
        for (const double v : row) {
            m2 += v * v;
            m3 += v * v * v;
            ++n;
        }
    }
    out.sd = std::sqrt(m2 / n);
    out.skew = m3 / n / (out.sd * out.sd * out.sd);
    for (int k = k0; k < k1; ++k) {
        for (int l = l0; l < l1; ++l) out.mean += b.renderer->shade(k, l) / n;
    }
    const auto correlation = [&](int dk, int dl) {
        double sum = 0, count = 0;
        for (std::size_t k = 0; k + static_cast<std::size_t>(dk) < g.size(); ++k) {
            for (std::size_t l = 0; l + static_cast<std::size_t>(dl) < g[k].size(); ++l) {
                sum +=
                    g[k][l] * g[k + static_cast<std::size_t>(dk)][l + static_cast<std::size_t>(dl)];
                ++count;
            }
        }
        return sum / count / (out.sd * out.sd);
    };
    const auto width = [&](bool axial) {
        double before = 1;
        for (int lag = 1; lag < 60; ++lag) {
            const double c = axial ? correlation(lag, 0) : correlation(0, lag);
            if (c < 0.5) return 2 * (lag - 1 + (before - 0.5) / (before - c));
            before = c;
        }
        return 120.0;
    };
    const double middle = 0.5 * (from_mm + to_mm);
    const double pitch = b.geometry.fan ? (b.geometry.radius_mm + middle) * b.geometry.line_step
                                        : b.geometry.line_step;
    out.axial_mm = width(true) * b.geometry.step_mm;
    out.lateral_mm = width(false) * pitch;
    return out;
}

TEST(PhantomPhysics, GrainIsFineAlongTheBeamAndWidensWithDepth) {
    PhantomOptions o;
    o.ribs = o.gas = o.vessels = o.kidney = o.layers = false;
    o.lower = {-110, -12, -25};
    o.upper = {110, 12, 160};
    Bench b(Phantom(o).bundle(), phantom_exercise());
    b.run();
    for (double z = 30; z < 120; z += 15) {
        const Grain g = grain(b, z, z + 15);
        std::printf("liver %3.0f mm: axial %.2f mm lateral %.2f mm\n", z, g.axial_mm, g.lateral_mm);
        EXPECT_GT(g.axial_mm, 0.6);
        EXPECT_LT(g.axial_mm, 1.4);
        EXPECT_GT(g.lateral_mm / g.axial_mm, 1.8);  // lowest of the living liver
        EXPECT_LT(g.lateral_mm / g.axial_mm, 6.0);
    }
    const double growth = grain(b, 110, 130).lateral_mm / grain(b, 50, 70).lateral_mm;
    std::printf("lateral growth from 60 to 120 mm: %.2f\n", growth);
    EXPECT_GT(growth, 1.2);
    EXPECT_LT(growth, 2.0);
}

TEST(PhantomPhysics, BoneIsABrightLineWithADarkButNotBlackShadow) {
    PhantomOptions o;
    o.gas = o.vessels = o.kidney = false;
    o.lower = {-60, -12, -15};
    o.upper = {60, 12, 80};
    Exercise e = phantom_linear_exercise();
    Bench b(Phantom(o).bundle(), e);
    b.frame.volume_from_probe.translation = {-22, 0, 0};  // over the rib's crest, 20.5 mm deep
    b.run();
    // Columns over the crest, aligned on their peaks.
    double peak = 0, width = 0, tissue = 0, shadow = 0, beside = 0;
    int n = 0;
    for (int l = 88; l < 104; ++l) {
        int top = b.row_of(15);
        for (int k = top; k < b.row_of(26); ++k) {
            if (b.renderer->shade(k, l) > b.renderer->shade(top, l)) top = k;
        }
        const int p = b.renderer->shade(top, l);
        double around = 0;
        for (int k = top - b.row_of(4); k < top - b.row_of(2); ++k)
            around += b.renderer->shade(k, l);
        around /= b.row_of(4) - b.row_of(2);
        const double half = 0.5 * (p + around);
        int first = top, last = top;
        while (b.renderer->shade(first, l) > half) --first;
        while (b.renderer->shade(last, l) > half) ++last;
        peak += p;
        tissue += around;
        width += (last - first - 1) * b.geometry.step_mm;
        ++n;
    }
    int m = 0;
    for (int k = b.row_of(32); k < b.row_of(42); ++k) {
        for (int l = 92; l < 100; ++l) {
            shadow += b.renderer->shade(k, l);
            beside += b.renderer->shade(k, l + 70);
            ++m;
        }
    }
    const double drop_db = (beside - shadow) / m * 60 / 255;
    std::printf(
        "bone: peak %.0f over %.0f, %.2f mm wide; shadow %.1f grey, %.1f dB below its neighbour\n",
        peak / n, tissue / n, width / n, shadow / m, drop_db);
    EXPECT_GT((peak - tissue) / n, 100);
    EXPECT_LT((peak - tissue) / n, 180);
    EXPECT_GT(width / n, 0.5);
    EXPECT_LT(width / n, 1.2);
    EXPECT_GT(drop_db, 18);
    EXPECT_LT(drop_db, 30);
    EXPECT_GT(shadow / m, 5);
}

TEST(PhantomPhysics, FasciaStandsOutAndAVesselIsDark) {
    PhantomOptions o;
    o.ribs = o.gas = false;
    o.lower = {-30, -12, -10};
    o.upper = {50, 16, 60};
    Bench b(Phantom(o).bundle(), phantom_linear_exercise());
    b.frame.volume_from_probe.translation = {20, 4, 0};
    b.run();
    // Between fat and muscle, about 11 mm deep.
    double line = 0, around = 0;
    int n = 0;
    for (int l = 20; l < 172; ++l) {
        int best = 0;
        double near = 0;
        for (int k = b.row_of(8); k < b.row_of(14.5); ++k)
            best = std::max<int>(best, b.renderer->shade(k, l));
        for (int k = b.row_of(5); k < b.row_of(7.5); ++k) near += b.renderer->shade(k, l);
        for (int k = b.row_of(15.5); k < b.row_of(18); ++k) near += b.renderer->shade(k, l);
        line += best;
        around += near / (b.row_of(7.5) - b.row_of(5) + b.row_of(18) - b.row_of(15.5));
        ++n;
    }
    std::printf("fascia %.0f over %.0f\n", line / n, around / n);
    EXPECT_GT((line - around) / n, 60);

    Bench c(phantom(), phantom_exercise());
    c.run();
    double lumen = 0;
    int m = 0;
    for (int k = c.row_of(71); k < c.row_of(79); ++k) {
        for (int l = 98; l < 104; ++l) {
            lumen += c.renderer->shade(k, l);
            ++m;
        }
    }
    std::printf("vessel lumen %.1f grey\n", lumen / m);
    EXPECT_GT(lumen / m, 1);   // 2.3: blood and haze show above the logarithm's black
    EXPECT_LT(lumen / m, 35);  // of living vessels 2 to 46
}

// Mean grey of some beams over a stretch of depth.
double grey_of(const Bench& b, double from_mm, double to_mm, int first_line, int end_line) {
    double sum = 0;
    int n = 0;
    for (int k = b.row_of(from_mm); k < b.row_of(to_mm); ++k) {
        for (int l = first_line; l < end_line; ++l, ++n) sum += b.renderer->shade(k, l);
    }
    return sum / n;
}

TEST(PhantomPhysics, BehindFluidTissueIsBrighterButNotWhite) {
    PhantomOptions o;
    o.ribs = o.gas = o.kidney = false;
    Bench b(Phantom(o).bundle(), phantom_exercise());
    b.run();
    // The cyst of 24 mm whose middle lies 105 mm down its beam.
    double line = 0, sample = 0;
    ASSERT_TRUE(b.geometry.locate({-40, 100}, line, sample));
    const double far_wall_mm = (sample + 0.5) * b.geometry.step_mm + 12;
    const int middle = static_cast<int>(line);
    const double inside = grey_of(b, far_wall_mm - 16, far_wall_mm - 8, middle - 3, middle + 4),
                 behind = grey_of(b, far_wall_mm + 5, far_wall_mm + 13, middle - 3, middle + 4),
                 beside = grey_of(b, far_wall_mm + 5, far_wall_mm + 13, middle + 22, middle + 30);
    std::printf("cyst %.0f grey, behind %.0f, beside %.0f\n", inside, behind, beside);
    EXPECT_LT(inside, 35);
    EXPECT_GT(behind - beside, 10);  // 2 to 8 dB behind 24 mm: 10 to 35 grey
    EXPECT_LT(behind - beside, 35);
}

// Liver with a rod of fluid across the plane, its middle 52 mm deep.
CaseBundle liver_with_rod(std::uint8_t label, double diameter_mm) {
    return block_of(1, [&](Point3 p) -> std::uint8_t {
        if (p.z < 0) return Phantom::outside;
        return std::hypot(p.x, p.z - 52) < 0.5 * diameter_mm ? label : std::uint8_t{Phantom::liver};
    });
}

struct Level {
    double db = 0, grey = 0;
};

// Behind the rod, mean over places along it, whose speckle differs.
Level behind_rod(const CaseBundle& bundle, const std::string& machine) {
    Bench b(bundle, phantom_exercise(), machine);
    double line = 0, sample = 0, power = 0;
    EXPECT_TRUE(b.geometry.locate({0, 75}, line, sample));
    const int from = b.row_of(70), to = b.row_of(80), middle = static_cast<int>(line);
    Level level;
    for (double y = -20; y <= 20; y += 5) {
        b.frame.volume_from_probe.translation = {0, y, 0};
        b.run();
        level.grey += grey_of(b, 70, 80, middle - 3, middle + 4) / 9;
        for (int k = from; k < to; ++k)
            for (int l = middle - 3; l <= middle + 3; ++l)
                power += static_cast<double>(b.renderer->power_row(k)[l]);
    }
    level.db = 10 * std::log10(power);
    return level;
}

// What behind the rod is brighter than without it, from pictures.
double brighter_behind_rod(const CaseBundle& with,
                           const CaseBundle& without,
                           const std::string& machine,
                           RendererKind kind) {
    RenderOptions options;
    options.kind = kind;
    options.machine = *built_in_machine(machine);
    options.width_px = options.height_px = 160;
    options.scanlines = 64;
    options.samples = 256;
    double grey[2] = {};
    for (int rod = 0; rod < 2; ++rod) {
        auto r = Renderer::create(rod == 1 ? with : without, phantom_exercise(), options);
        EXPECT_TRUE(r.has_value());
        std::vector<std::uint8_t> pixels(160 * 160);
        r->render({}, pixels);
        const Renderer::Layout layout = r->layout();
        int n = 0;
        for (double z = 68; z < 84; z += 0.5)
            for (double x = -6; x <= 6; x += 0.5, ++n) {
                const int column = static_cast<int>(layout.origin_x_px + x / layout.mm_per_px),
                          row = static_cast<int>(layout.origin_y_px + z / layout.mm_per_px);
                grey[rod] += pixels[static_cast<std::size_t>(row) * 160 + column];
            }
        grey[rod] /= n;
    }
    return grey[1] - grey[0];
}

TEST(PhantomPhysics, EnhancementBehindFluidIsWhatItsPathSpares) {
    const double mhz = phantom_exercise().probe.frequency_mhz;
    // Attenuation of urine, bile, cysts (0.01) and blood (0.15) as in the table of tissues, and
    // what the pulse loses in fluid besides since it steepens (physical_model.h).
    struct Fluid {
        const char* name;
        std::uint8_t label;
        double loss_db_cm_mhz;
    };
    constexpr Fluid kFluids[] = {{"cyst", Phantom::cyst, 0.01 + 0.209},
                                 {"blood", Phantom::blood, 0.15 + 0.055}};
    const CaseBundle liver = liver_with_rod(Phantom::liver, 12);
    for (const char* machine : {"classic", "modern"}) {
        const Level without = behind_rod(liver, machine);
        for (const Fluid& fluid : kFluids)
            for (const double diameter_mm : {12.0, 24.0}) {
                const CaseBundle bundle = liver_with_rod(fluid.label, diameter_mm);
                const Level with = behind_rod(bundle, machine);
                const double found = with.db - without.db,
                             spared = 2 * (0.5 - fluid.loss_db_cm_mhz) * 0.1 * diameter_mm * mhz;
                std::printf("%s of %g mm, %s: %.1f dB of %.1f, %.0f grey over %.0f\n", fluid.name,
                            diameter_mm, machine, found, spared, with.grey - without.grey,
                            without.grey);
                // The aperture sees past a narrow rod, where sound is weaker.
                EXPECT_LT(found, spared + 0.3);
                EXPECT_GT(found, 0.75 * spared - 0.4);
                EXPECT_GT(with.grey, without.grey + 4) << "not to be seen";
            }
    }
    const CaseBundle cyst = liver_with_rod(Phantom::cyst, 24);
    for (const char* machine : {"classic", "modern"}) {
        const double fast = brighter_behind_rod(cyst, liver, machine, RendererKind::fast),
                     slow = brighter_behind_rod(cyst, liver, machine, RendererKind::reference);
        std::printf("%s: %.1f grey brighter, reference %.1f\n", machine, fast, slow);
        EXPECT_GT(slow, 10);
        EXPECT_NEAR(fast, slow, 2);
    }
}

TEST(PhantomPhysics, GasThrowsLinesAtMultiplesOfItsDepth) {
    Bench b(phantom(), phantom_exercise());
    b.frame.volume_from_probe.translation = {48, 0, 0};  // its face 36 mm under the middle
    // Few beams meet the face squarely, and a draw of clutter is wider than they: mean of draws.
    constexpr std::uint32_t kDraws = 12;
    std::vector<double> grey(512, 0.0);
    for (std::uint32_t seed = 1; seed <= kDraws; ++seed) {
        b.frame.seed = seed;
        b.run();
        for (int k = 0; k < 512; ++k) {
            for (int l = 94; l < 98; ++l)
                grey[static_cast<std::size_t>(k)] += b.renderer->shade(k, l) / (4.0 * kDraws);
        }
    }
    const auto mean = [&](double from_mm, double to_mm) {
        const auto first = grey.begin() + b.row_of(from_mm), last = grey.begin() + b.row_of(to_mm);
        return std::accumulate(first, last, 0.0) / static_cast<double>(last - first);
    };
    for (const int n : {2, 3}) {
        // Roughness shifts a face by up to a millimetre, and its lines by as much again and again.
        const double depth_mm = 36.0 * n, reach_mm = n;
        const double on = *std::max_element(grey.begin() + b.row_of(depth_mm - reach_mm),
                                            grey.begin() + b.row_of(depth_mm + reach_mm)),
                     off = 0.5 *
                           (mean(depth_mm - 9, depth_mm - 6) + mean(depth_mm + 6, depth_mm + 9));
        std::printf("line at %.0f mm: %.0f over %.0f\n", depth_mm, on, off);
        EXPECT_GT(on, off + 10);
    }
    std::printf("dirty shadow %.0f grey, %.0f at twice the depth\n", mean(40, 46), mean(86, 96));
    EXPECT_GT(mean(40, 46), 50);  // dirty, and fading
    EXPECT_GT(mean(40, 46), mean(86, 96) + 30);
}

TEST(PhantomPhysics, SpeckleFollowsTheTissue) {
    Bench b(homogeneous(), phantom_linear_exercise());
    const double pitch = b.geometry.line_step;
    const int beams = static_cast<int>(std::lround(1.75 / pitch));
    b.run();
    std::vector<std::vector<double>> before;
    const int k0 = b.row_of(10), k1 = b.row_of(30);
    for (int k = k0; k < k1; ++k) {
        before.emplace_back();
        for (int l = 0; l < 192; ++l) before.back().push_back(std::log(b.amplitude(k, l)));
    }
    b.frame.volume_from_probe.translation.x = beams * pitch;  // slides 1.75 mm along its face
    b.frame.frame = 1;
    b.run();
    const auto correlation = [&](int shift) {
        double sa = 0, sb = 0, aa = 0, bb = 0, ab = 0, n = 0;
        for (int k = k0; k < k1; ++k) {
            for (int l = 20; l < 170; ++l) {
                const double x = before[static_cast<std::size_t>(k - k0)]
                                       [static_cast<std::size_t>(l + shift)],
                             y = std::log(b.amplitude(k, l));
                sa += x;
                sb += y;
                aa += x * x;
                bb += y * y;
                ab += x * y;
                ++n;
            }
        }
        return (ab / n - sa / n * sb / n) /
               std::sqrt((aa / n - sa / n * sa / n) * (bb / n - sb / n * sb / n));
    };
    std::printf("moved %.2f mm: correlation %.2f re-aligned, %.2f not\n", beams * pitch,
                correlation(beams), correlation(0));
    EXPECT_GT(correlation(beams), 0.8);
    EXPECT_LT(correlation(0), 0.2);
}

TEST(PhantomPhysics, MuscleUnderALinearProbeIsStrandsOnDarkGround) {
    PhantomOptions o;
    o.ribs = o.gas = o.vessels = o.kidney = false;
    o.lower = {-35, -12, -10};
    o.upper = {35, 12, 60};
    Bench b(Phantom(o).bundle(), phantom_linear_exercise());
    b.run();
    const Grain g = grain(b, 13.5, 20);
    std::printf("muscle: grey %.0f sd %.1f skew %+.2f axial %.2f mm lateral %.2f mm\n", g.mean,
                g.sd, g.skew, g.axial_mm, g.lateral_mm);
    EXPECT_GT(g.sd, 18);
    EXPECT_LT(g.sd, 40);
    EXPECT_GT(g.skew, 0.2);  // living muscle from 0.3 on; bright strands would hide an abscess
}

}  // namespace
}  // namespace sonocase::runtime
