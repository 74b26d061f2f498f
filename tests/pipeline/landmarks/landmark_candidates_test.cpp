// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/landmark_candidates.h"
#include "formats/base/constants.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "pipeline/registration/landmark_file.h"
#include "support/hard_case.h"
#include "support/temporary_folder.h"

namespace sonocase::pipeline {
namespace {

// Readings of a trunk of 300 x 200 mm from z = 0 to 450, with a navel of 6 mm at (0, front, 170),
// and of two legs of 150 mm below it; axes: x right, y front, z up.
std::vector<Point3> body(bool legs, bool navel, double noise_mm = 0.5) {
    std::mt19937 random(3);
    std::uniform_real_distribution<double> share(0, 1);
    std::normal_distribution<double> off(0, noise_mm);
    std::vector<Point3> out;
    const auto add = [&](Point3 p) {
        out.push_back({p.x + off(random), p.y + off(random), p.z + off(random)});
    };
    for (int i = 0; i < 9000; ++i) {
        const double a = 2 * kPi * share(random), z = 450 * share(random);
        Point3 p{150 * std::cos(a), 100 * std::sin(a), z};
        const double r = std::hypot(p.x, p.z - 170);
        if (navel && p.y > 0) p.y -= 6 * std::exp(-0.5 * r * r / 36);
        add(p);
    }
    for (int i = 0; legs && i < 4000; ++i) {
        const double a = 2 * kPi * share(random), z = -300 * share(random);
        const double side = i % 2 == 0 ? 76 : -76;
        add({side + 74 * std::cos(a), 80 * std::sin(a), z});
    }
    for (int i = 0; legs && i < 300; ++i)  // between the legs
        add({30 * share(random) - 15, 80 * share(random) - 40, 0});
    return out;
}

const LandmarkCandidate* named(const std::vector<LandmarkCandidate>& all, const char* name) {
    for (const LandmarkCandidate& one : all)
        if (one.name == name) return &one;
    return nullptr;
}

TEST(LandmarkCandidates, FindNavelAndCrotchInAnyFrame) {
    // Readings lie 6 mm apart; a front that is 6 degrees off moves the midline's band.
    testing::HardCase navel_off("navel in readings 6 mm apart, off", testing::HardCase::at_most, 9,
                                "mm");
    for (const double turn : {0.0, 1.1, 3.0}) {
        const Matrix3 frame = rotation_about(normalized(Vector3{0.3, -1, 0.5}), turn);
        const Vector3 shift{120, -340, 55};
        Surface skin;
        for (const Point3 p : body(true, true))
            skin.points.push_back(Point3{} + frame * (p - Point3{}) + shift);
        const auto found =
            landmark_candidates(skin, frame * Vector3{0, 0, 1}, frame * Vector3{0.1, 1, 0.2});
        const auto at = [&](Point3 p) { return Point3{} + frame * (p - Point3{}) + shift; };
        const auto* navel = named(found, "navel");
        const auto* crotch = named(found, "crotch");
        ASSERT_NE(navel, nullptr);
        ASSERT_NE(crotch, nullptr);
        navel_off.see(distance(navel->place, at({0, 94, 170})));
        const Vector3 off = crotch->place - at({0, 0, 0});
        EXPECT_LT(std::abs(dot(off, frame * Vector3{0, 0, 1})), 16) << turn;  // a slice
        EXPECT_LT(std::abs(dot(off, frame * Vector3{1, 0, 0})), 10) << turn;
        ASSERT_NE(named(found, "leftmost"), nullptr);
        EXPECT_NEAR(dot(named(found, "rightmost")->place - named(found, "leftmost")->place,
                        frame * Vector3{1, 0, 0}),
                    300, 8);
    }
}

TEST(LandmarkCandidates, LeaveOutWhatTheBodyDoesNotShow) {
    Surface trunk;
    trunk.points = body(false, false);
    const auto found = landmark_candidates(trunk, {0, 0, 1}, {0, 1, 0});
    EXPECT_EQ(named(found, "crotch"), nullptr);
    EXPECT_EQ(named(found, "navel"), nullptr);
    EXPECT_EQ(found.size(), 4u);
    EXPECT_TRUE(landmark_candidates(Surface{}, {0, 0, 1}, {0, 1, 0}).empty());
    EXPECT_EQ(landmark_rows(found, {}), "name,ct_x,ct_y,ct_z,x,y,z\n");
}

TEST(LandmarkCandidates, ThePictureAndTheRowsHoldBoth) {
    Surface skin;
    skin.points = body(true, true);
    const auto found = landmark_candidates(skin, {0, 0, 1}, {0, 1, 0});
    const std::string rows = landmark_rows(found, found);
    EXPECT_NE(rows.find("navel,"), std::string::npos);
    const auto png = landmark_picture(
        {{&skin, {0, 0, 1}, {0, 1, 0}, found}, {&skin, {0, 0, 1}, {0, 1, 0}, found}});
    ASSERT_GT(png.size(), 1000u);
    EXPECT_EQ(png[1], 'P');
}

TEST(LandmarkFile, ColumnsGoByTheirNamesInAnyOrder) {
    const auto plain = parse_landmarks("navel,1,2,3,4,5,6\n", "a.csv");
    const auto named = parse_landmarks(
        "\xEF\xBB\xBFx;y;z;ct_x;ct_y;ct_z;name;remark\n4,0;5;6;1;2;3;navel;soft\n", "a.csv");
    for (const auto& read : {plain, named}) {
        ASSERT_TRUE(read) << read.error().message();
        EXPECT_EQ(read->at(0).name, "navel");
        EXPECT_EQ(read->at(0).ct, (Point3{1, 2, 3}));
        EXPECT_EQ(read->at(0).mannequin, (Point3{4, 5, 6}));
    }
    const auto more = parse_landmarks("navel,1,2,3,4,5,6,7\n", "a.csv");
    ASSERT_FALSE(more);
    EXPECT_NE(more.error().message().find("name,ct_x,ct_y,ct_z,x,y,z"), std::string::npos);
    EXPECT_TRUE(parse_landmarks("name,ct_x,ct_y,ct_z,x,y,z,w\nnavel,1,2,3,4,5,6,7\n", "a.csv"));
    EXPECT_NE(parse_landmarks("navel,1,2,3,4,5,6\nh\xFC"
                              "fte,1,2,3,4,5,6\n",
                              "a.csv")
                  .error()
                  .message()
                  .find("a.csv:2"),
              std::string::npos);
}

TEST(LandmarkFile, TheHeaderSaysBodiesAxesAndUnits) {
    const auto first = [](const std::string& csv) {
        const auto read = parse_landmarks(csv, "a.csv");
        EXPECT_TRUE(read) << read.error().message();
        return read ? read->at(0) : Landmark{};
    };
    const Landmark lps = first("name,ct_l,ct_p,ct_s,x,y,z\nnavel,1,2,3,4,5,6\n");
    EXPECT_EQ(lps.ct, (Point3{-1, -2, 3}));
    EXPECT_EQ(lps.mannequin, (Point3{4, 5, 6}));
    const Landmark swapped =
        first("name,mannequin_x,mannequin_y,mannequin_z,ct_x,ct_y,ct_z\nnavel,4,5,6,1,2,3\n");
    EXPECT_EQ(swapped.ct, (Point3{1, 2, 3}));
    EXPECT_EQ(swapped.mannequin, (Point3{4, 5, 6}));
    const Landmark units =
        first("Landmark;CT X (cm);CT Y (cm);CT Z (cm);R;A;S\nnavel;1;2;3;4;5;6\n");
    EXPECT_EQ(units.ct, (Point3{10, 20, 30}));
    EXPECT_EQ(units.mannequin, (Point3{4, 5, 6}));
    // Names that leave open which body is which, which axis, or which unit.
    for (const char* header : {"name,x,y,z,x,y,z", "name,a1,a2,a3,b1,b2,b3",
                               "name,ct_x,ct_y,ct_z,x,y,w", "name,ct_x_cm,ct_y,ct_z,x,y,z",
                               "name,ct_l,ct_a,ct_s,x,y,z", "mark,ct_x,ct_y,ct_z,x,y,z"}) {
        const auto read = parse_landmarks(std::string(header) + "\nnavel,1,2,3,4,5,6\n", "a.csv");
        ASSERT_FALSE(read) << header;
        EXPECT_NE(read.error().message().find("which are the coordinates?"), std::string::npos);
    }
}

TEST(LandmarkFile, TwoListsOfMarksArePairedByName) {
    const testing::TemporaryFolder folder;
    const std::string patient =
        folder.write("ct.mrk.json",
                     R"({"markups":[{"coordinateSystem":"LPS","controlPoints":[
            {"label":"navel","position":[-1,-2,3]},{"label":"hip","position":[-4,-5,6]}]}]})");
    const std::string surface =
        folder.write("m.fcsv",
                     "# Markups fiducial file version = 4.11\n# CoordinateSystem = RAS\n"
                     "# columns = id,x,y,z,label\n1,40,50,60,hip\n2,10,20,30,navel\n");
    const auto pairs = load_landmarks(patient, surface);
    ASSERT_TRUE(pairs) << pairs.error().message();
    ASSERT_EQ(pairs->size(), 2u);
    EXPECT_EQ(pairs->at(0).ct, (Point3{1, 2, 3}));
    EXPECT_EQ(pairs->at(0).mannequin, (Point3{10, 20, 30}));
    EXPECT_EQ(pairs->at(1).mannequin, (Point3{40, 50, 60}));
    // One list alone is no pair; the advice is the option of the second.
    const auto alone = load_landmarks(patient);
    ASSERT_FALSE(alone);
    EXPECT_NE(alone.error().message().find("--surface-landmarks"), std::string::npos);
    const std::string less = folder.write("less.csv", "name,x,y,z\nhip,1,2,3\n");
    EXPECT_NE(load_landmarks(patient, less).error().message().find("'navel'"), std::string::npos);
    // Marks without names, or with the same, would all be paired with the first.
    for (const auto& [name, what] :
         {std::pair{"", "mark 1 has no name"}, std::pair{"navel", "two marks are named 'navel'"}}) {
        const std::string twice = folder.write(
            "twice.mrk.json",
            std::string(R"({"markups":[{"coordinateSystem":"LPS","controlPoints":[{"label":")") +
                name + R"(","position":[1,2,3]},{"label":")" + name +
                R"(","position":[4,5,6]}]}]})");
        for (const auto& refused :
             {load_landmarks(twice, surface), load_landmarks(patient, twice)}) {
            ASSERT_FALSE(refused);
            EXPECT_NE(refused.error().message().find(what), std::string::npos)
                << refused.error().message();
            EXPECT_NE(refused.error().where.find("twice"), std::string::npos);
        }
    }
}

}  // namespace
}  // namespace sonocase::pipeline
