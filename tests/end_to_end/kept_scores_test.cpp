// SPDX-License-Identifier: Apache-2.0

// Whatever is wrong with the progress book when an attempt ends: its scores are kept beside the
// recording, this is said, the exit status tells, and they are put into the book later.
#include <gtest/gtest.h>
#include <sqlite3.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>

#include "formats/files/atomic_file.h"
#include "formats/files/load_save.h"
#include "formats/progress_book/progress_book.h"
#include "support/paths.h"
#include "support/run_command.h"
#include "support/small_case.h"
#include "support/temporary_folder.h"

namespace sonocase {
namespace {

namespace fs = std::filesystem;

using testing::CommandResult;
using testing::read_text;

// Holds a file locked as another program does that writes to it.
class OtherProgram {
  public:
    explicit OtherProgram(const std::string& path) {
        sqlite3_open(path.c_str(), &db_);
        sqlite3_exec(db_, "BEGIN EXCLUSIVE", nullptr, nullptr, nullptr);
    }
    ~OtherProgram() { sqlite3_close(db_); }
    OtherProgram(const OtherProgram&) = delete;
    OtherProgram& operator=(const OtherProgram&) = delete;

  private:
    sqlite3* db_ = nullptr;
};

void tell(const std::string& path, const char* sql) {
    sqlite3* db = nullptr;
    sqlite3_open(path.c_str(), &db);
    EXPECT_EQ(sqlite3_exec(db, sql, nullptr, nullptr, nullptr), SQLITE_OK) << sqlite3_errmsg(db);
    sqlite3_close(db);
}

class KeptScores : public ::testing::Test {
  protected:
    void SetUp() override {
        bundle_ = folder_ / "cylinder.sonocase";
        ASSERT_TRUE(save_bundle(testing::small_case(), bundle_));
        // Twice as slow: an attempt of less than 3 s is not put into the book.
        std::string toml = testing::small_exercise_toml();
        toml.replace(toml.find("time_s = 1"), 10, "time_s = 2");
        toml.replace(toml.find("time_s = 2\nprobe = [0, 30"), 10, "time_s = 4");
        exercise_ = folder_.write("scan.toml", toml);
        fs::create_directories(folder_ / "data/sonocase");
        book_ = folder_ / "data/sonocase/progress.sqlite";
    }
    CommandResult run(const std::string& command, const std::string& before = "") {
        return testing::run_command(before + " env HOME=" + folder_.path() +
                                    " XDG_DATA_HOME=" + data_ + " " SONOCASE_BIN "/" + command);
    }
    // before: of the shell, as a limit that the program runs under
    CommandResult play(const std::string& before = "") {
        return run("sonoplay " + bundle_ + " --exercise " + exercise_ +
                       " --tracker sweep:along --headless --frames 30 --size 64x64 --model paper "
                       "--trainee Ada --record " +
                       record_,
                   before);
    }
    void fill_book(int sessions) {
        auto book = ProgressBook::open(book_);
        ASSERT_TRUE(book) << book.error().message();
        tell(book_, "PRAGMA journal_mode=MEMORY");
        ProgressEntry entry;
        entry.trainee = "Bob", entry.case_name = "demo", entry.exercise = "liver";
        entry.passed = true;
        for (const char* metric : {"elapsed_time_s", "targets_hit", "final_tip_to_target_mm"})
            entry.metrics.push_back({metric, 1.5});
        for (int i = 0; i < sessions; ++i) {
            entry.started = std::to_string(100000 + i);
            ASSERT_TRUE(book->add(entry));
        }
    }
    std::vector<ProgressEntry> sessions(const std::string& trainee) {
        auto book = ProgressBook::open(book_);
        EXPECT_TRUE(book) << book.error().message();
        return book ? *book->sessions(trainee, "") : std::vector<ProgressEntry>{};
    }
    // An attempt whose scores the book cannot take; then the obstacle goes.
    void expect_kept_and_added(const std::string& way,
                               const std::function<void()>& mend,
                               const std::string& before = "") {
        SCOPED_TRACE(way);
        const CommandResult played = play(before);
        EXPECT_EQ(played.status, 1) << played.error;
        EXPECT_NE(played.error.find("not put into the progress book"), std::string::npos)
            << played.error;
        const std::string kept = record_ + ".scores.json";
        EXPECT_NE(played.error.find("sonocase progress --add " + kept), std::string::npos)
            << played.error;
        ASSERT_TRUE(fs::exists(kept));
        const auto scores = nlohmann::json::parse(read_text(kept));
        if (before.empty()) {
            const CommandResult still = run("sonocase progress --add " + kept);
            EXPECT_EQ(still.status, 1) << still.out;
            EXPECT_EQ(std::count(still.error.begin(), still.error.end(), '\n'), 1) << still.error;
            EXPECT_TRUE(fs::exists(kept));
        }
        mend();
        for (int twice = 0; twice < 2; ++twice) {
            const CommandResult added = run("sonocase progress --add " + kept);
            EXPECT_EQ(added.status, 0) << added.error;
            EXPECT_NE(added.out.find("Ada, scan"), std::string::npos) << added.out;
        }
        const std::vector<ProgressEntry> mine = sessions("Ada");
        ASSERT_EQ(mine.size(), 1u);
        EXPECT_EQ(mine[0].passed, scores["passed"].get<bool>());
        EXPECT_GT(mine[0].metrics.size(), 5u);
        for (const Metric& metric : mine[0].metrics)
            EXPECT_EQ(metric.value, scores["metrics"][metric.name].get<double>()) << metric.name;
    }

