// SPDX-License-Identifier: Apache-2.0

// ColourImage: what the processor makes of the cells, and the pixels.
#include <algorithm>
#include <cmath>

#include "runtime/imaging/doppler/colour_image.h"

namespace sonocase::runtime::doppler {
namespace {

double clean(double value, double low, double high, double otherwise) {
    return std::isfinite(value) ? std::clamp(value, low, high) : otherwise;
}

float power_of(double db) {
    return static_cast<float>(std::pow(10.0, db / 10));
}

}  // namespace

// Those of a frame that persistence still blends are kept from the frame before.
inline const float* ColourImage::draws(std::uint32_t cell, std::uint32_t frame) {
    CellDraws& kept = draws_[cell];
    const std::size_t slot = frame % kMostPersisted;
    float* n = kept.n[slot];
    const std::uint64_t whose = static_cast<std::uint64_t>(seed_) << 32 | frame;
    if (kept.whose[slot] == whose) return n;
    kept.whose[slot] = whose;
    const std::uint32_t key = mixed(cell, seed_ + 0x632BE5ABu * frame);
    for (std::uint32_t q = 0; q < 4; ++q) n[q] = normal(key + q * 0x9E3779B9u);
    return n;
}

void ColourImage::estimate(const DopplerSettings& settings, const ColourMoment& moment) {
    const Ensemble ensemble(settings.ensemble);
    const double gain = clean(settings.gain_db, -30, 30, 0);
    const auto shown = static_cast<float>(std::pow(10.0, (kShownDb - gain) / 10)) * ensemble.r0;
    // Below the threshold by more than noise can lift it, nothing is worked out.
    const bool noise_shows = gain > 2;
    const int persistence = std::clamp(settings.persistence, 1, kMostPersisted);
    const float weight = 1 / std::sqrt(static_cast<float>(persistence));
    const float baseline = static_cast<float>(clean(settings.baseline, -0.9, 0.9, 0)) / 2;
    const float full = power_of(12);  // power that is drawn brightest, above the threshold
    for (int row = 0; row < box_.rows; ++row) {
        const float noise = noise_[static_cast<std::size_t>(box_.first_row + row)],
                    threshold = shown * noise;
        for (int line = 0; line < box_.lines; ++line) {
            const std::size_t i = at(line, row);
            index_[i] = 0;
            if (power_[i] < 0.02f * noise && !noise_shows) continue;
            const auto cell = static_cast<std::uint32_t>((box_.first_row + row) * kColourLines +
                                                         box_.first_line + line);
            float n[4] = {0, 0, 0, 0};
            for (int k = 0; k < persistence; ++k) {
                const float* drawn = draws(cell, moment.frame - static_cast<std::uint32_t>(k));
                for (int q = 0; q < 4; ++q) n[q] += weight * drawn[q];
            }
            const ColourEstimate found =
                estimate_colour(ensemble, power_[i], re_[i], im_[i], noise, n);
            turns_[i] = found.turns;
            shown_power_[i] = found.power;
            if (!(found.power > threshold)) continue;
            ++report_.shown_cells;
            if (is_blood_[i] != 0 && vessel_[i] >= 0)
                ++shown_of_[static_cast<std::size_t>(vessel_[i])];
            if (settings.mode == DopplerMode::power) {
                const float part = (found.power - threshold) / (full * threshold);
                index_[i] = static_cast<std::uint8_t>(40 + 215 * std::min(std::sqrt(part), 1.0f));
                continue;
            }
            // A shifted baseline wraps elsewhere.
            float turns = found.turns - baseline;
            turns -= std::floor(turns + 0.5f);
            const float signed_part = (settings.invert ? -turns : turns) * 2;
            const int colour = static_cast<int>(std::lround(128 + 127 * signed_part));
            index_[i] = static_cast<std::uint8_t>(std::clamp(colour, 1, 255));
        }
    }
}

// Bilinear between cells, the shortest way round the circle of velocities. Only pixels that have a
// coloured cell among their four are touched.
void ColourImage::paint(const DopplerSettings& settings,
                        std::span<const std::uint8_t> grey,
                        std::span<std::uint8_t> overlay) const {
    const int priority = static_cast<int>(std::lround(255 * clean(settings.priority, 0, 1, 0.5)));
    const bool wraps = settings.mode != DopplerMode::power;
    for (int k = -1; k < box_.rows; ++k) {
        if (box_.first_row + k < 0) continue;
        const std::uint8_t *above = k < 0 ? no_colour_.data() : index_.data() + at(-1, k),
                           *below = k + 1 < box_.rows ? index_.data() + at(-1, k + 1)
                                                      : no_colour_.data();
        for (int l = -1; l < box_.lines; ++l) {
            const int i = l + 1;
            const int corner[4] = {above[i], above[i + 1], below[i], below[i + 1]};
            if ((corner[0] | corner[1] | corner[2] | corner[3]) == 0) continue;
            if (box_.first_line + l < 0) continue;
            for (const ColourPixels::Pixel& p :
                 pixels_.of(box_.first_line + l, box_.first_row + k)) {
                if (grey[p.index] > priority) continue;
                const int u = p.line_part, v = p.row_part;
                const int weight[4] = {(256 - u) * (256 - v), u * (256 - v), (256 - u) * v, u * v};
                int covered = 0, sum = 0, first = 0;
                for (int c = 0; c < 4; ++c) {
                    if (corner[c] == 0) continue;
                    if (covered == 0) first = corner[c];
                    int away = corner[c] - first;
                    if (wraps && away > 127) away -= 254;
                    if (wraps && away < -127) away += 254;
                    covered += weight[c];
                    sum += weight[c] * away;
                }
                if (covered < 32768) continue;
                int value = first + sum / covered;
                if (wraps && value > 255) value -= 254;
                if (wraps && value < 1) value += 254;
                overlay[p.index] = static_cast<std::uint8_t>(std::clamp(value, 1, 255));
            }
        }
    }
}

}  // namespace sonocase::runtime::doppler
