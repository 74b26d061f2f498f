// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/reference/physical_reference.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "runtime/imaging/physical/model/cell_effects.h"
#include "runtime/imaging/physical/model/gas_faces.h"
#include "runtime/imaging/physical/reference/reference_beams.h"
#include "runtime/imaging/physical/reference/reference_cells.h"

namespace sonocase::runtime {
namespace {

using namespace physical;

// Mirrors an index beyond the outermost beams.
int reflect(int l, int n) {
    if (l < 0) l = -1 - l;
    if (l >= n) l = 2 * n - 1 - l;
    return std::clamp(l, 0, n - 1);
}

// Calls work(k, l) for every sample.
template <class Work>
void for_samples(const ReferenceInput& in, const Work& work) {
    for (int k = 0; k < in.geometry.samples; ++k) {
        for (int l = 0; l < in.geometry.scanlines; ++l) work(k, l);
    }
}

// What the whole aperture sees of a plane, so that shadows have a penumbra: every other beam of
// boxes of 10 and 6.
double seen_by_aperture(const ReferenceInput& in, const Plane& plane, int k, int l) {
    constexpr std::array<double, 7> kBoxes{1 / 15.0, 2 / 15.0, 3 / 15.0, 3 / 15.0,
                                           3 / 15.0, 2 / 15.0, 1 / 15.0};
    double smooth = 0;
    for (int j = -3; j <= 3; ++j)
        smooth += kBoxes[j + 3] * plane[in.at(k, reflect(l + 2 * j, in.geometry.scanlines))];
    return smooth;
}

// The light that remains after neighbouring beams have shared the light above.
Plane spread_light(const ReferenceInput& in, const Plane& light) {
    const int beams = in.tables.spread_beams, lines = in.geometry.scanlines;
    if (beams == 0) return light;
    const double share = in.tables.spread_share;
    Plane out = light;
    for (int k = 1; k < in.geometry.samples; ++k) {
        for (int l = 0; l < lines; ++l) {
            const double was = light[in.at(k - 1, l)];
            const double above = (1 - 2 * share) * out[in.at(k - 1, l)] +
                                 share * (out[in.at(k - 1, reflect(l - beams, lines))] +
                                          out[in.at(k - 1, reflect(l + beams, lines))]);
            const bool lit = was > 0 && above > kMinLight;
            out[in.at(k, l)] = lit ? above * (light[in.at(k, l)] / was) : 0;
        }
    }
    return out;
}

ComplexPlane light_echoes(const ReferenceInput& in,
                          const Plane& light,
                          const ComplexPlane& echoes) {
    ComplexPlane out{Plane(in.count()), Plane(in.count())};
    for_samples(in, [&](int k, int l) {
        const double seen = seen_by_aperture(in, light, k, l);
        out.re[in.at(k, l)] = echoes.re[in.at(k, l)] * seen;
        out.im[in.at(k, l)] = echoes.im[in.at(k, l)] * seen;
    });
    return out;
}

// Point spread across the beams.
void spread_across(const ReferenceInput& in, ComplexPlane& echoes) {
    const ComplexPlane from = echoes;
    for_samples(in, [&](int k, int l) {
        const Row& row = in.row(k);
        double re = 0, im = 0;
        for (int j = -row.reach; j <= row.reach; ++j) {
            const double tap = static_cast<double>(row.lateral[kMaxLateral + j]);
            const std::size_t at = in.at(k, reflect(l + j, in.geometry.scanlines));
            re += tap * from.re[at];
            im += tap * from.im[at];
        }
        echoes.re[in.at(k, l)] = re;
        echoes.im[in.at(k, l)] = im;
    });
}

// Adds tails, ringing and reverberation: echoes of their own, before the point spread and the gain.
// One look carries them for all. The grain behind a lung that slides is that of LungGrain's fields.
void add_clutter_noise(const ReferenceInput& in,
                       const BeamSamples& beams,
                       const Plane& clutter,
                       ComplexPlane& echoes) {
    const LungGrain grain = lung_grain(in.frame);
    for_samples(in, [&](int k, int l) {
        const Row& row = in.row(k);
        const auto add = [&](double power, std::uint32_t field) {
            const double level =
                std::sqrt(static_cast<double>(row.looks)) * std::sqrt(0.5 * power) / row.gain;
            const auto draw = [&](NoiseUse use) {
                return level * in.draw(in.noise.white, use, field, k, l);
            };
            echoes.re[in.at(k, l)] += draw(NoiseUse::clutter_re);
            echoes.im[in.at(k, l)] += draw(NoiseUse::clutter_im);
        };
        const double face = face_clutter(row, in.frame.effects),
                     others = row.drawn * (face * face + clutter[in.at(k, l)]),
                     tail = seen_by_aperture(in, beams.tail, k, l);
        if (!in.frame.effects.gas_ring_down || beams.slides[l] == 0) {
            add(tail + others, 0);
            return;
        }
        add(others, 0);
        for (std::uint32_t n = 0; n < 2; ++n)
            add(tail * static_cast<double>(grain.weight[n] * grain.weight[n]), grain.field + n);
    });
}

// Adds electronic noise, which each beam has of its own: before the gain and its filter, in one
// look for all.
void add_electronic_noise(const ReferenceInput& in, ComplexPlane& echoes) {
    const PhysicalEffects& on = in.frame.effects;
    if (!on.noise || !has_noise(in.tables)) return;
    for_samples(in, [&](int k, int l) {
        const Row& row = in.row(k);
        double n_re = 0, n_im = 0;
        for (int j = 0; j < (on.persistence ? in.tables.persisted : 1); ++j) {
            const double w = on.persistence ? in.tables.persistence[j] : 1;
            const std::uint32_t number = in.frame.frame - static_cast<std::uint32_t>(j);
            n_re += w * in.draw(in.noise.fine, NoiseUse::electronic_re, number, k, l);
            n_im += w * in.draw(in.noise.fine, NoiseUse::electronic_im, number, k, l);
        }
        const double level = std::sqrt(0.5 * row.looks) * row.noise / row.gain;
        echoes.re[in.at(k, l)] += level * n_re;
        echoes.im[in.at(k, l)] += level * n_im;
    });
}

// Point spread along the beam, and gain: the power of the envelope.
Plane envelope_power(const ReferenceInput& in, const ComplexPlane& echoes) {
    Plane power(in.count());
    for_samples(in, [&](int k, int l) {
        const Row& row = in.row(k);
        double re = echoes.re[in.at(k, l)], im = echoes.im[in.at(k, l)];
        if (in.frame.effects.point_spread) {
            re = im = 0;
            for (int j = -in.tables.axial_reach; j <= in.tables.axial_reach; ++j) {
                if (k + j < 0 || k + j >= in.geometry.samples) continue;
                const double tap = static_cast<double>(in.tables.axial[kMaxAxial + j]);
                re += tap * echoes.re[in.at(k + j, l)];
                im += tap * echoes.im[in.at(k + j, l)];
            }
        }
        power[in.at(k, l)] = (re * re + im * im) * row.gain * row.gain;
    });
    return power;
}

// Mean of the reverberation over neighbouring beams.
Plane mean_clutter(const ReferenceInput& in, const Plane& clutter) {
    Plane mean(in.count(), 0.0);
    if (!in.frame.effects.clutter) return mean;
    for_samples(in, [&](int k, int l) {
        const int reach = in.row(k).haze_reach;
        for (int j = -reach; j <= reach; ++j)
            mean[in.at(k, l)] +=
                clutter[in.at(k, reflect(l + j, in.geometry.scanlines))] / (2 * reach + 1);
    });
    return mean;
}

// Adds the steady power that the looks leave of the face's ringing and of reverberation.
void add_steady(const ReferenceInput& in, const Plane& clutter, Plane& power) {
    for_samples(in, [&](int k, int l) {
        const Row& row = in.row(k);
        const double face = face_clutter(row, in.frame.effects);
        power[in.at(k, l)] += (1 - row.drawn) * (face * face + clutter[in.at(k, l)]);
    });
}

// Adds a look to the mean of the detected looks.
void add_look(const ReferenceInput& in, int look, const Plane& of_look, Plane& power) {
    for_samples(in, [&](int k, int l) {
        const int looks = in.row(k).looks;
        if (look < looks) power[in.at(k, l)] += of_look[in.at(k, l)] / looks;
    });
}

// Haze of side lobes: the mean envelope nearby, some decibels below.
class Haze {
  public:
    Haze(const ReferenceInput& in, const Plane& power)
        : cells_k_((in.geometry.samples + kHazeCell - 1) / kHazeCell),
          cells_l_((in.geometry.scanlines + kHazeCell - 1) / kHazeCell),
          wide_(cells_k_ * cells_l_) {
        Plane sum(wide_.size(), 0.0), number(wide_.size(), 0.0);
        for_samples(in, [&](int k, int l) {
            const int cell = at(k / kHazeCell, l / kHazeCell);
            sum[cell] += std::sqrt(power[in.at(k, l)]);
            number[cell] += 1;
        });
        for (int ck = 0; ck < cells_k_; ++ck) {
            for (int cl = 0; cl < cells_l_; ++cl) {
                double s = 0, n = 0;
                for (int j = std::max(cl - kHazeReach, 0);
                     j <= std::min(cl + kHazeReach, cells_l_ - 1); ++j) {
                    s += sum[at(ck, j)];
                    n += number[at(ck, j)];
                }
                wide_[at(ck, cl)] =
                    std::pow(10.0, in.tables.machine.haze.side_lobe_db / 20) * s / n;
            }
        }
    }

