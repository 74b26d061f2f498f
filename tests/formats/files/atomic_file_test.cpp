// SPDX-License-Identifier: Apache-2.0

#include "formats/files/atomic_file.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <thread>

#include "formats/base/digest.h"
#include "support/temporary_folder.h"

namespace sonocase {
namespace {

using testing::TemporaryFolder;

TEST(AtomicFile, WritesAndReadsBack) {
    const TemporaryFolder folder;
    ASSERT_TRUE(write_file(folder / "a", std::string_view("first")));
    ASSERT_TRUE(write_file(folder / "a", std::string_view("second")));
    EXPECT_EQ(*read_text_file(folder / "a"), "second");
    EXPECT_EQ(folder.names().size(), 1u);
    ASSERT_TRUE(write_file(folder / "empty", std::string_view()));
    EXPECT_TRUE(read_file(folder / "empty")->empty());
}

TEST(AtomicFile, AFullDiskLeavesTheOldFileAndNothingElse) {
    const TemporaryFolder folder;
    ASSERT_TRUE(write_file(folder / "a", std::string_view("first")));
    // A limit on file size makes a write fail in its middle, as a full disk does.
    rlimit before{};
    ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
    const auto handler = std::signal(SIGXFSZ, SIG_IGN);
    const rlimit small{1000, before.rlim_max};
    ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
    const Status status = write_file(folder / "a", std::string(5000, 'x'));
    setrlimit(RLIMIT_FSIZE, &before);
    std::signal(SIGXFSZ, handler);
    ASSERT_FALSE(status);
    EXPECT_NE(status.error().message().find("nothing was written"), std::string::npos);
    EXPECT_EQ(*read_text_file(folder / "a"), "first");
    EXPECT_EQ(folder.names().size(), 1u);
}

TEST(AtomicFile, ErrorsNameThePath) {
    const TemporaryFolder folder;
    const auto missing = read_file(folder / "none");
    ASSERT_FALSE(missing);
    EXPECT_NE(missing.error().message().find("none: no such file"), std::string::npos);
    EXPECT_FALSE(read_file(folder / ""));
    // No folder can be made below a file.
    ASSERT_TRUE(write_file(folder / "file", std::string_view("x")));
    const Status below = write_file(folder / "file/below", std::string_view("x"));
    ASSERT_FALSE(below);
    EXPECT_NE(below.error().message().find("file/below"), std::string::npos);
    std::filesystem::create_directory(folder / "sub");
    const Status onto = write_file(folder / "sub", std::string_view("x"));
    ASSERT_FALSE(onto);
    EXPECT_EQ(onto.error().what, "is a folder");
    EXPECT_EQ(folder.names().size(), 2u);
}

// Below a link that leads nowhere no folder can be made, not even by root; opening the file would
// say "No such file or directory", as if the folder had only been forgotten.
TEST(AtomicFile, AFolderThatCannotBeMadeIsToldWithTheReason) {
    const TemporaryFolder folder;
    std::filesystem::create_symlink("nowhere/else", folder / "link");
    const Status status = write_file(folder / "link/new/a", std::string_view("x"));
    ASSERT_FALSE(status);
    EXPECT_EQ(status.error().what.find("No such file"), std::string::npos)
        << status.error().message();
    EXPECT_EQ(folder.names().size(), 1u);
}

TEST(AtomicFile, WhatCannotBeWrittenIsKnownBeforeTheWork) {
    const TemporaryFolder folder;
    EXPECT_TRUE(expect_writable(folder / "new/folder/a"));
    EXPECT_TRUE(expect_writable("/dev/stdout"));
    ASSERT_TRUE(write_file(folder / "file", std::string_view("x")));
    EXPECT_TRUE(expect_writable(folder / "file"));
    for (const std::string& path : {folder.path(), folder / "file/a"}) {
        EXPECT_FALSE(expect_writable(path)) << path;
        EXPECT_FALSE(write_file(path, std::string_view("x"))) << path;
    }
    EXPECT_EQ(folder.names().size(), 1u);
}

TEST(AtomicFile, MakesMissingFoldersAndAppendsToPipes) {
    const TemporaryFolder folder;
    ASSERT_TRUE(write_file(folder / "some/new/folder/a", std::string_view("x")));
    EXPECT_EQ(*read_text_file(folder / "some/new/folder/a"), "x");
    const std::string pipe = folder / "pipe";
    ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
    std::string read;
    std::jthread reader([&] { std::getline(std::ifstream(pipe), read); });
    ASSERT_TRUE(write_file(pipe, std::string_view("through")));
    reader.join();
    EXPECT_EQ(read, "through");
}

// A device may never end, and opening a pipe waits for its writer.
TEST(AtomicFile, ReadsNeitherDevicesNorPipesNorFolders) {
    const TemporaryFolder folder;
    const std::string pipe = folder / "pipe";
    ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
    const auto expect_refused = [](const std::string& path, const std::string& message) {
        const auto bytes = read_file(path);
        const auto large = read_large_file(path);
        const auto text = read_text_file(path);
        ASSERT_FALSE(bytes);
        ASSERT_FALSE(large);
        ASSERT_FALSE(text);
        EXPECT_EQ(bytes.error().message(), message);
        EXPECT_EQ(large.error().message(), message);
        EXPECT_EQ(text.error().message(), message);
    };
    expect_refused("/dev/zero", "/dev/zero: is a device; expected a file");
    expect_refused(pipe, pipe + ": is a pipe; expected a file");
    expect_refused(folder / "", (folder / "") + ": is a folder; expected a file");
}

// Files of the kernel that claim a size of zero are read whole all the same.
TEST(AtomicFile, ReadsFilesThatClaimToBeEmpty) {
    const auto text = read_text_file("/proc/self/status");
    ASSERT_TRUE(text);
    EXPECT_FALSE(text->empty());
}

TEST(Digest, IsTheOneOfXxh3AndTellsPartsApart) {
    // The published 128-bit XXH3 value of the empty input with seed 0.
    EXPECT_EQ(digest_of(std::string_view()), "99aa06d3014798d86001c324468d497f");
    EXPECT_NE(Digest().add(std::string_view("ab")).add(std::string_view("c")).hex(),
              Digest().add(std::string_view("a")).add(std::string_view("bc")).hex());
    EXPECT_EQ(Digest().add(0.0).hex(), Digest().add(-0.0).hex());
    EXPECT_NE(Digest().add(std::int64_t{1}).hex(), Digest().add(std::int64_t{2}).hex());
}

TEST(Digest, OfAFileIsThatOfItsBytes) {
    const TemporaryFolder folder;
    ASSERT_TRUE(write_file(folder / "a", std::string_view("content")));
    EXPECT_EQ(*digest_of_file(folder / "a"), digest_of(std::string_view("content")));
    EXPECT_FALSE(digest_of_file(folder / "b"));
}

}  // namespace
}  // namespace sonocase
