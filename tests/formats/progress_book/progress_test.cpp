// SPDX-License-Identifier: Apache-2.0

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sqlite3.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdarg>
#include <filesystem>

#include "formats/files/atomic_file.h"
#include "formats/progress_book/progress_book.h"
#include "formats/recording/session.h"
#include "support/random.h"
#include "support/temporary_folder.h"

namespace sonocase {
namespace {

namespace fs = std::filesystem;

using testing::TemporaryFolder;

ProgressEntry entry(const std::string& trainee, int number) {
    ProgressEntry e;
    e.trainee = trainee;
    e.case_name = "demo";
    e.exercise = number % 2 ? "liver" : "kidney";
    e.started = "2026-01-01T00:00:" + std::to_string(10 + number) + "Z";
    e.recording = std::to_string(number) + ".igs.mha";
    e.passed = number % 3 == 0;
    e.seed = 1000 + static_cast<std::uint64_t>(number);
    e.metrics = {{"elapsed_time_s", 1.0 / 3 + number}, {"targets_hit", 1}};
    return e;
}

TEST(ProgressBook, KeepsListsComparesAndExports) {
    const TemporaryFolder folder(/*in_memory=*/true);
    const std::string path = folder / "deep/er/progress.sqlite";
    {
        auto book = ProgressBook::open(path);
        ASSERT_TRUE(book) << book.error().message();
        for (int i = 0; i < 6; ++i)
            ASSERT_TRUE(book->add(entry(i < 4 ? "Ada" : "O'Brien, \"Bob\"", i)));
        ASSERT_TRUE(book->add(entry("Ada", 2)));  // the same session again takes its place
    }
    auto book = ProgressBook::open(path);
    ASSERT_TRUE(book) << book.error().message();
    EXPECT_EQ(*book->trainees(), (std::vector<std::string>{"Ada", "O'Brien, \"Bob\""}));
    const auto mine = book->sessions("Ada", "liver");
    ASSERT_TRUE(mine);
    ASSERT_EQ(mine->size(), 2u);
    EXPECT_EQ((*mine)[0].started, "2026-01-01T00:00:11Z");
    EXPECT_EQ((*mine)[1].metrics.at(0).name, "elapsed_time_s");
    EXPECT_EQ((*mine)[1].metrics.at(0).value, 1.0 / 3 + 3);
    EXPECT_TRUE((*mine)[1].passed);
    EXPECT_EQ((*mine)[1].seed, 1003u);
    EXPECT_EQ(book->sessions("", "")->size(), 6u);
    const std::string csv = *book->csv("", "");
    EXPECT_EQ(csv.substr(0, 58), "trainee,case,exercise,started,passed,seed,elapsed_time_s,t");
    EXPECT_NE(csv.find("\r\n\"O'Brien, \"\"Bob\"\"\",demo,kidney,"), std::string::npos);
    EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 7);
    ASSERT_TRUE(book->add(entry("=1+2", 0)));
    EXPECT_NE(book->csv("=1+2", "")->find("\r\n'=1+2,demo,"), std::string::npos);
}

// A book as the first version wrote it keeps its sessions and takes new ones.
TEST(ProgressBook, OneOfVersionOneIsBroughtUpToDate) {
    const TemporaryFolder folder(/*in_memory=*/true);
    const std::string path = folder / "progress.sqlite";
    sqlite3* db = nullptr;
    ASSERT_EQ(sqlite3_open(path.c_str(), &db), SQLITE_OK);
    ASSERT_EQ(
        sqlite3_exec(db,
                     "CREATE TABLE session(id INTEGER PRIMARY KEY, trainee TEXT NOT NULL, case_name"
                     " TEXT NOT NULL, exercise TEXT NOT NULL, started TEXT NOT NULL, recording TEXT"
                     " NOT NULL, passed INTEGER NOT NULL, UNIQUE(trainee, exercise, started));"
                     "CREATE TABLE score(session INTEGER NOT NULL REFERENCES session(id) ON DELETE"
                     " CASCADE, metric TEXT NOT NULL, value REAL NOT NULL, PRIMARY KEY(session,"
                     " metric)) WITHOUT ROWID;"
                     "INSERT INTO session VALUES(7, 'Ada', 'demo', 'liver', '2025', '', 1);"
                     "PRAGMA application_id=1397706319; PRAGMA user_version=1;",
                     nullptr, nullptr, nullptr),
        SQLITE_OK);
    sqlite3_close(db);
    auto book = ProgressBook::open(path);
    ASSERT_TRUE(book) << book.error().message();
    ASSERT_TRUE(book->add(entry("Ada", 3)));
    const auto all = ProgressBook::open(path)->sessions("Ada", "");
    ASSERT_TRUE(all);
    ASSERT_EQ(all->size(), 2u);
    EXPECT_EQ((*all)[0].id, 7);
    EXPECT_EQ((*all)[0].seed, 0u);
    EXPECT_FALSE((*all)[0].exam);
    EXPECT_TRUE((*all)[0].items.empty());
    EXPECT_TRUE(ProgressBook::open(path)->add(CourseAnswer{"Ada", "a", "b", 1}));
    EXPECT_EQ((*all)[1].seed, 1003u);
}

TEST(ProgressBook, KeepsChecklistsExamsAndAnswersUntilTheTraineeIsRemoved) {
    const TemporaryFolder folder(/*in_memory=*/true);
    const std::string path = folder / "progress.sqlite";
    auto book = ProgressBook::open(path);
    ASSERT_TRUE(book);
    ProgressEntry e = entry("Ada", 1);
    e.exam = true;
    e.items = {{"way-found", true, true}, {"numbed", false, false}};
    ASSERT_TRUE(book->add(e));
    ASSERT_TRUE(book->add(e));  // scored again
    ASSERT_TRUE(book->add(CourseAnswer{"Ada", "first-needles", "knobs", 0}));
    ASSERT_TRUE(book->add(CourseAnswer{"Ada", "first-needles", "planes", 2}));
    ASSERT_TRUE(book->add(CourseAnswer{"Ada", "first-needles", "knobs", 1}));
    ASSERT_TRUE(book->add(CourseAnswer{"Bob", "first-needles", "knobs", 2}));
    auto again = ProgressBook::open(path);
    ASSERT_TRUE(again);
    const auto sessions = again->sessions("Ada", "");
    ASSERT_TRUE(sessions);
    ASSERT_EQ(sessions->size(), 1u);
    EXPECT_TRUE((*sessions)[0].exam);
    EXPECT_EQ((*sessions)[0].items, e.items);
    EXPECT_EQ(*again->answers("Ada"),
              (std::vector<CourseAnswer>{{"Ada", "first-needles", "planes", 2},
                                         {"Ada", "first-needles", "knobs", 1}}));
    ASSERT_TRUE(again->remove_trainee("Ada"));
    EXPECT_TRUE(again->answers("Ada")->empty());
    EXPECT_EQ(again->answers("")->size(), 1u);
}

// The start is known to the second only.
TEST(ProgressBook, AttemptsOfOneSecondStandSideBySide) {
    const TemporaryFolder folder(/*in_memory=*/true);
    auto book = ProgressBook::open(folder / "progress.sqlite");
    ASSERT_TRUE(book);
    ProgressEntry e = entry("Ada", 1);
    for (const char* recording : {"", "", "a.igs.mha", "b.igs.mha", "b.igs.mha"}) {
        e.recording = recording;
        ASSERT_TRUE(book->add(e));
    }
    const auto all = book->sessions("Ada", "");
    ASSERT_TRUE(all);
    EXPECT_EQ(all->size(), 4u);  // b's was scored again
}

TEST(ProgressBook, ARemovedTraineeIsGoneWithFilesAndBytes) {
    const TemporaryFolder folder(/*in_memory=*/true);
    const std::string path = folder / "progress.sqlite";
    auto book = ProgressBook::open(path);
    ProgressEntry e = entry("Zaphod-Unmistakable", 1);
    e.recording = folder / "z.igs.mha";
    ASSERT_TRUE(write_file(e.recording, std::string_view("x")));
    ASSERT_TRUE(write_file(folder / "z.frames.igs.mha", std::string_view("x")));
    ASSERT_TRUE(write_file(e.recording + ".scores.json", std::string_view("x")));
    ASSERT_TRUE(book->add(e));
    ASSERT_TRUE(book->add(entry("Ada", 1)));
    ASSERT_NE(read_text_file(path)->find("Zaphod-Unmistakable"), std::string::npos);
    const auto removed = book->remove_trainee("Zaphod-Unmistakable");
    ASSERT_TRUE(removed) << removed.error().message();
    EXPECT_TRUE(removed->not_deleted.empty());
    EXPECT_EQ(removed->sessions, 1u);
    EXPECT_EQ(removed->recordings, 1u);
    EXPECT_FALSE(fs::exists(e.recording));
    EXPECT_FALSE(fs::exists(folder / "z.frames.igs.mha"));
    EXPECT_FALSE(fs::exists(e.recording + ".scores.json"));
    EXPECT_EQ(book->sessions("", "")->size(), 1u);
    EXPECT_EQ(read_text_file(path)->find("Zaphod-Unmistakable"), std::string::npos);
}

// Attempts under 3 s are recorded and not in the book; the window writes review pages beside them.
TEST(ProgressBook, ARemovedTraineeLeavesNoRecordingOutsideTheBookAndNoReview) {
    const TemporaryFolder folder(/*in_memory=*/true);
    const std::string sessions = folder / "sessions/";
    auto book = ProgressBook::open(folder / "progress.sqlite");
    const auto record = [&](const std::string& name, const std::string& trainee) {
        Session session;
        session.header.case_name = "demo";
        session.header.trainee = trainee;
        session.samples.resize(2);
        session.samples[1].time_s = 1;
        const auto bytes = write_sequence(sequence_from_session(session), SequenceForm::mha);
        EXPECT_TRUE(write_file(sessions + name + ".igs.mha", bytes));
        EXPECT_TRUE(write_file(sessions + name + ".review/review.html", std::string_view("x")));
        EXPECT_TRUE(write_file(sessions + name + ".review/scores.json", std::string_view("x")));
    };
    record("kept", "Zo\u00eb A.");
    record("short", "Zo\u00eb A.");
    record("short.frames", "Zo\u00eb A.");
    record("lone.frames", "Zo\u00eb A.");
    record("other", "Zo\u00eb");
    record("nobody", "");
    ASSERT_TRUE(write_file(sessions + "short.review/mine.txt", std::string_view("x")));
    ASSERT_TRUE(write_file(sessions + "text.igs.mha", std::string_view("SonocaseTrainee = Ada\n")));
    ProgressEntry e = entry("Zo\u00eb A.", 1);
    e.recording = sessions + "kept.igs.mha";
    ASSERT_TRUE(book->add(e));
    ASSERT_TRUE(book->add(entry("Ada", 1)));
    const auto removed = book->remove_trainee("Zo\u00eb A.");
    ASSERT_TRUE(removed) << removed.error().message();
    EXPECT_TRUE(removed->not_deleted.empty());
    EXPECT_EQ(removed->sessions, 1u);
    EXPECT_EQ(removed->recordings, 2u);
    EXPECT_EQ(removed->reviews, 2u);
    for (const char* gone :
         {"kept.igs.mha", "kept.review", "short.igs.mha", "short.frames.igs.mha",
          "short.review/review.html", "short.review/scores.json", "lone.frames.igs.mha"})
        EXPECT_FALSE(fs::exists(sessions + gone)) << gone;
    for (const char* stays : {"other.igs.mha", "other.review/review.html", "nobody.igs.mha",
                              "nobody.review/review.html", "short.review/mine.txt", "text.igs.mha"})
        EXPECT_TRUE(fs::exists(sessions + stays)) << stays;
    ASSERT_TRUE(book->remove_trainee("Ada"));
    EXPECT_TRUE(fs::exists(sessions + "text.igs.mha"));  // no session
}

TEST(ProgressBook, ATraineeWhoIsNotThereIsNamedWithTheNearest) {
    const TemporaryFolder folder(/*in_memory=*/true);
    auto book = ProgressBook::open(folder / "progress.sqlite");
    ASSERT_TRUE(book->add(entry("Ada Lovelace", 1)));
    ASSERT_TRUE(book->add(CourseAnswer{"Bob", "a", "b", 1}));
    EXPECT_TRUE(book->expect_trainee("Ada Lovelace"));
    EXPECT_TRUE(book->expect_trainee("Bob"));
    for (const Error& error :
         {book->expect_trainee("Ada Lovelac").error(), book->remove_trainee("Ada Lovelac").error()})
        EXPECT_NE(
            error.message().find("has no trainee 'Ada Lovelac'; did you mean 'Ada Lovelace'?"),
            std::string::npos)
            << error.message();
    EXPECT_FALSE(book->remove_trainee("Xerxes"));
    EXPECT_FALSE(book->remove_trainee(""));
    EXPECT_EQ(book->sessions("", "")->size(), 1u);
}

TEST(ProgressBook, KilledWhileWritingItStaysConsistent) {
    const TemporaryFolder folder(/*in_memory=*/true);
    testing::Random random(3);
    const std::string path = folder / "progress.sqlite";
    ASSERT_TRUE(ProgressBook::open(path));
    int told = 0;
    for (int run = 0; run < 40; ++run) {
        int ends[2];
        ASSERT_EQ(::pipe(ends), 0);
        const pid_t child = ::fork();
        if (child == 0) {
            auto book = ProgressBook::open(path);
            for (int i = 0; book; ++i) {
                ProgressEntry e = entry("run" + std::to_string(run), i % 50);
                e.started = std::to_string(i);
                if (!book->add(e) || ::write(ends[1], "x", 1) != 1) ::_exit(1);
            }
            ::_exit(1);
        }
        ::close(ends[1]);
        char byte = 0;
        int commits = static_cast<int>(random.uniform(0, 12));
        for (int i = 0; i < commits; ++i) ASSERT_EQ(::read(ends[0], &byte, 1), 1);
        volatile double sink = 0;
        for (int i = 0; i < random.uniform(0, 200000); ++i) sink = sink + i;
        ::kill(child, SIGKILL);
        while (::read(ends[0], &byte, 1) == 1) ++commits;
        ::close(ends[0]);
        ::waitpid(child, nullptr, 0);
        told += commits;
        auto book = ProgressBook::open(path);
        ASSERT_TRUE(book) << run << ": " << book.error().message();
        const auto all = book->sessions("", "");
        ASSERT_TRUE(all) << all.error().message();
        EXPECT_GE(static_cast<int>(all->size()), told);
        for (const ProgressEntry& e : *all) ASSERT_EQ(e.metrics.size(), 2u);
    }
}

TEST(ProgressBook, AFileThatIsNoneIsRefusedAndLeftAlone) {
    const TemporaryFolder folder(/*in_memory=*/true);
    const std::string path = folder / "a.sqlite";
    const std::string text(5000, 'x');
    ASSERT_TRUE(write_file(path, text));
    const auto book = ProgressBook::open(path);
    ASSERT_FALSE(book);
    EXPECT_NE(book.error().message().find("a.sqlite"), std::string::npos);
    EXPECT_EQ(*read_text_file(path), text);
}

// What the file system says to every lock that is asked for.
int refused_lock = 0;
int (*true_fcntl)(int, int, ...) = nullptr;
int fcntl_without_locks(int file, int command, ...) {
    va_list more;
    va_start(more, command);
    void* argument = va_arg(more, void*);
    va_end(more);
    if (command != F_SETLK && command != F_GETLK) return true_fcntl(file, command, argument);
    errno = refused_lock;
    return -1;
}

TEST(ProgressBook, AFolderThatCannotLockIsNamed) {
    sqlite3_vfs* vfs = sqlite3_vfs_find(nullptr);
    ASSERT_NE(vfs->xGetSystemCall(vfs, "fcntl"), nullptr);
    true_fcntl = reinterpret_cast<int (*)(int, int, ...)>(vfs->xGetSystemCall(vfs, "fcntl"));
    testing::TemporaryFolder folder;
    const std::string path = folder / "book.sqlite";
    ASSERT_TRUE(ProgressBook::open(path));
    vfs->xSetSystemCall(vfs, "fcntl", reinterpret_cast<sqlite3_syscall_ptr>(&fcntl_without_locks));
    for (const int reason : {ESTALE, EOPNOTSUPP, EIO}) {
        refused_lock = reason;
        const auto book = ProgressBook::open(path);
        ASSERT_FALSE(book) << reason;
        EXPECT_NE(book.error().what.find("cannot lock files (a network home)"), std::string::npos)
            << book.error().message();
    }
    vfs->xSetSystemCall(vfs, "fcntl", nullptr);
    EXPECT_TRUE(ProgressBook::open(path));
}

}  // namespace
}  // namespace sonocase
