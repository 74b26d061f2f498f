// SPDX-License-Identifier: Apache-2.0

#include "pipeline/texture/texture_bank.h"

#include <algorithm>
#include <atomic>
#include <cassert>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>

#include "formats/files/atomic_file.h"
#include "pipeline/base/counter_random.h"
#include "pipeline/base/parallel.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/base/text.h"
#include "pipeline/texture/example_image.h"
#include "pipeline/texture/matched_texture.h"
#include "pipeline/texture/pyramid_texture.h"
#include "pipeline/texture/read_example.h"
#include "pipeline/texture/synthetic_examples.h"

namespace sonocase::pipeline::inline texture {
namespace {

// The class of patches.csv that is used for a built-in texture, and which patch of the class
// (modulo their number): organs share the patches of phantoms such that neighbours differ.
struct StandIn {
    const char* texture;
    const char* patch_class;
    std::size_t which;
    ThirdAxis third_axis;
};
constexpr StandIn kStandIns[] = {
    {"liver", "organ_parenchyma", 0, ThirdAxis::along},
    {"spleen", "organ_parenchyma", 2, ThirdAxis::along},
    {"kidney_cortex", "organ_parenchyma", 1, ThirdAxis::along},
    {"pancreas", "organ_parenchyma", 3, ThirdAxis::along},
    {"gland", "organ_parenchyma", 1, ThirdAxis::along},
    {"soft_tissue", "organ_parenchyma", 0, ThirdAxis::along},
    {"bowel", "organ_parenchyma", 3, ThirdAxis::along},
    {"cartilage", "organ_parenchyma", 2, ThirdAxis::along},
    {"muscle", "muscle", 0, ThirdAxis::across},
    {"fat", "fat", 0, ThirdAxis::along},
    {"skin", "fat", 1, ThirdAxis::along},
    {"kidney_sinus", "fat", 0, ThirdAxis::across},
    {"fascia", "fascia", 0, ThirdAxis::along},
    {"fluid", "fluid", 0, ThirdAxis::along},
    {"gas", "bone_shadow", 0, ThirdAxis::along},
    {"bone", "organ_parenchyma", 3, ThirdAxis::along},
};

const StandIn* stand_in_for(const std::string& texture) {
    for (const StandIn& s : kStandIns) {
        if (texture == s.texture) return &s;
    }
    return nullptr;
}

// Files of each class in patches.csv.
Result<std::map<std::string, std::vector<std::string>>> read_patch_table(
    const std::string& folder) {
    const std::filesystem::path path = std::filesystem::path(folder) / "patches.csv";
    const Result<std::string> text = read_text_file(path.string());
    if (!text) {
        return Error{"no patches.csv: " + text.error().what, folder,
                     "expected a table with the columns file and class beside the patches"};
    }
    const std::vector<TextRow> rows = split_rows(*text);
    const std::vector<std::string> header =
        rows.empty() ? std::vector<std::string>() : rows[0].cells;
    const std::size_t file = std::find(header.begin(), header.end(), "file") - header.begin();
    const std::size_t kind = std::find(header.begin(), header.end(), "class") - header.begin();
    if (file >= header.size() || kind >= header.size()) {
        return Error{"no column named file and class", path.string(),
                     "expected both in its first line"};
    }
    std::map<std::string, std::vector<std::string>> out;
    for (std::size_t r = 1; r < rows.size(); ++r) {
        const std::vector<std::string>& cells = rows[r].cells;
        if (cells.size() <= std::max(file, kind)) continue;
        out[cells[kind]].push_back((std::filesystem::path(folder) / cells[file]).string());
    }
    return out;
}

// Files of the examples of a texture: those given for it, else the patches of its own class, else
// the patch of its stand-in.
std::vector<std::string> example_files(
    const std::string& texture,
    const StandIn* stand_in,
    const std::vector<TextureExample>& given,
    const std::map<std::string, std::vector<std::string>>& patches) {
    std::vector<std::string> files;
    for (const TextureExample& example : given) {
        if (example.texture == texture) files.push_back(example.path);
    }
    if (!files.empty()) return files;
    const auto own = patches.find(texture);
    if (own != patches.end() && !(stand_in && own->first == stand_in->patch_class))
        return own->second;
    if (stand_in) {
        const auto shared = patches.find(stand_in->patch_class);
        if (shared != patches.end())
            files.push_back(shared->second[stand_in->which % shared->second.size()]);
    }
    return files;
}

std::uint64_t name_seed(const std::string& name, std::uint64_t seed) {
    std::uint64_t hash = seed;
    for (const char c : name) hash = derive_seed(hash, static_cast<unsigned char>(c));
    return hash;
}

}  // namespace

Result<SolidTextureResult> make_solid_texture(const TextureSpec& spec) {
    assert(!spec.examples.empty());
    SolidTextureResult out;
    std::vector<ExampleImage> prepared;
    double count = 0, sum = 0, square = 0;
    for (const ExampleImage& example : spec.examples) {
        SONOCASE_TRY(auto p, prepare_example(example));
        out.warnings.insert(out.warnings.end(), p.warnings.begin(), p.warnings.end());
        for (std::size_t i = 0; i < p.image.count(); ++i) {
            if (!p.image.used(i)) continue;
            count += 1;
            sum += p.image.grey[i];
            square += static_cast<double>(p.image.grey[i]) * p.image.grey[i];
        }
        prepared.push_back(std::move(p.image));
    }
    out.grey_mean = sum / count;
    out.grey_sd = std::sqrt(std::max(square / count - out.grey_mean * out.grey_mean, 1e-12));
    std::vector<float> grey;
    if (spec.mode == TextureMode::pyramid) {
        const PyramidStatistics statistics = learn_pyramid(prepared, spec.pyramid);
        out.warnings.insert(out.warnings.end(), statistics.warnings.begin(),
                            statistics.warnings.end());
        grey = synthesise_pyramid(statistics, spec.edge, spec.seed);
    } else {
        MatchedOptions options;
        options.third_axis = spec.third_axis;
        MatchedTexture made = synthesise_matched(prepared, spec.edge, spec.seed, options);
        grey = std::move(made.grey);
        out.pixels_per_voxel = made.pixels_per_voxel;
    }
    out.texture.name = spec.name;
    out.texture.edge = spec.edge;
    out.texture.voxel_mm = spec.pixel_mm * out.pixels_per_voxel;
    out.texture.voxels.resize(grey.size());
    for (std::size_t i = 0; i < grey.size(); ++i) {
        double v = std::round(128 + 32 * (grey[i] - out.grey_mean) / out.grey_sd);
        // Values saturated in the example remain saturated, although a step of the code may be two
        // levels of grey.
        if (grey[i] >= 255 && out.grey_mean + (v - 128) / 32 * out.grey_sd < 255) v += 1;
        if (grey[i] <= 0 && out.grey_mean + (v - 128) / 32 * out.grey_sd > 0) v -= 1;
        out.texture.voxels[i] = static_cast<std::uint8_t>(std::clamp(v, 0.0, 255.0));
    }
    return out;
}

Result<std::vector<TextureSpec>> plan_texture_bank(std::span<const Tissue> tissues,
                                                   const TextureBankOptions& options,
                                                   std::vector<std::string>* notes) {
    const auto note = [&](std::string text) {
        if (notes) notes->push_back(std::move(text));
    };
    std::map<std::string, std::vector<std::string>> patches;
    if (!options.example_folder.empty()) {
        SONOCASE_TRY(auto table, read_patch_table(options.example_folder));
        patches = std::move(table);
    }
    std::vector<TextureSpec> specs;
    const auto planned = [&](const std::string& name) {
        return std::any_of(specs.begin(), specs.end(),
                           [&](const TextureSpec& s) { return s.name == name; });
    };
    for (const Tissue& tissue : tissues) {
        if (tissue.texture.empty() || planned(tissue.texture)) continue;
        TextureSpec spec;
        spec.name = tissue.texture;
        spec.mode = options.mode;
        spec.pyramid = options.pyramid;
        spec.edge = options.edge;
        spec.pixel_mm = options.pixel_mm;
        spec.seed = name_seed(tissue.texture, options.seed);
        const StandIn* stand_in = stand_in_for(tissue.texture);
        if (stand_in) spec.third_axis = stand_in->third_axis;
        const std::vector<std::string> files =
            example_files(tissue.texture, stand_in, options.examples, patches);
        for (const std::string& file : files) {
            SONOCASE_TRY(auto example, read_example(file, {}, notes));
            spec.examples.push_back(std::move(example));
        }
        if (spec.examples.empty()) {
            spec.examples.push_back(synthetic_example(spec.name, 160, 128, options.seed));
            if (!options.example_folder.empty()) {
                note("Texture " + spec.name + " has no example image; a synthetic one is used.");
            }
        }
        specs.push_back(std::move(spec));
    }
    for (const TextureExample& example : options.examples) {
        if (!planned(example.texture)) {
            note("No tissue uses the texture " + example.texture + "; its example was not read.");
        }
    }
    return specs;
}

Result<TextureBankResult> build_texture_bank(std::span<const Tissue> tissues,
                                             const TextureBankOptions& options,
                                             const Progress& progress) {
    const Stopwatch watch;
    TextureBankResult out;
    out.report.stage = stage_names::kTexture;
    SONOCASE_TRY(auto specs, plan_texture_bank(tissues, options, &out.report.warnings));
    std::vector<std::optional<Result<SolidTextureResult>>> made(specs.size());
    report_progress(progress, 0.1, "learning textures");
    parallel_for(made.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) made[i].emplace(make_solid_texture(specs[i]));
    });
    double synthetic = 0;
    for (std::size_t i = 0; i < made.size(); ++i) {
        if (!*made[i]) return made[i]->error();
        SolidTextureResult& result = **made[i];
        out.textures.push_back(std::move(result.texture));
        out.report.warnings.insert(out.report.warnings.end(), result.warnings.begin(),
                                   result.warnings.end());
        synthetic += specs[i].examples[0].name.rfind("synthetic ", 0) == 0;
    }
    report_progress(progress, 1, "learning textures");
    out.report.measures = {{"textures", static_cast<double>(made.size())},
                           {"synthetic_examples", synthetic},
                           {"edge_voxels", static_cast<double>(options.edge)}};
    out.report.seconds = watch.seconds();
    return out;
}

}  // namespace sonocase::pipeline::inline texture
