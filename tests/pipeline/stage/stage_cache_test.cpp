// SPDX-License-Identifier: Apache-2.0

#include "pipeline/stages/stage_cache.h"

#include <gtest/gtest.h>

#include <fcntl.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <thread>

#include "formats/base/digest.h"
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
        EXPECT_FALSE(cache.find("warp", kKey, nullptr).has_value()) << at;
    }
    folder.write(name, whole + "x");
    EXPECT_FALSE(cache.find("warp", kKey, nullptr).has_value());
}

TEST(StageCache, DigestIsLookedUpWithoutItsBytesAndNeverFromADamagedLine) {
    const TemporaryFolder folder;
    const StageCache cache(folder.path());
    EXPECT_FALSE(cache.digest_in("warp", kKey).has_value());
    const CacheEntry entry = entry_of("some bytes of a stage");
    ASSERT_TRUE(cache.store("warp", kKey, entry).has_value());
    EXPECT_EQ(cache.digest_in("warp", kKey), entry.digest);
    const std::string path = cache.path_of("warp", kKey);
    const std::string whole = testing::read_text(path);
    const std::string name = std::filesystem::relative(path, folder.path()).string();
    for (std::size_t length = 0; length < whole.size(); ++length) {
        folder.write(name, whole.substr(0, length));
        EXPECT_FALSE(cache.digest_in("warp", kKey).has_value()) << length;
    }
    for (std::size_t at = 0; at <= whole.find('\n'); ++at) {
        std::string changed = whole;
        changed[at] = static_cast<char>(changed[at] ^ 4);
        folder.write(name, changed);
        EXPECT_FALSE(cache.digest_in("warp", kKey).has_value()) << at;
    }
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

TEST(StageCache, TidyRemovesDamagedEntriesAndKeepsTheRest) {
    const TemporaryFolder folder;
    const StageCache cache(folder.path());
    std::string other = kKey;
    other[0] = 'f';
    ASSERT_TRUE(cache.store("warp", kKey, entry_of("one")).has_value());
    ASSERT_TRUE(cache.store("warp", other, entry_of("two")).has_value());
    std::string bytes = testing::read_text(cache.path_of("warp", other));
    bytes.back() = static_cast<char>(bytes.back() ^ 1);
    std::ofstream(cache.path_of("warp", other), std::ios::binary) << bytes;
    EXPECT_EQ(cache.tidy(false).damaged, 0u);
    const CacheSummary summary = cache.tidy(true);
    EXPECT_EQ(summary.damaged, 1u);
    EXPECT_EQ(summary.entries, 1u);
    EXPECT_TRUE(cache.find("warp", kKey, nullptr).has_value());
    EXPECT_FALSE(std::filesystem::exists(cache.path_of("warp", other)));
}

TEST(StageCache, WhatNobodyUsedForLongGoesAndWhatIsUsedStays) {
    const TemporaryFolder folder;
    const StageCache cache(folder.path());
    const auto key = [](char first) { return first + std::string(kKey).substr(1); };
    for (const char first : {'a', 'b', 'c'}) {
        ASSERT_TRUE(cache.store("s", key(first), entry_of("some")));
        std::filesystem::last_write_time(
            cache.path_of("s", key(first)),
            std::filesystem::file_time_type::clock::now() - std::chrono::hours(24 * 10));
    }
    ASSERT_TRUE(cache.find("s", key('b'), nullptr).has_value());  // used now
    EXPECT_EQ(cache.tidy(false, 11).old, 0u);
    const CacheSummary summary = cache.tidy(true, 9);  // verifying is no use
    EXPECT_EQ(summary.old, 2u);
    EXPECT_EQ(summary.entries, 1u);
    EXPECT_TRUE(cache.find("s", key('b'), nullptr).has_value());
}

// Processes, not threads: what a farm's machines do to a folder that they share.
class ManyProcesses {
  public:
    template <class Work>
    void start(const Work& work) {
        const pid_t child = fork();
        if (child == 0) _exit(work() ? 0 : 1);
        children_.push_back(child);
    }
    void kill_all() const {
        for (const pid_t child : children_) kill(child, SIGKILL);
    }
    int failures() {
        int failed = 0;
        for (const pid_t child : children_) {
            int status = 0;
            waitpid(child, &status, 0);
            failed += status == 0 ? 0 : 1;
        }
        children_.clear();
        return failed;
    }

  private:
    std::vector<pid_t> children_;
};

std::string key_of(int n) {
    std::string key = kKey;
    key[0] = static_cast<char>('a' + n);
    return key;
}
CacheEntry entry_number(int n) {
    return entry_of(std::string(20000, static_cast<char>('A' + n)));
}

TEST(StageCache, ProcessesThatWriteReadAndEvictAtOnceNeverSeeAWrongEntry) {
    const TemporaryFolder folder;
    ManyProcesses processes;
    for (int p = 0; p < 6; ++p)
        processes.start([&folder, p] {
            const StageCache cache(folder.path(), 90000);  // room for four of the eight
            for (int round = 0; round < 60; ++round) {
                const int n = (round * 5 + p) % 8;
                bool damaged = false;
                const auto found = cache.find("s", key_of(n), &damaged);
                if (damaged) return false;
                if (found && found->bytes != entry_number(n).bytes) return false;
                if (!found && !cache.store("s", key_of(n), entry_number(n))) return false;
            }
            return true;
        });
    EXPECT_EQ(processes.failures(), 0);
    const CacheSummary summary = StageCache(folder.path(), 90000).tidy(true);
    EXPECT_EQ(summary.damaged, 0u);
    EXPECT_EQ(summary.leftovers, 0u);
    EXPECT_LE(summary.bytes, 90000u);
    EXPECT_GE(summary.entries, 1u);
}

TEST(StageCache, KilledWritersLeaveNoEntryAndTheirRestIsCleared) {
    const TemporaryFolder folder;
    const StageCache cache(folder.path());
    // The writer stands in the middle of its entry when it is killed.
    const std::string pipe = folder / "started";
    ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
    ManyProcesses processes;
    processes.start([&] {
        const std::string tmp = folder / "s/ab/." + kKey + ".host.1.0.tmp";
        std::filesystem::create_directories(folder / "s/ab");
        const int file = open(tmp.c_str(), O_CREAT | O_WRONLY, 0600);
        if (flock(file, LOCK_EX) != 0 || write(file, "sonocase-cache 2 ", 17) != 17) return false;
        std::ofstream(pipe) << "x";
        pause();
        return true;
    });
    {
        std::ifstream wait(pipe);
        wait.get();
    }
    std::filesystem::remove(pipe);
    EXPECT_EQ(cache.tidy(false).leftovers, 0u);  // alive, so that its file is in use
    processes.kill_all();
    processes.failures();
    EXPECT_EQ(cache.tidy(false).leftovers, 1u);
    EXPECT_EQ(folder.names(), (std::vector<std::string>{"s", "s/ab"}));
}

TEST(StageCache, WriterWhoseTemporaryIsTakenForALeftoverWritesAnother) {
    const TemporaryFolder folder;
    ManyProcesses processes;
    for (int p = 0; p < 2; ++p)
        processes.start([&folder] {
            const StageCache cache(folder.path());
            for (int round = 0; round < 300; ++round)
                if (!cache.store("s", key_of(round % 3), entry_number(round % 3))) return false;
            return true;
        });
    processes.start([&folder] {
        const StageCache cache(folder.path());
        for (int round = 0; round < 300; ++round) cache.tidy(false);
        return true;
    });
    EXPECT_EQ(processes.failures(), 0);
    for (int n = 0; n < 3; ++n)
        EXPECT_TRUE(StageCache(folder.path()).find("s", key_of(n), nullptr).has_value());
}

}  // namespace
}  // namespace sonocase::pipeline
