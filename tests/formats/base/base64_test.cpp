// SPDX-License-Identifier: Apache-2.0

#include "formats/base/base64.h"

#include <gtest/gtest.h>

#include <vector>

namespace sonocase {
namespace {

std::string encoded(const std::string& text) {
    return base64(std::vector<std::uint8_t>(text.begin(), text.end()));
}

TEST(Base64, GivesTheVectorsOfRfc4648) {
    EXPECT_EQ(encoded(""), "");
    EXPECT_EQ(encoded("f"), "Zg==");
    EXPECT_EQ(encoded("fo"), "Zm8=");
    EXPECT_EQ(encoded("foo"), "Zm9v");
    EXPECT_EQ(encoded("foob"), "Zm9vYg==");
    EXPECT_EQ(encoded("fooba"), "Zm9vYmE=");
    EXPECT_EQ(encoded("foobar"), "Zm9vYmFy");
}

TEST(Base64, UsesAllDigits) {
    EXPECT_EQ(base64(std::vector<std::uint8_t>{0xFB, 0xFF, 0xFE, 0x00, 0x10, 0x83}), "+//+ABCD");
}

}  // namespace
}  // namespace sonocase
