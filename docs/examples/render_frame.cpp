// SPDX-License-Identifier: Apache-2.0

// render_frame BUNDLE OUT.pgm: the picture at the start of a bundle's first exercise.
//
// Needs sonocase::core alone: the bytes of the bundle come from a file here, but could come from a
// network or be part of the program.
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <vector>

#include "formats/bundle/case_bundle.h"
#include "formats/exercise/exercise.h"
#include "runtime/imaging/renderer.h"

using namespace sonocase;

int fail(const Error& error) {
    std::fprintf(stderr, "render_frame: %s\n", error.message().c_str());
    return 1;
}

int main(int argc, char** argv) {
    if (argc != 3) {
        std::fprintf(stderr, "usage: render_frame BUNDLE OUT.pgm\n");
        return 2;
    }
    std::ifstream file(argv[1], std::ios::binary);
    const std::vector<char> content{std::istreambuf_iterator<char>(file), {}};
    const std::vector<std::uint8_t> bytes(content.begin(), content.end());

    const Result<CaseBundle> bundle = read_bundle(bytes, argv[1]);
    if (!bundle) return fail(bundle.error());
    if (bundle->exercises.empty()) return fail({"the bundle holds no exercise", argv[1], ""});
    const Result<Exercise> exercise = parse_exercise(bundle->exercises[0].toml, argv[1]);
    if (!exercise) return fail(exercise.error());

    runtime::RenderOptions options;
    options.model =
        exercise->model == "paper" ? runtime::ImageModel::paper : runtime::ImageModel::physical;
    auto renderer = runtime::Renderer::create(*bundle, *exercise, options);
    if (!renderer) return fail(renderer.error());

    // From here on nothing allocates or fails: this is the part that runs once per frame.
    runtime::FrameInput input;
    input.mannequin_from_probe = start_pose(*exercise);
    std::vector<std::uint8_t> pixels(512 * 512);
    renderer->render(input, pixels);

    std::ofstream picture(argv[2], std::ios::binary);
    picture << "P5\n512 512\n255\n";
    picture.write(reinterpret_cast<const char*>(pixels.data()), 512 * 512);
    if (!picture.flush()) return fail({"cannot be written", argv[2], "check folder and disk"});
    return 0;
}
