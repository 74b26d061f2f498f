// SPDX-License-Identifier: Apache-2.0

// register and map as a case author meets them, with the sweeps that go wrong.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "formats/text/number_text.h"
#include "pipeline/import/mesh/surface_file.h"
#include "pipeline/registration/map/registration.h"
#include "support/hard_case.h"
#include "support/paths.h"
#include "support/random.h"
#include "support/run_command.h"
#include "support/temporary_folder.h"

namespace sonocase::pipeline {
namespace {

using sonocase::testing::CommandResult;
using sonocase::testing::read_text;
using sonocase::testing::TemporaryFolder;

const std::string kLabels = SONOCASE_DATA "/ct/labels.nii.gz";
const std::string kSweep = SONOCASE_DATA "/mannequin/sweep.csv";

CommandResult run(const std::string& arguments, const TemporaryFolder& folder) {
    return sonocase::testing::run_command("cd " + folder.path() + " && " SONOCASE_BIN "/sonocase " +
                                          arguments);
}

std::vector<Point3> sweep() {
    return std::filesystem::exists(kSweep) ? import_surface(kSweep)->points : std::vector<Point3>{};
}

#define NEEDS_SWEEP() \
    if (sweep().empty()) GTEST_SKIP() << "no " SONOCASE_DATA

void write_points(const TemporaryFolder& folder,
                  const std::string& name,
                  const std::vector<Point3>& points) {
    std::string csv = "x,y,z\n";
    for (Point3 p : points)
        csv += number_text(p.x) + "," + number_text(p.y) + "," + number_text(p.z) + "\n";
    folder.write(name, csv);
}

TEST(RegisterVerb, SweepsThatCannotBeFittedFailWithOneLineAndNothingWritten) {
    NEEDS_SWEEP();
    const TemporaryFolder folder;
    std::vector<Point3> metres = sweep(), flat = sweep(), straight = sweep(), once = sweep();
    for (Point3& p : metres) p = {p.x / 1000, p.y / 1000, p.z / 1000};
    for (Point3& p : flat) p.z = 7;
    for (Point3& p : straight) p = {p.x, 2 * p.x, -p.x};
    for (Point3& p : once) p = once[static_cast<std::size_t>(&p - once.data()) % 20];
    const struct {
        std::vector<Point3> points;
        const char* says;
    } cases[] = {{metres, "metres"}, {flat, "plane"}, {straight, "line"}, {once, "distinct"}};
    sonocase::testing::HardCase written("of four sweeps that cannot be fitted, fits written",
                                        sonocase::testing::HardCase::at_most, 0, "");
    int files = 0;
    for (const auto& c : cases) {
        write_points(folder, "s.csv", c.points);
        const CommandResult r =
            run("register --labels " + kLabels + " --surface s.csv -o r.json", folder);
        EXPECT_EQ(r.status, 1) << c.says;
        EXPECT_NE(r.error.find(c.says), std::string::npos) << r.error;
        EXPECT_EQ(std::count(r.error.begin(), r.error.end(), '\n'), 1) << r.error;
        files += std::filesystem::exists(folder / "r.json");
    }
    written.see(files);
}

TEST(RegisterVerb, ASpoiltSweepFarAwayIsFittedAndWhatWasWrongIsSaid) {
    NEEDS_SWEEP();
    const TemporaryFolder folder;
    std::vector<Point3> points = sweep();
    for (Point3& p : points) p = p + Vector3{1e6, -1e6, 1e6};
    testing::Random random(3);
    for (std::size_t i = 0; i < points.size(); i += 20)  // 5 % in the air
        points[i] = points[i] + random.uniform(30, 80) * random.direction();
    for (std::size_t i = 0; i < 30; ++i) {
        points.push_back(points[11 * i]);
        points.push_back({std::nan(""), 1, 2});
    }
    write_points(folder, "s.csv", points);
    const CommandResult r = run(
        "register --labels " + kLabels + " --surface s.csv -o r.json --report rep.json", folder);
    ASSERT_EQ(r.status, 0) << r.error;
    const auto report = nlohmann::json::parse(read_text(folder / "rep.json"));
    EXPECT_GT(report["min_det_jacobian"].get<double>(), 0.2);
    EXPECT_GT(report["coverage"].get<double>(), 0.6);
    EXPECT_LT(report["skin_median_mm"].get<double>(), 1.0);
    EXPECT_EQ(report["readings_repeated"].get<double>(), 30);
    EXPECT_GT(report["readings_lifted_off"].get<double>(), 40);  // of 108, in any direction
    EXPECT_NE(r.error.find("30 readings without position"), std::string::npos) << r.error;
    EXPECT_NE(r.error.find("lie off the surface of their neighbours"), std::string::npos)
        << r.error;
    // What no fit can know is said first, with the option that settles it.
    EXPECT_NE(r.error.find("warning: not verified: the skin does not tell "), std::string::npos)
        << r.error;
    EXPECT_NE(r.error.find("right from left"), std::string::npos) << r.error;
}

TEST(RegisterVerb, FiftyReadingsOfTheFrontGiveAnAnswerAndTheHintsToAdd) {
    NEEDS_SWEEP();
    const TemporaryFolder folder;
    const std::vector<Point3> all = sweep();
    std::vector<Point3> few;
    for (std::size_t i = 0; i < 50; ++i) few.push_back(all[i * all.size() / 50]);
    write_points(folder, "s.csv", few);
    const CommandResult r =
        run("register --labels " + kLabels + " --surface s.csv -o r.json", folder);
    ASSERT_EQ(r.status, 0) << r.error;
    EXPECT_NE(r.error.find("50 readings"), std::string::npos) << r.error;
    EXPECT_GT(load_registration(folder / "r.json")->min_det_jacobian, 0.2);
}

TEST(RegisterVerb, OfSeveralMannequinsTheOneThatFitsBestIsTaken) {
    NEEDS_SWEEP();
    const TemporaryFolder folder;
    std::vector<Point3> near = sweep(), broad = sweep();
    for (Point3& p : broad) p = {1.3 * p.x, 1.3 * p.y, 1.3 * p.z};
    write_points(folder, "near.csv", near);
    write_points(folder, "broad.csv", broad);
    const CommandResult r =
        run("register --labels " + kLabels +
                " --surface broad.csv near.csv --path residual -o r.json --report rep.json",
            folder);
    ASSERT_EQ(r.status, 0) << r.error;
    const auto report = nlohmann::json::parse(read_text(folder / "rep.json"));
    EXPECT_EQ(report["mannequin"], "near.csv");
    EXPECT_LT(report["misfit"]["near.csv"].get<double>(),
              report["misfit"]["broad.csv"].get<double>());
    EXPECT_LT(report["misfit"]["near.csv"].get<double>(), 1);
    EXPECT_EQ(report["path"], "residual");
    EXPECT_EQ(report["open_side"], "none");
    EXPECT_GT(report["least_minor"].get<double>(), 0);
    EXPECT_NEAR(report["volume_change"]["liver"].get<double>(), 1, 0.08);
}

// y_x = x^2 / 250 - 100 over x in [0, 250]: points with y_x < -100 have no preimage at all.
TEST(MapVerb, AFifthOfTheTargetsWithoutPreimageAndPointsOnTheFoldAreMarked) {
    const TemporaryFolder folder;
    Registration fold;
    fold.ct_box.include(Point3{0, -100, -100});
    fold.ct_box.include(Point3{250, 100, 100});
    fold.quadratic.coefficients[0] = {-100, 0, 0, 0, 1 / 250.0, 0, 0, 0, 0, 0};
    fold.quadratic.coefficients[1] = {0, 0, 1, 0, 0, 0, 0, 0, 0, 0};
    fold.quadratic.coefficients[2] = {0, 0, 0, 1, 0, 0, 0, 0, 0, 0};
    ASSERT_TRUE(save_registration(fold, folder / "fold.json"));
    std::vector<Point3> targets;
    for (int i = 0; i < 100; ++i) targets.push_back({-149.5 + 2.5 * i, 10, -20});
    for (int i = 0; i < 5; ++i) targets.push_back({-100, 10.0 * i, 0});  // on the fold
    targets.push_back({std::nan(""), 0, 0});
    write_points(folder, "y.csv", targets);
    const CommandResult back =
        run("map fold.json --from mannequin --to ct --points y.csv -o x.csv", folder);
    ASSERT_EQ(back.status, 0) << back.error;
    std::istringstream rows(read_text(folder / "x.csv"));
    std::string line;
    std::getline(rows, line);
    EXPECT_EQ(line, "x,y,z,status");
    testing::HardCase off("where a place with a preimage goes back to, off",
                          testing::HardCase::at_most, 1e-6, "mm");
    int none = 0;
    for (const Point3 y : targets) {
        ASSERT_TRUE(std::getline(rows, line));
        const std::string status = line.substr(line.rfind(',') + 1);
        if (!(y.x >= -100)) {
            EXPECT_EQ(status, "no_preimage") << y.x;
            none += y.x < -100;
        } else if (status == "ok") {
            const double x = std::stod(line);
            off.see(std::abs(x * x / 250 - 100 - y.x));
        } else {
            EXPECT_EQ(y.x, -100) << "only on the fold may a point with a preimage be refused";
        }
    }
    EXPECT_EQ(none, 20);
    EXPECT_FALSE(std::getline(rows, line));
}

}  // namespace
}  // namespace sonocase::pipeline
