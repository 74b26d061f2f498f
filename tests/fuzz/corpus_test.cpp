// SPDX-License-Identifier: Apache-2.0

// Every stored input of every reader, and simple damage to each: truncated, one byte changed.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "fuzz/targets.h"
#include "pipeline/import/mesh/polygon_file.h"
#include "support/hard_case.h"
#include "support/paths.h"
#include "support/random.h"
#include "support/temporary_folder.h"

namespace sonocase::fuzz {
namespace {

std::vector<std::vector<std::uint8_t>> corpus(const std::string& name) {
    std::vector<std::filesystem::path> paths;
    for (const auto& entry : std::filesystem::directory_iterator(std::string(SONOCASE_SOURCE) +
                                                                 "/tests/fuzz/corpus/" + name)) {
        paths.push_back(entry.path());
    }
    std::sort(paths.begin(), paths.end());
    std::vector<std::vector<std::uint8_t>> out;
    for (const auto& path : paths) {
        std::ifstream in(path, std::ios::binary);
        out.emplace_back(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
    }
    return out;
}

TEST(FuzzCorpus, EveryKeptInputComesBack) {
    int back = 0;
    for (const Target& target : targets()) {
        const auto inputs = corpus(target.name);
        EXPECT_FALSE(inputs.empty()) << target.name;
        for (const auto& input : inputs) {
            target.run(input);
            ++back;
        }
        target.run({});
    }
    testing::HardCase kept("kept inputs that came back", testing::HardCase::at_least, 100, "");
    kept.see(back);
}

// Once read for minutes: an entry without properties takes no byte of the file.
TEST(FuzzCorpus, APlyThatPromisesMoreThanItsBytesIsNotRead) {
    const sonocase::testing::TemporaryFolder folder;
    const std::string path = folder.write("a.ply",
                                          "ply\nformat ascii 1.0\nelement camera 5000000000000\n"
                                          "element vertex 1\nproperty float x\nproperty float y\n"
                                          "property float z\nend_header\n0 0 0\n");
    const auto file = pipeline::read_ply_file(path);
    ASSERT_FALSE(file);
    const std::string said = file.error().message(), words = "damaged after ";
    ASSERT_NE(said.find(words), std::string::npos) << said;
    sonocase::testing::HardCase read("entries read of a PLY that promises 5e12 of no bytes",
                                     sonocase::testing::HardCase::at_most, 0, "");
    read.see(std::atof(said.c_str() + said.find(words) + words.size()));
}

TEST(FuzzCorpus, DamagedInputsComeBack) {
    const std::uint64_t seed = 1;
    SCOPED_TRACE("seed 1");
    sonocase::testing::Random random(seed);
    int back = 0;
    for (const Target& target : targets()) {
        std::size_t tried = 0;
        for (const auto& input : corpus(target.name)) {
            if (input.empty() || tried > 400) continue;
            for (int k = 0; k < 12; ++k, ++tried) {
                std::vector<std::uint8_t> damaged = input;
                const auto at =
                    static_cast<std::size_t>(random.uniform(0, static_cast<double>(input.size())));
                if (k % 3 == 0) {
                    damaged.resize(at);
                } else {
                    damaged[at] = static_cast<std::uint8_t>(random.uniform(0, 256));
                }
                target.run(damaged);
                ++back;
            }
        }
    }
    testing::HardCase hit("damaged inputs that came back", testing::HardCase::at_least, 1000, "");
    hit.see(back);
}

}  // namespace
}  // namespace sonocase::fuzz
