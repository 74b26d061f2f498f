// SPDX-License-Identifier: Apache-2.0

// The options of every stage, and the one table that names their keys in a recipe.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/anatomy/analytic_torso.h"
#include "pipeline/anatomy/bake_structure.h"
#include "pipeline/registration/register_surfaces.h"
#include "pipeline/registration/skin/skin_surface.h"
#include "pipeline/segmentation/resample_labels.h"
#include "pipeline/segmentation/smooth_labels.h"
#include "pipeline/texture/texture_bank.h"

namespace sonocase::pipeline {

// The embedded torso as an input: sampling of its "CT" and readings of its mannequin.
struct AnalyticInput {
    AnalyticBody body;
    AnalyticMannequinOptions mannequin;
    double voxel_mm = 2;
    double slice_mm = 3;
    int landmarks = 0;             // marked on both bodies, see analytic_torso_landmarks
    double landmark_noise_mm = 1;  // of each and axis
    bool known_map = false;        // take the map that made the mannequin instead of fitting one
};

struct TextureStageOptions {
    TextureBankOptions bank;
    int speckle_edge = 64;
};

struct StageOptions {
    SkinSurfaceOptions surface;
    RegisterOptions fit;  // [align] and [warp]
    ResampleOptions resample;
    // Resampling by shape smooths as it goes; "auto" smooths again only after "nearest".
    std::string smooth_method = "auto";
    SmoothOptions smooth;
    TextureStageOptions texture;
    std::string texture_mode = "matched";
    BakeStructureOptions structure;
    int seed = 1;  // of everything random in a case; [case] seed
};

// Where a key's value lives.
using OptionSlot = std::variant<double*, int*, bool*, std::uint64_t*, std::string*>;

struct OptionKey {
    const char* section;
    const char* key;
    double low, high;  // of numbers
    const char* unit;  // "mm", "" for none
    const char* meaning;
    OptionSlot (*slot)(StageOptions& options);
    const char* choices = "";  // of strings: "a|b|c"
};

std::span<const OptionKey> option_keys();
const OptionKey* find_option_key(std::string_view section, std::string_view key);
std::vector<std::string> option_sections();
std::vector<std::string> option_names(std::string_view section);

// Sets one option from text ("1.5", "true", "matched"). An Error says what was expected, with
// `where`.
Status set_option(const OptionKey& key,
                  const std::string& value,
                  StageOptions& options,
                  const std::string& where);
std::string option_value(const OptionKey& key, StageOptions& options);

// "key=value\n" of every option of a section: the part that they have in the stage's cache key.
std::string canonical_options(std::string_view section, const StageOptions& options);

// Settings of a preset: pairs of "section.key" and value. Empty for an unknown name.
struct PresetSetting {
    const char* key;
    const char* value;
};
std::span<const PresetSetting> preset_settings(std::string_view preset);
std::vector<std::string> preset_names();

}  // namespace sonocase::pipeline
