// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <string_view>

#include "pipeline/base/stopwatch.h"
#include "pipeline/texture/example_image.h"
#include "pipeline/texture/synthetic_examples.h"
#include "pipeline/texture/texture_bank.h"
#include "pipeline/texture/texture_quality.h"
#include "pipeline/tradeoff/suites.h"

namespace sonocase::pipeline::inline tradeoff {
namespace {

constexpr const char* kExamples[] = {"liver", "muscle", "fat"};

Result<Measured> measure_bank(const Settings& settings) {
    TextureSpec spec;
    for (const Setting& s : settings) {
        if (s.key == "texture.edge") spec.edge = std::stoi(s.value);
        if (s.key == "texture.mode") {
            spec.mode = s.value == "pyramid" ? TextureMode::pyramid : TextureMode::matched;
        }
    }
    Measured sum;
    for (const char* name : kExamples) {
        SONOCASE_TRY(const auto example, prepare_example(synthetic_example(name)));
        spec.name = name;
        spec.examples = {synthetic_example(name)};
        const double before = processor_seconds();
        const auto made = make_solid_texture(spec);
        sum.seconds += processor_seconds() - before;
        if (!made) return made.error();
        const TextureQuality quality = measure_texture(*made, example.image);
        sum.error += quality.distance.grain / std::size(kExamples);
    }
    return sum;
}

}  // namespace

Suite texture_suite() {
    Suite suite;
    suite.name = "texture";
    suite.title = "Solid textures";
    suite.body = "synthetic-examples";
    suite.error_name = "grain";
    suite.error_unit = "rms of autocorrelations";
    suite.truth =
        "The textures of liver, muscle and fat are learned from examples and synthesised. The "
        "error is the rms difference between the autocorrelations of example and texture within "
        "the grain's width, averaged over the three tissues.";
    suite.knobs = knobs_of(built_in_stages(), suite.name);
    suite.named = {{TrialRole::paper,
                    "paper, eq. (15), 32 voxels",
                    {{"texture.mode", "pyramid"}, {"texture.edge", "32"}}},
                   {TrialRole::peer, "eq. (15), 64 voxels", {{"texture.mode", "pyramid"}}}};
    suite.measure = measure_bank;
    return suite;
}

}  // namespace sonocase::pipeline::inline tradeoff
