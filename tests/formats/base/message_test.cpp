// SPDX-License-Identifier: Apache-2.0

#include "formats/base/message.h"

#include <gtest/gtest.h>

#include "formats/base/result.h"

namespace sonocase {
namespace {

TEST(Message, IsItsEnglishAndKeepsFormatAndArguments) {
    const Message plain("one voxel");
    EXPECT_EQ(plain, "one voxel");
    EXPECT_EQ(plain.format(), "one voxel");
    EXPECT_TRUE(plain.arguments().empty());

    const Message nested("{} of {}", {Message("{} voxels", {"3"}), std::string("liver")});
    EXPECT_EQ(nested, "3 voxels of liver");
    EXPECT_EQ(nested.format(), "{} of {}");
    ASSERT_EQ(nested.arguments().size(), 2u);
    EXPECT_EQ(nested.arguments()[0].format(), "{} voxels");
    EXPECT_EQ(nested.arguments()[1], "liver");
}

TEST(Message, FillsFieldsInOrderAndReadsNoFieldInAnArgument) {
    EXPECT_EQ(filled_in("{}{}", {"{}", "b"}), "{}b");
    EXPECT_EQ(filled_in("a {} b {}", {"1"}), "a 1 b {}");
    EXPECT_EQ(filled_in("", {"1"}), "");
}

TEST(Message, OfAnErrorIsOneLineOfItsParts) {
    const Message what("no sweep named {}", {"a\nb"});
    EXPECT_EQ((Error{what, "", ""}.message()), "no sweep named a b");
    EXPECT_EQ((Error{what, "", ""}.message().format()), "no sweep named {}");
    EXPECT_EQ((Error{what, "c.toml", ""}.message()), "c.toml: no sweep named a b");
    EXPECT_EQ((Error{what, "", "name one"}.message()), "no sweep named a b; name one");
    const Message whole = Error{what, "c\x1b.toml", "name one"}.message();
    EXPECT_EQ(whole, "c .toml: no sweep named a b; name one");
    ASSERT_EQ(whole.arguments().size(), 3u);
    EXPECT_EQ(whole.arguments()[1].format(), "no sweep named {}");
    EXPECT_EQ(whole.arguments()[1].arguments()[0], "a b");
}

}  // namespace
}  // namespace sonocase
