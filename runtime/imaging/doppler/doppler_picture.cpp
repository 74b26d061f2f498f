// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/doppler/doppler_picture.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace sonocase::runtime::doppler {
namespace {

std::uint8_t byte(double v) {
    return static_cast<std::uint8_t>(std::clamp(v, 0.0, 255.0) + 0.5);
}

std::array<Rgb, 256> colour_palette() {
    std::array<Rgb, 256> map{};
    for (int i = 1; i < 256; ++i) {
        const double v = (i - 128) / 127.0, size = std::abs(v);
        const double base = 90 + 165 * std::min(1.6 * size, 1.0);
        const double second = 255 * std::clamp(1.7 * size - 0.7, 0.0, 1.0);
        map[i] = v >= 0 ? Rgb{byte(base), byte(second), byte(10)}
                        : Rgb{byte(10), byte(0.25 * base + second), byte(base)};
    }
    return map;
}

std::array<Rgb, 256> power_palette() {
    std::array<Rgb, 256> map{};
    for (int i = 1; i < 256; ++i) {
        const double p = i / 255.0;
        map[i] = {byte(70 + 260 * p), byte(300 * p - 90), byte(220 * p - 150)};
    }
    return map;
}

}  // namespace

const std::array<Rgb, 256>& palette(DopplerMode mode) {
    static const std::array<Rgb, 256> colours = colour_palette(), powers = power_palette();
    return mode == DopplerMode::power ? powers : colours;
}

void compose(std::span<const std::uint8_t> grey,
             std::span<const std::uint8_t> overlay,
             DopplerMode mode,
             std::span<std::uint8_t> rgb) {
    assert(overlay.size() == grey.size() && rgb.size() == 3 * grey.size());
    const auto& map = palette(mode);
    for (std::size_t i = 0; i < grey.size(); ++i) {
        const Rgb c = overlay[i] == 0 ? Rgb{grey[i], grey[i], grey[i]} : map[overlay[i]];
        rgb[3 * i] = c[0];
        rgb[3 * i + 1] = c[1];
        rgb[3 * i + 2] = c[2];
    }
}

void draw_spectrum(const SpectralStrip& strip,
                   double seconds,
                   int width,
                   int height,
                   std::span<std::uint8_t> grey) {
    const double per_px = seconds * kLinesPerSecond / width;
    for (int x = 0; x < width; ++x) {
        const auto k = strip.last() - static_cast<std::int64_t>((width - 1 - x) * per_px);
        const bool known = k >= 0 && strip.last() - k < kStripLines && strip.line(k).number == k;
        for (int y = 0; y < height; ++y) {
            const double bin = kBins * (1 - (y + 0.5) / height);
            const int b = static_cast<int>(std::clamp(bin, 0.0, kBins - 1.0));
            std::uint8_t value = known ? strip.line(k).shade[b] : 0;
            const double zero = kBins * (0.5 - strip.baseline());
            if (std::abs(bin - zero) < 0.6 * kBins / height)
                value = std::max<std::uint8_t>(value, 90);
            grey[static_cast<std::size_t>(y) * width + x] = value;
        }
        if (!known || strip.line(k).edge_turns == 0) continue;
        const double bin =
            kBins * (0.5 - strip.baseline() + static_cast<double>(strip.line(k).edge_turns));
        const int y = static_cast<int>(height * (1 - bin / kBins));
        if (y >= 0 && y < height) grey[static_cast<std::size_t>(y) * width + x] = 255;
    }
}

void draw_m_mode(const MMode& strip, int width, int height, std::span<std::uint8_t> grey) {
    for (int x = 0; x < width; ++x) {
        const std::int64_t k = strip.last() - (width - 1 - x) * MMode::kColumns / width;
        const bool known = k >= 0 && strip.last() - k < MMode::kColumns;
        for (int y = 0; y < height; ++y)
            grey[static_cast<std::size_t>(y) * width + x] =
                known ? strip.column(k)[y * MMode::kRows / height] : 0;
    }
}

}  // namespace sonocase::runtime::doppler

namespace sonocase::runtime {

void draw_doppler(const DopplerView& view,
                  DopplerMode mode,
                  std::span<const std::uint8_t> pixels,
                  int width,
                  int height,
                  std::span<std::uint8_t> rgb) {
    const int below = doppler_rows(mode, height) - height;
    const auto row = static_cast<std::size_t>(width);
    const std::size_t picture = row * height, strip = row * below;
    assert(pixels.size() == picture && rgb.size() == 3 * (picture + strip));
    doppler::compose(pixels, view.overlay(), mode, rgb.first(3 * picture));
    if (below == 0) return;
    // The strip is drawn in grey into the end of its own place, and spread out from the front.
    const std::span<std::uint8_t> grey = rgb.subspan(3 * picture + 2 * strip, strip);
    if (mode == DopplerMode::spectral)
        doppler::draw_spectrum(view.spectrum(), kStripSeconds, width, below, grey);
    else
        doppler::draw_m_mode(view.m_mode(), width, below, grey);
    std::uint8_t* to = rgb.data() + 3 * picture;
    for (std::size_t i = 0; i < strip; ++i) {
        const std::uint8_t value = grey[i];
        for (int c = 0; c < 3; ++c) *to++ = value;
    }
}

}  // namespace sonocase::runtime
