// SPDX-License-Identifier: Apache-2.0

// The bank of solid textures of the image model "paper": one per texture name of the tissue table,
// learned from an example image where one is given.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/volume/solid_texture.h"
#include "formats/volume/tissue.h"
#include "pipeline/base/progress.h"
#include "pipeline/texture/example_image.h"
#include "pipeline/texture/pyramid_texture.h"

namespace sonocase::pipeline::inline texture {

enum class TextureMode {
    pyramid,  // eq. (15) of the paper; pyramid_texture.h
    matched,  // autocorrelation and histogram of the example, with direction; matched_texture.h
};

// How the two axes of a picture extend to three. Texture x is the picture's x, and y its depth.
// Out of the picture, the texture looks as it does in the picture ...
enum class ThirdAxis {
    across,  // across the main direction: fibres
    along,   // along the main direction: speckle (as wide in elevation as laterally), septa, layers
};

struct TextureSpec {
    std::string name;
    std::vector<ExampleImage> examples;  // >= 1
    TextureMode mode = TextureMode::matched;
    PyramidOptions pyramid;  // of mode pyramid
    ThirdAxis third_axis = ThirdAxis::across;
    int edge = 64;          // power of two in 8..128
    double pixel_mm = 0.5;  // size of a pixel of the example in tissue
    std::uint64_t seed = 1;
};

struct SolidTextureResult {
    SolidTexture texture;      // voxel_mm = pixel_mm * pixels_per_voxel
    int pixels_per_voxel = 1;  // pixels of the example; matched_texture.h
    double grey_mean = 0;      // of the example without its depth trend
    double grey_sd = 0;
    std::vector<std::string> warnings;
};

// Learns and synthesises one texture. Error: those of prepare_example.
Result<SolidTextureResult> make_solid_texture(const TextureSpec& spec);

// The file of an example image for one texture.
struct TextureExample {
    std::string texture;  // name of a texture of the tissue table
    std::string path;
};

struct TextureBankOptions {
    // Folder with patches.csv (columns file, class). A class with the name of a texture is used for
    // that texture; muscle, fat, fascia, organ_parenchyma, fluid, bone_surface and bone_shadow are
    // used for the built-in textures that resemble them. Empty: no folder.
    std::string example_folder;
    std::vector<TextureExample> examples;  // take precedence over the folder
    TextureMode mode = TextureMode::matched;
    PyramidOptions pyramid;  // of mode pyramid
    int edge = 64;
    double pixel_mm = 0.5;  // size of a pixel of the examples in tissue
    std::uint64_t seed = 1;
};

struct TextureBankResult {
    std::vector<SolidTexture> textures;  // in the order in which the tissues name them
    StageReport report;                  // stage "texture"
};

// What the bank will be made from: every texture that `tissues` name, once each, with its examples
// read. Adds a sentence to `notes` (may be null) for each irregularity of a file. Error: a file
// that cannot be read.
Result<std::vector<TextureSpec>> plan_texture_bank(std::span<const Tissue> tissues,
                                                   const TextureBankOptions& options,
                                                   std::vector<std::string>* notes);

// Every texture that `tissues` name, once each. A name without an example gets a synthetic one
// (synthetic_examples.h), with a warning in the report if a folder was given.
// Same bytes for any number of threads. Cost: 16 textures of 64^3 under 3 s on two cores.
Result<TextureBankResult> build_texture_bank(std::span<const Tissue> tissues,
                                             const TextureBankOptions& options = {},
                                             const Progress& progress = {});

}  // namespace sonocase::pipeline::inline texture
