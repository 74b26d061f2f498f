// SPDX-License-Identifier: Apache-2.0

#include "pipeline/cook/stage_options.h"

#include <charconv>
#include <cmath>
#include <cstdio>

#include "formats/text/nearest_name.h"

namespace sonocase::pipeline {
namespace {

using Options = StageOptions;

// The one table of keys. Sections are stages, in the order in which they run.
const std::vector<OptionKey>& table() {
    static const std::vector<OptionKey> keys{
        {"surface", "working_mm", 0.5, 20, "mm", "voxel to which the body is averaged for its skin",
         [](Options& o) -> OptionSlot { return &o.surface.working_mm; }},
        {"surface", "smoothing_mm", 0, 20, "mm", "standard deviation of the skin's smoothing",
         [](Options& o) -> OptionSlot { return &o.surface.smoothing_mm; }},
        {"surface", "bridge_mm", 0, 100, "mm", "thinner sheets and bridges are not body",
         [](Options& o) -> OptionSlot { return &o.surface.bridge_mm; }},
        {"surface", "least_part", 0, 1, "", "of a slice's largest part: smaller ones are arms",
         [](Options& o) -> OptionSlot { return &o.surface.least_part; }},
        {"align", "starts", 1, 2000, "", "rotations to start from",
         [](Options& o) -> OptionSlot { return &o.fit.rigid.starts; }},
        {"align", "offsets", 1, 20, "", "starts along the long axis for each rotation",
         [](Options& o) -> OptionSlot { return &o.fit.rigid.offsets; }},
        {"align", "offset_mm", 0, 200, "mm", "between these",
         [](Options& o) -> OptionSlot { return &o.fit.rigid.offset_mm; }},
        {"align", "candidates", 1, 50, "", "poses handed on to the warp",
         [](Options& o) -> OptionSlot { return &o.fit.rigid.candidates; }},
        {"align", "cone_rad", 0.05, 3.2, "rad", "largest tilt of the head from inputs.up",
         [](Options& o) -> OptionSlot { return &o.fit.rigid.cone_rad; }},
        {"align", "landmark_mm", 0.1, 100, "mm", "standard deviation of a landmark along an axis",
         [](Options& o) -> OptionSlot { return &o.fit.landmark_mm; }},
        {"warp", "trials", 1, 100000, "", "of the random consensus",
         [](Options& o) -> OptionSlot { return &o.fit.ransac.trials; }},
        {"warp", "correspondences", 10, 200, "", "of each trial",
         [](Options& o) -> OptionSlot { return &o.fit.ransac.correspondences; }},
        {"warp", "match_ratio", 1, 10, "", "T_d of eq. (7)",
         [](Options& o) -> OptionSlot { return &o.fit.ransac.match_ratio; }},
        {"warp", "constraint_mm", 0, 1000, "mm", "weight of eqs. (4)-(6); 0: from the readings",
         [](Options& o) -> OptionSlot { return &o.fit.constraint_mm; }},
        {"warp", "strain", 0.001, 1, "", "slopes that the map is expected to have",
         [](Options& o) -> OptionSlot { return &o.fit.strain; }},
        {"warp", "paper", 0, 1, "", "stop after the random consensus, eqs. (3)-(9)",
         [](Options& o) -> OptionSlot { return &o.fit.paper_warp; }},
        {"warp", "residual", 0, 1, "", "B-spline displacement after the quadratic",
         [](Options& o) -> OptionSlot { return &o.fit.residual_warp; }},
        {"warp", "spacing_mm", 10, 200, "mm", "of its control points",
         [](Options& o) -> OptionSlot { return &o.fit.residual.spacing_mm; }},
        {"warp", "bending", 1e-09, 10, "", "weight of its bending",
         [](Options& o) -> OptionSlot { return &o.fit.residual.bending; }},
        {"warp", "stretching", 0, 10, "", "weight of its stretching",
         [](Options& o) -> OptionSlot { return &o.fit.residual.stretching; }},
        {"warp", "inside_mm", 0, 100, "mm", "mean move of the inside that it may cause",
         [](Options& o) -> OptionSlot { return &o.fit.residual.inside_mm; }},
        {"warp", "fade_mm", 1, 500, "mm", "depth at which it has faded",
         [](Options& o) -> OptionSlot { return &o.fit.residual.fade_mm; }},
        {"resample", "voxel_mm", 0.2, 10, "mm", "edge of the cooked voxels",
         [](Options& o) -> OptionSlot { return &o.resample.voxel_mm; }},
        {"resample", "margin_mm", 0, 50, "mm", "air kept round the body",
         [](Options& o) -> OptionSlot { return &o.resample.margin_mm; }},
        {"resample", "method", 0, 0, "", "how labels go through the map",
         [](Options& o) -> OptionSlot { return &o.resample.method; }, "shape|nearest|paper"},
        {"resample", "sigma_vx", 0, 4, "voxels of the map", "smoothing of the surfaces",
         [](Options& o) -> OptionSlot { return &o.resample.sigma_vx; }},
        {"resample", "detail_vx", 0, 4, "voxels of the map", "smoothing of what sigma_vx wipes out",
         [](Options& o) -> OptionSlot { return &o.resample.detail_vx; }},
        {"resample", "sigma_slices", 0, 2, "slices", "smoothing along thick slices; 0: sigma_vx",
         [](Options& o) -> OptionSlot { return &o.resample.sigma_slices; }},
        {"resample", "volume_iterations", 0, 50, "", "Newton steps that keep volumes; 0: not kept",
         [](Options& o) -> OptionSlot { return &o.resample.volume_iterations; }},
        {"resample", "follow_shift", 0, 1, "", "blend oblique vessels along their shift",
         [](Options& o) -> OptionSlot { return &o.resample.follow_shift; }},
        {"resample", "record_band_vx", 0, 2.6, "voxels", "reach of boundary records; 0: none",
         [](Options& o) -> OptionSlot { return &o.resample.record_band_vx; }},
        {"resample", "block_vx", 4, 16, "nodes", "blocks of distances, 4, 8 or 16: time and memory",
         [](Options& o) -> OptionSlot { return &o.resample.block_vx; }},
        {"resample", "snap_vx", 0, 0.5, "voxels",
         "most that surfaces move to be kept short; 0: none",
         [](Options& o) -> OptionSlot { return &o.resample.snap_vx; }},
        {"resample", "k0", 0.001, 100, "1/mm^2", "method paper: eq. (10)",
         [](Options& o) -> OptionSlot { return &o.resample.level_set.k0; }},
        {"resample", "iterations", 1, 1000, "", "method paper: of eq. (10)",
         [](Options& o) -> OptionSlot { return &o.resample.level_set.iterations; }},
        {"resample", "closest_point", 0, 1, "",
         "method paper: curvature at the nearest surface point",
         [](Options& o) -> OptionSlot { return &o.resample.level_set.closest_point; }},
        {"smooth", "method", 0, 0, "", "auto: joint after resample.method nearest, else none",
         [](Options& o) -> OptionSlot { return &o.smooth_method; }, "auto|none|joint|level_set"},
        {"smooth", "sigma_vx", 0, 4, "voxels", "joint: of the smoothing",
         [](Options& o) -> OptionSlot { return &o.smooth.sigma_vx; }},
        {"smooth", "iterations", 1, 20, "", "joint: times over",
         [](Options& o) -> OptionSlot { return &o.smooth.iterations; }},
        {"smooth", "volume_iterations", 0, 50, "", "joint: steps that keep volumes",
         [](Options& o) -> OptionSlot { return &o.smooth.volume_iterations; }},
        {"smooth", "k0", 0.0001, 100, "1/mm^2", "level_set: K0 of eq. (10)",
         [](Options& o) -> OptionSlot { return &o.smooth.level_set.k0; }},
        {"smooth", "level_set_iterations", 1, 1000, "", "level_set: of eq. (10)",
         [](Options& o) -> OptionSlot { return &o.smooth.level_set.iterations; }},
        {"texture", "edge", 8, 128, "voxels", "of the solid textures; a power of two",
         [](Options& o) -> OptionSlot { return &o.texture.bank.edge; }},
        {"texture", "pixel_mm", 0.05, 4, "mm", "size of an example pixel in tissue",
         [](Options& o) -> OptionSlot { return &o.texture.bank.pixel_mm; }},
        {"texture", "speckle_edge", 8, 256, "voxels", "of the speckle volume; a power of two",
         [](Options& o) -> OptionSlot { return &o.texture.speckle_edge; }},
        {"texture", "mode", 0, 0, "", "matched keeps direction, pyramid is eq. (15)",
         [](Options& o) -> OptionSlot { return &o.texture_mode; }, "matched|pyramid"},
        {"structure", "parenchyma", 0, 1, "", "bake it into the echo offsets",
         [](Options& o) -> OptionSlot { return &o.structure.parenchyma; }},
        {"structure", "liver_vessels", 0, 1, "", "bake it into the echo offsets",
         [](Options& o) -> OptionSlot { return &o.structure.liver_vessels; }},
        {"structure", "kidney", 0, 1, "", "bake it into the echo offsets",
         [](Options& o) -> OptionSlot { return &o.structure.kidney; }},
        {"structure", "muscle_fibres", 0, 1, "", "bake it into the echo offsets",
         [](Options& o) -> OptionSlot { return &o.structure.muscle_fibres; }},
        {"structure", "fat_septa", 0, 1, "", "bake it into the echo offsets",
         [](Options& o) -> OptionSlot { return &o.structure.fat_septa; }},
        {"structure", "bowel_wall", 0, 1, "", "bake it into the echo offsets",
         [](Options& o) -> OptionSlot { return &o.structure.bowel_wall; }},
        {"structure", "fascia", 0, 1, "", "bake it into the echo offsets",
         [](Options& o) -> OptionSlot { return &o.structure.fascia; }},
        {"case", "seed", 0, 2e9, "", "of everything random in the case",
         [](Options& o) -> OptionSlot { return &o.seed; }},
    };
    return keys;
}

constexpr PresetSetting kDraft[] = {{"resample.voxel_mm", "2"}, {"texture.edge", "32"}};
constexpr PresetSetting kBalanced[] = {{"resample.voxel_mm", "1"}};
constexpr PresetSetting kAccurate[] = {{"resample.voxel_mm", "0.75"}, {"surface.working_mm", "2"}};

std::string shortest(double value) {
    char text[32];
    const auto end = std::to_chars(text, text + sizeof text, value).ptr;
    return std::string(text, end);
}

}  // namespace

std::span<const OptionKey> option_keys() {
    return table();
}

const OptionKey* find_option_key(std::string_view section, std::string_view key) {
    for (const OptionKey& entry : table())
        if (section == entry.section && key == entry.key) return &entry;
    return nullptr;
}

std::vector<std::string> option_sections() {
    std::vector<std::string> sections;
    for (const OptionKey& entry : table())
        if (sections.empty() || sections.back() != entry.section) sections.push_back(entry.section);
    return sections;
}

std::vector<std::string> option_names(std::string_view section) {
    std::vector<std::string> names;
    for (const OptionKey& entry : table())
        if (section == entry.section) names.push_back(entry.key);
    return names;
}

Status set_option(const OptionKey& key,
                  const std::string& value,
                  StageOptions& options,
                  const std::string& where) {
    const std::string name = std::string(key.section) + "." + key.key;
    const auto bad = [&](const std::string& expected) {
        return Error{"'" + value + "' for " + name, where, "expected " + expected};
    };
    return std::visit(
        [&](auto* slot) -> Status {
            using T = std::remove_pointer_t<decltype(slot)>;
            if constexpr (std::is_same_v<T, bool>) {
                if (value != "true" && value != "false") return bad("true or false");
                *slot = value == "true";
            } else if constexpr (std::is_same_v<T, std::string>) {
                std::vector<std::string> choices;
                for (std::string_view rest = key.choices; !rest.empty();) {
                    const std::size_t bar = rest.find('|');
                    choices.emplace_back(rest.substr(0, bar));
                    rest =
                        bar == std::string_view::npos ? std::string_view() : rest.substr(bar + 1);
                }
                bool known = choices.empty();
                for (const std::string& choice : choices) known = known || choice == value;
                if (!known)
                    return bad(std::string(key.choices) + "; " + suggest_name(value, choices));
                *slot = value;
            } else {
                double number = 0;
                const auto [end, code] =
                    std::from_chars(value.data(), value.data() + value.size(), number);
                const bool whole = !std::is_same_v<T, double>;
                if (code != std::errc() || end != value.data() + value.size() ||
                    !(number >= key.low) || !(number <= key.high) ||
                    (whole && number != std::floor(number)))
                    return bad(std::string(whole ? "a whole number" : "a number") + " from " +
                               shortest(key.low) + " to " + shortest(key.high) +
                               (*key.unit ? std::string(" ") + key.unit : std::string()));
                *slot = static_cast<T>(number);
            }
            return Done{};
        },
        key.slot(options));
}

std::string option_value(const OptionKey& key, StageOptions& options) {
    return std::visit(
        [](auto* slot) -> std::string {
            using T = std::remove_pointer_t<decltype(slot)>;
            if constexpr (std::is_same_v<T, bool>)
                return *slot ? "true" : "false";
            else if constexpr (std::is_same_v<T, std::string>)
                return *slot;
            else if constexpr (std::is_same_v<T, double>)
                return shortest(*slot);
            else
                return std::to_string(*slot);
        },
        key.slot(options));
}

std::string canonical_options(std::string_view section, const StageOptions& options) {
    StageOptions copy = options;
    std::string text;
    for (const OptionKey& key : table())
        if (section == key.section)
            text += std::string(key.key) + "=" + option_value(key, copy) + "\n";
    return text;
}

std::span<const PresetSetting> preset_settings(std::string_view preset) {
    if (preset == "draft") return kDraft;
    if (preset == "balanced") return kBalanced;
    if (preset == "accurate") return kAccurate;
    return {};
}

std::vector<std::string> preset_names() {
    return {"draft", "balanced", "accurate"};
}

}  // namespace sonocase::pipeline
