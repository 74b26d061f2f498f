// SPDX-License-Identifier: Apache-2.0

// How near a solid texture comes to its example, compared with how near two halves of a real patch
// come to each other.
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/volume/solid_texture.h"
#include "pipeline/texture/autocorrelation.h"
#include "pipeline/texture/example_image.h"
#include "pipeline/texture/texture_bank.h"

namespace sonocase::pipeline::inline texture {

// Distance between two samples of grey and their grain.
struct TextureDistance {
    double ks = 0;  // Kolmogorov-Smirnov: largest gap between the distribution functions, [0, 1]
    double earth_mover_grey = 0;  // mean shift of grey that turns one histogram into the other
    double grain = 0;             // RMS difference of the autocorrelations within the grain's width
};

struct TextureQuality {
    TextureDistance distance;     // texture against example
    TextureDistance floor;        // one half of the example against the other; a lower bound
    CorrelationWidths example;    // px
    CorrelationWidths texture;    // voxels, planes z = const
    double example_contrast = 0;  // sd / mean of grey
    double texture_contrast = 0;
    double seam_score = 0;  // largest |z| of the seam_scores
};

// Kolmogorov-Smirnov and earth mover's distance between two sets of values, neither empty.
double kolmogorov_smirnov(std::span<const float> a, std::span<const float> b);
double earth_mover(std::span<const float> a, std::span<const float> b);

// z-scores of the mean step across the wrap in x, y and z: (seam - mean of inner steps) / their sd.
std::array<double, 3> seam_scores(const SolidTexture& texture);

// Grey values of a texture for a tissue of that mean and spread, # edge^3, in [0, 255].
std::vector<float> texture_grey(const SolidTexture& texture, double mean, double sd);

// The two halves of an example, cut across its longer side.
std::array<ExampleImage, 2> split_example(const ExampleImage& example);

TextureDistance distance_between(const ExampleImage& a, const ExampleImage& b);
TextureDistance distance_between(const SolidTextureResult& made, const ExampleImage& example);

// made: by make_solid_texture; example: prepared (example_image.h). Cost: about that of making
// the texture.
TextureQuality measure_texture(const SolidTextureResult& made, const ExampleImage& example);

// A texture, its quality, and how well a texture learned from one half of the example predicts the
// other half.
struct TextureAssessment {
    SolidTextureResult made;
    ExampleImage example;        // the largest one, prepared
    TextureQuality quality;      // against that one
    bool has_held_back = false;  // false: half the example has too few pixels
    TextureDistance held_back;   // texture learned from the first half against the second half
    double seconds = 0;          // of make_solid_texture alone
    // Names start with "NAME.": ks, earth_mover_grey, grain and their *_floor, widths and contrast
    // of example and texture, seam_score, held_back_*, seconds.
    std::vector<Measure> measures() const;
};

// Errors are those of make_solid_texture. Cost: three times that of making the texture.
Result<TextureAssessment> assess_texture(const TextureSpec& spec);

// Writes a page to compare a solid texture with its example by eye, a PNG: the example; cuts x-y,
// x-z and z-y and an oblique cut at the scale of the example, larger than the texture's period;
// histograms; autocorrelation along and across. Error: those of the chart writer.
Status write_texture_page(const TextureAssessment& assessment, const std::string& path);

}  // namespace sonocase::pipeline::inline texture
