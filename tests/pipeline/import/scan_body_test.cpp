// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/body/scan_body.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "formats/base/constants.h"
#include "support/paths.h"

namespace sonocase::pipeline {
namespace {

// A body of 200 x 140 x 60 mm: fat about muscle, gas in a gut, a liver; on a table of 12 mm that
// touches its back. Voxels of 4 mm.
struct Study {
    ScanVolume scan;
    ImportedLabels imported;
};

bool in_body(Point3 p) {
    return std::hypot(p.x / 100, p.y / 70) < 1;
}

Study study() {
    Study s;
    Grid grid;
    grid.size = {60, 50, 15};
    grid.spacing_mm = {4, 4, 4};
    grid.origin_mm = {-118, -98, 0};
    s.scan.grid = s.imported.labels.grid = grid;
    s.imported.labels.labels = {
        {"outside", "outside", 0, {}}, {"liver", "liver", 5, {}}, {"colon", "bowel", 20, {}}};
    for (int k = 0; k < grid.size.z; ++k)
        for (int j = 0; j < grid.size.y; ++j)
            for (int i = 0; i < grid.size.x; ++i) {
                const Point3 p = grid.point_from_voxel({double(i), double(j), double(k)});
                const bool liver = std::hypot(p.x - 30, p.y) < 25,
                           gut = std::hypot(p.x + 40, p.y) < 20;
                const bool inner = std::hypot(p.x / 80, p.y / 50) < 1;
                const bool table = p.y < -70 && p.y > -84 && std::abs(p.x) < 90;
                const bool body = in_body(p);
                s.scan.values.push_back(
                    static_cast<std::int16_t>(!body ? (table ? 100 : -1000)
                                              : gut && std::hypot(p.x + 40, p.y) < 12 ? -900
                                              : liver || gut                          ? 60
                                              : inner                                 ? 40
                                                                                      : -100));
                s.imported.labels.voxels.push_back(!body ? 0 : liver ? 1 : gut ? 2 : 0);
            }
    return s;
}

int label_at(const LabelVolume& labels, Point3 p) {
    const Point3 v = labels.grid.voxel_from_point(p);
    return labels.voxels[labels.grid.index(static_cast<int>(std::lround(v.x)),
                                           static_cast<int>(std::lround(v.y)),
                                           static_cast<int>(std::lround(v.z)))];
}
std::string name_at(const LabelVolume& labels, Point3 p) {
    return labels.labels[static_cast<std::size_t>(label_at(labels, p))].name;
}

TEST(ScanBody, what_organs_leave_is_filled_by_density_and_the_table_is_not) {
    Study s = study();
    const auto filled = fill_from_scan(s.scan, "ct", s.imported);
    ASSERT_TRUE(filled) << filled.error().message();
    const LabelVolume& labels = s.imported.labels;
    EXPECT_EQ(name_at(labels, {30, 0, 30}), "liver");
    EXPECT_EQ(name_at(labels, {-40, 0, 30}), "gas_in_body");  // within the colon's label
    EXPECT_EQ(name_at(labels, {-40, 16, 30}), "colon");
    EXPECT_EQ(name_at(labels, {0, 20, 30}), "other_muscle");
    EXPECT_EQ(name_at(labels, {0, 58, 30}), "other_fat");
    EXPECT_EQ(name_at(labels, {0, 66, 30}), "skin");
    EXPECT_EQ(name_at(labels, {60, -78, 30}), "outside");  // the table
    double ml = 0;
    for (const Measure& m : s.imported.report.measures)
        if (m.name == "scan_body_ml") ml = m.value;
    // The ellipse's area times the height; its edge is known to half a voxel: 2 of 70 mm.
    EXPECT_NEAR(ml, kPi * 100 * 70 * 60 / 1000, 0.06 * 1320);
    for (const Label& label : labels.labels) EXPECT_NE(label.name, "other_bone");  // not used
}

double ml_of(const LabelVolume& labels, const std::string& name) {
    double count = 0;
    for (const std::uint8_t label : labels.voxels) count += labels.labels[label].name == name;
    return count * labels.grid.voxel_volume_mm3() / 1000;
}

TEST(ScanBody, a_label_of_the_whole_body_leaves_its_inside_to_the_scan) {
    Study plain = study();
    ASSERT_TRUE(fill_from_scan(plain.scan, "ct", plain.imported));
    for (const char* name : {"body", "Body", "body_trunc", "body trunk", "body-extremities",
                             "External", "skin", "Skin"}) {
        Study s = study();
        LabelVolume& labels = s.imported.labels;
        labels.labels.push_back(
            {name, std::string(name).ends_with("kin") ? "skin" : "soft_tissue", 300, {}});
        const Grid& grid = labels.grid;
        for (std::size_t n = 0; n < labels.voxels.size(); ++n) {
            const int i = static_cast<int>(n) % grid.size.x,
                      j = static_cast<int>(n) / grid.size.x % grid.size.y;
            if (labels.voxels[n] == 0 && in_body(grid.point_from_voxel({double(i), double(j), 0})))
                labels.voxels[n] = 3;
        }
        const auto filled = fill_from_scan(s.scan, "ct", s.imported);
        ASSERT_TRUE(filled) << filled.error().message();
        for (const char* part : {"liver", "other_fat", "other_muscle", "skin", "gas_in_body"})
            EXPECT_NEAR(ml_of(labels, part), ml_of(plain.imported.labels, part),
                        0.01 * ml_of(plain.imported.labels, part))
                << name << ": " << part;
        EXPECT_TRUE(std::string(name) == "skin" || ml_of(labels, name) == 0) << name;
        ASSERT_EQ(s.imported.report.warnings.size(), 1u) << name;
        EXPECT_NE(s.imported.report.warnings[0].find(std::string("'") + name + "'"),
                  std::string::npos);
    }
}

TEST(ScanBody, a_skin_that_is_a_thin_layer_stays) {
    Study s = study();
    LabelVolume& labels = s.imported.labels;
    labels.labels.push_back({"skin", "skin", 300, {}});
    const Grid& grid = labels.grid;
    for (std::size_t n = 0; n < labels.voxels.size(); ++n) {
        const int i = static_cast<int>(n) % grid.size.x,
                  j = static_cast<int>(n) / grid.size.x % grid.size.y;
        const Point3 p = grid.point_from_voxel({double(i), double(j), 0});
        if (in_body(p) && std::hypot(p.x / 95, p.y / 65) > 1) labels.voxels[n] = 3;
    }
    const double drawn = ml_of(labels, "skin");
    ASSERT_TRUE(fill_from_scan(s.scan, "ct", s.imported));
    EXPECT_GE(ml_of(labels, "skin"), drawn);
    EXPECT_TRUE(s.imported.report.warnings.empty());
}

TEST(ScanBody, a_map_of_the_whole_body_stays_as_it_is) {
    Study s = study();
    ASSERT_TRUE(fill_from_scan(s.scan, "ct", s.imported));
    const std::vector<std::uint8_t> whole = s.imported.labels.voxels;
    const std::size_t count = s.imported.labels.labels.size();
    ASSERT_TRUE(fill_from_scan(s.scan, "ct", s.imported));
    EXPECT_EQ(s.imported.labels.voxels, whole);
    EXPECT_EQ(s.imported.labels.labels.size(), count);
    EXPECT_NE(s.imported.report.notes.back().text.find("not needed"), std::string::npos);
}

TEST(ScanBody, a_scan_of_another_place_or_without_hounsfield_units_is_refused) {
    Study moved = study();
    moved.scan.grid.origin_mm.x += 300;
    auto refused = fill_from_scan(moved.scan, "ct", moved.imported);
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().what.find("covers"), std::string::npos);
    Study mr = study();
    for (std::int16_t& value : mr.scan.values) value = static_cast<std::int16_t>(value + 1000);
    refused = fill_from_scan(mr.scan, "mr", mr.imported);
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().expected.find("Hounsfield"), std::string::npos);
}

