// SPDX-License-Identifier: Apache-2.0

#include "formats/text/toml_reader.h"

#include <gtest/gtest.h>

#include "support/hard_case.h"

namespace sonocase {
namespace {

TomlTable parsed(std::string_view text) {
    auto table = TomlTable::parse(text, "a.toml");
    EXPECT_TRUE(table) << table.error().message();
    return *table;
}

std::string fault_of(const TomlTable& table) {
    return table.fault() ? table.fault()->message() : "";
}

// Behind a value only white space may stand, which these letters are not.
TEST(TomlReader, NoLetterBeyondAsciiIsWhiteSpace) {
    int taken = 0;
    for (int letter = 0xA1; letter <= 0x499; ++letter) {
        const std::string text = "a = 1" + std::string{static_cast<char>(0xC0 | letter >> 6),
                                                       static_cast<char>(0x80 | (letter & 0x3F))};
        taken += TomlTable::parse(text, "a.toml").has_value();
    }
    testing::HardCase spaces("of the 1,017 letters U+00A1 to U+0499, taken for white space",
                             testing::HardCase::at_most, 0, "");
    spaces.see(taken);
}

TEST(TomlReader, ReadsEveryKindOfValue) {
    const TomlTable root = parsed(
        "name = \"x\"\nlist = [\"a\", \"b\"]\nsize = 2.5\ncount = 3\non = true\n"
        "at = [1, 2.5, -3]\nup = [0, 0, 2]\nkind = \"soft\"\n[part]\nsize = 4\n"
        "[[items]]\nsize = 5\n[[items]]\nsize = 6\n");
    std::string name;
    std::vector<std::string> list;
    double size = 0, part_size = 0;
    int count = 0;
    bool on = false;
    Point3 at;
    Vector3 up;
    EXPECT_TRUE(root.text("name", name));
    EXPECT_TRUE(root.texts("list", list));
    EXPECT_TRUE(root.number("size", size, 0, 10));
    EXPECT_TRUE(root.whole("count", count, 0, 10));
    EXPECT_TRUE(root.flag("on", on));
    EXPECT_TRUE(root.point("at", at));
    EXPECT_TRUE(root.direction("up", up));
    EXPECT_EQ(root.choice("kind", {"hard", "soft"}), 1u);
    const auto part = root.table("part");
    ASSERT_TRUE(part);
    EXPECT_TRUE(part->number("size", part_size, 0, 10));
    EXPECT_EQ(root.tables("items").size(), 2u);
    root.finish();
    EXPECT_EQ(fault_of(root), "");
    EXPECT_EQ(name, "x");
    EXPECT_EQ(list, (std::vector<std::string>{"a", "b"}));
    EXPECT_EQ(size, 2.5);
    EXPECT_EQ(count, 3);
    EXPECT_TRUE(on);
    EXPECT_EQ(at, (Point3{1, 2.5, -3}));
    EXPECT_EQ(up, (Vector3{0, 0, 1}));
    EXPECT_EQ(part_size, 4);
    EXPECT_EQ(part->line("size"), 10);
    EXPECT_EQ(part->place("size"), "a.toml:10");
}

TEST(TomlReader, AbsentKeysLeaveTheirDefaults) {
    const TomlTable root = parsed("");
    double size = 7;
    std::string name = "as it was";
    EXPECT_FALSE(root.number("size", size, 0, 1));
    EXPECT_FALSE(root.text("name", name));
    EXPECT_FALSE(root.table("part"));
    EXPECT_TRUE(root.tables("items").empty());
    EXPECT_EQ(size, 7);
    EXPECT_EQ(name, "as it was");
    EXPECT_EQ(fault_of(root), "");
}

TEST(TomlReader, FaultsNameFileLineKeyFoundAndExpected) {
    double number = 1;
    int whole = 1;
    bool flag = false;
    std::string text;
    std::vector<std::string> texts;
    Point3 point;
    {
        const TomlTable root = parsed("\nsize = 11\n");
        root.number("size", number, 0, 10);
        EXPECT_EQ(fault_of(root),
                  "a.toml:2: size is 11, out of range; expected a number from 0 to 10");
    }
    {
        const TomlTable root = parsed("size = nan\n");
        root.number("size", number, 0, 10);
        EXPECT_EQ(fault_of(root),
                  "a.toml:1: size is nan, out of range; expected a number from 0 to 10");
    }
    {
        const TomlTable root = parsed("size = 0.0\n");
        root.number("size", number, 0, 10, /*above_low=*/true);
        EXPECT_NE(fault_of(root).find("above 0 and up to 10"), std::string::npos);
    }
    {
        const TomlTable root = parsed("size = \"big\"\n");
        root.number("size", number, 0, 10);
        EXPECT_NE(fault_of(root).find("size is big, not a number"), std::string::npos);
    }
    {
        const TomlTable root = parsed("count = 2.5\n");
        root.whole("count", whole, 0, 10);
        EXPECT_EQ(fault_of(root), "a.toml:1: count is 2.5; expected a whole number");
    }
    {
        const TomlTable root = parsed("on = 1\n");
        root.flag("on", flag);
        EXPECT_EQ(fault_of(root), "a.toml:1: on is 1; expected true or false");
    }
    {
        const TomlTable root = parsed("name = [1]\n");
        root.text("name", text);
        EXPECT_EQ(fault_of(root), "a.toml:1: name is (a list); expected text in quotes");
    }
    {
        const TomlTable root = parsed("list = [\"a\", 3]\n");
        root.texts("list", texts);
        EXPECT_EQ(fault_of(root), "a.toml:1: list holds 3; expected texts in quotes");
        EXPECT_TRUE(texts.empty());
    }
    {
        const TomlTable root = parsed("[[parts]]\nat = [1, 2, inf]\n");
        for (const TomlTable& part : root.tables("parts")) part.point("at", point);
        EXPECT_NE(fault_of(root).find("a.toml:2: parts[0].at is not a list of 3 numbers"),
                  std::string::npos);
    }
    EXPECT_EQ(number, 1);
    EXPECT_EQ(point, (Point3{}));
}

TEST(TomlReader, BrokenTomlIsToldInWordsThatNameTheLineAndTheRemedy) {
    const std::pair<const char*, const char*> cases[] = {
        {"a = 1\nname = \"x\"\nname = \"y\"\n",
         "f.toml:3: the string 'name' is given twice; remove one of the two"},
        {"a = 1\nb = \"open\n", "f.toml:2: not valid TOML ("},
        {"d = \"\"\"open", "f.toml:1: not valid TOML (the file ends too early"},
        {"a = \xff\xfe", "f.toml:1: not valid TOML ("},
    };
    for (const auto& [text, message] : cases) {
        const auto parsed = TomlTable::parse(text, "f.toml");
        ASSERT_FALSE(parsed.has_value()) << text;
        const std::string told = parsed.error().message();
        EXPECT_EQ(told.find(message), 0u) << told;
        EXPECT_EQ(told.find("Error while"), std::string::npos) << told;
        EXPECT_EQ(told.find('\n'), std::string::npos) << told;
    }
}

TEST(TomlReader, TheFirstFaultIsKept) {
    const TomlTable root = parsed("a = 1\nb = 2\n");
    std::string text;
    root.text("b", text);
    root.text("a", text);
    EXPECT_EQ(root.fault()->where, "a.toml:2");
}

TEST(TomlReader, KeysThatNothingAskedForAreUnknownAndTheNearestIsNamed) {
    const TomlTable root = parsed("[probe]\ndepht_mm = 3\n");
    const auto probe = root.table("probe");
    double depth_mm = 0;
    probe->number("depth_mm", depth_mm, 0, 10);
    probe->finish();
    root.finish();
    EXPECT_EQ(fault_of(root), "a.toml:2: unknown key 'probe.depht_mm'; did you mean 'depth_mm'?");
}

TEST(TomlReader, CopiesShareWhatHasBeenAskedFor) {
    const TomlTable root = parsed("a = \"x\"\n");
    const TomlTable copy = root;
    std::string text;
    copy.text("a", text);
    root.finish();
    EXPECT_EQ(fault_of(root), "");
}

TEST(TomlReader, PlainValuesAreThoseOfACommandLine) {
    const TomlTable root = parsed("a = \"x y\"\nb = 0.1\nc = 3\nd = false\ne = [1]\n");
    EXPECT_EQ(root.plain_value("a"), "x y");
    EXPECT_EQ(root.plain_value("b"), "0.1");
    EXPECT_EQ(root.plain_value("c"), "3");
    EXPECT_EQ(root.plain_value("d"), "false");
    EXPECT_EQ(root.plain_value("e"), "(a list)");
    EXPECT_EQ(root.plain_value("f"), std::nullopt);
}

TEST(TomlReader, TablesKeepTheirDocumentAlive) {
    std::optional<TomlTable> part;
    {
        const TomlTable root = parsed("[part]\na = \"x\"\n");
        part = root.table("part");
    }
    std::string text;
    EXPECT_TRUE(part->text("a", text));
    EXPECT_EQ(text, "x");
}

TEST(TomlReader, TextThatIsNotTomlNamesItsLine) {
    const auto root = TomlTable::parse("a = 1\nb = \n", "a.toml");
    ASSERT_FALSE(root);
    EXPECT_EQ(root.error().where, "a.toml:2");
}

TEST(TomlReader, AnotherEncodingOrAWindowsPathIsToldWithItsCure) {
    using namespace std::string_literals;
    for (const std::string& text :
         {"\xFF\xFE"s + "n\0a\0m\0e\0"s, "name = \"Caf\xE9\"\n"s, "n\0a\0m\0e\0 \0=\0"s}) {
        const auto root = TomlTable::parse(text, "a.toml");
        ASSERT_FALSE(root);
        EXPECT_EQ(root.error().expected, "save the file as UTF-8") << root.error().what;
    }
    for (const char* text : {"ct = \"C:\\Users\\a\"\n", "ct = \"D:\\data\"\n"}) {
        const auto root = TomlTable::parse(text, "a.toml");
        ASSERT_FALSE(root);
        EXPECT_NE(root.error().expected.find("single quotes"), std::string::npos)
            << root.error().what;
    }
}

}  // namespace
}  // namespace sonocase
