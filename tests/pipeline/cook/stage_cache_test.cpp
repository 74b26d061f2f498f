#include "pipeline/cook/stage_cache.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <thread>

#include "formats/digest.h"
#include "support/temporary_folder.h"

namespace sonocase::pipeline {
namespace {

using testing::TemporaryFolder;

const std::string kKey = "0123456789abcdef0123456789abcdef";

CacheEntry entry_of(const std::string& text) {
    CacheEntry entry{{text.begin(), text.end()}, "", 1.25};
    entry.digest = digest_of(entry.bytes);
    return entry;
}

TEST(StageCache, GivesBackWhatWasStored) {
    const TemporaryFolder folder;
    const StageCache cache(folder.path());
    EXPECT_FALSE(cache.find("warp", kKey, nullptr).has_value());
    ASSERT_TRUE(cache.store("warp", kKey, entry_of("a\nb")).has_value());
    bool damaged = true;
    const auto found = cache.find("warp", kKey, &damaged);
    ASSERT_TRUE(found.has_value());
    EXPECT_FALSE(damaged);
    EXPECT_EQ(std::string(found->bytes.begin(), found->bytes.end()), "a\nb");
    EXPECT_EQ(found->seconds, 1.25);
    EXPECT_FALSE(cache.find("align", kKey, nullptr).has_value());
}

TEST(StageCache, EveryTruncationAndEveryChangedByteCountsAsAbsent) {
    const TemporaryFolder folder;
    const StageCache cache(folder.path());
    ASSERT_TRUE(cache.store("warp", kKey, entry_of("some bytes of a stage")).has_value());
    const std::string path = cache.path_of("warp", kKey);
    const std::string whole = testing::read_text(path);
    const std::string name = std::filesystem::relative(path, folder.path()).string();
    for (std::size_t length = 0; length < whole.size(); ++length) {
        folder.write(name, whole.substr(0, length));
        bool damaged = false;
        EXPECT_FALSE(cache.find("warp", kKey, &damaged).has_value()) << length;
        EXPECT_TRUE(damaged) << length;
    }
    for (std::size_t at = 0; at < whole.size(); ++at) {
        std::string changed = whole;
        changed[at] = static_cast<char>(changed[at] ^ 4);
        folder.write(name, changed);
        const auto found = cache.find("warp", kKey, nullptr);
        // A digit of the seconds may change unnoticed: they are no part of a result.
        if (found) {
            EXPECT_EQ(digest_of(found->bytes), entry_of("some bytes of a stage").digest) << at;
        }
    }
    folder.write(name, whole + "x");
    EXPECT_FALSE(cache.find("warp", kKey, nullptr).has_value());
}

TEST(StageCache, EntryOfAnotherKeyIsNotTaken) {
    const TemporaryFolder folder;
    const StageCache cache(folder.path());
    ASSERT_TRUE(cache.store("warp", kKey, entry_of("x")).has_value());
    std::string other = kKey;
    other[31] = '0';
    std::filesystem::copy(cache.path_of("warp", kKey), cache.path_of("warp", other));
    EXPECT_FALSE(cache.find("warp", other, nullptr).has_value());
}

TEST(StageCache, ManyWritersLeaveOneGoodEntryAndNoRest) {
    const TemporaryFolder folder;
    std::vector<std::thread> writers;
    const CacheEntry entry = entry_of(std::string(300000, 'q'));
    for (int t = 0; t < 8; ++t)
        writers.emplace_back([&] {
            const StageCache cache(folder.path());
            for (int n = 0; n < 20; ++n) {
                EXPECT_TRUE(cache.store("warp", kKey, entry).has_value());
                EXPECT_TRUE(cache.find("warp", kKey, nullptr).has_value());
            }
        });
    for (std::thread& writer : writers) writer.join();
    EXPECT_EQ(folder.names(), (std::vector<std::string>{"warp", "warp/01", "warp/01/" + kKey}));
}

TEST(StageCache, LimitKeepsWhatWasUsedLast) {
    const TemporaryFolder folder;
    const StageCache cache(folder.path(), 50000);
    const auto key = [](int n) {
        std::string k = kKey;
        k[0] = static_cast<char>('a' + n);
        return k;
    };
    const auto used_at = [&](int n, int seconds_ago) {
        std::filesystem::last_write_time(
            cache.path_of("s", key(n)),
            std::filesystem::file_time_type::clock::now() - std::chrono::seconds(seconds_ago));
    };
    for (int n = 0; n < 4; ++n) {
        ASSERT_TRUE(
            cache.store("s", key(n), entry_of(std::string(10000, static_cast<char>('0' + n)))));
        used_at(n, 100 - n);
    }
    ASSERT_TRUE(cache.find("s", key(0), nullptr).has_value());  // now the one used last
    ASSERT_TRUE(cache.store("s", key(4), entry_of(std::string(10000, '4'))));
    EXPECT_TRUE(cache.find("s", key(0), nullptr).has_value());
    EXPECT_FALSE(cache.find("s", key(1), nullptr).has_value());
    EXPECT_TRUE(cache.find("s", key(4), nullptr).has_value());
}

}  // namespace
}  // namespace sonocase::pipeline
