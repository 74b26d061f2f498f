// SPDX-License-Identifier: Apache-2.0

// Every kept input of every reader, and cheap damage to each: cut short, one byte changed.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "fuzz/targets.h"
#include "support/paths.h"
#include "support/random.h"

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
    for (const Target& target : targets()) {
        const auto inputs = corpus(target.name);
        EXPECT_FALSE(inputs.empty()) << target.name;
        for (const auto& input : inputs) target.run(input);
        target.run({});
    }
}

TEST(FuzzCorpus, DamagedInputsComeBack) {
    const std::uint64_t seed = 1;
    SCOPED_TRACE("seed 1");
    sonocase::testing::Random random(seed);
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
            }
        }
    }
}

}  // namespace
}  // namespace sonocase::fuzz
