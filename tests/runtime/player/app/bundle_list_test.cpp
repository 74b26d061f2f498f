// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/case_cards.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

#include "runtime/player/app/settings.h"
#include "support/temporary_folder.h"

namespace sonocase::runtime {
namespace {

using sonocase::testing::TemporaryFolder;

std::string a_bundles_first_bytes() {
    return "\x89SONO\r\n\x1a" + std::string(100, '\0');
}

TEST(Bundles, ThatAreDamagedAreNotOffered) {
    const TemporaryFolder folder;
    folder.write("empty.sonocase", "");
    folder.write("short.sonocase", a_bundles_first_bytes().substr(0, 20));
    folder.write("text.sonocase", std::string(500, 'x'));
    folder.write("good.sonocase", a_bundles_first_bytes());
    std::vector<std::string> recent;
    for (const char* name : {"empty", "short", "text", "good"})
        recent.push_back(folder / (std::string(name) + ".sonocase"));
    std::string offered;
    for (const BundleEntry& entry : find_bundles(recent)) {
        if (entry.recent) offered += entry.name;
    }
    EXPECT_EQ(offered, "good");
}

TEST(ExpandHome, PutsTheHomeFolderInPlaceOfATilde) {
    const std::string home = std::getenv("HOME") ? std::getenv("HOME") : "";
    ::setenv("HOME", "/home/ada", 1);
    EXPECT_EQ(expand_home("~/cases/a.sonocase"), "/home/ada/cases/a.sonocase");
    EXPECT_EQ(expand_home("~"), "/home/ada");
    EXPECT_EQ(expand_home("~bob/a"), "~bob/a");
    EXPECT_EQ(expand_home("a/~/b"), "a/~/b");
    EXPECT_EQ(expand_home(""), "");
    ::setenv("HOME", home.c_str(), 1);
}

TEST(Bundles, AreFoundOnceRecentOnesFirst) {
    const TemporaryFolder folder;
    folder.write("one.sonocase", a_bundles_first_bytes());
    folder.write("other.txt", "x");
    const auto found = find_bundles(
        {folder / "absent.sonocase", folder / "one.sonocase", folder / "one.sonocase"});
    ASSERT_FALSE(found.empty());
    EXPECT_EQ(found[0].name, "one");
    EXPECT_TRUE(found[0].recent);
    int times = 0;
    for (const BundleEntry& entry : found) times += entry.name == "one";
    EXPECT_EQ(times, 1);
}

TEST(Bundles, TheLastOpenedComesFirstAndTwelveAreKept) {
    std::vector<std::string> recent;
    for (int i = 0; i < 14; ++i) remember_bundle("/" + std::to_string(i), recent);
    remember_bundle("/5", recent);
    ASSERT_EQ(recent.size(), kMaxRecent);
    EXPECT_EQ(recent[0], "/5");
    EXPECT_EQ(recent[1], "/13");
    EXPECT_EQ(std::count(recent.begin(), recent.end(), "/5"), 1);
}

}  // namespace
}  // namespace sonocase::runtime