// The shared CT as it is, mirrored along each axis, and 20 and 40 mm aside: the body is found, but
// not the patient's.
TEST(ScanBody, a_scan_that_does_not_lie_on_the_labels_is_named) {
    const std::string ct = SONOCASE_DATA "/ct";
    if (!std::filesystem::exists(ct)) GTEST_SKIP() << "shared/data/ct is absent";
    const auto imported = import_label_map(ct + "/labels_source.nii.gz");
    const auto scan = read_scan(ct + "/ct.nii.gz");
    ASSERT_TRUE(imported && scan);
    const Int3 size = scan->grid.size;
    // x, y and z of the voxel that is taken in place of each; beyond the scan the nearest.
    const auto named = [&](auto&& from) {
        ScanVolume other = *scan;
        for (int k = 0; k < size.z; ++k)
            for (int j = 0; j < size.y; ++j)
                for (int i = 0; i < size.x; ++i) {
                    const Int3 at = from(Int3{i, j, k});
                    other.values[scan->grid.index(i, j, k)] = scan->values[scan->grid.index(
                        std::clamp(at.x, 0, size.x - 1), std::clamp(at.y, 0, size.y - 1),
                        std::clamp(at.z, 0, size.z - 1))];
                }
        ImportedLabels filled = *imported;
        filled.report.warnings.clear();
        const auto done = fill_from_scan(other, "ct", filled);
        if (!done) return done.error().what + "; " + done.error().expected;
        return filled.report.warnings.empty() ? std::string() : filled.report.warnings[0];
    };
    EXPECT_EQ(named([](Int3 v) { return v; }), "");
    EXPECT_EQ(named([](Int3 v) { return Int3{v.x + 1, v.y, v.z}; }), "");  // 3 mm: not told
    const char* likely = "is the scan mirrored, upside down or of another examination?";
    const auto told = [&](const char* what, const std::string& said) {
        EXPECT_NE(said.find(likely), std::string::npos) << what << ": " << said;
    };
    told("right and left", named([&](Int3 v) { return Int3{size.x - 1 - v.x, v.y, v.z}; }));
    told("front and back", named([&](Int3 v) { return Int3{v.x, size.y - 1 - v.y, v.z}; }));
    told("upside down", named([&](Int3 v) { return Int3{v.x, v.y, size.z - 1 - v.z}; }));
    for (const int by : {7, -7, 13, -13}) {
        told("x", named([&](Int3 v) { return Int3{v.x + by, v.y, v.z}; }));
        told("y", named([&](Int3 v) { return Int3{v.x, v.y + by, v.z}; }));
    }
    for (const int by : {13, -13})
        told("z", named([&](Int3 v) { return Int3{v.x, v.y, v.z + by}; }));
}

// The map that the shared data were completed to by another program, by the same rule.
TEST(ScanBody, the_shared_ct_becomes_the_body_that_its_makers_have) {
    const std::string ct = SONOCASE_DATA "/ct";
    if (!std::filesystem::exists(ct)) GTEST_SKIP() << "shared/data/ct is absent";
    auto imported = import_label_map(ct + "/labels_source.nii.gz");
    ASSERT_TRUE(imported);
    const auto scan = read_scan(ct + "/ct.nii.gz");
    ASSERT_TRUE(scan);
    ASSERT_TRUE(fill_from_scan(*scan, "ct", *imported));
    const auto whole = import_label_map(ct + "/labels.nii.gz");
    ASSERT_TRUE(whole);
    std::size_t both = 0, either = 0;
    for (std::size_t n = 0; n < whole->labels.voxels.size(); ++n) {
        const bool a = imported->labels.voxels[n] != 0, b = whole->labels.voxels[n] != 0;
        both += a && b;
        either += a || b;
    }
    // Two programs that open and fill by other shapes differ along the skin's edge.
    EXPECT_GT(static_cast<double>(both) / static_cast<double>(either), 0.99);
}

}  // namespace
}  // namespace sonocase::pipeline
