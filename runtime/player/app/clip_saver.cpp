// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/clip_saver.h"

#include <algorithm>
#include <cmath>

#include "runtime/imaging/doppler/doppler_picture.h"
#include "runtime/player/session/gif_file.h"

namespace sonocase::runtime::inline player_app {
namespace {

constexpr double kFramesPerS = 10;
constexpr int kMaxSide = 480;

constexpr int kGreys = 64;  // speckle in 256 makes the film four times as large, and looks the same

// Greys, and every second or third colour of each Doppler map: a film of any mode needs no other.
const GifColours& film_colours() {
    static const GifColours colours = [] {
        GifColours all{};
        for (std::size_t i = 0; i < kGreys; ++i) all[i].fill(static_cast<std::uint8_t>(4 * i));
        std::size_t at = kGreys;
        for (const DopplerMode mode : {DopplerMode::colour, DopplerMode::power}) {
            for (std::size_t i = 0; i < 96; ++i)
                all[at++] = doppler::palette(mode)[1 + i * 254 / 95];
        }
        return all;
    }();
    return colours;
}

// The nearest of those colours; a table holds it for each colour of 5 bits per part.
std::uint8_t nearest_colour(int red, int green, int blue) {
    static const std::vector<std::uint8_t> nearest = [] {
        std::vector<std::uint8_t> table(1 << 15);
        for (int i = 0; i < 1 << 15; ++i) {
            const int wanted[] = {(i >> 10) * 8 + 4, (i >> 5 & 31) * 8 + 4, (i & 31) * 8 + 4};
            int best = 1 << 30;
            for (std::size_t c = 0; c < film_colours().size(); ++c) {
                int off = 0;
                for (std::size_t k = 0; k < 3; ++k) {
                    const int by = film_colours()[c][k] - wanted[k];
                    off += by * by;
                }
                if (off >= best) continue;
                best = off;
                table[i] = static_cast<std::uint8_t>(c);
            }
        }
        return table;
    }();
    return nearest[(red >> 3) << 10 | (green >> 3) << 5 | blue >> 3];
}

// Means of blocks of `by` x `by` pixels, as values of film_colours().
std::vector<std::uint8_t> reduced(const ScanFrame& frame, int by, int width, int height) {
    std::vector<std::uint8_t> out(static_cast<std::size_t>(width) * height);
    const std::vector<std::uint8_t>& rgb = frame.doppler.rgb;
    const bool coloured = rgb.size() == 3 * frame.pixels.size();
    const int blocks = by * by;
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            int sum[3] = {blocks / 2, blocks / 2, blocks / 2};
            for (int v = 0; v < by; ++v) {
                for (int u = 0; u < by; ++u) {
                    const std::size_t i =
                        static_cast<std::size_t>(by * y + v) * frame.width_px + by * x + u;
                    for (std::size_t k = 0; k < 3; ++k)
                        sum[k] += coloured ? rgb[3 * i + k] : frame.pixels[i];
                }
            }
            const int red = sum[0] / blocks, green = sum[1] / blocks, blue = sum[2] / blocks;
            const bool grey = red == green && green == blue;
            out[static_cast<std::size_t>(y) * width + x] =
                grey ? static_cast<std::uint8_t>(red / (256 / kGreys))
                     : nearest_colour(red, green, blue);
        }
    }
    return out;
}

}  // namespace

ClipSaver::ClipSaver(int kept, double span_s, bool was_frozen)
    : kept_(std::max(kept, 1)), was_frozen_(was_frozen) {
    const double rate = span_s > 0 ? kept_ / span_s : kCineRate;
    step_ = std::max(1, static_cast<int>(std::lround(rate / kFramesPerS)));
    back_ = (kept_ - 1) / step_ * step_;
}

bool ClipSaver::take(const ScanFrame& frame) {
    if (!frame.frozen || frame.cine_back != back_ || frame.width_px <= 0) return true;
    const int by =
        std::max(1, (std::max(frame.width_px, frame.height_px) + kMaxSide - 1) / kMaxSide);
    if (frames_.empty()) {
        width_px_ = frame.width_px / by;
        height_px_ = frame.height_px / by;
    }
    if (frame.width_px / by != width_px_ || frame.height_px / by != height_px_) return false;
    frames_.push_back(reduced(frame, by, width_px_, height_px_));
    times_s_.push_back(frame.record.input.time_s);
    back_ -= step_;
    return back_ >= 0;
}

double ClipSaver::share() const {
    return double(frames_.size()) * step_ / kept_;
}

Status ClipSaver::write(const std::string& path) const {
    std::vector<int> delays_cs;
    for (std::size_t i = 0; i < times_s_.size(); ++i) {
        const double seconds = i + 1 < times_s_.size() ? times_s_[i + 1] - times_s_[i] : 0.1;
        delays_cs.push_back(std::clamp(static_cast<int>(std::lround(100 * seconds)), 2, 100));
    }
    return write_gif(path, width_px_, height_px_, film_colours(), frames_, delays_cs);
}

}  // namespace sonocase::runtime::inline player_app
