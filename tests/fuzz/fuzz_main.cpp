// SPDX-License-Identifier: Apache-2.0

// libFuzzer's entry: an environment variable names the reader, so one program serves all.
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "fuzz/targets.h"

namespace {
const sonocase::fuzz::Target* chosen = nullptr;
}

extern "C" int LLVMFuzzerInitialize(int*, char***) {
    const char* name = std::getenv("SONOCASE_FUZZ_TARGET");
    for (const auto& target : sonocase::fuzz::targets()) {
        if (name && std::strcmp(name, target.name) == 0) chosen = &target;
    }
    if (!chosen) {
        std::fprintf(stderr, "set SONOCASE_FUZZ_TARGET to one of:");
        for (const auto& target : sonocase::fuzz::targets())
            std::fprintf(stderr, " %s", target.name);
        std::fprintf(stderr, "\n");
        std::exit(2);
    }
    return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const unsigned char* data, std::size_t size) {
    chosen->run({data, size});
    return 0;
}
