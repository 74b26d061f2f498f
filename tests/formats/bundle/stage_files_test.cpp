// SPDX-License-Identifier: Apache-2.0

#include "formats/bundle/stage_files.h"

#include <gtest/gtest.h>

#include "formats/text/stage_report_json.h"
#include "formats/volume/boundary_record.h"
#include "support/tiny_case.h"

namespace sonocase {
namespace {

LabelFile label_file() {
    const CaseBundle bundle = testing::tiny_case();
    LabelFile file;
    file.frame = "ct";
    file.volume.grid = bundle.grid;
    file.volume.grid.spacing_mm = {1, 2, 3.5};  // what a CT may have and a cooked case may not
    file.volume.grid.direction = rotation_about({0, 0, 1}, 0.3);
    file.volume.labels = bundle.labels;
    file.volume.voxels = dense_from_bricks(bundle.label_bricks);
    file.boundary = bundle.boundary;
    file.echo_offset = bundle.echo_offset;
    file.reports = bundle.manifest.stages;
    return file;
}

TEST(StageFiles, LabelsComeBackAsTheyWere) {
    const LabelFile file = label_file();
    const auto bytes = write_label_file(file);
    const auto back = read_label_file(bytes, "labels");
    ASSERT_TRUE(back) << back.error().message();
    EXPECT_EQ(back->frame, "ct");
    EXPECT_EQ(back->volume.grid, file.volume.grid);
    EXPECT_EQ(back->volume.voxels, file.volume.voxels);
    EXPECT_EQ(back->volume.labels, file.volume.labels);
    EXPECT_EQ(back->boundary.pool, file.boundary.pool);
    EXPECT_EQ(back->echo_offset.pool, file.echo_offset.pool);
    EXPECT_EQ(back->reports, file.reports);
    EXPECT_EQ(container_kind(bytes), "LABL");
}

TEST(StageFiles, EveryTruncationAndEveryDamagedByteIsAnError) {
    auto bytes = write_label_file(label_file());
    for (std::size_t n = 0; n < bytes.size(); ++n) {
        EXPECT_FALSE(read_label_file(std::span(bytes).first(n), "cut")) << n;
        bytes[n] ^= 0x10;
        EXPECT_FALSE(read_label_file(bytes, "damaged")) << n;
        bytes[n] ^= 0x10;
    }
}

TEST(StageFiles, TexturesAndSurfacesComeBackAsTheyWere) {
    const CaseBundle bundle = testing::tiny_case();
    const TextureFile file{bundle.textures, bundle.speckle, bundle.tissues, bundle.manifest.stages};
    const auto back = read_texture_file(write_texture_file(file), "textures");
    ASSERT_TRUE(back) << back.error().message();
    EXPECT_EQ(back->textures.at(0).voxels, file.textures[0].voxels);
    EXPECT_EQ(back->speckle.voxels, file.speckle.voxels);
    EXPECT_EQ(back->tissues.size(), 3u);
    const auto surface =
        read_surface_file(write_surface_file({"ct", bundle.patient_skin, {}}), "surface");
    ASSERT_TRUE(surface) << surface.error().message();
    EXPECT_EQ(surface->surface.points, bundle.patient_skin.points);
    EXPECT_EQ(surface->surface.triangles, bundle.patient_skin.triangles);
}

TEST(StageFiles, OneKindIsNotTakenForAnother) {
    const auto bytes = write_label_file(label_file());
    const auto wrong = read_texture_file(bytes, "x");
    ASSERT_FALSE(wrong);
    EXPECT_NE(wrong.error().message().find("LABL"), std::string::npos);
}

TEST(StageFiles, ReportsComeBackWithNumbersThatWereNotMeasured) {
    const StageReport report{
        "align", 2, 0.5, {{"rms_mm", 1.0 / 3}, {"p95_mm", NAN}}, {}, {}, {"One.", "Two."}};
    const auto back = parse_stage_report(stage_report_json(report), "report");
    ASSERT_TRUE(back) << back.error().message();
    EXPECT_EQ(back->stage, "align");
    EXPECT_EQ(back->measures[0], report.measures[0]);
    EXPECT_TRUE(std::isnan(back->measures[1].value));
    EXPECT_EQ(back->warnings, report.warnings);
}

}  // namespace
}  // namespace sonocase
