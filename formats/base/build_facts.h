// SPDX-License-Identifier: Apache-2.0

// What a program is and how it was built, for --version and for the producer of a bundle. Each
// program compiles its own answer (scripts/cmake/build_facts.cpp.in), so that a new commit rebuilds
// one small file.
#pragma once

#include <string>

namespace sonocase {

// Lines for people: version, commit, compiler, build type, libraries.
std::string build_facts();
// "sonocase 0.1.0"; the same for every build of a version.
std::string producer();

}  // namespace sonocase
