// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/reference/physical_reference.h"

#include <algorithm>
#include <cmath>

namespace sonocase::runtime {
namespace {

using namespace physical;

int reflect(int l, int n) {
    if (l < 0) l = -1 - l;
    if (l >= n) l = 2 * n - 1 - l;
    return std::clamp(l, 0, n - 1);
}

}  // namespace

void render_physical_reference(const PhysicalScene& s,
                               const ScanGeometry& g,
                               const Tables& tables,
                               const PhysicalNoise& noise,
                               const PhysicalFrame& f,
                               std::span<std::uint8_t> pixels) {
    const PhysicalEffects& on = f.effects;
    const int lines = g.scanlines, samples = g.samples;
    const auto at = [&](int k, int l) {
        return static_cast<std::size_t>(k) * static_cast<std::size_t>(lines) +
               static_cast<std::size_t>(l);
    };
    const std::size_t count = static_cast<std::size_t>(samples) * static_cast<std::size_t>(lines);
    const auto tile = [&](const std::vector<std::int8_t>& t, NoiseUse use, std::uint32_t frame,
                          int k, int l) {
        return t[noise_start(f.seed, use, frame, k) + static_cast<std::uint32_t>(l)] / 32.0;
    };

    // 1. Down each beam: scatterers, interfaces, light that is left, tails.
    const auto [q_re, q_im, light, tail] = reference_beams(s, g, tables, noise, f);

    // 2. The light is that of the whole aperture: boxes of 5 and 3 beams.
    std::vector<double> f_re(count), f_im(count);
    for (int k = 0; k < samples; ++k) {
        for (int l = 0; l < lines; ++l) {
            double smooth = 0;
            constexpr std::array<double, 7> kBoxes{1 / 15.0, 2 / 15.0, 3 / 15.0, 3 / 15.0,
                                                   3 / 15.0, 2 / 15.0, 1 / 15.0};
            for (int j = -3; j <= 3; ++j)
                smooth +=
                    kBoxes[static_cast<std::size_t>(j + 3)] * light[at(k, reflect(l + j, lines))];
            f_re[at(k, l)] = q_re[at(k, l)] * smooth;
            f_im[at(k, l)] = q_im[at(k, l)] * smooth;
        }
    }

    // 3. Point spread across the beams.
    if (on.point_spread) {
        const std::vector<double> in_re = f_re, in_im = f_im;
        for (int k = 0; k < samples; ++k) {
            const Row& row = tables.rows[static_cast<std::size_t>(k)];
            for (int l = 0; l < lines; ++l) {
                double re = 0, im = 0;
                for (int j = -row.reach; j <= row.reach; ++j) {
                    const double tap =
                        static_cast<double>(row.lateral[static_cast<std::size_t>(kMaxLateral + j)]);
                    re += tap * in_re[at(k, reflect(l + j, lines))];
                    im += tap * in_im[at(k, reflect(l + j, lines))];
                }
                f_re[at(k, l)] = re;
                f_im[at(k, l)] = im;
            }
        }
    }

    // 4. Clutter and electronic noise, as they reach the receiver: before the gain and its filter.
    for (int k = 0; k < samples; ++k) {
        const Row& row = tables.rows[static_cast<std::size_t>(k)];
        for (int l = 0; l < lines; ++l) {
            const double near = on.near_field ? row.near_field * row.near_field : 0;
            const double clutter = std::sqrt(0.5 * (tail[at(k, l)] + near)) / row.gain;
            f_re[at(k, l)] += clutter * tile(noise.streak, NoiseUse::clutter_re, 0, k, l);
            f_im[at(k, l)] += clutter * tile(noise.streak, NoiseUse::clutter_im, 0, k, l);
            if (!on.noise) continue;
            double n_re = 0, n_im = 0;
            for (int j = 0; j < (on.persistence ? kPersistedFrames : 1); ++j) {
                const double w = on.persistence ? kPersistence[static_cast<std::size_t>(j)] : 1;
                n_re += w * tile(noise.fine, NoiseUse::electronic_re,
                                 f.frame - static_cast<std::uint32_t>(j), k, l);
                n_im += w * tile(noise.fine, NoiseUse::electronic_im,
                                 f.frame - static_cast<std::uint32_t>(j), k, l);
            }
            f_re[at(k, l)] += row.noise / row.gain * std::sqrt(0.5) * n_re;
            f_im[at(k, l)] += row.noise / row.gain * std::sqrt(0.5) * n_im;
        }
    }

    // 5. Point spread along the beam, gain; power of the envelope, and its mean nearby for the
    // haze.
    std::vector<double> power(count);
    const int cells_k = (samples + kHazeCell - 1) / kHazeCell,
              cells_l = (lines + kHazeCell - 1) / kHazeCell;
    std::vector<double> mean(static_cast<std::size_t>(cells_k * cells_l), 0.0),
        cell_n(mean.size(), 0.0);
    for (int k = 0; k < samples; ++k) {
        const Row& row = tables.rows[static_cast<std::size_t>(k)];
        for (int l = 0; l < lines; ++l) {
            double re = f_re[at(k, l)], im = f_im[at(k, l)];
            if (on.point_spread) {
                re = im = 0;
                for (int j = -tables.axial_reach; j <= tables.axial_reach; ++j) {
                    if (k + j < 0 || k + j >= samples) continue;
                    const double tap =
                        static_cast<double>(tables.axial[static_cast<std::size_t>(kMaxAxial + j)]);
                    re += tap * f_re[at(k + j, l)];
                    im += tap * f_im[at(k + j, l)];
                }
            }
            power[at(k, l)] = (re * re + im * im) * row.gain * row.gain;
            const auto cell = static_cast<std::size_t>(k / kHazeCell * cells_l + l / kHazeCell);
            mean[cell] += std::sqrt(power[at(k, l)]);
            cell_n[cell] += 1;
        }
    }
    if (on.haze) {
        std::vector<double> wide(mean.size());
        for (int ck = 0; ck < cells_k; ++ck) {
            for (int cl = 0; cl < cells_l; ++cl) {
                double sum = 0, n = 0;
                for (int j = std::max(cl - kHazeReach, 0);
                     j <= std::min(cl + kHazeReach, cells_l - 1); ++j) {
                    sum += mean[static_cast<std::size_t>(ck * cells_l + j)];
                    n += cell_n[static_cast<std::size_t>(ck * cells_l + j)];
                }
                wide[static_cast<std::size_t>(ck * cells_l + cl)] =
                    std::pow(10.0, kHazeDb / 20) * sum / n;
            }
        }
        for (int k = 0; k < samples; ++k) {
            for (int l = 0; l < lines; ++l) {
                const double ck = std::clamp((k + 0.5) / kHazeCell - 0.5, 0.0, cells_k - 1.0);
                const double cl = std::clamp((l + 0.5) / kHazeCell - 0.5, 0.0, cells_l - 1.0);
                const int k0 = std::min(static_cast<int>(ck), std::max(cells_k - 2, 0)),
                          l0 = std::min(static_cast<int>(cl), std::max(cells_l - 2, 0));
                const int k1 = std::min(k0 + 1, cells_k - 1), l1 = std::min(l0 + 1, cells_l - 1);
                const auto w = [&](int a, int b) {
                    return wide[static_cast<std::size_t>(a * cells_l + b)];
                };
                const double haze =
                    (w(k0, l0) * (1 - (cl - l0)) + w(k0, l1) * (cl - l0)) * (1 - (ck - k0)) +
                    (w(k1, l0) * (1 - (cl - l0)) + w(k1, l1) * (cl - l0)) * (ck - k0);
                const double mix = static_cast<double>(k % kHazeGrain) / kHazeGrain;
                const double unit = 1 / std::sqrt(mix * mix + (1 - mix) * (1 - mix));
                const auto draw = [&](NoiseUse use) {
                    return unit * ((1 - mix) * tile(noise.streak, use, 0, k / kHazeGrain, l) +
                                   mix * tile(noise.streak, use, 0, k / kHazeGrain + 1, l));
                };
                const double a = draw(NoiseUse::haze_re), b = draw(NoiseUse::haze_im);
                power[at(k, l)] += haze * haze * 0.5 * (a * a + b * b);
            }
        }
    }

    // 6. Log compression, post-filter, grey map.
    std::vector<double> grey(count);
    for (int k = 0; k < samples; ++k) {
        for (int l = 0; l < lines; ++l) {
            const double db = 10 * std::log10(power[at(k, l)] + 1e-12) +
                              static_cast<double>(f.row_gain_db[static_cast<std::size_t>(k)]);
            grey[at(k, l)] =
                std::clamp(kGreyOfUnit + 255 * db / f.dynamic_range_db, kGreyFloor, kGreyCeiling);
        }
    }
    if (on.post_filter) {
        std::vector<double> across(count);
        for (int k = 0; k < samples; ++k) {
            for (int l = 0; l < lines; ++l) {
                across[at(k, l)] = 0.25 * grey[at(k, reflect(l - 1, lines))] +
                                   0.5 * grey[at(k, l)] + 0.25 * grey[at(k, reflect(l + 1, lines))];
            }
        }
        for (int k = 0; k < samples; ++k) {
            for (int l = 0; l < lines; ++l) {
                grey[at(k, l)] = 0.25 * across[at(std::max(k - 1, 0), l)] + 0.5 * across[at(k, l)] +
                                 0.25 * across[at(std::min(k + 1, samples - 1), l)];
            }
        }
    }
    std::vector<double> shade(count);
    for (std::size_t i = 0; i < count; ++i) {
        double t = std::clamp(grey[i] / 255, 0.0, 1.0);
        if (on.grey_map) t -= kGreyMap * t * (1 - t) * (1 - 2 * t);
        shade[i] = std::nearbyint(255 * t);
    }

    // 7. Scan conversion.
    for (int r = 0; r < g.height_px; ++r) {
        for (int c = 0; c < g.width_px; ++c) {
            double line = 0, sample = 0, value = 0;
            if (g.locate(g.pixel_centre(c, r), line, sample)) {
                line = std::clamp(line, 0.0, lines - 1.0);
                sample = std::clamp(sample, 0.0, samples - 1.0);
                const int l = std::min(static_cast<int>(line), std::max(lines - 2, 0)),
                          k = std::min(static_cast<int>(sample), std::max(samples - 2, 0));
                const int l1 = std::min(l + 1, lines - 1), k1 = std::min(k + 1, samples - 1);
                value = (shade[at(k, l)] * (1 - (line - l)) + shade[at(k, l1)] * (line - l)) *
                            (1 - (sample - k)) +
                        (shade[at(k1, l)] * (1 - (line - l)) + shade[at(k1, l1)] * (line - l)) *
                            (sample - k);
            }
            pixels[static_cast<std::size_t>(r) * static_cast<std::size_t>(g.width_px) +
                   static_cast<std::size_t>(c)] = static_cast<std::uint8_t>(std::lround(value));
        }
    }
}

}  // namespace sonocase::runtime
