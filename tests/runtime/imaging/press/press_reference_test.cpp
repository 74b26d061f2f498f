// SPDX-License-Identifier: Apache-2.0

// The press field in lanes against the plain one, and the plain one against itself.
#include <gtest/gtest.h>

#include "runtime/imaging/press/plain_press.h"
#include "runtime/imaging/press/press_support.h"
#include "support/hard_case.h"

namespace sonocase::testing {
namespace {

using namespace runtime::press;

// Mean distance over the picture between what two maps show.
template <class A, class B>
double mean_distance(const A& a, const B& b) {
    double sum = 0;
    int count = 0;
    for (double x = -19; x <= 19; x += 1)
        for (double z = 0; z <= 60; z += 1) {
            const BeamPoint p = a(BeamPoint{x, z}), q = b(BeamPoint{x, z});
            sum += std::hypot(p.lateral_mm - q.lateral_mm, p.depth_mm - q.depth_mm);
            ++count;
        }
    return sum / count;
}

auto map_of(const PressField& field) {
    return [&field](BeamPoint p) {
        const Point3 rest = field.pull_back({p.lateral_mm, 0, p.depth_mm});
        return BeamPoint{rest.x, rest.z};
    };
}
auto map_of(const PlainPress& plain) {
    return [&plain](BeamPoint p) { return plain.pull_back(p); };
}

TEST(PressReference, TheFastFieldIsThePlainOneUpToItsIterations) {
    PressField field({});
    HardCase iterated("fast field off the plain one, all iterations", HardCase::at_most, 0.06,
                      "mm");
    HardCase force("its force, off", HardCase::at_most, 0.001, "");
    HardCase frame("with the iterations of a frame, over what is pressed", HardCase::at_most, 0.02,
                   "");
    for (const double pressed_mm : {2.0, 8.0, 15.0}) {
        const Body body = vessels(pressed_mm);
        (void)press(field, body, {{3, 400, 400}, 1});
        const PlainPress plain(field.samples(), field.face(), 3);
        // All iterations: what is left is single precision, three Newton steps for the factor of a
        // column and a table of 0.375 mm.
        iterated.see(mean_distance(map_of(field), map_of(plain)));
        force.see(std::abs(field.state().force_n / plain.force_n() - 1));
        (void)press(field, body);
        // With the iterations of a frame: 2 % of what tissue moves.
        frame.see(mean_distance(map_of(field), map_of(plain)) / pressed_mm);
    }
}

TEST(PressReference, IncrementsConverge) {
    PressField field({});
    (void)press(field, vessels(8));
    const auto plain = [&](int increments) {
        return PlainPress(field.samples(), field.face(), increments);
    };
    const PlainPress finest = plain(48);
    double before = 1e9;
    for (const int increments : {1, 3, 12}) {
        const PlainPress now = plain(increments);
        const double error = mean_distance(map_of(now), map_of(finest));
        EXPECT_LT(error, before / 2) << increments;  // first order: a third or a quarter each
        before = error;
    }
}

TEST(PressReference, RandomTissuesAgreeToo) {
    Random random(23);
    HardCase off("fast field off the plain one, random tissues", HardCase::at_most, 0.25, "mm");
    PressField field({});
    for (int n = 0; n < 8; ++n) {
        const Body body = random_body(random);
        if (!press(field, body, {{3, 400, 400}, 1})) continue;
        const PlainPress plain(field.samples(), field.face(), 3);
        const double excess = field.state().excess_mm;
        const auto fast = [&](BeamPoint p) {
            const Point3 rest = field.pull_back({p.lateral_mm, 0, p.depth_mm - excess});
            return BeamPoint{rest.x, rest.z + excess};
        };
        off.see(mean_distance(fast, map_of(plain)));
    }
}

}  // namespace
}  // namespace sonocase::testing
