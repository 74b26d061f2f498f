// SPDX-License-Identifier: Apache-2.0

// Pressing a case's bundle, and that a pressed frame allocates nothing: this program counts.
#include "runtime/imaging/press/press_bundle.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <new>

#include "runtime/imaging/press/press_field.h"
#include "support/phantom_bundle.h"
#include "support/random.h"

namespace {
std::atomic<long> allocations{0};
}  // namespace

// Not inlined: GCC 12 would take the memory for malloc's own, and warn where delete frees it.
[[gnu::noinline]] void* operator new(std::size_t size) {
    ++allocations;
    if (void* memory = std::malloc(size)) return memory;
    throw std::bad_alloc();
}
[[gnu::noinline]] void operator delete(void* memory) noexcept {
    std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept {
    std::free(memory);
}

namespace sonocase::testing {
namespace {

using namespace runtime::press;

Rigid pressed_by(double mm) {
    Rigid pose;
    pose.translation = {0, 0, mm};
    return pose;
}

runtime::SimdTarget best() {
    return runtime::available_simd_targets().front();
}

TEST(PressBundle, LooksUpTheVoxelsOwnLabelsAlongAnyLine) {
    const CaseBundle bundle = Phantom().bundle();
    PressBundle body(bundle);
    ASSERT_EQ(body.tissues().size(), bundle.labels.size());
    Random random(41);
    for (int n = 0; n < 80; ++n) {
        const Rigid pose = random.rigid(40);
        const PressScene scene = body.scene(pose);
        std::vector<PressLine> lines;
        for (int l = 0; l <= n % kMaxPressLines; ++l)
            lines.push_back({random.point(60), random.direction()});
        const std::array<float, 5> depth{-30, -1, 0, 12.5f, 71};
        std::vector<std::uint8_t> found(depth.size() * lines.size());
        scene.lookup.along(scene.lookup.context, lines, depth, found.data());
        for (const runtime::SimdTarget& target : runtime::available_simd_targets()) {
            PressBundle other(bundle, {8, target});
            std::vector<std::uint8_t> again(found.size());
            const PressScene same = other.scene(pose);
            same.lookup.along(same.lookup.context, lines, depth, again.data());
            EXPECT_EQ(again, found) << target.name;
        }
        for (std::size_t k = 0; k < found.size(); ++k) {
            const PressLine& line = lines[k % lines.size()];
            const Point3 p = pose * (line.from + double{depth[k / lines.size()]} * line.direction);
            const Point3 v = bundle.grid.voxel_from_point(p);
            const auto clamped = [](double x, int size) {
                return static_cast<int>(std::clamp(std::floor(x + 0.5), 0.0, size - 1.0));
            };
            const Int3 size = bundle.label_bricks.size;
            EXPECT_EQ(found[k], bundle.label_bricks.at(clamped(v.x, size.x), clamped(v.y, size.y),
                                                       clamped(v.z, size.z)));
        }
    }
    EXPECT_EQ(body.label({NAN, NAN, NAN}), bundle.label_bricks.at(0, 0, 0));
}

TEST(PressBundle, FiguresComeFromTissuesAndLabels) {
    CaseBundle bundle = Phantom().bundle();
    bundle.labels[Phantom::blood].name = "femoral_vein";
    bundle.tissues[Phantom::liver].mechanics = TissueMechanics{21, false, 0.1, false};
    const PressBundle body(bundle, {16});
    const auto tissues = body.tissues();
    EXPECT_TRUE(tissues[Phantom::outside].outside);
    EXPECT_TRUE(tissues[Phantom::skin].membrane);
    EXPECT_TRUE(tissues[Phantom::blood].drains);
    EXPECT_NEAR(tissues[Phantom::blood].stiffness_kpa, 1.2, 1e-6);  // twice the pressure
    EXPECT_EQ(tissues[Phantom::liver].stiffness_kpa, 21);
    EXPECT_TRUE(tissues[Phantom::bone].rigid);
}

TEST(PressBundle, APressedPhantomYieldsAndItsRibDoesNot) {
    const CaseBundle bundle = Phantom().bundle();
    PressBundle body(bundle);
    PressField field({});
    EXPECT_FALSE(field.press(best(), body.scene(pressed_by(-3))));
    ASSERT_TRUE(field.press(best(), body.scene(pressed_by(6))));
    EXPECT_GT(field.state().force_n, 0.5);
    EXPECT_LT(field.state().force_n, 30);
    // The skin is at the face, the rib where it was.
    EXPECT_NEAR(field.pull_back({10, 0, 0}).z, -6 + 100.0 / 900, 1.1);  // a voxel
    const Point3 rib = field.pull_back({-20, 0, 24 - 6});
    EXPECT_NEAR(rib.z, 24 - 6, 0.6);
}

TEST(PressBundle, NothingIsAllocatedOnceThereIsAField) {
    const CaseBundle bundle = Phantom().bundle();
    PressBundle body(bundle);
    PressField field({});
    const runtime::SimdTarget target = best();
    (void)field.press(target, body.scene(pressed_by(4)));
    const long before = allocations;
    for (const double mm : {-5.0, 0.5, 8.0, 25.0, 120.0}) {
        (void)field.press(target, body.scene(pressed_by(mm)));
        (void)field.push_forward(field.pull_back({3, 2, 20}));
        (void)field.closed({3, 0, 20});
    }
    EXPECT_EQ(allocations, before);
}

}  // namespace
}  // namespace sonocase::testing
