// SPDX-License-Identifier: Apache-2.0

// What a module that is opened when the first image is read says to read_example(): OpenImageIO
// and its readers are two hundred libraries, and linking them took two thirds of the start of every
// command.
#pragma once

#include <string>
#include <vector>

namespace sonocase::pipeline::inline texture {

struct StoredImage {
    int width = 0, height = 0, depth = 1, channels = 0;
    int alpha = -1;            // its channel
    double full = 0;           // stored number that a value of 1 stands for; 0: floating point
    std::vector<float> value;  // width * height * channels, not scaled
};

enum class ImageFailure { none, not_an_image, no_frame, size, damaged, other };

// The module's one function. `why` is the library's own sentence on one line, where it has one.
extern "C" {
using ReadImage = ImageFailure(const char* path, int frame, StoredImage& image, std::string& why);
ReadImage sonocase_read_image;
}

}  // namespace sonocase::pipeline::inline texture
