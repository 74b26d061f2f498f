// SPDX-License-Identifier: Apache-2.0

#include <csignal>
#include <cstdio>
#include <exception>
#include <string_view>

#include "runtime/player/command_line.h"
#include "runtime/player/dataset_command.h"
#include "runtime/player/headless/run_headless.h"
#include "runtime/player/session/clock.h"
#include "runtime/player/ui/run_window.h"

using namespace sonocase;
using namespace sonocase::runtime;

int main(int argc, char** argv) {
    const double start_s = steady_seconds();
    // A file that may not grow further is an error of its write, as a full disk is.
    std::signal(SIGXFSZ, SIG_IGN);
    try {
        if (argc > 1 && std::string_view(argv[1]) == "dataset")
            return run_dataset_command(argc - 1, argv + 1);
        PlayerArguments arguments;
        bool exit_now = false;
        const int status = parse_arguments(argc, argv, arguments, exit_now);
        if (exit_now) return status;
        const Status done =
            arguments.headless ? run_headless(arguments, start_s) : run_window(arguments, start_s);
        if (done) return 0;
        std::fprintf(stderr, "sonoplay: %s\n", done.error().message().c_str());
    } catch (const std::exception& e) {
        // Only memory can run out here; everything else is a Result.
        std::fprintf(stderr, "sonoplay: %s; close other programs and try again\n", e.what());
    }
    return 1;
}
