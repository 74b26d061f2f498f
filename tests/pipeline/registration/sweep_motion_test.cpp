// SPDX-License-Identifier: Apache-2.0

// A mannequin that moved while it was swept.
#include "pipeline/registration/fit/sweep_motion.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <tuple>
#include <vector>

#include "formats/base/constants.h"
#include "pipeline/base/text.h"
#include "pipeline/import/mesh/surface_file.h"
#include "support/hard_case.h"
#include "support/paths.h"
#include "support/torso_builds.h"

namespace sonocase::pipeline {
namespace {

using namespace sonocase::testing;

// In which order a surface is read.
enum class Order {
    anywhere,  // here and there
    twice,     // twice over the whole, in strokes along the body
    strokes,   // once, in strokes along the body, one beside the other round it
    rings,     // once, in rings round the body, from the feet to the head
};
constexpr Order kOrders[] = {Order::anywhere, Order::twice, Order::strokes, Order::rings};
const char* name_of(Order order) {
    const char* const names[] = {"anywhere", "twice", "strokes", "rings"};
    return names[static_cast<int>(order)];
}

Surface in_order(const BuiltMannequin& m, Order order) {
    const std::vector<Point3>& points = m.sweep.points;
    if (order == Order::anywhere) return m.sweep;
    Point3 middle;
    for (Point3 p : points) middle = middle + (p - Point3{}) / static_cast<double>(points.size());
    struct Key {
        int round, band;
        double along;
        std::size_t index;
    };
    std::vector<Key> keys;
    const Vector3 left = cross(m.head, m.back);
    for (std::size_t i = 0; i < points.size(); ++i) {
        const Vector3 d = points[i] - middle;
        const double height = dot(d, m.head), angle = std::atan2(dot(d, left), dot(d, m.back));
        const int band = static_cast<int>(
            std::floor(order == Order::rings ? height / 25 : angle / (10 * kRadPerDeg)));
        const double along = order == Order::rings ? angle : height;
        keys.push_back({order == Order::twice ? static_cast<int>(i % 2) : 0, band,
                        band % 2 == 0 ? along : -along, i});
    }
    std::sort(keys.begin(), keys.end(), [](const Key& a, const Key& b) {
        return std::tie(a.round, a.band, a.along, a.index) <
               std::tie(b.round, b.band, b.along, b.index);
    });
    Surface out;
    for (const Key& key : keys) out.points.push_back(points[key.index]);
    return out;
}

// All readings from one on are moved by these, in a random direction, about their middle.
void move_from(
    Surface& sweep, std::size_t first, double shift_mm, double turn_deg, Random& random) {
    Vector3 middle;
    for (Point3 p : sweep.points)
        if (std::isfinite(p.x))
            middle = middle + (p - Point3{}) / static_cast<double>(sweep.points.size());
    const auto direction = [&] {
        return normalized({random.gaussian(), random.gaussian(), random.gaussian()});
    };
    const Vector3 shift = shift_mm * direction();
    const Matrix3 turn = rotation_about(direction(), turn_deg * kRadPerDeg);
    for (std::size_t i = first; i < sweep.points.size(); ++i) {
        const Vector3 d = (sweep.points[i] - Point3{}) - middle;
        sweep.points[i] = Point3{} + middle + turn * d + shift;
    }
}

SweepMotion motion_in(const Surface& sweep) {
    const auto target = prepare_target(sweep);
    EXPECT_TRUE(target);
    return find_sweep_motion(*target);
}

void show(const char* what, const SweepMotion& m) {
    if (std::getenv("SONOCASE_SHOW"))
        std::printf(
            "%s: %s, from %zu, %.1f mm, %.1f degrees, gaps %.2f mm, closed %.2f mm, evidence %.0f, "
            "overlap %.2f\n",
            what, m.found ? "found" : "none", m.first_after, m.shift_mm, m.turn_deg, m.gap_mm,
            m.closed_gap_mm, m.evidence, m.overlap);
}

// Five builds, read all round and from the front, in four orders.
TEST(SweepMotion, OfFortySweepsThatDidNotMoveNoneIsFound) {
    int alarms = 0, sweeps = 0;
    for (const Build build : kBuilds) {
        for (const double front : {-2.0, -0.3}) {
            BuildSweep plan;
            plan.least_front = front;
            const BuiltMannequin m = built_mannequin(build, front < -1 ? 1 : 2, plan);
            for (const Order order : kOrders) {
                const SweepMotion found = motion_in(in_order(m, order));
                show((build_name(build) + " " + name_of(order)).c_str(), found);
                alarms += found.found;
                ++sweeps;
            }
        }
    }
    EXPECT_EQ(sweeps, 40);
    HardCase none("of 40 sweeps of mannequins at rest, called moved", HardCase::at_most, 0, "");
    none.see(alarms);
}

// Without noise what is left of the gaps along a border is the curvature of the skin, which a turn
// about it seems to close.
TEST(SweepMotion, OfScansWithoutNoiseNoneIsFound) {
    BuildSweep plan;
    plan.points = 6000;
    plan.noise_mm = plan.outliers = 0;
    for (const Build build : kBuilds) {
        const BuiltMannequin m = built_mannequin(build, 3, plan);
        for (const Order order : kOrders) {
            const SweepMotion found = motion_in(in_order(m, order));
            show((build_name(build) + " scan " + name_of(order)).c_str(), found);
            EXPECT_FALSE(found.found) << build_name(build) << " " << name_of(order);
        }
    }
}

TEST(SweepMotion, TheSharedSweepDidNotMove) {
    const std::string file = SONOCASE_DATA "/mannequin/sweep.csv";
    if (!std::filesystem::exists(file)) GTEST_SKIP() << "no " << file;
    const SweepMotion found = motion_in(*import_surface(file));
    show("shared", found);
    EXPECT_FALSE(found.found);
}

struct Move {
    double shift_mm, turn_deg;
};
constexpr Move kMoves[] = {{5, 0}, {10, 0}, {20, 0}, {0, 2}, {0, 5}};

// Moves every mannequin in every way, from another place in the order each time.
void for_moved(Order order, const std::vector<double>& fronts, const auto& see) {
    Random random(5);
    int moves = 0;
    for (const Build build : kBuilds) {
        for (const double front : fronts) {
            BuildSweep plan;
            plan.least_front = front;
            const BuiltMannequin m = built_mannequin(build, front < -1 ? 1 : 2, plan);
            for (const Move& move : kMoves) {
                Surface sweep = in_order(m, order);
                const std::size_t first = sweep.points.size() * (2 + moves++ % 5) / 8;
                move_from(sweep, first, move.shift_mm, move.turn_deg, random);
                const SweepMotion found = motion_in(sweep);
                show(text("%s %s %g mm %g degrees from %zu", build_name(build).c_str(),
                          name_of(order), move.shift_mm, move.turn_deg, first)
                         .c_str(),
                     found);
                see(move, first, found);
            }
        }
    }
}

// Where both parts were read all over, each motion is found with its size and its place.
TEST(SweepMotion, OfASweepThatWentOverTheWholeAgainIsFound) {
    HardCase shift("shift of a mannequin that moved in its sweep, off", HardCase::at_most, 2, "mm");
    HardCase turn("turn of it, off", HardCase::at_most, 2, "degrees");
    HardCase all("of 100 motions of 5 to 20 mm and 2 to 5 degrees, found", HardCase::at_least, 100,
                 "");
    int found = 0, near = 0;
    for (const Order order : {Order::anywhere, Order::twice}) {
        for_moved(
            order, {-2.0, -0.3}, [&](const Move& move, std::size_t first, const SweepMotion& m) {
                found += m.found;
                near +=
                    std::abs(static_cast<double>(m.first_after) - static_cast<double>(first)) < 50;
                if (move.turn_deg == 0) shift.see(std::abs(m.shift_mm - move.shift_mm));
                turn.see(std::abs(m.turn_deg - move.turn_deg));
            });
    }
    all.see(found);
    HardCase place("of these, within 50 of 2,000 readings", HardCase::at_least, 95, "");
    place.see(near);
}

// Where each place was read once, the two parts meet along a border alone: strips of some 75
// readings tell a motion of 10 mm or 5 degrees as a rule, and of one along the border nothing.
TEST(SweepMotion, OfASweepThatWentOverTheWholeOnceIsMostlyFound) {
    int found = 0;
    for (const Order order : {Order::strokes, Order::rings})
        for_moved(order, {-2.0},
                  [&](const Move&, std::size_t, const SweepMotion& m) { found += m.found; });
    HardCase some("of 50 motions seen along a border alone, found", HardCase::at_least, 30, "");
    some.see(found);
}

// Said once, with what moved, by how much, from which row on and what to do.
TEST(SweepMotion, IsNamedByTheFit) {
    const BuiltMannequin m = built_mannequin(Build::pear, 1, {});
    RegisterOptions options;
    options.up = m.head;
    for (const double shift_mm : {0.0, 10.0}) {
        Random random(8);
        Surface sweep = m.sweep;
        sweep.points.insert(sweep.points.begin(), 3, {NAN, 0, 0});  // rows that are left out count
        move_from(sweep, 1203, shift_mm, 0, random);
        const auto aligned = align_surfaces({torso_patient().skin, sweep}, options);
        ASSERT_TRUE(aligned);
        const auto& warnings = aligned->report.warnings;
        const auto named = std::find_if(warnings.begin(), warnings.end(), [](const std::string& w) {
            return w.find("moved while it was swept") != std::string::npos;
        });
        ASSERT_EQ(named != warnings.end(), shift_mm > 0);
        if (shift_mm == 0) continue;
        EXPECT_NE(named->find("from about reading 120"), std::string::npos) << *named;
        EXPECT_NE(named->find("by 10 mm"), std::string::npos) << *named;
        EXPECT_NE(named->find("sweep again"), std::string::npos) << *named;
    }
}

}  // namespace
}  // namespace sonocase::pipeline
