// SPDX-License-Identifier: Apache-2.0

#include "formats/text/number_text.h"

#include <gtest/gtest.h>

#include <bit>
#include <clocale>
#include <cmath>

#include "support/random.h"

namespace sonocase {
namespace {

double parsed(std::string_view text) {
    double value = -12345;
    EXPECT_TRUE(parse_number(text, value)) << text;
    return value;
}

TEST(NumberText, ReadsNumbersAndNothingElse) {
    EXPECT_EQ(parsed(" 1.5\t"), 1.5);
    EXPECT_EQ(parsed("-2e-3\r"), -2e-3);
    EXPECT_EQ(parsed("+7"), 7);
    EXPECT_TRUE(std::isnan(parsed("nan")));
    EXPECT_EQ(parsed("-inf"), -INFINITY);
    double value = 0;
    for (const char* text : {"", " ", "1,5", "1.5x", "1 2", "0x10", "one", "--1", "1e", "nan(1)"}) {
        EXPECT_FALSE(parse_number(text, value)) << text;
    }
    EXPECT_FALSE(parse_number(std::string(500, '1'), value));
    std::int64_t whole = 0;
    EXPECT_TRUE(parse_number("+42", whole));
    EXPECT_EQ(whole, 42);
    EXPECT_FALSE(parse_number("4.0", whole));
    EXPECT_FALSE(parse_number("99999999999999999999", whole));
}

TEST(NumberText, TextReadsBackAsTheSameDouble) {
    EXPECT_EQ(number_text(0.1), "0.1");
    EXPECT_EQ(number_text(-3.0), "-3");
    EXPECT_EQ(number_text(1.0 / 3, 4), "0.3333");
    EXPECT_EQ(number_text(1234567, 3), "1.23e+06");
    EXPECT_EQ(fixed_text(2.0 / 3, 2), "0.67");
    EXPECT_EQ(fixed_text(-0.5, 0), "-0");
    EXPECT_EQ(fixed_text(1e300, 1).size(), 303u);
    EXPECT_EQ(fixed_text(-INFINITY, 1), "-inf");
    testing::Random random(3);
    for (int i = 0; i < 5000; ++i) {
        const double v =
            std::ldexp(random.uniform(-1, 1), static_cast<int>(random.uniform(-1000, 1000)));
        EXPECT_EQ(std::bit_cast<std::uint64_t>(parsed(number_text(v))),
                  std::bit_cast<std::uint64_t>(v));
    }
}

TEST(NumberText, DoesNotFollowTheLocale) {
    const std::string before = std::setlocale(LC_ALL, nullptr);
    const char* found = nullptr;
    for (const char* name : {"de_DE.UTF-8", "de_DE", "fr_FR.UTF-8", "nl_NL.UTF-8"}) {
        if (!found) found = std::setlocale(LC_ALL, name);
    }
    if (!found)
        std::puts("no locale with a decimal comma is installed: tested in the plain one only");
    EXPECT_EQ(number_text(1234.5), "1234.5");
    EXPECT_EQ(parsed("1234.5"), 1234.5);
    std::setlocale(LC_ALL, before.c_str());
}

}  // namespace
}  // namespace sonocase
