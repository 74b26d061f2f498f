// SPDX-License-Identifier: Apache-2.0

// The region on smaller voxels on disk: it comes back as it was, older readers pass it by, hostile
// bytes are refused.
#include <gtest/gtest.h>

#include <cmath>

#include "formats/bundle/case_bundle.h"
#include "formats/bundle/codec/chunk_file.h"
#include "formats/bundle/codec/region_codec.h"
#include "formats/bundle/stage_files.h"
#include "formats/volume/boundary_record.h"
#include "support/tiny_case.h"

namespace sonocase {
namespace {

using Bytes = std::vector<std::uint8_t>;

// The ball of curved_case(), on voxels of 0.4 mm.
FineRegion ball_region() {
    FineRegion region;
    region.name = "ball";
    region.box = {{4.1, 5, 3}, {15, 12.3, 11}};
    region.grid = region_grid(region.box, 0.4);
    const Grid& grid = region.grid;
    std::vector<std::uint8_t> labels;
    std::vector<std::uint32_t> boundary;
    for (int k = 0; k < grid.size.z; ++k) {
        for (int j = 0; j < grid.size.y; ++j) {
            for (int i = 0; i < grid.size.x; ++i) {
                const Vector3 in = Point3{10.3, 9.8, 8.1} -
                                   grid.point_from_voxel({double(i), double(j), double(k)});
                const double d = (6.2 - norm(in)) / 0.4;
                const std::uint8_t own = d > 0 ? 2 : 1, other = d > 0 ? 1 : 2;
                labels.push_back(own);
                boundary.push_back(std::abs(d) < 1.5
                                       ? pack_boundary({other, std::abs(d),
                                                        d > 0 ? normalized(in) : -normalized(in)})
                                       : kNoBoundary);
            }
        }
    }
    region.label_bricks = bricks_from_dense<std::uint8_t>(labels, grid.size);
    region.boundary = bricks_from_dense<std::uint32_t>(boundary, grid.size);
    return region;
}

void expect_same(const FineRegion& a, const FineRegion& b) {
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.box.lower, b.box.lower);
    EXPECT_EQ(a.box.upper, b.box.upper);
    EXPECT_EQ(a.grid, b.grid);
    EXPECT_EQ(dense_from_bricks(a.label_bricks), dense_from_bricks(b.label_bricks));
    ASSERT_EQ(a.boundary.table.empty(), b.boundary.table.empty());
    if (a.boundary.table.empty()) return;
    EXPECT_EQ(dense_from_bricks<std::uint32_t>(a.boundary),
              dense_from_bricks<std::uint32_t>(b.boundary));
}

CaseBundle case_with_region() {
    CaseBundle bundle = testing::curved_case();
    bundle.region = ball_region();
    return bundle;
}

TEST(FineRegion, GridReachesBeyondItsBox) {
    const Box3 box{{-3.3, 0, 0.05}, {4.1, 0.3, 9.99}};
    for (const double h : {0.1, 0.25, 0.3, 0.4}) {
        FineRegion region;
        region.box = box;
        region.grid = region_grid(box, h);
        EXPECT_TRUE(check_region(region, 1, "x")) << h;
        EXPECT_FALSE(check_region(region, h, "x"));
    }
}

TEST(FineRegion, ComesBackInBundlesAndLabelFiles) {
    const CaseBundle bundle = case_with_region();
    const Bytes bytes = write_bundle(bundle);
    const auto read = read_bundle(bytes, "a");
    ASSERT_TRUE(read) << read.error().message();
    ASSERT_TRUE(read->region);
    expect_same(*read->region, *bundle.region);
    EXPECT_EQ(write_bundle(*read), bytes);
    const auto streamed = stream_bundle({bytes.begin(), bytes.end()}, "a");
    ASSERT_TRUE(streamed && (*streamed)->region);
    expect_same(*(*streamed)->region, *bundle.region);

    LabelFile file;
    file.frame = "mannequin";
    file.volume = {bundle.grid, dense_from_bricks(bundle.label_bricks), bundle.labels};
    file.boundary = bundle.boundary;
    const Bytes without = write_label_file(file);
    file.region = bundle.region;
    file.region->boundary = {};
    const auto again = read_label_file(write_label_file(file), "b");
    ASSERT_TRUE(again) << again.error().message();
    ASSERT_TRUE(again->region);
    expect_same(*again->region, *file.region);
    EXPECT_FALSE(read_label_file(without, "c")->region);
}

TEST(FineRegion, IsThereBeforeTheFirstPictureOfACaseInParts) {
    const auto bytes = arranged_for_loading(write_bundle(case_with_region()), false, "a");
    ASSERT_TRUE(bytes);
    const auto parts = parts_to_open(*bytes, "a");
    ASSERT_TRUE(parts);
    Arrivals arrivals(bytes->size(), 256);
    RawVector<std::uint8_t> here;
    here.assign(bytes->size(), std::uint8_t{0});
    for (const ByteRange& part : *parts) {
        for (std::size_t n = part.at / 256; n * 256 < part.end(); ++n) {
            const ByteRange r = arrivals.range(n);
            std::copy_n(bytes->begin() + static_cast<std::ptrdiff_t>(r.at), r.count,
                        here.data() + r.at);
            arrivals.add(n);
        }
    }
    const auto opened = stream_bundle_in_parts(std::move(here), std::move(arrivals), "a");
    ASSERT_TRUE(opened) << opened.error().message();
    EXPECT_TRUE((*opened)->region);
}

// The chunk is not required, so that a reader that does not know it passes it by; the case's own
// volume is the same with it and without.
TEST(FineRegion, OlderReadersSeeTheCaseWithoutIt) {
    const CaseBundle bundle = case_with_region(), plain = testing::curved_case();
    const Bytes bytes = write_bundle(bundle), plain_bytes = write_bundle(plain);
    constexpr std::string_view kAll[] = {"manifest", "vox.kind", "vox.one", "vox.mix",  "vox.pair",
                                         "vox.low",  "vox.high", "vox.fix", "ofs.kind", "ofs.one",
                                         "ofs.val",  "textures", "speckle", "skin.pat", "skin.fit",
                                         "skin.man", "flow",     "preview"};
    const auto reader = ChunkReader::open(bytes, "CASE", kAll, "a"),
               plain_reader = ChunkReader::open(plain_bytes, "CASE", kAll, "b");
    ASSERT_TRUE(reader && plain_reader);
    EXPECT_FALSE(reader->is_required("region"));
    for (const std::string_view type : kAll) {
        const auto a = reader->read(type, 1 << 20), b = plain_reader->read(type, 1 << 20);
        ASSERT_EQ(a.has_value(), b.has_value()) << type;
        EXPECT_EQ(a ? *a : Bytes(), b ? *b : Bytes()) << type;
    }
}

TEST(FineRegion, HostileBytesAreRefused) {
    const FineRegion good = ball_region();
    const Bytes bytes = detail::region_bytes(good, serial_jobs());
    const auto read = [](const Bytes& b, std::size_t palette, double case_mm) {
        return detail::region_from_bytes(b, palette, case_mm, "x", serial_jobs());
    };
    ASSERT_TRUE(read(bytes, 3, 1));
    EXPECT_FALSE(read(bytes, 2, 1));    // a label beyond the palette
    EXPECT_FALSE(read(bytes, 3, 0.4));  // voxels not below the case's
    for (std::size_t cut = 0; cut < bytes.size(); cut += 97)
        EXPECT_FALSE(read({bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(cut)}, 3, 1));
    for (std::size_t at = 0; at < bytes.size(); at += 41) {
        Bytes changed = bytes;
        changed[at] ^= 0x10;
        EXPECT_FALSE(read(changed, 3, 1)) << at;
    }
    FineRegion bad = good;
    bad.box.upper.x = 17;  // beyond the grid
    EXPECT_FALSE(read(detail::region_bytes(bad, serial_jobs()), 3, 1));
    bad = good;
    std::swap(bad.box.lower, bad.box.upper);
    EXPECT_FALSE(read(detail::region_bytes(bad, serial_jobs()), 3, 1));
    const auto fault = read({}, 3, 1);
    ASSERT_FALSE(fault);
    EXPECT_NE(fault.error().message().find("fine region"), std::string::npos);
}

}  // namespace
}  // namespace sonocase
