// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/bundle_list.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "support/temporary_folder.h"

namespace sonocase::runtime {
namespace {

using sonocase::testing::TemporaryFolder;

TEST(Bundles, AreFoundOnceRecentOnesFirst) {
    const TemporaryFolder folder;
    folder.write("one.sonocase", "x");
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
    ASSERT_EQ(recent.size(), kMostRecent);
    EXPECT_EQ(recent[0], "/5");
    EXPECT_EQ(recent[1], "/13");
    EXPECT_EQ(std::count(recent.begin(), recent.end(), "/5"), 1);
}

}  // namespace
}  // namespace sonocase::runtime
