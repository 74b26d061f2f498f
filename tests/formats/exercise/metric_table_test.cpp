// SPDX-License-Identifier: Apache-2.0

#include "formats/exercise/metric_table.h"

#include <gtest/gtest.h>

#include <set>

#include "support/paths.h"
#include "support/temporary_folder.h"

namespace sonocase {
namespace {

// docs/metrics.md, part 9, shows the same table, row by row.
TEST(MetricTable, IsTheOneOfTheDocument) {
    const std::string text = testing::read_text(std::string(SONOCASE_SOURCE) + "/docs/metrics.md");
    const std::size_t part = text.find("## 8.");
    ASSERT_NE(part, std::string::npos);
    std::size_t at = part;
    for (const MetricInfo& info : metric_table()) {
        const std::string sense = info.sense == MetricSense::less_is_better   ? "less"
                                  : info.sense == MetricSense::more_is_better ? "more"
                                                                              : "-";
        const std::string evidence = info.evidence;
        const std::string row = std::string("| `") + info.name + "` | " + info.title + " | " +
                                metric_range(info.name) + " | " + sense + " | " +
                                (evidence.empty() ? "-" : evidence) + " |";
        const std::size_t found = text.find(row, at);
        EXPECT_NE(found, std::string::npos) << "docs/metrics.md lacks, or has elsewhere: " << row;
        if (found != std::string::npos) at = found;
    }
}

TEST(MetricTable, NamesAndTitlesWithinAGroupAreDifferent) {
    std::set<std::string> names, titles;
    for (const MetricInfo& info : metric_table()) {
        EXPECT_TRUE(names.insert(info.name).second) << info.name;
        EXPECT_TRUE(titles.insert(std::string(info.group) + info.title).second) << info.title;
    }
}

}  // namespace
}  // namespace sonocase
