// SPDX-License-Identifier: Apache-2.0

// The colour picture of tubes, discs and vessels whose flow is known.
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <vector>

#include "doppler_cases.h"
#include "formats/base/constants.h"
#include "formats/flow/flow_field.h"
#include "runtime/imaging/doppler/colour_image.h"
#include "runtime/imaging/doppler/doppler_view.h"
#include "runtime/imaging/doppler/ensemble_reference.h"
#include "support/flowing_case.h"
#include "support/hard_case.h"

namespace sonocase::runtime::doppler {
namespace {

using sonocase::testing::HardCase;

using testing::StillTissue;
using testing::tube_at;

struct Scan {
    explicit Scan(const FlowField& field, double frequency_mhz = 5, int size = 256)
        : scene(field, 60.0 / 70),
          geometry(make_scan_geometry(testing::linear_probe(), 192, 512, size, size)),
          image(scene, geometry, frequency_mhz, 30),
          grey(static_cast<std::size_t>(size) * size, 20),
          overlay(grey.size(), 9) {
        settings.mode = DopplerMode::colour;
        settings.box_left = 0;
        settings.box_right = 1;
        settings.box_top_mm = 10;
        settings.box_bottom_mm = 50;
        settings.wall_filter = 0.05;
    }
    ColourReport render(std::uint32_t frame = 0, double phase = 0, double inspired = 0.5) {
        return image.render(settings, {phase, inspired, frame, 1}, tissue, grey, overlay);
    }
    // Turns of a cell behind the wall filter and a Gaussian of 0.8 x 1.2 cells, from the true
    // velocities round it: what a machine without noise shows.
    double behind_the_point_spread(int line, int row) const {
        const WallFilter filter(settings.wall_filter);
        std::complex<double> sum;
        for (int k = -4; k <= 4; ++k)
            for (int l = -3; l <= 3; ++l) {
                const bool in_box = line + l >= 0 && line + l < image.box().lines && row + k >= 0 &&
                                    row + k < image.box().rows;
                if (!in_box || !image.cell(line + l, row + k).blood) continue;
                const auto turns = static_cast<double>(image.cell(line + l, row + k).truth);
                const auto gain = static_cast<double>(
                    filter.gain(static_cast<float>(std::abs(std::sin(kPi * turns)))));
                sum += std::exp(-0.5 * (l * l / 0.64 + k * k / 1.44)) * gain *
                       std::polar(1.0, 2 * kPi * turns);
            }
        return std::arg(sum) / (2 * kPi);
    }
    FlowScene scene;
    ScanGeometry geometry;
    ColourImage image;
    StillTissue tissue;
    DopplerSettings settings;
    std::vector<std::uint8_t> grey, overlay;
};

TEST(ColourImage, TubesOfKnownFlowHaveTheirVelocityInTheMiddle) {
    for (const double radius : {3.0, 4.0, 6.0})
        for (const double angle : {20.0, 45.0, 70.0, 120.0}) {
            const double axis_mm_s = 400;
            Scan scan(tube_at(30, angle, radius, axis_mm_s / 2 * kPi * radius * radius / 1000));
            scan.settings.scale_cm_s = 60;
            double sum = 0, truth = 0, square = 0, spread = 0;
            int count = 0;
            for (std::uint32_t frame = 0; frame < 8; ++frame) {
                const ColourReport report = scan.render(frame);
                ASSERT_GT(report.shown_cells, 20);
                for (int row = 0; row < scan.image.box().rows; ++row)
                    for (int line = 0; line < scan.image.box().lines; ++line) {
                        const ColourCell cell = scan.image.cell(line, row);
                        const double v = 2 * 600 * static_cast<double>(cell.truth);
                        // The inner half of the radius: 1 - 1/4 of the axis's velocity and more.
                        const double along = axis_mm_s * std::cos(angle * kPi / 180);
                        if (!cell.blood || !cell.shown || std::abs(v) < 0.75 * std::abs(along))
                            continue;
                        const double shown = 2 * 600 * static_cast<double>(cell.turns);
                        sum += shown;
                        truth += v;
                        spread += 2 * 600 * scan.behind_the_point_spread(line, row);
                        square += (shown - v) * (shown - v);
                        ++count;
                    }
            }
            ASSERT_GT(count, 50) << radius << " " << angle;
            // Slower blood beside it in the point spread makes it slower, by 3 % at 6 mm: known to
            // half a per cent.
            EXPECT_NEAR(sum / spread, 1, 0.005) << radius << " " << angle;
            EXPECT_NEAR(sum / truth, 1, 0.031) << radius << " " << angle;
            EXPECT_LT(std::sqrt(square / count), 0.05 * axis_mm_s);
            EXPECT_GT(truth * std::cos(angle * kPi / 180), 0);  // towards the probe is positive
        }
}

// A disc of 20 mm that turns: v = omega r. The closed form is linear along any line.
bool disc(Point3 p, Vector3& v) {
    const double x = p.x, z = p.z - 30, omega = 2 * kPi * 0.5 * 1.0;
    if (std::hypot(x, z) > 18) return false;
    v = {omega * 4 * z, 0, -omega * 4 * x};
    return true;
}

TEST(ColourImage, ARotatingDiscComesOutAsItsClosedForm) {
    Scan scan(tube_at(30, 90, 1, 0.1), 0.01);  // no loss with depth: 20 dB everywhere
    scan.image.use_field(disc);
    const double top = 2 * kPi * 0.5 * 4 * 18;  // 226 mm/s
    scan.settings.scale_cm_s = 25;
    scan.settings.persistence = 1;
    scan.settings.wall_filter = 0.05;
    double square = 0;
    int count = 0;
    for (std::uint32_t frame = 0; frame < 10; ++frame) {
        scan.render(frame);
        for (int row = 4; row + 4 < scan.image.box().rows; ++row)
            for (int line = 4; line + 4 < scan.image.box().lines; ++line) {
                const ColourCell cell = scan.image.cell(line, row);
                // Inside the disc and outside 1.5 times the wall filter.
                const bool edge = !scan.image.cell(line - 3, row).blood ||
                                  !scan.image.cell(line + 3, row).blood ||
                                  !scan.image.cell(line, row - 3).blood ||
                                  !scan.image.cell(line, row + 3).blood;
                const double v = 2 * 250 * static_cast<double>(cell.truth);
                if (!cell.shown || edge || std::abs(v) < 1.5 * 0.05 * 250) continue;
                const double error = 2 * 250 * static_cast<double>(cell.turns) - v;
                square += error * error;
                ++count;
            }
    }
    ASSERT_GT(count, 5000);
    // 1 % of the greatest velocity at 20 dB.
    EXPECT_LT(std::sqrt(square / count) / top, 0.01);
}

TEST(ColourImage, VelocitiesBeyondTheLimitWrapAround) {
    HardCase off("velocity of a wrapped cell, off", HardCase::at_most, 0.05, "turns");
    // 400 mm/s on the axis at 0 degrees would be 1.33 of a limit of 30 cm/s: shown as -0.67.
    Scan scan(tube_at(30, 20, 5, 400 / std::cos(20 * kPi / 180) / 2 * kPi * 25 / 1000));
    scan.settings.scale_cm_s = 30;
    scan.render();
    int wrapped = 0;
    for (int row = 0; row < scan.image.box().rows; ++row)
        for (int line = 0; line < scan.image.box().lines; ++line) {
            const ColourCell cell = scan.image.cell(line, row);
            if (!cell.blood || !cell.shown || cell.truth < 0.62f) continue;
            off.see(
                std::abs(static_cast<double>(cell.turns) - static_cast<double>(cell.truth) + 1));
            ++wrapped;
        }
    EXPECT_GT(wrapped, 20);
    scan.settings.scale_cm_s = 60;
    scan.render();
    const ColourCell middle = scan.image.cell(48, scan.image.box().rows / 2);
    EXPECT_GT(middle.turns, 0.2f);
}

TEST(ColourImage, AtRightAnglesThereIsNoColourAndSteeringBringsIt) {
    Scan scan(tube_at(30, 90, 4, 3));
    HardCase none("cells in colour at right angles", HardCase::at_most, 30, "");
    none.see(scan.render().shown_cells);
    scan.settings.steer_deg = 20;
    const ColourReport steered = scan.render();
    HardCase some("cells in colour, steered by 20 degrees", HardCase::at_least, 300, "");
    some.see(steered.shown_cells);
    const int middle = scan.image.box().rows / 2;
    const ColourCell one = scan.image.cell(40, middle);
    scan.settings.steer_deg = -20;
    scan.render();
    const ColourCell other = scan.image.cell(56, middle);
    EXPECT_LT(one.turns * other.turns, 0);
}

TEST(ColourImage, TissueThatMovesFlashesAndStillTissueCostsNothing) {
    Scan scan(tube_at(30, 60, 4, 3));
    const ColourReport still = scan.render();
    EXPECT_FALSE(still.flash);
    // Colour on the vessel and within the point spread's reach of it, and nowhere else.
    const ColourBox& box = scan.image.box();
    for (int row = 0; row < box.rows; ++row)
        for (int line = 0; line < box.lines; ++line) {
            if (!scan.image.cell(line, row).shown) continue;
            bool near = false;
            for (int k = std::max(row - 3, 0); k <= std::min(row + 3, box.rows - 1); ++k)
                for (int l = std::max(line - 2, 0); l <= std::min(line + 2, box.lines - 1); ++l)
                    near = near || scan.image.cell(l, k).blood;
            EXPECT_TRUE(near) << line << " " << row;
        }
    scan.tissue.tissue_mm_s = {0, 0, -60};
    const ColourReport moving = scan.render();
    EXPECT_TRUE(moving.flash);
    EXPECT_GT(moving.shown_cells, 0.8 * moving.cells);
}

TEST(ColourImage, ShutVeinsAndWhatLiesBehindBoneHaveNoFlow) {
    FlowField field = tube_at(30, 50, 4, 3);
    field.vessels[0].kind = FlowKind::vein;
    Scan scan(field);
    EXPECT_GT(scan.render().shown_cells, 100);
    HardCase blood("cells with blood in a shut vein and behind bone", HardCase::at_most, 0, "");
    scan.tissue.all_closed = true;
    blood.see(scan.render().blood_cells);
    scan.tissue.all_closed = false;
    scan.tissue.bone_z_mm = 4;
    blood.see(scan.render().blood_cells);
    Scan empty(FlowField{});
    const ColourReport none = empty.render();
    EXPECT_EQ(none.blood_cells + none.shown_cells, 0);
    HardCase coloured("coloured pixels of a bundle without flow", HardCase::at_most, 0, "");
    coloured.see(static_cast<double>(std::count_if(empty.overlay.begin(), empty.overlay.end(),
                                                   [](std::uint8_t p) { return p != 0; })));
}

TEST(ColourImage, ColourLiesInTheBoxOnTheVesselWhereGreyIsDark) {
    Scan scan(tube_at(30, 60, 4, 3));
    for (std::size_t i = 0; i < scan.grey.size(); ++i) scan.grey[i] = i % 2 ? 20 : 250;
    scan.settings.box_left = 0.4;
    scan.settings.box_right = 0.6;
    scan.render();
    int shown = 0, away = 0;
    for (std::size_t i = 0; i < scan.overlay.size(); ++i) {
        if (scan.overlay[i] == 0) continue;
        ++shown;
        EXPECT_EQ(scan.grey[i], 20);
        const PlanePoint p =
            scan.geometry.pixel_centre(static_cast<int>(i % 256), static_cast<int>(i / 256));
        EXPECT_LT(std::abs(p.x), 5.0);
        away += scan.overlay[i] < 120;
    }
    EXPECT_LT(away, 0.03 * shown);  // it flows towards the probe
    EXPECT_GT(shown, 100);
}

TEST(ColourImage, ANeedleInTheLumenStaysGreyAndBloodRunsOnBesideIt) {
    Scan scan(tube_at(30, 60, 4, 3));
    scan.render(3);
    const auto before = scan.overlay;
    // A bright line across the vessel, as the picture draws a needle.
    for (int i = 0; i < 256; ++i) scan.grey[static_cast<std::size_t>(i * 256 + i)] = 255;
    scan.render(3);
    HardCase other("pixels beside a needle in the lumen that changed", HardCase::at_most, 0, "");
    int covered = 0, changed = 0;
    for (std::size_t i = 0; i < before.size(); ++i) {
        const bool needle = i / 256 == i % 256;
        covered += needle && before[i] != 0;
        changed += scan.overlay[i] != (needle ? 0 : before[i]);
    }
    other.see(changed);
    EXPECT_GT(covered, 10);
}

TEST(ColourImage, AVeinSlowsDownOnInspirationAndAnArteryDoesNot) {
    HardCase off("flow on inspiration over that on expiration, off", HardCase::at_most, 1e-3, "");
    for (const double share : {0.0, 0.58}) {
        FlowField field = tube_at(30, 60, 4, 5);
        field.vessels[0].breathing = static_cast<float>(share);
        Scan scan(field);
        const auto mean = [&](double inspired) {
            double sum = 0;
            for (std::uint32_t frame = 0; frame < 8; ++frame) {
                scan.render(4 * frame, 0, inspired);
                const ColourBox& box = scan.image.box();
                for (int row = 0; row < box.rows; ++row)
                    for (int line = 0; line < box.lines; ++line)
                        if (scan.image.cell(line, row).blood)
                            sum += static_cast<double>(scan.image.cell(line, row).truth);
            }
            return sum;
        };
        const double ratio = mean(1) / mean(0),
                     truth = flow_ml_s(field.vessels[0], 0, 1) / flow_ml_s(field.vessels[0], 0, 0);
        off.see(std::abs(ratio - truth));
        if (share > 0) {
            EXPECT_LT(ratio, 0.7);
        }
    }
}

TEST(ColourImage, TheSameFrameIsTheSamePictureAndAnotherIsNot) {
    Scan scan(tube_at(30, 60, 4, 3));
    scan.render(7);
    const auto first = scan.overlay;
    scan.render(9);
    EXPECT_NE(scan.overlay, first);
    scan.render(7);
    EXPECT_EQ(scan.overlay, first);
}

TEST(ColourImage, SettingsThatMakeNoSenseAreHarmless) {
    Scan scan(tube_at(30, 60, 4, 3));
    const double nan = std::nan("");
    const DopplerSettings sane = scan.settings;
    const int usual = scan.render().blood_cells;
    HardCase after("cells with blood after settings that make no sense, off those before",
                   HardCase::at_most, 0, "");
    for (const double bad : {nan, 1e308, -1e308, 0.0}) {
        DopplerSettings& s = scan.settings;
        s.box_left = s.box_right = s.box_top_mm = s.box_bottom_mm = bad;
        s.steer_deg = s.scale_cm_s = s.baseline = s.wall_filter = s.gain_db = s.priority = bad;
        s.ensemble = s.persistence = -5;
        scan.render();
        s.box_left = 0;
        s.box_right = 1;
        s.box_top_mm = 0;
        s.box_bottom_mm = 60;
        scan.render();
        s = sane;
        after.see(std::abs(scan.render().blood_cells - usual));
    }
}

// Artery or vein from twelve colour frames of a beat: how much the mean velocity shown changes.
bool looks_like_an_artery(Scan& scan) {
    double least = 1e9, most = -1e9, size = 0;
    for (std::uint32_t frame = 0; frame < 12; ++frame) {
        scan.render(frame, frame / 12.0);
        double sum = 0, count = 0;
        for (int row = 0; row < scan.image.box().rows; ++row)
            for (int line = 0; line < scan.image.box().lines; ++line) {
                const ColourCell cell = scan.image.cell(line, row);
                sum += cell.blood && cell.shown ? static_cast<double>(cell.turns) : 0.0;
                count += cell.blood;
            }
        const double mean = sum / count;
        least = std::min(least, mean);
        most = std::max(most, mean);
        size += std::abs(mean) / 12;
    }
    return (most - least) / size > 1.5;
}

TEST(ColourImage, TwelveFramesTellArteryFromVein) {
    FlowWave leg{}, vein{};
    const double re[] = {0.77, -0.89, -1.37, -0.61, 0.07, 0.15},
                 im[] = {-1.65, -1.41, 0.1, 0.82, 0.52, 0.1};
    for (std::size_t h = 0; h < 6; ++h)
        leg[h] = {static_cast<float>(re[h]), static_cast<float>(im[h])};
    vein[0] = {-0.07f, -0.1f};
    vein[1] = {-0.02f, 0.08f};
    for (const double radius : {3.5, 5.0, 6.5})
        for (const double angle : {45.0, 60.0, 115.0, 130.0}) {
            Scan artery(tube_at(30, angle, radius, 0.12 * kPi * radius * radius, 3, leg));
            artery.settings.scale_cm_s = 60;
            EXPECT_TRUE(looks_like_an_artery(artery)) << radius << " " << angle;
            Scan other(tube_at(30, angle, radius, 0.07 * kPi * radius * radius, 3, vein));
            other.settings.scale_cm_s = 60;
            EXPECT_FALSE(looks_like_an_artery(other)) << radius << " " << angle;
        }
}

TEST(DopplerView, AimsAtTheVesselThatThePlaneCutsAndAtNoOther) {
    const CaseBundle bundle = sonocase::testing::flowing_case();
    Exercise exercise;
    exercise.probe = testing::linear_probe();
    const auto view = DopplerView::create(bundle, exercise, {});
    ASSERT_TRUE(view) << view.error().message();
    // Across the vessel, which runs along y at z = 25; between two of its nodes, which lie at even
    // places.
    FrameInput input;
    input.mannequin_from_probe = {Matrix3::from_columns({1, 0, 0}, {0, -1, 0}, {0, 0, -1}),
                                  {-8, 5, 60}};
    DopplerSettings settings;
    settings.mode = DopplerMode::spectral;
    const auto aimed = view->aim(input, settings, true);
    ASSERT_TRUE(aimed);
    EXPECT_NEAR(aimed->gate_depth_mm, 35, 0.5);
    EXPECT_NEAR(aimed->gate_line, 0.5 + 8.0 / 40, 0.03);
    EXPECT_EQ(std::abs(aimed->angle_deg), 80);  // at right angles; the cursor goes no further
    EXPECT_LT(aimed->box_left, aimed->gate_line);
    EXPECT_GT(aimed->box_right, aimed->gate_line);
    // Along it a steered beam has 70 degrees to the flow.
    input.mannequin_from_probe.rotation = Matrix3::from_columns({0, 1, 0}, {1, 0, 0}, {0, 0, -1});
    input.mannequin_from_probe.translation = {1, 0, 60};
    const auto along = view->aim(input, settings, true);
    ASSERT_TRUE(along);
    EXPECT_EQ(std::abs(along->steer_deg), 20);
    EXPECT_NEAR(std::abs(along->angle_deg), 70, 1.5);
    // The fastest blood, seen at that angle, fills three quarters of the scale; in steps of 5.
    const FlowVessel& vessel = bundle.flow.vessels.front();
    const double area_mm2 = section_area_mm2(bundle.flow.nodes[vessel.first_node].radius_mm);
    const double fastest_cm_s =
        0.1 * velocity_range(vessel, area_mm2, 60 / exercise.pulsation.rate_per_min).peak *
        std::cos(along->angle_deg * kPi / 180);
    EXPECT_GE(along->spectral_scale_cm_s, fastest_cm_s / 0.75);
    EXPECT_LE(along->spectral_scale_cm_s, std::max(fastest_cm_s / 0.75 + 5.5, 10.0));
    EXPECT_EQ(std::fmod(along->spectral_scale_cm_s, 5), 0);
    // A slow vessel has a small scale, so that its trace is no flat line.
    CaseBundle slow = bundle;
    slow.flow.vessels.front().mean_ml_s /= 8;
    const auto slow_view = DopplerView::create(slow, exercise, {});
    ASSERT_TRUE(slow_view) << slow_view.error().message();
    EXPECT_EQ(slow_view->aim(input, settings, true)->spectral_scale_cm_s, 10);
    // Beside the vessel there is none.
    input.mannequin_from_probe.translation = {30, 0, 60};
    EXPECT_FALSE(view->aim(input, settings, true));
    EXPECT_EQ(view->aimed(input, settings), settings);
}

}  // namespace
}  // namespace sonocase::runtime::doppler