    testing::TemporaryFolder folder_{/*in_memory=*/true};
    std::string bundle_, exercise_, book_;
    std::string data_ = folder_ / "data", record_ = folder_ / "attempt.igs.mha";
};

TEST_F(KeptScores, ABookThatTakesThemHasThemAtOnce) {
    const CommandResult played = play();
    EXPECT_EQ(played.status, 0) << played.error;
    EXPECT_EQ(sessions("Ada").size(), 1u);
    EXPECT_FALSE(fs::exists(record_ + ".scores.json"));
}

TEST_F(KeptScores, BesideABookThatAnotherProgramHas) {
    fill_book(1);
    auto other = std::make_unique<OtherProgram>(book_);
    expect_kept_and_added("locked", [&] { other.reset(); });
    EXPECT_EQ(sessions("Bob").size(), 1u);
}

TEST_F(KeptScores, BesideABookThatIsNone) {
    const auto away = [&] { fs::rename(book_, book_ + ".bad"); };
    ASSERT_TRUE(write_file(book_, std::string(5000, 'x')));
    expect_kept_and_added("damaged", away);
    EXPECT_EQ(read_text(book_ + ".bad"), std::string(5000, 'x'));
}

TEST_F(KeptScores, BesideABookThatLostItsEnd) {
    fill_book(300);
    fs::resize_file(book_, fs::file_size(book_) / 3);
    expect_kept_and_added("cut off", [&] { fs::rename(book_, book_ + ".bad"); });
}

TEST_F(KeptScores, BesideABookOfANewerProgram) {
    fill_book(1);
    tell(book_, "PRAGMA user_version=99");
    expect_kept_and_added("newer", [&] { tell(book_, "PRAGMA user_version=4"); });
}

TEST_F(KeptScores, WhereAFolderStandsInTheBooksPlace) {
    fs::create_directories(book_);
    expect_kept_and_added("folder", [&] { fs::remove(book_); });
}

TEST_F(KeptScores, WhereTheHomeCannotBeWritten) {
    data_ = "/proc";
    expect_kept_and_added("no home", [&] { data_ = folder_ / "data"; });
}

// A file that may not grow further fails its write as a full disk does.
TEST_F(KeptScores, WhereTheDiskIsFull) {
    fill_book(1500);
    // Its last pages may not be written; the recording is smaller.
    const auto limit = fs::file_size(book_) / 1024 * 3 / 4;
    ASSERT_GT(limit, 100u);
    expect_kept_and_added(
        "full", [] {}, "bash -c 'ulimit -f " + std::to_string(limit) + "; exec \"$@\"' -");
    EXPECT_EQ(sessions("Bob").size(), 1500u);
}

// Its owner may write to a file whatever its mode says, if it is root: then the programs run as
// nobody.
TEST_F(KeptScores, BesideABookThatMayOnlyBeRead) {
    fill_book(1);
    std::string as_nobody;
    if (::geteuid() == 0) {
        as_nobody = "setpriv --reuid 65534 --regid 65534 --clear-groups";
        fs::permissions(folder_.path(), fs::perms::all);
        fs::permissions(folder_ / "data", fs::perms::all);
        const CommandResult may =
            testing::run_command(as_nobody + " test -x " SONOCASE_BIN "/sonoplay");
        ASSERT_EQ(may.status, 0) << "nobody cannot run the programs: " << may.error;
    }
    const auto mode = fs::perms::owner_read | fs::perms::group_read | fs::perms::others_read;
    fs::permissions(book_, mode);
    fs::permissions(folder_ / "data/sonocase",
                    mode | fs::perms::owner_exec | fs::perms::group_exec | fs::perms::others_exec);
    const auto mend = [&] {
        fs::permissions(folder_ / "data/sonocase", fs::perms::all);
        fs::permissions(book_, mode | fs::perms::owner_write);
    };
    expect_kept_and_added("read-only", mend, as_nobody + " ");
}

}  // namespace
}  // namespace sonocase
