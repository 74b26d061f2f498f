// SPDX-License-Identifier: Apache-2.0

#include <gtest/gtest.h>

#include "formats/calibration/calibration.h"
#include "formats/calibration/foreign_calibration.h"
#include "support/random.h"

namespace sonocase {
namespace {

TEST(CalibrationFile, ComesBackAsItWas) {
    testing::Random random(9);
    Calibration c;
    c.kind = "needle";
    c.sensor = "VP-0042";
    c.sensor_from_tool = random.rigid(100);
    c.rms_mm = 0.4;
    c.sigma_mm = {0.1, 0.2, INFINITY};
    c.condition = 12.5;
    c.poses = 200;
    c.date = "2026-03-01T12:00:00Z";
    c.data_digest = "00ff";
    c.warnings = {"Turn the tool about more than one axis."};
    const auto back = parse_calibration(format_calibration(c), "c.json");
    ASSERT_TRUE(back) << back.error().message();
    EXPECT_EQ(back->kind, c.kind);
    EXPECT_EQ(back->sensor, c.sensor);
    EXPECT_EQ(back->sensor_from_tool, c.sensor_from_tool);
    EXPECT_EQ(back->rms_mm, c.rms_mm);
    EXPECT_EQ(back->sigma_mm, c.sigma_mm);
    EXPECT_EQ(back->condition, c.condition);
    EXPECT_EQ(back->poses, 200);
    EXPECT_EQ(back->date, c.date);
    EXPECT_EQ(back->warnings, c.warnings);
}

TEST(CalibrationFile, ComesAndGoesInTheFormsOfOtherPrograms) {
    testing::Random random(4);
    for (const char* kind : {"needle", "probe", "mannequin"}) {
        Calibration c;
        c.kind = kind;
        c.sensor_from_tool = random.rigid(100);
        c.rms_mm = 0.3;
        for (const char* ending : {".xml", ".tfm", ".txt"}) {
            const std::string path = std::string("/tmp/my_") + kind + ending;
            const std::string text = format_foreign_calibration(c, path);
            ASSERT_TRUE(looks_like_foreign_calibration(text)) << path;
            const auto back = parse_foreign_calibrations(text, path);
            ASSERT_TRUE(back) << back.error().message();
            ASSERT_EQ(back->size(), 1u);
            EXPECT_EQ(back->front().kind, kind);
            const Rigid apart = inverse(c.sensor_from_tool) * back->front().sensor_from_tool;
            EXPECT_LT(norm(apart.translation) + rotation_angle(apart.rotation), 1e-7) << path;
        }
    }
    EXPECT_EQ(format_foreign_calibration({}, "c.json"), "");
    EXPECT_FALSE(looks_like_foreign_calibration("{\"format\": \"sonocase calibration\"}"));
}

// A transform file holds the inverse in LPS+: 3D Slicer's "transform to parent" of 10 mm to the
// right and 20 mm up is written with +10 and -20.
TEST(CalibrationFile, ItkTransformsResampleInLps) {
    const auto read = parse_foreign_calibrations(
        "#Insight Transform File V1.0\n#Transform 0\nTransform: AffineTransform_double_3_3\n"
        "Parameters: 1 0 0 0 1 0 0 0 1 10 0 -20\nFixedParameters: 0 0 0\n",
        "needle.tfm");
    ASSERT_TRUE(read) << read.error().message();
    EXPECT_LT(norm(read->front().sensor_from_tool.translation - Vector3{10, 0, 20}), 1e-12);
    // A centre of rotation moves the place.
    const auto turned = parse_foreign_calibrations(
        "#Insight Transform File V1.0\n#Transform 0\nTransform: AffineTransform_double_3_3\n"
        "Parameters: 0 -1 0 1 0 0 0 0 1 0 0 0\nFixedParameters: 10 0 0\n",
        "needle.tfm");
    ASSERT_TRUE(turned) << turned.error().message();
    // The fixed point (10, 0, 0) LPS is (-10, 0, 0) RAS and stays.
    EXPECT_LT(norm(turned->front().sensor_from_tool * Point3{-10, 0, 0} - Point3{-10, 0, 0}),
              1e-12);
}

TEST(CalibrationFile, PlusGivesEachToolAndTheFaceOfTheProbe) {
    // Pixels of 0.2 mm; the face's middle at pixel (200, 30); the image 5 mm along z of the sensor.
    const std::string plus =
        "<?xml version=\"1.0\"?><PlusConfiguration><CoordinateDefinitions>\n"
        "<Transform From=\"Image\" To=\"Probe\" Matrix=\"0.2 0 0 1 0 0.2 0 2 0 0 0.2 5 0 0 0 "
        "1\"/>\n"
        "<Transform From=\"TransducerOriginPixel\" To=\"Image\" Matrix=\"1 0 0 200 0 1 0 30 0 0 1 "
        "0 0 "
        "0 0 1\"/>\n"
        "<Transform From=\"TransducerOrigin\" To=\"TransducerOriginPixel\" Matrix=\"5 0 0 0 0 5 0 "
        "0 "
        "0 0 5 0 0 0 0 1\"/>\n"
        "<Transform From='StylusTip' To='Stylus' Matrix='1 0 0 3\n 0 1 0 4\n 0 0 1 -150\n 0 0 0 1' "
        "Error='0.4'/></CoordinateDefinitions></PlusConfiguration>";
    const auto read = parse_foreign_calibrations(plus, "PlusDeviceSet.xml");
    ASSERT_TRUE(read) << read.error().message();
    ASSERT_EQ(read->size(), 2u);
    EXPECT_EQ((*read)[0].kind, "needle");
    EXPECT_EQ((*read)[0].rms_mm, 0.4);
    EXPECT_LT(norm((*read)[0].sensor_from_tool.translation - Vector3{3, 4, -150}), 1e-12);
    EXPECT_EQ((*read)[1].kind, "probe");
    const Rigid face = (*read)[1].sensor_from_tool;
    EXPECT_LT(norm(face.translation - Vector3{41, 8, 5}), 1e-9);
    EXPECT_LT(norm(face.rotation.column(0) - Vector3{1, 0, 0}), 1e-9);  // along the face
    EXPECT_LT(norm(face.rotation.column(2) - Vector3{0, 1, 0}), 1e-9);  // into the body
    const auto fault = [](const std::string& text, const char* path) {
        const auto bad = parse_foreign_calibrations(text, path);
        return bad ? std::string() : bad.error().message();
    };
    EXPECT_NE(fault("1 0 0 3\n0 1 0 4\n0 0 1 5\n0 0 0 1\n", "c.txt").find("which tool"),
              std::string::npos);
    EXPECT_NE(fault("1 0 0 0\n0 1 0 0\n0 0 1 0\n3 4 5 1\n", "needle.txt").find("last row"),
              std::string::npos);
    EXPECT_NE(fault("2 0 0 0\n0 2 0 0\n0 0 2 0\n0 0 0 1\n", "needle.txt").find("not rigid"),
              std::string::npos);
    EXPECT_NE(fault("<a><Transform From='Image' To='Probe' Matrix='1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 "
                    "1'/></a>",
                    "p.xml")
                  .find("Image to Probe"),
              std::string::npos);
}

std::string transform_element(const std::string& from, const std::string& to, int x) {
    return "<Transform From='" + from + "' To='" + to + "' Matrix='1 0 0 " + std::to_string(x) +
           " 0 1 0 0 0 0 1 0 0 0 0 1'/>\n";
}

// A configuration keeps older calibrations in comments.
TEST(CalibrationFile, ElementsInCommentsOfXmlAreNotRead) {
    const auto read = [](const std::string& elements) {
        const std::string text = "<PlusConfiguration>" + elements + "</PlusConfiguration>";
        EXPECT_TRUE(looks_like_foreign_calibration(text));
        return parse_foreign_calibrations(text, "PlusDeviceSet.xml");
    };
    const std::string old = transform_element("NeedleTip", "Needle", 1),
                      needle = transform_element("NeedleTip", "Needle", 7);
    for (const std::string& elements :
         {"<!-- of May: " + old + "-->" + needle, "<![CDATA[" + old + "]]>" + needle,
          "<!-- a > b --><!--" + old + old + "-->" + needle + "<!--" + old}) {
        const auto found = read(elements);
        ASSERT_TRUE(found) << found.error().message();
        EXPECT_EQ(found->front().sensor_from_tool.translation.x, 7) << elements;
        EXPECT_TRUE(found->front().warnings.empty());
    }
    const auto none = read("<!--" + old + "-->");
    ASSERT_FALSE(none);
    EXPECT_NE(none.error().message().find("found none"), std::string::npos);
}

TEST(CalibrationFile, ANeedleGoesBeforeAStylusAndThisIsSaid) {
    const std::string needle = transform_element("NeedleTip", "Needle", 7),
                      stylus = transform_element("StylusTip", "Stylus", 8);
    for (const std::string& elements : {needle + stylus, stylus + needle}) {
        const auto found = parse_foreign_calibrations("<a>" + elements + "</a>", "set.xml");
        ASSERT_TRUE(found) << found.error().message();
        ASSERT_EQ(found->size(), 1u);
        EXPECT_EQ(found->front().sensor_from_tool.translation.x, 7);
        ASSERT_EQ(found->front().warnings.size(), 1u);
        EXPECT_EQ(found->front().warnings[0],
                  "NeedleTip to Needle is the needle; not taken: StylusTip to Stylus.");
    }
    const auto alone = parse_foreign_calibrations("<a>" + stylus + "</a>", "set.xml");
    ASSERT_TRUE(alone) << alone.error().message();
    EXPECT_EQ(alone->front().sensor_from_tool.translation.x, 8);
    EXPECT_TRUE(alone->front().warnings.empty());
}

TEST(CalibrationFile, DecimalCommasAreReadAndBinaryFilesNamed) {
    for (const char* text : {"1;0;0;3,5\n0;1;0;-4,25\n0;0;1;150,125\n0;0;0;1\n",
                             "1,0;0,0;0,0;3,5;0,0;1,0;0,0;-4,25;0,0;0,0;1,0;150,125",
                             "[1, 0, 0, 3.5; 0, 1, 0, -4.25; 0, 0, 1, 150.125; 0, 0, 0, 1]"}) {
        ASSERT_TRUE(looks_like_foreign_calibration(text)) << text;
        const auto read = parse_foreign_calibrations(text, "needle.txt");
        ASSERT_TRUE(read) << text << read.error().message();
        EXPECT_EQ(read->front().sensor_from_tool.translation, (Vector3{3.5, -4.25, 150.125}));
    }
    // Transforms of ITK in HDF5 and in MATLAB's form.
    for (const std::string& bytes : {std::string("\x89HDF\r\n\x1a\n\0\0\0", 11),
                                     std::string("\0\0\0\0\x0c\0\0\0\x01\0\0\0", 12)}) {
        ASSERT_TRUE(looks_like_foreign_calibration(bytes));
        const auto refused = parse_foreign_calibrations(bytes, "needle.h5");
        ASSERT_FALSE(refused);
        EXPECT_NE(refused.error().message().find(".tfm or .txt"), std::string::npos);
    }
}

TEST(CalibrationFile, AMirrorIsNoRotationAndAnUnknownKindIsNamed) {
    Calibration c;
    c.kind = "probe";
    c.sensor_from_tool.rotation = Matrix3::diagonal({1, 1, -1});
    EXPECT_FALSE(parse_calibration(format_calibration(c), "c.json"));
    c.sensor_from_tool = {};
    c.kind = "prob";
    const auto wrong = parse_calibration(format_calibration(c), "c.json");
    ASSERT_FALSE(wrong);
    EXPECT_NE(wrong.error().message().find("prob"), std::string::npos);
}

}  // namespace
}  // namespace sonocase
