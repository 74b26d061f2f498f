// SPDX-License-Identifier: Apache-2.0

// A table that was read with the mannequin is found, left out of the fit, and used as a hint.
#include "pipeline/registration/fit/table_plane.h"
#include "formats/base/constants.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "pipeline/registration/fit/open_side.h"
#include "pipeline/registration/register_surfaces.h"
#include "support/hard_case.h"
#include "support/torso_builds.h"

namespace sonocase::pipeline {
namespace {

using namespace sonocase::testing;

// A mannequin on a table that touches its back, read beside the body.
struct OnTable {
    BuiltMannequin mannequin;
    Point3 place;  // on the table
    std::size_t body_readings = 0;
};

OnTable on_table(Build build, std::uint64_t seed, double least_front, int table_readings) {
    BuildSweep plan;
    plan.least_front = least_front;
    OnTable out{built_mannequin(build, seed, plan), {}, 0};
    BuiltMannequin& m = out.mannequin;
    out.body_readings = m.sweep.points.size();
    const Vector3 left = cross(m.head, m.back);
    double lowest = -1e9, widest = 0;
    Point3 centre;
    for (Point3 p : m.truth.points)
        centre = centre + (p - Point3{}) / static_cast<double>(m.truth.points.size());
    for (Point3 p : m.truth.points) {
        lowest = std::max(lowest, dot(p - centre, m.back));
        widest = std::max(widest, std::abs(dot(p - centre, left)));
    }
    out.place = centre + lowest * m.back;
    Random random(seed);
    for (int n = 0; n < table_readings; ++n) {
        const double side = (n % 2 == 0 ? 1 : -1) * (widest + random.uniform(30, 160));
        m.sweep.points.push_back(out.place + side * left + random.uniform(-180, 180) * m.head +
                                 0.7 * random.gaussian() * m.back);
    }
    return out;
}

TEST(TablePlane, IsFoundAmongFewAndManyReadingsWithinADegreeAndTwoMillimetres) {
    HardCase tilt("tilt of the table found", HardCase::at_most, 1, "degrees");
    HardCase height("its height, off", HardCase::at_most, 2, "mm");
    for (const Build build : kBuilds) {
        for (const int readings : {12, 40, 400}) {
            for (const double least_front : {-0.3, -0.8}) {
                SCOPED_TRACE(build_name(build) + " " + std::to_string(readings));
                const OnTable lying = on_table(build, 2, least_front, readings);
                const BuiltMannequin& m = lying.mannequin;
                const TablePlane table = find_table(m.sweep.points);
                ASSERT_TRUE(table.found);
                // 12 readings with a noise of 0.7 mm leave the normal uncertain by a third of a
                // degree.
                tilt.see(std::acos(std::min(1.0, dot(table.normal, -m.back))) * kDegPerRad);
                height.see(std::abs(dot(table.normal, lying.place - table.place)));
                long taken = 0;
                for (std::size_t i = 0; i < table.on_table.size(); ++i) {
                    if (i >= lying.body_readings) {
                        EXPECT_TRUE(table.on_table[i]) << i;
                    } else {
                        taken += table.on_table[i];
                    }
                }
                // Where the back touches the table, a reading may belong to either.
                EXPECT_LE(taken, 4);
            }
        }
    }
}

TEST(TablePlane, NoBodyAloneIsATable) {
    for (const Build build :
         {Build::belly, Build::wide, Build::slim, Build::pear, Build::gaunt, Build::huge}) {
        for (const double least_front : {-2.0, -0.3, 0.0}) {
            for (std::uint64_t seed = 1; seed <= 3; ++seed) {
                BuildSweep plan;
                plan.least_front = least_front;
                const TablePlane table =
                    find_table(built_mannequin(build, seed, plan).sweep.points);
                EXPECT_FALSE(table.found) << build_name(build) << least_front;
            }
        }
    }
    // A flat back, flat ends and a rim in one plane belong to the body: they lie inside its
    // outline.
    Random random(3);
    Surface flat;
    for (int n = 0; n < 2000; ++n) {
        const double angle = random.uniform(0, 3.14159265), r = std::sqrt(random.uniform(0, 1));
        const double z = random.uniform(-200, 200);
        if (n % 3 == 0) {
            flat.points.push_back({random.uniform(-150, 150), random.gaussian(), z});
        } else if (n % 3 == 1) {
            flat.points.push_back({150 * std::cos(angle), 110 * std::sin(angle), z});
        } else {
            flat.points.push_back({150 * r * std::cos(angle), 110 * r * std::sin(angle),
                                   n % 2 == 0 ? -200.0 : 200.0});
        }
    }
    EXPECT_FALSE(find_table(flat.points).found);
}

TEST(TablePlane, OfReadingsOfTheTableOnlyNothingIsFitted) {
    Random random(1);
    Surface table;
    for (int n = 0; n < 400; ++n)
        table.points.push_back(
            {random.uniform(-300, 300), random.uniform(-500, 500), 0.7 * random.gaussian()});
    HardCase fitted("of two clouds of the table, fitted", HardCase::at_most, 0, "");
    const auto refused = register_surfaces({torso_patient().skin, table});
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().message().find("in a plane"), std::string::npos)
        << refused.error().message();
    // Twenty readings of a body do not change that.
    for (int n = 0; n < 20; ++n)
        table.points.push_back(
            {random.uniform(-100, 100), random.uniform(-100, 100), random.uniform(50, 150)});
    fitted.see(refused.has_value() + register_surfaces({torso_patient().skin, table}).has_value());
}

// 95th percentile of the distance from the true surface that nobody read to the mapped skin.
double unread_error_mm(const OnTable& lying, const RegisterResult& result) {
    const Surface mapped = mapped_skin(torso_patient().skin.skin, result.registration, Point3{});
    const PointIndex places(mapped.points);
    const Vector3 back = lying.mannequin.back;
    Point3 centre;
    for (Point3 p : lying.mannequin.truth.points) {
        centre = centre + (p - Point3{}) / static_cast<double>(lying.mannequin.truth.points.size());
    }
    std::vector<double> off;
    for (Point3 p : lying.mannequin.truth.points) {
        if (dot(p - centre, back) < 40) continue;
        const std::uint32_t v = places.nearest(p);
        if (torso_patient().skin.on_rim[v]) continue;
        off.push_back(std::abs(dot(p - mapped.points[v], mapped.normals[v])));
    }
    std::sort(off.begin(), off.end());
    return off[off.size() * 95 / 100];
}

TEST(TablePlane, LeavesTheBackNearerToTheTruthAndSaysWhichSideItIs) {
    for (const Build build : {Build::slim, Build::gaunt}) {
        SCOPED_TRACE(build_name(build));
        const OnTable lying = on_table(build, 1, -0.3, 40);
        RegisterOptions options;
        options.up = lying.mannequin.head;
        options.landmarks = lying.mannequin.landmarks;
        const RegisterInput input{torso_patient().skin, lying.mannequin.sweep,
                                  &torso_patient().labels};
        const auto with = register_surfaces(input, options);
        ASSERT_TRUE(with) << with.error().message();
        Surface bare = lying.mannequin.sweep;
        bare.points.resize(lying.body_readings);
        const auto without =
            register_surfaces({torso_patient().skin, bare, &torso_patient().labels}, options);
        ASSERT_TRUE(without);
        EXPECT_LT(unread_error_mm(lying, *with), unread_error_mm(lying, *without));
        RecordProperty("with_" + build_name(build), std::to_string(unread_error_mm(lying, *with)));
        std::printf("%s: unread back %.1f mm without the table, %.1f mm with it\n",
                    build_name(build).c_str(), unread_error_mm(lying, *without),
                    unread_error_mm(lying, *with));
        EXPECT_LE(with->fit.behind_table_mm, 15);
        EXPECT_LE(with->fit.median_mm, 0.75);
        EXPECT_LE(with->fit.p95_mm, 2.7);
        EXPECT_GE(with->registration.min_det_jacobian, 0.2);
        for (const OrganChange& c : with->organs) {
            if (c.label == "liver" || c.label == "spleen" || c.label.starts_with("kidney_")) {
                EXPECT_NEAR(c.volume_ratio, 1, 0.08) << c.label;
            }
        }
    }
}

// Without any hint but the table the patient does not lie face down.
TEST(TablePlane, DecidesTheOpenSideEvenOfAClosedSweep) {
    const OnTable lying = on_table(Build::belly, 3, -0.6, 40);
    RegisterOptions options;
    options.up = lying.mannequin.head;
    const auto aligned = align_surfaces(
        {torso_patient().skin, lying.mannequin.sweep, &torso_patient().labels}, options);
    ASSERT_TRUE(aligned) << aligned.error().message();
    EXPECT_LT(dot(aligned->registration.mannequin_from_ct.rotation.column(1), lying.mannequin.back),
              -0.7);
    bool told = false;
    for (const Note& note : aligned->report.notes)
        told |= note.text.find("the table that was read") != std::string::npos;
    EXPECT_TRUE(told);
    for (const Measure& m : aligned->report.measures) {
        if (m.name == "table_readings") {
            EXPECT_NEAR(m.value, 40, 2);
        }
    }
}

}  // namespace
}  // namespace sonocase::pipeline
