// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pictures/markup.h"

#include <gtest/gtest.h>

namespace sonocase::pipeline {
namespace {

constexpr const char* kPage =
    "comment\n<!--begin:row--><tr>{{a}}{{b}}{{a}}</tr><!--end:row-->\n"
    "<!--begin:empty--><!--end:empty--> <!--begin:plain-->no { keys } here<!--end:plain-->";

TEST(HtmlTemplate, FillsEveryPlaceholderOfABlock) {
    const HtmlTemplate page(kPage);
    EXPECT_EQ(page.filled("row", {{"a", "1"}, {"b", "<i>"}, {"unused", "x"}}), "<tr>1<i>1</tr>");
    EXPECT_EQ(page.filled("empty", {}), "");
    EXPECT_EQ(page.filled("plain", {}), "no { keys } here");
}

TEST(HtmlTemplate, ValuesAreNotSearchedForPlaceholders) {
    const HtmlTemplate page(kPage);
    EXPECT_EQ(page.filled("row", {{"a", "{{b}}"}, {"b", "2"}}), "<tr>{{b}}2{{b}}</tr>");
}

}  // namespace
}  // namespace sonocase::pipeline
