// SPDX-License-Identifier: Apache-2.0

#include <gtest/gtest.h>

#include <cmath>

#include "formats/machine/machine.h"

namespace sonocase {
namespace {

TEST(Machine, EveryBuiltInMachineIsItsTextAndBack) {
    for (const std::string& name : machine_names()) {
        const auto machine = built_in_machine(name);
        ASSERT_TRUE(machine);
        EXPECT_EQ(machine->name, name);
        const auto again = parse_machine(machine_toml(*machine), name);
        ASSERT_TRUE(again) << again.error().message();
        EXPECT_EQ(*again, *machine);
    }
    EXPECT_EQ(*built_in_machine("modern"), Machine{});
}

TEST(Machine, NumbersAndNamesSurviveToTheLastBit) {
    Machine m;
    m.name = "a \"quoted\" \\ name";
    m.title = "two\nlines\ttab \x7f";
    m.grey.level = 0.1 + 0.2 + 40;
    m.beam.axial_mm = std::nextafter(0.7, 1.0);
    m.persistence = {1.0 / 3};
    m.tissue_db = {{"portal vein", -12.25}, {"liver", 0}, {"a.b", 1e-300}};
    const auto again = parse_machine(machine_toml(m), "m");
    ASSERT_TRUE(again) << again.error().message();
    EXPECT_EQ(*again, m);
}

TEST(Machine, KeysLeftOutComeFromTheBase) {
    const auto empty = parse_machine("[machine]\n", "m.toml");
    ASSERT_TRUE(empty);
    EXPECT_EQ(*empty, Machine{});
    const auto some =
        parse_machine("[machine]\nbase = 'classic'\n[machine.grey]\nlevel = 100\n", "m.toml");
    ASSERT_TRUE(some) << some.error().message();
    Machine expected = *built_in_machine("classic");
    expected.grey.level = 100;
    EXPECT_EQ(*some, expected);
}

void expect_fault(const std::string& toml, const std::vector<std::string>& says) {
    const auto machine = parse_machine(toml, "dir/m.toml");
    ASSERT_FALSE(machine) << toml;
    const std::string message = machine.error().message();
    for (const std::string& word : says)
        EXPECT_NE(message.find(word), std::string::npos) << message;
    EXPECT_EQ(message.find('\n'), std::string::npos);
}

TEST(Machine, FaultsNameFileLineKeyAndLimits) {
    expect_fault("", {"machine is missing", "[machine]"});
    expect_fault("[machin]\n", {"machine is missing"});
    expect_fault("machine = 3\n", {"not a table"});
    expect_fault("[machine]\nbase = 'modrn'\n", {"dir/m.toml:2", "'modern'"});
    expect_fault("[machine.grey]\nlevle = 3\n", {"m.toml:2", "machine.grey.levle", "'level'"});
    expect_fault("[machine.gray]\nlevel = 3\n", {"machine.gray", "'grey'"});
    expect_fault("[machine]\n[other]\n", {"other"});
    expect_fault("[machine.beam]\naxial_mm = nan\n", {"axial_mm", "out of range", "0 to 10"});
    expect_fault("[machine.beam]\naxial_mm = inf\n", {"axial_mm", "out of range"});
    expect_fault("[machine.beam]\nfrequency_mhz = 0.1\n", {"0.1", "expected 0, or", "0.5 to 50"});
    expect_fault("[machine.looks]\ncount = 0\n", {"machine.looks.count", "1 to 16"});
    expect_fault("[machine.looks]\ncount = 2.5\n", {"whole"});
    expect_fault("[machine.grey]\nmap = 'lin'\n", {"unknown value 'lin'"});
    expect_fault("[machine]\npersistence = []\n", {"1 to 8 numbers from 0 to 1"});
    expect_fault("[machine]\npersistence = [0.5, nan]\n", {"1 to 8 numbers from 0 to 1"});
    expect_fault("[machine]\npersistence = [0, 1]\n", {"newest"});
    expect_fault("[machine]\nname = ''\n", {"name is empty"});
    expect_fault("[machine.tissue_db]\nliver = 1e9\n", {"tissue_db.liver", "-60 to 60"});
}

TEST(Machine, EveryTruncationIsReadOrRefusedWithoutACrash) {
    const std::string text = machine_toml(Machine{});
    for (std::size_t n = 0; n <= text.size(); ++n) (void)parse_machine(text.substr(0, n), "cut");
}

TEST(Machine, AnUnknownNameIsAnsweredWithTheNearest) {
    const auto none = built_in_machine("clasic");
    ASSERT_FALSE(none);
    EXPECT_NE(none.error().message().find("'classic'"), std::string::npos);
}

}  // namespace
}  // namespace sonocase
