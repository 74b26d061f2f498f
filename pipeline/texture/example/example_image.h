// SPDX-License-Identifier: Apache-2.0

// An example of the texture of a tissue: grey pixels of a B-mode image, and which of them to use.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace sonocase::pipeline {

struct ExampleImage {
    std::string name;  // for messages: file or recipe
    int width = 0;     // pixels
    int height = 0;
    std::vector<float> grey;        // # width * height, [0, 255], row by row from the top
    std::vector<std::uint8_t> use;  // # width * height, 1: part of the example; empty: all of them

    std::size_t count() const {
        return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
    }
    std::size_t index(int x, int y) const {
        return static_cast<std::size_t>(x) +
               static_cast<std::size_t>(width) * static_cast<std::size_t>(y);
    }
    bool used(std::size_t i) const { return use.empty() || use[i] != 0; }
};

// Grey of the used pixels, in order.
std::vector<float> used_grey(const ExampleImage& image);

struct GreyMoments {
    std::size_t count = 0;  // used pixels
    double mean = 0;
    double squares = 0;  // sum of the squared deviations from the mean
    double sd() const;
};
GreyMoments grey_moments(const ExampleImage& image);

}  // namespace sonocase::pipeline
