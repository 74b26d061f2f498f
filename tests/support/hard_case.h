// SPDX-License-Identifier: Apache-2.0

// The figures of docs/numerics.md. A test states what it measures of a hard case and the limit that
// it holds it to; the document's row of that test says both in the same words:
//
//     HardCase tip("tip, 30 % outliers", HardCase::at_most, 0.15, "mm");
//     for (...) tip.see(norm(fit.tip_mm - truth_mm));
//
//     | ... | tip, 30 % outliers: 0.12 mm (at most 0.15) | `PointCalibration.ThirtyPercent...` |
//
// The worst value seen is held to the limit, and to the figure of the document: a figure that is a
// quarter off, another limit or a missing row fails the test. `scripts/hard-cases` writes the
// figures, from the file that SONOCASE_HARD_CASES names, to which every HardCase adds a line.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <limits>
#include <string>

#include "support/paths.h"

namespace sonocase::testing {

class HardCase {
  public:
    enum Limit { at_most, at_least };

    HardCase(std::string what, Limit limit, double bound, std::string unit)
        : what_(std::move(what)), unit_(std::move(unit)), limit_(limit), bound_(bound) {}
    HardCase(const HardCase&) = delete;
    HardCase& operator=(const HardCase&) = delete;

    void see(double value) {
        if (std::isnan(value) || std::isnan(worst_)) {
            worst_ = std::numeric_limits<double>::quiet_NaN();
        } else if (!seen_ || (limit_ == at_most ? value > worst_ : value < worst_)) {
            worst_ = value;
        }
        seen_ = true;
    }

    ~HardCase() {
        if (::testing::Test::IsSkipped()) return;
        EXPECT_TRUE(seen_) << what_ << ": nothing was measured";
        if (limit_ == at_most)
            EXPECT_LE(worst_, bound_) << what_;
        else
            EXPECT_GE(worst_, bound_) << what_;
        if (const char* path = std::getenv("SONOCASE_HARD_CASES")) {
            const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
            std::ofstream(path, std::ios::app)
                << test->test_suite_name() << '.' << test->name() << '\t' << what_ << '\t'
                << number(worst_) << '\t' << tail() << '\n';
        } else {
            compare();
        }
    }

  private:
    static std::string number(double value) {
        char text[32];
        std::snprintf(text, sizeof text, "%.2g", value);
        return text;
    }
    std::string tail() const {
        char bound[32];
        std::snprintf(bound, sizeof bound, "%g", bound_);
        return (unit_.empty() ? "" : " " + unit_) + " (at " +
               (limit_ == at_most ? "most " : "least ") + bound + ")";
    }
    void compare() const {
        std::ifstream file(SONOCASE_SOURCE "/docs/numerics.md");
        const std::string text{std::istreambuf_iterator<char>(file), {}};
        const std::size_t at = text.find(what_ + ": ");
        ASSERT_NE(at, std::string::npos)
            << "docs/numerics.md has no '" << what_ << "'; scripts/hard-cases writes it";
        const char* begin = text.c_str() + at + what_.size() + 2;
        char* end = nullptr;
        const double said = std::strtod(begin, &end);
        EXPECT_EQ(text.compare(static_cast<std::size_t>(end - text.c_str()), tail().size(), tail()),
                  0)
            << "docs/numerics.md says another limit of '" << what_ << "' than" << tail();
        // Rounding differs between compilers.
        if (std::abs(worst_) < 1e-6 && std::abs(said) < 1e-6) return;
        EXPECT_NEAR(worst_, said, 0.25 * std::abs(said))
            << "docs/numerics.md, '" << what_ << "': scripts/hard-cases writes it anew";
    }

    std::string what_, unit_;
    Limit limit_;
    double bound_, worst_ = 0;
    bool seen_ = false;
};

}  // namespace sonocase::testing
