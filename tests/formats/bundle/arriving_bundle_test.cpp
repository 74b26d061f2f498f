// SPDX-License-Identifier: Apache-2.0

// Bundles that arrive in segments, as over a network.
#include <gtest/gtest.h>

#include <algorithm>

#include "formats/bundle/case_bundle.h"
#include "support/hard_case.h"
#include "support/random.h"
#include "support/tiny_case.h"

namespace sonocase {
namespace {

using Bytes = std::vector<std::uint8_t>;
constexpr std::size_t kSegment = 256;

Bytes arranged(const CaseBundle& bundle) {
    auto bytes = arranged_for_loading(write_bundle(bundle), false, "curved");
    EXPECT_TRUE(bytes) << bytes.error().message();
    return *bytes;
}

// A file of which nothing is there yet, and the whole of it.
struct Link {
    explicit Link(const Bytes& whole) : file(whole), arrivals(whole.size(), kSegment) {
        here.assign(whole.size(), std::uint8_t{0});
    }
    void bring(std::size_t segment, std::uint8_t* to) const {
        const ByteRange r = arrivals.range(segment);
        std::copy_n(file.begin() + static_cast<std::ptrdiff_t>(r.at), r.count, to + r.at);
    }
    void bring(std::size_t segment) {
        bring(segment, here.data());
        arrivals.add(segment);
    }
    void bring(const std::vector<ByteRange>& ranges) {
        for (const ByteRange& r : ranges) {
            for (std::size_t n = r.at / kSegment; n * kSegment < r.end(); ++n) bring(n);
        }
    }
    Bytes file;
    RawVector<std::uint8_t> here;
    Arrivals arrivals;
};

TEST(Arrivals, CountsSegmentsAndKnowsRanges) {
    Arrivals a(1000, 256);
    EXPECT_EQ(a.segments(), 4u);
    EXPECT_EQ(a.range(3), (ByteRange{768, 232}));
    EXPECT_TRUE(a.has({500, 0}));
    EXPECT_FALSE(a.has({0, 1}));
    a.add(1);
    a.add(1);
    EXPECT_EQ(a.left(), 3u);
    EXPECT_TRUE(a.has({256, 256}));
    EXPECT_FALSE(a.has({255, 2}));
    EXPECT_FALSE(a.has({511, 2}));
    for (std::size_t n : {0u, 2u, 3u}) a.add(n);
    EXPECT_TRUE(a.whole() && a.has({0, 1000}));
}

TEST(ArrivingBundle, ArrangedHoldsTheSameInAnotherOrder) {
    for (const bool textures : {false, true}) {
        const CaseBundle bundle = testing::curved_case();
        const Bytes bytes = write_bundle(bundle);
        const auto again = arranged_for_loading(bytes, textures, "curved");
        ASSERT_TRUE(again);
        const auto read = read_bundle(*again, "again");
        ASSERT_TRUE(read) << read.error().message();
        EXPECT_EQ(write_bundle(*read), bytes);
        EXPECT_LE(again->size(), bytes.size() + 64);
        // Textures that the first picture needs are among what must be there.
        const auto parts = parts_to_open(*again, "again");
        ASSERT_TRUE(parts);
        Link link(*again);
        link.bring(*parts);
        const auto opened = stream_bundle_in_parts(link.here, link.arrivals, "again");
        ASSERT_TRUE(opened) << opened.error().message();
        EXPECT_EQ(opened->has_textures(), textures || link.arrivals.whole());
    }
    EXPECT_FALSE(arranged_for_loading(Bytes(200, 7), false, "holiday"));
    EXPECT_FALSE(parts_to_open(Bytes(200, 7), "holiday"));
}

// Under the sanitizers: nothing is read that is not there.
TEST(ArrivingBundle, IsRehearsedWithAnyPartOfIt) {
    Link link(arranged(testing::curved_case()));
    const auto parts = parts_to_open(link.file, "curved");
    ASSERT_TRUE(parts);
    rehearse_opening(link.here, link.arrivals);
    for (const ByteRange& r : *parts) {
        for (std::size_t n = r.at / kSegment; n * kSegment < r.end(); ++n) {
            link.bring(n);
            rehearse_opening(link.here, link.arrivals);
        }
    }
    EXPECT_TRUE(stream_bundle_in_parts(link.here, link.arrivals, "curved"));
}

TEST(ArrivingBundle, OpensWithLittleAndIsWholeInTheEnd) {
    const CaseBundle bundle = testing::curved_case();
    Link link(arranged(bundle));
    const auto parts = parts_to_open(link.file, "curved");
    ASSERT_TRUE(parts);
    link.bring(*parts);
    ASSERT_GT(link.arrivals.left(), 0u);
    auto opened = stream_bundle_in_parts(link.here, link.arrivals, "curved");
    ASSERT_TRUE(opened) << opened.error().message();
    StreamedBundle streamed = std::move(*opened);
    EXPECT_EQ(dense_from_bricks(streamed->label_bricks), dense_from_bricks(bundle.label_bricks));

    // Asked for too early: something valid, and awaited.
    VoxelBlocks& blocks = *streamed.blocks();
    blocks.ensure_loaded([](Int3) { return true; });
    EXPECT_GT(blocks.awaited(), 0u);
    EXPECT_FALSE(blocks.whole());
    for (const std::uint32_t v : streamed->boundary.pool)
        ASSERT_TRUE((v & 0xFFu) == 0xFFu || (v & 0xFFu) < bundle.labels.size());
    const std::size_t awaited = blocks.awaited();
    blocks.ensure_loaded([](Int3) { return true; });
    EXPECT_EQ(blocks.awaited(), awaited) << "a block counts once";
    blocks.forget_awaited();
    EXPECT_EQ(blocks.awaited(), 0u);

    // The rest in a random order, asked for meanwhile.
    std::vector<std::size_t> order;
    for (std::size_t n = 0; n < link.arrivals.segments(); ++n) {
        if (!streamed.arrivals()->has_segment(n)) order.push_back(n);
    }
    testing::Random random(7);
    for (std::size_t n = order.size(); n > 1; --n)
        std::swap(order[n - 1],
                  order[static_cast<std::size_t>(random.uniform(0, static_cast<double>(n)))]);
    for (const std::size_t segment : order) {
        link.bring(segment, streamed.bytes().data());
        streamed.arrived(segment);
        ASSERT_TRUE(streamed.read_arrived());
        blocks.ensure_loaded([](Int3) { return true; });
    }
    EXPECT_TRUE(streamed.arrivals()->whole() && streamed.has_textures());
    EXPECT_TRUE(blocks.whole() && blocks.status());
    const Int3 size = bundle.grid.size;
    int off = 0;
    for (int k = 0; k < size.z; ++k) {
        for (int j = 0; j < size.y; ++j) {
            for (int i = 0; i < size.x; ++i) {
                off += streamed->boundary.at(i, j, k) != bundle.boundary.at(i, j, k) ||
                       streamed->echo_offset.at(i, j, k) != bundle.echo_offset.at(i, j, k);
            }
        }
    }
    testing::HardCase voxels("voxels off once all blocks are there", testing::HardCase::at_most, 0,
                             "");
    voxels.see(off);
    ASSERT_EQ(streamed->textures.size(), bundle.textures.size());
    for (std::size_t n = 0; n < bundle.textures.size(); ++n)
        EXPECT_EQ(streamed->textures[n].voxels, bundle.textures[n].voxels);
    EXPECT_EQ(streamed->patient_skin.points, bundle.patient_skin.points);
    EXPECT_EQ(streamed->skin_unfitted, bundle.skin_unfitted);
    EXPECT_EQ(streamed->preview_png, bundle.preview_png);
}

TEST(ArrivingBundle, WithoutAnyOfItsFirstSegmentsItSaysThatSomethingHasNotArrived) {
    const Bytes file = arranged(testing::curved_case());
    const auto parts = parts_to_open(file, "curved");
    ASSERT_TRUE(parts);
    Link all(file);
    all.bring(*parts);
    for (std::size_t missing = 0; missing < all.arrivals.segments(); ++missing) {
        if (!all.arrivals.has_segment(missing)) continue;
        Link link(file);
        for (std::size_t n = 0; n < all.arrivals.segments(); ++n) {
            if (n != missing && all.arrivals.has_segment(n)) link.bring(n);
        }
        const auto opened = stream_bundle_in_parts(link.here, link.arrivals, "curved");
        ASSERT_FALSE(opened) << missing;
        EXPECT_NE(opened.error().message().find("has not arrived"), std::string::npos)
            << opened.error().message();
    }
}

// Segments are checked by whoever brings them; a wrong one must still do no harm.
TEST(ArrivingBundle, AWrongBlockIsFoundWhenItIsAskedFor) {
    const CaseBundle bundle = testing::curved_case();
    Link link(arranged(bundle));
    const auto parts = parts_to_open(link.file, "curved");
    ASSERT_TRUE(parts);
    link.bring(*parts);
    auto opened = stream_bundle_in_parts(link.here, link.arrivals, "curved");
    ASSERT_TRUE(opened);
    for (std::size_t n = 0; n < link.arrivals.segments(); ++n) {
        if (opened->arrivals()->has_segment(n)) continue;
        const ByteRange r = link.arrivals.range(n);
        std::fill_n(opened->bytes().begin() + static_cast<std::ptrdiff_t>(r.at), r.count,
                    std::uint8_t{0x5A});
        opened->arrived(n);
    }
    EXPECT_FALSE(opened->read_arrived()) << "chunks that are read whole have checksums";
    opened->blocks()->ensure_loaded([](Int3) { return true; });
    EXPECT_TRUE(opened->blocks()->damaged());
    for (const std::uint32_t v : (*opened)->boundary.pool)
        ASSERT_TRUE((v & 0xFFu) == 0xFFu || (v & 0xFFu) < bundle.labels.size());
}

}  // namespace
}  // namespace sonocase