    // Amplitude at a sample, between the middles of the cells.
    double amplitude(int k, int l) const {
        const double ck = std::clamp((k + 0.5) / kHazeCell - 0.5, 0.0, cells_k_ - 1.0);
        const double cl = std::clamp((l + 0.5) / kHazeCell - 0.5, 0.0, cells_l_ - 1.0);
        const int k0 = std::min(static_cast<int>(ck), std::max(cells_k_ - 2, 0)),
                  l0 = std::min(static_cast<int>(cl), std::max(cells_l_ - 2, 0));
        const int k1 = std::min(k0 + 1, cells_k_ - 1), l1 = std::min(l0 + 1, cells_l_ - 1);
        const auto w = [&](int a, int b) { return wide_[at(a, b)]; };
        return (w(k0, l0) * (1 - (cl - l0)) + w(k0, l1) * (cl - l0)) * (1 - (ck - k0)) +
               (w(k1, l0) * (1 - (cl - l0)) + w(k1, l1) * (cl - l0)) * (ck - k0);
    }

  private:
    int at(int ck, int cl) const { return ck * cells_l_ + cl; }

    int cells_k_, cells_l_;
    Plane wide_;
};

void add_haze(const ReferenceInput& in, Plane& power) {
    const Haze haze(in, power);
    for_samples(in, [&](int k, int l) {
        const double mix = static_cast<double>(k % kHazeGrain) / kHazeGrain;
        const double unit = 1 / std::sqrt(mix * mix + (1 - mix) * (1 - mix));
        const auto draw = [&](NoiseUse use) {
            return unit * ((1 - mix) * in.draw(in.noise.streak, use, 0, k / kHazeGrain, l) +
                           mix * in.draw(in.noise.streak, use, 0, k / kHazeGrain + 1, l));
        };
        const double a = draw(NoiseUse::haze_re), b = draw(NoiseUse::haze_im);
        const double h = haze.amplitude(k, l);
        power[in.at(k, l)] += h * h * 0.5 * (a * a + b * b);
    });
}

// Each sample's grey and its eight neighbours', weighted 1 2 1 either way.
Plane binomial(const ReferenceInput& in, const Plane& grey) {
    const int lines = in.geometry.scanlines, samples = in.geometry.samples;
    Plane across(in.count()), out(in.count());
    for_samples(in, [&](int k, int l) {
        across[in.at(k, l)] = 0.25 * grey[in.at(k, reflect(l - 1, lines))] +
                              0.5 * grey[in.at(k, l)] +
                              0.25 * grey[in.at(k, reflect(l + 1, lines))];
    });
    for_samples(in, [&](int k, int l) {
        out[in.at(k, l)] = 0.25 * across[in.at(std::max(k - 1, 0), l)] + 0.5 * across[in.at(k, l)] +
                           0.25 * across[in.at(std::min(k + 1, samples - 1), l)];
    });
    return out;
}

// The machine's map, post-filter or edge enhancement: grey in [0, 255], whole numbers.
Plane grey_of(const ReferenceInput& in, const Plane& power) {
    const MachineGrey& map = in.tables.machine.grey;
    const GreyLine line = grey_line(map, in.frame.dynamic_range_db);
    const bool logarithm = has_logarithm(in.tables);
    Plane grey(in.count());
    const double grain_db = 0.5 * kDbPerLog2 * grain_of(in.tables, in.frame.effects);
    for_samples(in, [&](int k, int l) {
        const double own_db =
            grain_db > 0 ? grain_db * in.draw(in.noise.white, NoiseUse::grain, 0, k, l) : 0;
        const double db = 10 * std::log10(power[in.at(k, l)] + 1e-12) + own_db + in.row(k).unit_db +
                          static_cast<double>(in.frame.row_gain_db[k]);
        double g = line.of_unit + line.per_db * db;
        if (!logarithm) {
            g = map.floor + std::exp2(std::min(g, 12.0));
            if (g > map.knee) g = map.knee + map.knee_slope * (g - map.knee);
        }
        grey[in.at(k, l)] = std::clamp(g, lowest_grey(map), kGreyCeiling);
    });
    const double weight = filter_weight(in.tables, in.frame.effects);
    if (weight != 0) {
        const Plane filtered = binomial(in, grey);
        for (std::size_t i = 0; i < grey.size(); ++i) grey[i] += weight * (filtered[i] - grey[i]);
    }
    for (double& g : grey) {
        double t = std::clamp(g / 255, 0.0, 1.0);
        if (in.frame.effects.grey_map && logarithm) t -= kGreyMap * t * (1 - t) * (1 - 2 * t);
        g = std::nearbyint(255 * t);
    }
    return grey;
}

void convert(const ReferenceInput& in, const Plane& shade, std::span<std::uint8_t> pixels) {
    const ScanGeometry& g = in.geometry;
    const int lines = g.scanlines, samples = g.samples;
    for (int r = 0; r < g.height_px; ++r) {
        for (int c = 0; c < g.width_px; ++c) {
            double line = 0, sample = 0, value = 0;
            if (g.locate(g.pixel_centre(c, r), line, sample)) {
                line = std::clamp(line, 0.0, lines - 1.0);
                sample = std::clamp(sample, 0.0, samples - 1.0);
                const int l = std::min(static_cast<int>(line), std::max(lines - 2, 0)),
                          k = std::min(static_cast<int>(sample), std::max(samples - 2, 0));
                const int l1 = std::min(l + 1, lines - 1), k1 = std::min(k + 1, samples - 1);
                value =
                    (shade[in.at(k, l)] * (1 - (line - l)) + shade[in.at(k, l1)] * (line - l)) *
                        (1 - (sample - k)) +
                    (shade[in.at(k1, l)] * (1 - (line - l)) + shade[in.at(k1, l1)] * (line - l)) *
                        (sample - k);
            }
            pixels[static_cast<std::size_t>(r) * g.width_px + static_cast<std::size_t>(c)] =
                static_cast<std::uint8_t>(std::lround(value));
        }
    }
}

}  // namespace

void render_physical_reference(const PhysicalScene& scene,
                               const ScanGeometry& geometry,
                               const Tables& tables,
                               const PhysicalNoise& noise,
                               const PhysicalFrame& frame,
                               std::span<std::uint8_t> pixels) {
    const ReferenceInput in{scene, geometry, tables, noise, frame};
    const BeamSamples beams = reference_beams(in);
    const Plane clutter = mean_clutter(in, beams.clutter), light = spread_light(in, beams.light);
    Plane power(in.count(), 0.0);
    for (int look = 0; look < tables.looks; ++look) {
        ComplexPlane echoes = light_echoes(in, light, beams.looks[look]);
        if (look == 0) add_clutter_noise(in, beams, clutter, echoes);
        if (frame.effects.point_spread) spread_across(in, echoes);
        if (look == 0) add_electronic_noise(in, echoes);
        add_look(in, look, envelope_power(in, echoes), power);
    }
    add_steady(in, clutter, power);
    const CellPlane sums = envelope_sums(in, power), even = even_gains(in, sums);
    if (frame.effects.haze && has_side_lobes(tables)) add_haze(in, power);
    for_samples(in, [&](int k, int l) { power[in.at(k, l)] *= even.between(k, l); });
    reduce_speckle(in, beams.noise, sums, even, power);
    convert(in, grey_of(in, power), pixels);
}

}  // namespace sonocase::runtime
