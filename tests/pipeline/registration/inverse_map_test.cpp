// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/map/inverse_map.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "support/hard_case.h"
#include "support/random.h"

namespace sonocase::pipeline {
namespace {

using sonocase::testing::HardCase;

using sonocase::testing::Random;

// A body-sized map: any rigid motion, a quadratic of a few cm and a residual of a few mm.
Registration some_map(std::uint64_t seed, double residual_mm) {
    Random random(seed);
    Registration r;
    r.ct_box.include(Point3{-180, -140, 90});
    r.ct_box.include(Point3{180, 140, 430});
    r.mannequin_from_ct = random.rigid(300);
    r.quadratic = QuadraticMap::from_rigid(r.mannequin_from_ct, r.ct_box.centre(), 200);
    for (auto& row : r.quadratic.coefficients) {
        for (std::size_t c = 1; c < 10; ++c) row[c] += random.uniform(-8, 8);
    }
    if (residual_mm > 0) {
        const double h = 30;
        r.residual.spacing_mm = h;
        r.residual.origin_mm = r.ct_box.lower;
        const Vector3 e = r.ct_box.extent();
        r.residual.size = {static_cast<int>(std::ceil(e.x / h)) + 3,
                           static_cast<int>(std::ceil(e.y / h)) + 3,
                           static_cast<int>(std::ceil(e.z / h)) + 3};
        const std::size_t n =
            static_cast<std::size_t>(r.residual.size.x) * r.residual.size.y * r.residual.size.z;
        for (std::size_t i = 0; i < n; ++i) {
            r.residual.control_mm.push_back({residual_mm * random.gaussian(),
                                             residual_mm * random.gaussian(),
                                             residual_mm * random.gaussian()});
        }
    }
    return r;
}

Point3 point_in(const Box3& box, Random& random) {
    return {random.uniform(box.lower.x, box.upper.x), random.uniform(box.lower.y, box.upper.y),
            random.uniform(box.lower.z, box.upper.z)};
}

TEST(InverseMap, ReturnsToTheStartWithinAMicrometre) {
    HardCase loop("there and back", HardCase::at_most, 1e-6, "mm");
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
        SCOPED_TRACE(::testing::Message() << "seed " << seed);
        const Registration r = some_map(seed, seed % 2 ? 3 : 0);
        const InverseMap inverse_map(r);
        Random random(100 + seed);
        for (int i = 0; i < 500; ++i) {
            const Point3 x = point_in(r.ct_box, random);
            Point3 back;
            ASSERT_EQ(inverse_map.invert(mannequin_from_ct(r, x), &back), MapStatus::ok);
            loop.see(distance(back, x));
        }
    }
}

TEST(InverseMap, PointsOnTheFaceOfTheBoxAreInside) {
    const Registration r = some_map(3, 3);
    const InverseMap inverse_map(r);
    Random random(5);
    for (int i = 0; i < 300; ++i) {
        Point3 x = point_in(r.ct_box, random);
        x[i % 3] = i % 2 ? r.ct_box.lower[i % 3] : r.ct_box.upper[i % 3];
        Point3 back;
        EXPECT_EQ(inverse_map.invert(mannequin_from_ct(r, x), &back), MapStatus::ok);
    }
}

TEST(InverseMap, BeyondTheBoxIsOutside) {
    const Registration r = some_map(4, 3);
    const InverseMap inverse_map(r);
    Point3 x = r.ct_box.centre();
    x.z = r.ct_box.upper.z + 10;
    Point3 back;
    EXPECT_EQ(inverse_map.invert(mannequin_from_ct(r, x), &back), MapStatus::outside);
    EXPECT_EQ(inverse_map.invert({NAN, 0, 0}, &back), MapStatus::no_preimage);
    EXPECT_TRUE(std::isnan(back.x));
}

// y_x = x^2 / 200 - 100 reaches no point with y_x < -100, and every other twice: the box keeps
// x > 0.
Registration folding_map() {
    Registration r;
    r.ct_box.include(Point3{0, -100, -100});
    r.ct_box.include(Point3{200, 100, 100});
    r.quadratic.scale_mm = 1;
    r.quadratic.coefficients[0] = {-100, 0, 0, 0, 1 / 200.0, 0, 0, 0, 0, 0};
    r.quadratic.coefficients[1] = {0, 0, 1, 0, 0, 0, 0, 0, 0, 0};
    r.quadratic.coefficients[2] = {0, 0, 0, 1, 0, 0, 0, 0, 0, 0};
    return r;
}

TEST(InverseMap, TellsPointsWithoutPreimageFromTheRest) {
    const Registration r = folding_map();
    const InverseMap inverse_map(r);
    Random random(6);
    int none = 0;
    HardCase taken("of a thousand targets, found where none is", HardCase::at_most, 0, "");
    for (int i = 0; i < 1000; ++i) {
        const Point3 y{random.uniform(-150, 100), random.uniform(-90, 90), random.uniform(-90, 90)};
        Point3 x;
        const MapStatus status = inverse_map.invert(y, &x);
        if (y.x < -100) {
            taken.see(status == MapStatus::no_preimage ? 0 : 1);
            ++none;
        } else {
            ASSERT_EQ(status, MapStatus::ok) << y.x;
            EXPECT_LT(distance(mannequin_from_ct(r, x), y), 1e-6);
        }
    }
    EXPECT_GT(none, 100);
}

TEST(InverseMap, PointsExactlyOnAFoldAreFoundOrRefusedNeverWrong) {
    const Registration r = folding_map();
    const InverseMap inverse_map(r);
    for (int i = -5; i <= 5; ++i) {
        const Point3 y{-100, 10.0 * i, 3.0 * i};
        Point3 x;
        if (inverse_map.invert(y, &x) == MapStatus::ok) {
            EXPECT_LT(distance(mannequin_from_ct(r, x), y), 1e-6);
        }
    }
}

// The row solver against the point solver: same verdicts away from the edges, same places.
void expect_rows_agree(const Registration& r, double step_mm, std::uint64_t seed) {
    const InverseMap inverse_map(r);
    Random random(seed);
    Box3 image;
    for (int i = 0; i < 3000; ++i) image.include(mannequin_from_ct(r, point_in(r.ct_box, random)));
    const int count = static_cast<int>(1.2 * norm(image.extent()) / step_mm);
    std::vector<float> px(static_cast<std::size_t>(count)), py(px), pz(px);
    std::vector<MapStatus> status(px.size());
    int ok = 0, differ = 0;
    for (int row = 0; row < 40; ++row) {
        const Vector3 step = step_mm * (row % 2 ? Vector3{1, 0, 0} : random.direction());
        const Point3 through = point_in(image, random);
        const Point3 start = through + (-0.5 * count) * step;
        inverse_map.invert_row(start, step, count, px.data(), py.data(), pz.data(), status.data());
        for (int i = 0; i < count; ++i) {
            const auto n = static_cast<std::size_t>(i);
            Point3 exact;
            const MapStatus truth =
                inverse_map.invert(start + static_cast<double>(i) * step, &exact);
            if ((truth == MapStatus::ok) != (status[n] == MapStatus::ok)) {
                ++differ;
                continue;
            }
            if (truth != MapStatus::ok) continue;
            ++ok;
            // The cubic's 5e-4 mm plus single-precision coordinates.
            const Point3 y = start + static_cast<double>(i) * step;
            EXPECT_LT(distance(mannequin_from_ct(r, {px[n], py[n], pz[n]}), y), 1e-3) << i;
        }
    }
    EXPECT_GT(ok, 1000);
    EXPECT_LE(differ, 2);  // points within rounding of a face
}

TEST(InverseMap, RowsAgreeWithPoints) {
    expect_rows_agree(some_map(11, 0), 1.0, 21);
    expect_rows_agree(some_map(12, 3), 1.0, 22);
    expect_rows_agree(some_map(13, 3), 0.5, 23);
    expect_rows_agree(some_map(14, 2), 4.0, 24);
    expect_rows_agree(folding_map(), 1.0, 25);
}

TEST(InverseMap, ShortRowsAreWhole) {
    const Registration r = some_map(15, 3);
    const InverseMap inverse_map(r);
    const Point3 y = mannequin_from_ct(r, r.ct_box.centre());
    for (int count = 1; count < 40; ++count) {
        std::vector<float> x(static_cast<std::size_t>(count), -1e9f), yy(x), z(x);
        std::vector<MapStatus> status(x.size(), MapStatus::no_preimage);
        inverse_map.invert_row(y, {1, 0, 0}, count, x.data(), yy.data(), z.data(), status.data());
        for (int i = 0; i < count; ++i) {
            EXPECT_EQ(status[i], MapStatus::ok) << count << " " << i;
            EXPECT_NE(x[i], -1e9f) << count << " " << i;
        }
    }
}

TEST(InverseMap, FramesAKilometreAwayLoseNothingButTheirOwnRounding) {
    Registration r = some_map(16, 0);
    for (auto& row : r.quadratic.coefficients) row[0] += 1e6;
    const InverseMap inverse_map(r);
    HardCase loop("there and back, frame 1e6 mm away", HardCase::at_most, 1e-6, "mm");
    Random random(17);
    for (int i = 0; i < 200; ++i) {
        const Point3 x = point_in(r.ct_box, random);
        Point3 back;
        ASSERT_EQ(inverse_map.invert(mannequin_from_ct(r, x), &back), MapStatus::ok);
        loop.see(distance(back, x));
    }
}

}  // namespace
}  // namespace sonocase::pipeline
