// SPDX-License-Identifier: Apache-2.0

#include "formats/bundle/case_bundle.h"
#include "formats/bundle/codec/flow_codec.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>
#include <type_traits>

#include "formats/bundle/body_axes.h"
#include "formats/bundle/codec/chunk_file.h"
#include "formats/bundle/stage_files.h"
#include "formats/files/atomic_file.h"
#include "formats/files/load_save.h"
#include "formats/files/thread_jobs.h"
#include "formats/volume/boundary_record.h"
#include "support/paths.h"
#include "support/random.h"
#include "support/temporary_folder.h"
#include "support/tiny_case.h"

namespace sonocase {
namespace {

using Bytes = std::vector<std::uint8_t>;
using testing::tiny_case;

template <class T>
void expect_same_volume(const BrickVolume<T>& a, const BrickVolume<T>& b) {
    EXPECT_EQ(a.size, b.size);
    ASSERT_EQ(a.table.size(), b.table.size());
    if (!a.table.empty()) {
        EXPECT_EQ(dense_from_bricks(a), dense_from_bricks(b));
    }
    EXPECT_EQ(a.uniform, b.uniform);
    EXPECT_EQ(a.pool.size(), b.pool.size());  // the order of its bricks is free
}

void expect_same(const Surface& a, const Surface& b) {
    EXPECT_EQ(a.points, b.points);
    EXPECT_EQ(a.normals, b.normals);
    EXPECT_EQ(a.triangles, b.triangles);
}

void expect_same(const CaseBundle& a, const CaseBundle& b) {
    EXPECT_EQ(a.manifest.case_name, b.manifest.case_name);
    EXPECT_EQ(a.manifest.producer, b.manifest.producer);
    EXPECT_EQ(a.manifest.recipe, b.manifest.recipe);
    EXPECT_EQ(a.manifest.stages, b.manifest.stages);
    ASSERT_EQ(a.manifest.inputs.size(), b.manifest.inputs.size());
    for (std::size_t i = 0; i < a.manifest.inputs.size(); ++i) {
        EXPECT_EQ(a.manifest.inputs[i].path, b.manifest.inputs[i].path);
        EXPECT_EQ(a.manifest.inputs[i].digest, b.manifest.inputs[i].digest);
    }
    EXPECT_EQ(a.grid, b.grid);
    EXPECT_EQ(a.labels, b.labels);
    ASSERT_EQ(a.tissues.size(), b.tissues.size());
    for (std::size_t i = 0; i < a.tissues.size(); ++i) {
        const Tissue &s = a.tissues[i], &t = b.tissues[i];
        EXPECT_EQ(s.name, t.name);
        EXPECT_EQ(s.kind, t.kind);
        EXPECT_EQ(s.casts_shadow, t.casts_shadow);
        EXPECT_EQ(s.texture, t.texture);
        EXPECT_EQ(s.source, t.source);
        EXPECT_EQ(s.mechanics, t.mechanics);
        EXPECT_EQ(std::tie(s.grey_mean, s.grey_sd, s.echo_db, s.structure_db,
                           s.attenuation_db_cm_mhz, s.impedance_mrayl, s.sound_speed_m_s),
                  std::tie(t.grey_mean, t.grey_sd, t.echo_db, t.structure_db,
                           t.attenuation_db_cm_mhz, t.impedance_mrayl, t.sound_speed_m_s));
    }
    ASSERT_EQ(a.exercises.size(), b.exercises.size());
    for (std::size_t i = 0; i < a.exercises.size(); ++i) {
        EXPECT_EQ(a.exercises[i].name, b.exercises[i].name);
        EXPECT_EQ(a.exercises[i].toml, b.exercises[i].toml);
    }
    expect_same_volume(a.label_bricks, b.label_bricks);
    expect_same_volume(a.echo_offset, b.echo_offset);
    expect_same_volume<std::uint32_t>(a.boundary, b.boundary);
    ASSERT_EQ(a.textures.size(), b.textures.size());
    for (std::size_t i = 0; i < a.textures.size(); ++i) {
        EXPECT_EQ(a.textures[i].name, b.textures[i].name);
        EXPECT_EQ(a.textures[i].edge, b.textures[i].edge);
        EXPECT_EQ(a.textures[i].voxel_mm, b.textures[i].voxel_mm);
        EXPECT_EQ(a.textures[i].voxels, b.textures[i].voxels);
    }
    EXPECT_EQ(a.speckle.edge, b.speckle.edge);
    EXPECT_EQ(a.speckle.voxels, b.speckle.voxels);
    expect_same(a.patient_skin, b.patient_skin);
    EXPECT_EQ(a.skin_unfitted, b.skin_unfitted);
    expect_same(a.mannequin_skin, b.mannequin_skin);
    EXPECT_EQ(a.preview_png, b.preview_png);
    EXPECT_EQ(detail::flow_bytes(a.flow), detail::flow_bytes(b.flow));
}

// What the types promise: a bundle is a value, a streamed one has one owner, and a view refers to
// something that outlives it.
static_assert(std::is_copy_constructible_v<CaseBundle> && std::is_copy_assignable_v<CaseBundle>);
static_assert(std::is_move_constructible_v<StreamedBundle> &&
              !std::is_copy_constructible_v<StreamedBundle> &&
              !std::is_copy_assignable_v<StreamedBundle>);
static_assert(std::is_constructible_v<CaseView, const CaseBundle&> &&
              std::is_constructible_v<CaseView, const StreamedBundle&> &&
              !std::is_constructible_v<CaseView, CaseBundle> &&
              !std::is_constructible_v<CaseView, StreamedBundle>);

TEST(CaseBundle, ComesBackAsItWas) {
    const CaseBundle bundle = tiny_case();
    const Bytes bytes = write_bundle(bundle);
    const auto back = read_bundle(bytes, "tiny");
    ASSERT_TRUE(back) << back.error().message();
    expect_same(*back, bundle);
    EXPECT_EQ(write_bundle(*back), bytes);
    EXPECT_EQ(container_kind(bytes), "CASE");
}

TEST(CaseBundle, TheMarkOfUnfittedSkinComesBackAndHasOneEntryPerPoint) {
    CaseBundle bundle = tiny_case();
    const Bytes without = write_bundle(bundle);
    const std::size_t points = bundle.patient_skin.points.size();
    ASSERT_GT(points, 1u);
    bundle.skin_unfitted.assign(points, 0);
    bundle.skin_unfitted[1] = 1;
    const auto back = read_bundle(write_bundle(bundle), "marked");
    ASSERT_TRUE(back) << back.error().message();
    expect_same(*back, bundle);
    bundle.skin_unfitted.pop_back();
    EXPECT_FALSE(read_bundle(write_bundle(bundle), "short"));
    bundle.skin_unfitted.clear();
    EXPECT_EQ(write_bundle(bundle), without);  // nothing is stored where all is fitted
}

TEST(CaseBundle, AnEmptyOneComesBackToo) {
    CaseBundle bundle;
    bundle.labels = {{"outside", "outside", 0, {0, 0, 0}}};
    Tissue outside;
    outside.name = "outside";
    bundle.tissues = {outside};
    const auto back = read_bundle(write_bundle(bundle), "empty");
    ASSERT_TRUE(back) << back.error().message();
    EXPECT_TRUE(back->textures.empty());
    EXPECT_TRUE(back->label_bricks.table.empty());
}

TEST(CaseBundle, EveryTruncationIsAnError) {
    const Bytes file = write_bundle(tiny_case());
    for (std::size_t n = 0; n < file.size(); ++n) {
        EXPECT_FALSE(read_bundle(std::span(file).first(n), "cut")) << n;
    }
}

TEST(CaseBundle, EveryDamagedByteIsAnError) {
    Bytes file = write_bundle(tiny_case());
    for (std::size_t i = 0; i < file.size(); ++i) {
        for (const int change : {0x01, 0x80}) {
            file[i] = static_cast<std::uint8_t>(file[i] ^ change);
            EXPECT_FALSE(read_bundle(file, "damaged")) << "byte " << i;
            file[i] = static_cast<std::uint8_t>(file[i] ^ change);
        }
    }
}

// The file with one chunk changed, and right checksums.
template <class Change>
Bytes with_chunk(const Bytes& file, const std::string& type, Change change) {
    static constexpr std::string_view known[] = {
        "manifest", "lab.t",    "lab.u",    "lab.p",    "echo.t",  "echo.u",  "echo.p",
        "bnd.t",    "bnd.u",    "bnd.p",    "vox.kind", "vox.one", "vox.mix", "vox.pair",
        "vox.low",  "vox.high", "vox.fix",  "ofs.kind", "ofs.one", "ofs.val", "textures",
        "speckle",  "skin.pat", "skin.fit", "skin.man", "flow",    "preview"};
    const auto reader = ChunkReader::open(file, "CASE", known, "test");
    EXPECT_TRUE(reader);
    ChunkWriter writer("CASE");
    for (const std::string_view name : known) {
        if (!reader->has(name)) continue;
        Bytes bytes = *reader->read(name, SIZE_MAX / 4);
        if (name == type) change(bytes);
        if (name == "vox.fix" || name == "ofs.val") {
            writer.add_packed(std::string(name), false, std::move(bytes));
        } else {
            writer.add(std::string(name), false, std::move(bytes));
        }
    }
    return writer.write();
}

TEST(CaseBundle, FlowComesBackAndABundleWithoutItHasNone) {
    CaseBundle bundle = tiny_case();
    FlowVessel vessel;
    vessel.name = "aorta";
    vessel.mean_ml_s = 40;
    vessel.nodes = 2;
    bundle.flow.vessels = {vessel};
    for (const double z : {0.0, 3.0}) {
        FlowNode node{{0, 0, z}, {0, 0, 1}, {}};
        node.radius_mm.fill(9);
        bundle.flow.nodes.push_back(node);
    }
    const auto back = read_bundle(write_bundle(bundle), "test");
    ASSERT_TRUE(back) << back.error().message();
    expect_same(*back, bundle);
    EXPECT_EQ(back->flow.vessels[0].name, "aorta");
    EXPECT_TRUE(read_bundle(write_bundle(tiny_case()), "test")->flow.empty());
    const Bytes cut = with_chunk(write_bundle(bundle), "flow", [](Bytes& b) { b.pop_back(); });
    const auto bad = read_bundle(cut, "test");
    ASSERT_FALSE(bad);
    EXPECT_NE(bad.error().message().find("flow field"), std::string::npos);
}

Bytes file_of_version_1() {
    return *read_file(std::string(SONOCASE_SOURCE) + "/tests/data/versions/case-1.sonocase");
}

TEST(CaseBundle, TablesOfTheFirstLayoutMayNotPointOutside) {
    for (const std::uint32_t word : {100000u, kUniformBrick | 77u}) {
        const Bytes file = with_chunk(file_of_version_1(), "lab.t",
                                      [&](Bytes& b) { std::memcpy(b.data() + 4, &word, 4); });
        const auto back = read_bundle(file, "forged");
        ASSERT_FALSE(back);
        EXPECT_NE(back.error().message().find("names a brick"), std::string::npos);
    }
}

// Surfaces that patches describe, and others: whatever bytes the chunks hold, what is read is
// whole.
TEST(CaseBundle, AnyByteOfThePackedVolumesIsRefusedOrHarmless) {
    const Bytes file = write_bundle(testing::curved_case());
    for (const char* type : {"vox.kind", "vox.one", "vox.mix", "vox.pair", "vox.low", "vox.high",
                             "vox.fix", "ofs.kind", "ofs.one", "ofs.val"}) {
        std::size_t size = 0;
        with_chunk(file, type, [&](Bytes& b) { size = b.size(); });
        EXPECT_GT(size, 0u) << type;
        const std::size_t stride = std::max<std::size_t>(1, size / 60);
        for (std::size_t at = 0; at < size; at += stride) {
            for (const int value : {0x03, 0x1F, 0x7F, 0xFF}) {
                const auto back = read_bundle(
                    with_chunk(file, type,
                               [&](Bytes& b) { b[at] = static_cast<std::uint8_t>(value); }),
                    "forged");
                if (!back) continue;
                const BrickVolume<std::uint8_t>& labels = back->label_bricks;
                for (const std::uint8_t v : labels.pool) ASSERT_LT(v, back->labels.size());
                for (const std::uint8_t v : labels.uniform) ASSERT_LT(v, back->labels.size());
                for (const std::uint32_t v : back->boundary.pool)
                    ASSERT_TRUE(v == kNoBoundary || (v & 0xFFu) < back->labels.size());
                ASSERT_EQ(labels.at(0, 0, 0), labels.at(0, 0, 0));
            }
        }
        EXPECT_FALSE(read_bundle(with_chunk(file, type, [](Bytes& b) { b.push_back(0); }), "long"));
        EXPECT_FALSE(read_bundle(with_chunk(file, type, [](Bytes& b) { b.pop_back(); }), "short"));
    }
}

TEST(CaseBundle, PackedVolumesComeBackExactlyAndSmall) {
    const CaseBundle bundle = testing::curved_case();
    const Bytes bytes = write_bundle(bundle);
    const auto back = read_bundle(bytes, "curved");
    ASSERT_TRUE(back) << back.error().message();
    expect_same(*back, bundle);
    EXPECT_EQ(write_bundle(*back), bytes);
    ThreadJobs jobs(4);
    EXPECT_EQ(write_bundle(bundle, jobs), bytes);
    const auto parallel = read_bundle(bytes, "curved", jobs);
    ASSERT_TRUE(parallel);
    expect_same(*parallel, bundle);
}

// What a player does: blocks in any order, each when it is asked for.
TEST(CaseBundle, OpenedIsAsLoadedBlockByBlock) {
    const CaseBundle bundle = testing::curved_case();
    const testing::TemporaryFolder folder;
    const std::string path = folder / "curved.sonocase";
    ASSERT_TRUE(save_bundle(bundle, path));
    auto opened = open_bundle(path);
    ASSERT_TRUE(opened) << opened.error().message();
    ASSERT_TRUE(opened->blocks());
    expect_same_volume((*opened)->label_bricks, bundle.label_bricks);
    EXPECT_FALSE(opened->blocks()->whole());
    const StreamedBundle moved = std::move(*opened);
    const Int3 size = bundle.grid.size;
    for (int k = size.z - 1; k >= 0; --k) {
        for (int j = 0; j < size.y; ++j) {
            for (int i = 0; i < size.x; ++i) {
                moved.blocks()->ensure_voxel_loaded(i, j, k);
                ASSERT_EQ(moved->boundary.at(i, j, k), bundle.boundary.at(i, j, k));
                ASSERT_EQ(moved->echo_offset.at(i, j, k), bundle.echo_offset.at(i, j, k));
            }
        }
    }
    EXPECT_TRUE(moved.blocks()->whole());
    EXPECT_TRUE(moved.blocks()->status());
}

// A block with right checksums and invalid contents: found when it is asked for, and empty.
TEST(CaseBundle, AnInvalidBlockSaysSoAndHoldsNothing) {
    const testing::TemporaryFolder folder;
    const std::string path = folder / "forged.sonocase";
    const Bytes good = write_bundle(testing::curved_case());
    for (const char* type : {"vox.fix", "ofs.val"}) {
        const Bytes file =
            with_chunk(good, type, [](Bytes& b) { std::fill(b.end() - 40, b.end(), 0x5A); });
        EXPECT_FALSE(read_bundle(file, "forged"));
        ASSERT_TRUE(write_file(path, file));
        const auto opened = open_bundle(path);
        ASSERT_TRUE(opened) << opened.error().message();
        EXPECT_TRUE(opened->blocks()->status());
        opened->blocks()->ensure_loaded([](Int3) { return true; });
        EXPECT_TRUE(opened->blocks()->damaged());
        ASSERT_FALSE(opened->blocks()->status());
        EXPECT_NE(opened->blocks()->status().error().message().find(path), std::string::npos);
        for (const std::uint32_t v : (*opened)->boundary.pool)
            ASSERT_TRUE(v == kNoBoundary || (v & 0xFFu) < (*opened)->labels.size());
    }
}

// Written by our own writer with right checksums, so that only the checks of the contents can see
// it.
void expect_refused(const CaseBundle& bundle, const std::string& says) {
    const auto back = read_bundle(write_bundle(bundle), "forged");
    ASSERT_FALSE(back) << says;
    EXPECT_NE(back.error().message().find(says), std::string::npos) << back.error().message();
}

TEST(CaseBundle, ContentsThatWouldBreakTheRendererAreRefused) {
    CaseBundle b = tiny_case();
    b.label_bricks.pool[5] = 3;
    expect_refused(b, "label beyond the palette");
    b = tiny_case();
    b.boundary.pool[3] = 200;
    expect_refused(b, "boundary record");
    b = tiny_case();
    b.patient_skin.triangles[0][2] = 4;
    expect_refused(b, "triangle");
    b = tiny_case();
    b.patient_skin.points[0].x = NAN;
    expect_refused(b, "not finite");
    b = tiny_case();
    b.grid.spacing_mm.y = 3;
    expect_refused(b, "not cubes");
    b = tiny_case();
    b.grid.size.x = 1000;
    expect_refused(b, "calls for");
    b = tiny_case();
    b.grid.size = {60000, 60000, 60000};
    expect_refused(b, "out of range");
    b = tiny_case();
    b.labels[1].name = "liver";
    expect_refused(b, "twice");
    b = tiny_case();
    b.labels[1].tissue = "cheese";
    expect_refused(b, "cheese");
    b = tiny_case();
    b.textures[0].edge = 16;
    expect_refused(b, "calls for");
    b = tiny_case();
    b.labels.clear();
    expect_refused(b, "1 to 255");
}

TEST(CaseBundle, TissueOfLabelFollowsTheNames) {
    EXPECT_EQ(tissue_of_label(tiny_case()), (std::vector<int>{0, 1, 2}));
}

// One bundle of every released layout stays readable. The newest is written anew only by
//     SONOCASE_WRITE_GOLDEN=1 formats_container_test
TEST(CaseBundle, GoldenFileOfVersion1StaysReadable) {
    const std::string path = std::string(SONOCASE_SOURCE) + "/tests/data/versions/case-1.sonocase";
    const auto back = load_bundle(path);
    ASSERT_TRUE(back) << back.error().message();
    expect_same(*back, tiny_case());
}

// The second layout: volumes packed.
TEST(CaseBundle, GoldenFileOfThePackedLayoutStaysReadable) {
    const std::string path =
        std::string(SONOCASE_SOURCE) + "/tests/data/versions/case-1-packed.sonocase";
    if (std::getenv("SONOCASE_WRITE_GOLDEN")) {
        ASSERT_TRUE(save_bundle(testing::curved_case(), path));
    }
    const auto back = load_bundle(path);
    ASSERT_TRUE(back) << back.error().message();
    expect_same(*back, testing::curved_case());
}

TEST(CaseBundle, AFutureVersionSaysSo) {
    const std::string path =
        std::string(SONOCASE_SOURCE) + "/tests/data/versions/case-future.sonocase";
    const auto back = load_bundle(path);
    ASSERT_FALSE(back);
    EXPECT_NE(back.error().message().find("format version 9"), std::string::npos)
        << back.error().message();
    EXPECT_NE(back.error().message().find("up to version 1"), std::string::npos)
        << back.error().message();
}

// A patient with the head towards +y and the right side towards -x, as labels say.
CaseBundle lying_case(const std::vector<std::pair<std::string, Point3>>& organs) {
    CaseBundle bundle;
    bundle.grid.size = {50, 50, 50};
    bundle.grid.spacing_mm = {4, 4, 4};
    bundle.labels.push_back({"outside", "air"});
    std::vector<std::uint8_t> dense(bundle.grid.voxel_count());
    for (const auto& [name, centre] : organs) {
        bundle.labels.push_back({name, "tissue"});
        for (int k = 0; k < 50; ++k)
            for (int j = 0; j < 50; ++j)
                for (int i = 0; i < 50; ++i)
                    if (distance({4.0 * i, 4.0 * j, 4.0 * k}, centre) < 16)
                        dense[bundle.grid.index(i, j, k)] =
                            static_cast<std::uint8_t>(bundle.labels.size() - 1);
    }
    bundle.label_bricks = bricks_from_dense<std::uint8_t>(dense, bundle.grid.size);
    return bundle;
}

TEST(BodyAxes, FollowFromWhereOrgansLie) {
    const CaseBundle bundle = lying_case({{"urinary_bladder", {100, 30, 100}},
                                          {"femur_right", {60, 30, 100}},
                                          {"femur_left", {140, 30, 100}},
                                          {"liver", {60, 160, 100}},
                                          {"spleen", {140, 160, 100}}});
    const BodyAxes axes = body_axes(bundle);
    ASSERT_TRUE(axes.known);
    EXPECT_GT(dot(axes.head, Vector3{0, 1, 0}), 0.98);
    EXPECT_GT(dot(axes.right, Vector3{-1, 0, 0}), 0.98);
    EXPECT_GT(dot(axes.front, Vector3{0, 0, 1}), 0.98);  // head x right
    EXPECT_NEAR(axes.groin_mm, 46, 8);
    EXPECT_EQ(label_at(axes, "iliac_vena_right", {60, 30, 100}), "common_femoral_vein_right");
    EXPECT_EQ(label_at(axes, "iliac_artery_left", {60, 30, 100}), "common_femoral_artery_left");
    EXPECT_EQ(label_at(axes, "iliac_vena_right", {60, 90, 100}), "iliac_vena_right");
    EXPECT_EQ(label_at(axes, "liver", {60, 30, 100}), "liver");
}

TEST(BodyAxes, AreNotKnownWhereLabelsDoNotSay) {
    EXPECT_FALSE(body_axes(CaseBundle{}).known);
    EXPECT_FALSE(body_axes(lying_case({{"liver", {60, 160, 100}}})).known);
    EXPECT_FALSE(
        body_axes(lying_case({{"liver", {60, 160, 100}}, {"urinary_bladder", {60, 30, 100}}}))
            .known);
    EXPECT_EQ(label_at({}, "iliac_vena_right", {0, 0, 0}), "iliac_vena_right");
}

}  // namespace
}  // namespace sonocase
