// How near a solid texture comes to its example, beside how near two real patches come to each
// other.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "formats/solid_texture.h"
#include "pipeline/texture/autocorrelation.h"
#include "pipeline/texture/example_image.h"
#include "pipeline/texture/texture_bank.h"

namespace sonocase::pipeline {

// Distance between two samples of grey and their grain.
struct TextureDistance {
    double ks = 0;  // Kolmogorov-Smirnov: greatest gap between the distributions, [0, 1]
    double earth_mover_grey = 0;  // mean shift of grey that turns one histogram into the other
    double grain = 0;             // rms difference of the autocorrelations within the grain's width
};

struct TextureQuality {
    TextureDistance distance;     // texture against example
    TextureDistance floor;        // one half of the example against the other: no method goes below
    CorrelationWidths example;    // px
    CorrelationWidths texture;    // voxels, planes z = const
    double example_contrast = 0;  // sd / mean of grey
    double texture_contrast = 0;
    double seam_score = 0;  // greatest |z| of the steps across the faces x, y, z among inner steps
};

// Kolmogorov-Smirnov and earth mover's distance of two sets of values; both not empty.
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

// made: by make_solid_texture; example: prepared (prepare_example.h). Cost: about that of making
// the texture.
TextureQuality measure_texture(const SolidTextureResult& made, const ExampleImage& example);

}  // namespace sonocase::pipeline
