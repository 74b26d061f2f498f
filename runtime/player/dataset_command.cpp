// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/dataset_command.h"

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <string>

#include "runtime/player/dataset/make_dataset.h"

namespace sonocase::runtime {

int run_dataset_command(int argc, char** argv) {
    DatasetArguments arguments;
    std::string shard = "1/1";
    CLI::App app{"Render frames at random poses with their truth, as a recipe says.",
                 "sonoplay dataset"};
    app.add_option("recipe", arguments.recipe, "Recipe (*.toml)")->required();
    app.add_option("-o,--out", arguments.out, "Folder of the data set; goes on where it stopped")
        ->required();
    app.add_option("--frames", arguments.frames, "Frames of the whole data set")
        ->required()
        ->check(CLI::Range(1, 100000000));
    app.add_option("--seed", arguments.seed, "Of all that is drawn; default: 1");
    app.add_option("--shard", shard, "I/N: the I-th of N parts, I from 1; default: 1/1");
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& e) {
        if (e.get_exit_code() == 0) return app.exit(e);
        std::fprintf(stderr, "sonoplay: %s; sonoplay dataset --help lists the options\n", e.what());
        return 2;
    }
    char extra = 0;
    if (std::sscanf(shard.c_str(), "%d/%d%c", &arguments.shard, &arguments.shards, &extra) != 2 ||
        arguments.shard < 1 || arguments.shard > arguments.shards) {
        std::fprintf(stderr, "sonoplay: --shard %s is not I/N with I from 1 to N; use e.g. 1/4\n",
                     shard.c_str());
        return 2;
    }
    // Progress on a terminal; quiet in a pipe.
    const bool shows = isatty(2) != 0;
    const Status done = make_dataset(arguments, [&](std::uint64_t chunks, std::uint64_t of) {
        if (shows)
            std::fprintf(stderr, "\r%llu of %llu chunks%s", static_cast<unsigned long long>(chunks),
                         static_cast<unsigned long long>(of), chunks == of ? "\n" : "");
    });
    if (done) return 0;
    std::fprintf(stderr, "%ssonoplay: %s\n", shows ? "\n" : "", done.error().message().c_str());
    return 1;
}

}  // namespace sonocase::runtime
