// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/sound/tones.h"

#include <cmath>

namespace sonocase::runtime {
namespace {

constexpr double kPi = 3.14159265358979323846;

// A note that swells and dies away, so that it does not click.
void add_note(std::vector<float>& pairs, double hz, double seconds) {
    const int count = static_cast<int>(kToneHz * seconds);
    for (int i = 0; i < count; ++i) {
        const double t = double(i) / count, swell = std::sin(kPi * t);
        const auto v =
            static_cast<float>(0.3 * swell * swell * std::sin(2 * kPi * hz * i / kToneHz));
        pairs.push_back(v);
        pairs.push_back(v);
    }
}

}  // namespace

std::vector<float> tone(Tone what) {
    std::vector<float> pairs;
    if (what == Tone::target) {
        add_note(pairs, 660, 0.1);
        add_note(pairs, 880, 0.12);
    } else {
        add_note(pairs, 196, 0.3);
    }
    return pairs;
}

}  // namespace sonocase::runtime
