// SPDX-License-Identifier: Apache-2.0

// The bank of solid textures that the image model "paper" looks up: one for each texture name of
// the tissue table, learned from example images where there are any.
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
#include "pipeline/texture/example/example_image.h"
#include "pipeline/texture/pyramid_texture.h"

namespace sonocase::pipeline {

enum class TextureMode {
    pyramid,  // eq. (15) of the paper; pyramid_texture.h
    matched,  // autocorrelation and histogram of the example; keeps direction; matched_texture.h
};

// How a picture's two axes extend to three. Texture x is the picture's x, y its depth.
enum class ThirdAxis {
    across,  // out of the picture as across the main direction in it: fibres
    along,   // as along it: speckle (as wide in elevation as sideways), septa and layers
};

struct TextureSpec {
    std::string name;
    std::vector<ExampleImage> examples;  // >= 1
    TextureMode mode = TextureMode::matched;
    PyramidOptions pyramid;  // of mode pyramid
    ThirdAxis third_axis = ThirdAxis::across;
    int edge = 64;          // power of two in 8..128
    double pixel_mm = 0.5;  // size that a pixel of the example has in tissue
    std::uint64_t seed = 1;
};

struct SolidTextureResult {
    SolidTexture texture;      // voxel_mm = pixel_mm * pixels_per_voxel
    int pixels_per_voxel = 1;  // of the example; matched_texture.h
    double grey_mean = 0;      // of the example after its depth trend is taken off
    double grey_sd = 0;
    std::vector<std::string> warnings;
};

// Learns and synthesises one texture. Error: no used pixel, or a constant image.
Result<SolidTextureResult> make_solid_texture(const TextureSpec& spec);

// An example image for one texture, by file.
struct TextureExample {
    std::string texture;  // name of a texture of the tissue table
    std::string path;
};

struct TextureBankOptions {
    // Folder with patches.csv (columns file, class): classes that are texture names serve those;
    // muscle, fat, fascia, organ_parenchyma, fluid, bone_surface and bone_shadow serve the built-in
    // textures that resemble them. Empty: no folder.
    std::string example_folder;
    std::vector<TextureExample> examples;  // these win over the folder
    TextureMode mode = TextureMode::matched;
    PyramidOptions pyramid;  // of mode pyramid
    int edge = 64;
    double pixel_mm = 0.5;  // size that a pixel of the examples has in tissue
    std::uint64_t seed = 1;
};

struct TextureBankResult {
    std::vector<SolidTexture> textures;  // in the order in which the tissues name them
    StageReport report;                  // stage "texture"
};

// What the bank will be made from: every texture that `tissues` name, each once, with its examples
// read. `notes` gets a sentence on each oddity of a file. Errors are those of the files.
Result<std::vector<TextureSpec>> plan_texture_bank(std::span<const Tissue> tissues,
                                                   const TextureBankOptions& options,
                                                   std::vector<std::string>* notes);

// Every texture that `tissues` name, each once. Names without an example get a synthetic one
// (synthetic_examples.h), and the report's warnings say so when a folder was given.
// Same bytes for any number of threads. Cost: 16 textures of 64^3 under 3 s on two cores.
Result<TextureBankResult> build_texture_bank(std::span<const Tissue> tissues,
                                             const TextureBankOptions& options = {},
                                             const Progress& progress = {});

}  // namespace sonocase::pipeline
