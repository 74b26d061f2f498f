// SPDX-License-Identifier: Apache-2.0

#include "formats/bundle/codec/chunk_file.h"

#include <gtest/gtest.h>

#include <numeric>

#include "formats/files/thread_jobs.h"

namespace sonocase {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::string_view kKnown[] = {"alpha", "beta", "gamma"};

Bytes pattern(std::size_t size) {
    Bytes out(size);
    for (std::size_t i = 0; i < size; ++i) out[i] = static_cast<std::uint8_t>((i * i) >> 9);
    return out;
}

Bytes small_file() {
    ChunkWriter writer("TEST");
    writer.add("alpha", true, pattern(300));
    writer.add("beta", false, {});
    writer.add("gamma", false, Bytes{7, 8, 9});
    return writer.write();
}

Result<Bytes> read_all(const Bytes& file) {
    const auto reader = ChunkReader::open(file, "TEST", kKnown, "file");
    if (!reader) return reader.error();
    Bytes all;
    for (const char* type : {"alpha", "beta", "gamma"}) {
        const auto bytes = reader->read(type, 1 << 20);
        if (!bytes) return bytes.error();
        all.insert(all.end(), bytes->begin(), bytes->end());
    }
    return all;
}

TEST(ChunkFile, GivesBackWhatWasWritten) {
    const auto all = read_all(small_file());
    ASSERT_TRUE(all) << all.error().message();
    Bytes expected = pattern(300);
    expected.insert(expected.end(), {7, 8, 9});
    EXPECT_EQ(*all, expected);
}

TEST(ChunkFile, LongChunksAreCompressedAlikeOnAnyNumberOfThreads) {
    const Bytes long_chunk = pattern(3 * kFrameBytes + 12345);
    ChunkWriter writer("TEST");
    writer.add_view("alpha", true, long_chunk);
    ThreadJobs four_threads(4);
    const Bytes one = writer.write(), four = writer.write(four_threads);
    EXPECT_EQ(one, four);
    EXPECT_LT(one.size(), long_chunk.size() / 2);
    const auto reader = ChunkReader::open(one, "TEST", kKnown, "file");
    ASSERT_TRUE(reader);
    for (const int threads : {1, 4}) {
        ThreadJobs jobs(threads);
        const auto back = reader->read("alpha", long_chunk.size(), jobs);
        ASSERT_TRUE(back) << back.error().message();
        EXPECT_EQ(*back, long_chunk);
    }
}

TEST(ChunkFile, ChunksStartAtMultiplesOf64) {
    const Bytes file = small_file();
    EXPECT_EQ((64 + 3 * 64) % 64, 0);
    EXPECT_EQ(file[256 + 0], pattern(300)[0]);
}

TEST(ChunkFile, EveryTruncationIsAnError) {
    const Bytes file = small_file();
    for (std::size_t n = 0; n < file.size(); ++n) {
        EXPECT_FALSE(read_all(Bytes(file.begin(), file.begin() + static_cast<std::ptrdiff_t>(n))))
            << n;
    }
}

TEST(ChunkFile, EveryDamagedByteIsAnError) {
    const Bytes file = small_file();
    for (std::size_t i = 0; i < file.size(); ++i) {
        for (const int change : {1, 0x80, 0xFF}) {
            Bytes damaged = file;
            damaged[i] = static_cast<std::uint8_t>(damaged[i] ^ change);
            EXPECT_FALSE(read_all(damaged)) << "byte " << i;
        }
    }
}

TEST(ChunkFile, TrailingBytesAreAnError) {
    Bytes file = small_file();
    file.push_back(0);
    const auto all = read_all(file);
    ASSERT_FALSE(all);
    EXPECT_NE(all.error().what.find("follow the end"), std::string::npos);
}

TEST(ChunkFile, AnotherKindIsNamed) {
    const Bytes file = small_file();
    const auto reader = ChunkReader::open(file, "CASE", kKnown, "file");
    ASSERT_FALSE(reader);
    EXPECT_NE(reader.error().message().find("TEST"), std::string::npos);
}

TEST(ChunkFile, UnknownOptionalChunksAreSkippedAndUnknownRequiredOnesAreErrors) {
    for (const bool required : {false, true}) {
        ChunkWriter writer("TEST");
        writer.add("alpha", true, pattern(10));
        writer.add("omega", required, pattern(1000));
        writer.add("gamma", false, pattern(5));
        const Bytes file = writer.write();
        const auto reader = ChunkReader::open(file, "TEST", kKnown, "file");
        EXPECT_EQ(reader.has_value(), !required);
        if (!reader) {
            EXPECT_NE(reader.error().message().find("omega"), std::string::npos);
            continue;
        }
        EXPECT_FALSE(reader->has("omega"));
        EXPECT_EQ(*reader->read("gamma", 100), pattern(5));
    }
}

TEST(ChunkFile, ASizeBeyondTheCallersLimitIsRefusedBeforeAllocation) {
    const Bytes file = small_file();
    const auto reader = ChunkReader::open(file, "TEST", kKnown, "file");
    ASSERT_TRUE(reader);
    EXPECT_FALSE(reader->read("alpha", 299));
    EXPECT_FALSE(reader->read_array<std::uint32_t>("alpha", 76));
    EXPECT_TRUE(reader->read_array<std::uint32_t>("alpha", 75));
    EXPECT_FALSE(reader->read_array<std::uint32_t>("omega", 0));
}

}  // namespace
}  // namespace sonocase
