// SPDX-License-Identifier: Apache-2.0

#include "formats/text/excerpt.h"

#include <gtest/gtest.h>

#include <vector>

namespace sonocase {
namespace {

TEST(Excerpt, NamesTheFirstAndCountsTheRest) {
    const std::vector<std::string> items{"a", "b", "c", "d", "e", "f"};
    const auto first = [&](std::size_t n) { return std::span(items).first(n); };
    EXPECT_EQ(excerpt(first(0)), "");
    EXPECT_EQ(excerpt(first(1)), "a");
    EXPECT_EQ(excerpt(first(4)), "a, b, c, d");
    EXPECT_EQ(excerpt(first(5)), "a, b, c, d and 1 more");
    EXPECT_EQ(excerpt(items, 2), "a, b and 4 more");
}

}  // namespace
}  // namespace sonocase
