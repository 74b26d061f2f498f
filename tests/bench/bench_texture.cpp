// SPDX-License-Identifier: Apache-2.0

// Textures, speckle and structure. Real patches where the data is there.
#include <benchmark/benchmark.h>

#include <filesystem>
#include <map>
#include <string>

#include "pipeline/anatomy/analytic_torso.h"
#include "pipeline/anatomy/bake_structure.h"
#include "pipeline/anatomy/tissue_table.h"
#include "pipeline/base/parallel.h"
#include "pipeline/texture/read_example.h"
#include "pipeline/texture/speckle_volume.h"
#include "pipeline/texture/synthetic_examples.h"
#include "pipeline/texture/texture_bank.h"
#include "pipeline/texture/texture_quality.h"
#include "support/paths.h"

namespace sonocase::pipeline {
namespace {

void set_errors(benchmark::State& state, const TextureAssessment& a) {
    state.counters["ks"] = a.quality.distance.ks;
    state.counters["ks_floor"] = a.quality.floor.ks;
    state.counters["along_error"] = a.quality.texture.along / a.quality.example.along - 1;
    state.counters["across_error"] = a.quality.texture.across / a.quality.example.across - 1;
    state.counters["anisotropy_error"] = a.quality.texture.ratio() / a.quality.example.ratio() - 1;
    state.counters["seam_score"] = a.quality.seam_score;
    if (a.has_held_back) {
        state.counters["held_back_ks_over_floor"] = a.held_back.ks / a.quality.floor.ks;
        state.counters["held_back_grain_over_floor"] = a.held_back.grain / a.quality.floor.grain;
    }
}

// One texture: time of making it, and how near it comes.
void BM_Texture(benchmark::State& state, const ExampleImage& example, TextureSpec spec) {
    spec.name = example.name;
    spec.third_axis = ThirdAxis::along;
    spec.examples = {example};
    for (auto _ : state) benchmark::DoNotOptimize(make_solid_texture(spec));
    if (const auto assessed = assess_texture(spec)) set_errors(state, *assessed);
}

void BM_TextureBank(benchmark::State& state) {
    const ThreadLimit limit(2);
    TextureBankOptions options;
    options.edge = static_cast<int>(state.range(0));
    const std::string folder = std::string(SONOCASE_DATA) + "/ultrasound";
    if (std::filesystem::exists(folder)) options.example_folder = folder;
    for (auto _ : state) {
        auto bank = build_texture_bank(built_in_tissues(), options);
        if (!bank) return state.SkipWithError(bank.error().message().c_str());
        state.counters["textures"] = static_cast<double>(bank->textures.size());
    }
}
BENCHMARK(BM_TextureBank)
    ->Arg(32)
    ->Arg(64)
    ->Arg(128)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->MeasureProcessCPUTime();

void BM_Speckle(benchmark::State& state) {
    for (auto _ : state)
        benchmark::DoNotOptimize(make_speckle(static_cast<int>(state.range(0)), 1));
}
BENCHMARK(BM_Speckle)
    ->Arg(64)
    ->Arg(128)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->MeasureProcessCPUTime();

// The analytic torso; the counter tells how many voxels the time is for.
void BM_BakeStructure(benchmark::State& state) {
    const ThreadLimit limit(2);
    const auto mm = static_cast<double>(state.range(0));
    const LabelVolume torso = sample_analytic_torso(analytic_torso_grid({mm, mm, mm}));
    for (auto _ : state) {
        auto baked = bake_structure(torso, built_in_tissues());
        if (!baked) return state.SkipWithError(baked.error().message().c_str());
        state.counters["stored_mb"] = static_cast<double>(baked->echo_offset.pool.size()) / 1e6;
    }
    state.counters["voxels"] = static_cast<double>(torso.voxels.size());
}
BENCHMARK(BM_BakeStructure)
    ->Arg(1)
    ->Arg(2)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->MeasureProcessCPUTime();

// Rows of error against time: every shared patch at the usual setting, and one of each kind over
// sizes, levels and modes.
[[maybe_unused]] const bool registered = [] {
    std::map<std::string, ExampleImage> examples;
    const std::string folder = std::string(SONOCASE_DATA) + "/ultrasound/patches";
    if (std::filesystem::exists(folder)) {
        for (const char* name : {"muscle_a", "muscle_b", "muscle_c", "muscle_d", "fascia_a",
                                 "fat_a", "fat_b", "organ_a", "organ_b", "organ_c", "organ_d",
                                 "fluid_a", "bone_surface_a", "bone_surface_b", "shadow_a"}) {
            if (auto e = read_example(folder + "/" + name + ".png")) examples[name] = *e;
        }
    } else {
        for (const char* name : {"liver", "muscle", "fat"})
            examples[name] = synthetic_example(name);
    }
    const auto add = [](const std::string& row, const ExampleImage& e, const TextureSpec& spec) {
        benchmark::RegisterBenchmark(("BM_Texture/" + row).c_str(), BM_Texture, e, spec)
            ->Unit(benchmark::kMillisecond)
            ->MeasureProcessCPUTime();
    };
    for (const auto& [name, example] : examples) add(name + "/matched/64", example, {});
    for (const char* name : {"muscle_b", "organ_a", "muscle", "liver"}) {
        const auto found = examples.find(name);
        if (found == examples.end()) continue;
        const std::string row = name;
        for (const int edge : {32, 128}) {
            TextureSpec spec;
            spec.edge = edge;
            add(row + "/matched/" + std::to_string(edge), found->second, spec);
        }
        for (const int levels : {2, 3, 4}) {
            TextureSpec spec;
            spec.mode = TextureMode::pyramid;
            spec.pyramid.levels = levels;
            add(row + "/pyramid" + std::to_string(levels) + "/64", found->second, spec);
        }
        TextureSpec spec;
        spec.mode = TextureMode::pyramid;
        spec.pyramid.decimate = true;
        add(row + "/pyramid4_decimated/64", found->second, spec);
    }
    return true;
}();

}  // namespace
}  // namespace sonocase::pipeline
