// SPDX-License-Identifier: Apache-2.0

// Cases that tests play, cooked as a user would. Each is cooked once in a program, and all share
// the stages that they have in common, as builds with one cache do: those of all programs that one
// run of ctest starts, which empties the cache first (SONOCASE_TEST_CACHE).
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <map>
#include <string>

#include "support/paths.h"
#include "support/run_command.h"

namespace sonocase::testing {

struct CookedCase {
    std::string path, error;  // the bundle, and what the build wrote to standard error
};

// arguments: of `sonocase build`, after it. A build that fails fails the test.
inline const CookedCase& cooked_case(const std::string& arguments) {
    static const TemporaryFolder folder;
    static std::map<std::string, CookedCase> cooked;
    const auto [found, fresh] = cooked.try_emplace(arguments);
    if (!fresh) return found->second;
    found->second.path = folder / ("case" + std::to_string(cooked.size()) + ".sonocase");
    const char* shared = std::getenv("SONOCASE_TEST_CACHE");
    const std::string cache = shared ? shared : folder / "cache";
    const CommandResult build =
        run_command(SONOCASE_BIN "/sonocase build " + arguments + " --cache " + cache +
                    " --quiet -o " + found->second.path);
    EXPECT_EQ(build.status, 0) << build.error;
    found->second.error = build.error;
    return found->second;
}

// The same for a recipe below scenarios/ that takes the shared data.
inline const CookedCase& cooked_scenario(const std::string& name,
                                         const std::string& arguments = "") {
    const bool data = std::filesystem::exists(SONOCASE_DATA);
    return cooked_case(SONOCASE_SOURCE "/scenarios/" + name +
                       (data ? " --data " SONOCASE_DATA " " : " ") + arguments);
}

}  // namespace sonocase::testing
