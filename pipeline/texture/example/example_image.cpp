// SPDX-License-Identifier: Apache-2.0

#include "pipeline/texture/example/example_image.h"

#include <cmath>

namespace sonocase::pipeline {

std::vector<float> used_grey(const ExampleImage& image) {
    std::vector<float> out;
    for (std::size_t i = 0; i < image.count(); ++i) {
        if (image.used(i)) out.push_back(image.grey[i]);
    }
    return out;
}

double GreyMoments::sd() const {
    return count > 0 ? std::sqrt(squares / static_cast<double>(count)) : 0;
}

GreyMoments grey_moments(const ExampleImage& image) {
    GreyMoments m;
    double sum = 0;
    for (std::size_t i = 0; i < image.count(); ++i) {
        if (!image.used(i)) continue;
        ++m.count;
        sum += image.grey[i];
    }
    if (m.count == 0) return m;
    m.mean = sum / static_cast<double>(m.count);
    for (std::size_t i = 0; i < image.count(); ++i) {
        if (image.used(i)) m.squares += (image.grey[i] - m.mean) * (image.grey[i] - m.mean);
    }
    return m;
}

}  // namespace sonocase::pipeline
