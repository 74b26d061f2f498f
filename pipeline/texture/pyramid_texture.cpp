// SPDX-License-Identifier: Apache-2.0

#include "pipeline/texture/pyramid_texture.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "pipeline/base/counter_random.h"
#include "pipeline/base/parallel.h"
#include "pipeline/base/periodic_volume.h"

namespace sonocase::pipeline::inline texture {
namespace {

constexpr int kBins = 256;
constexpr float kTaps[5] = {1 / 16.f, 4 / 16.f, 6 / 16.f, 4 / 16.f, 1 / 16.f};

int bin_of(const PyramidBand& band, float value) {
    if (band.high <= band.low) return 0;
    const float t = (value - band.low) / (band.high - band.low) * kBins;
    return std::clamp(static_cast<int>(t), 0, kBins - 1);
}

// Filters an image (low-pass) with taps `gap` apart. Pixels outside the image or the mask are left
// out and the weights rescaled: nothing from outside the example enters its statistics.
std::vector<float> lowpass_image(const ExampleImage& shape, const std::vector<float>& in, int gap) {
    std::vector<float> weight(in.size()), sum(in.size());
    for (std::size_t i = 0; i < in.size(); ++i) {
        weight[i] = shape.used(i) ? 1.f : 0.f;
        sum[i] = shape.used(i) ? in[i] : 0.f;
    }
    const auto pass = [&](int dx, int dy) {
        std::vector<float> new_sum(in.size()), new_weight(in.size());
        for (int y = 0; y < shape.height; ++y) {
            for (int x = 0; x < shape.width; ++x) {
                float s = 0, w = 0;
                for (int t = -2; t <= 2; ++t) {
                    const int xx = x + t * dx, yy = y + t * dy;
                    if (xx < 0 || yy < 0 || xx >= shape.width || yy >= shape.height) continue;
                    s += kTaps[t + 2] * sum[shape.index(xx, yy)];
                    w += kTaps[t + 2] * weight[shape.index(xx, yy)];
                }
                new_sum[shape.index(x, y)] = s;
                new_weight[shape.index(x, y)] = w;
            }
        }
        sum.swap(new_sum);
        weight.swap(new_weight);
    };
    pass(gap, 0);
    pass(0, gap);
    for (std::size_t i = 0; i < in.size(); ++i) sum[i] = weight[i] > 0 ? sum[i] / weight[i] : 0.f;
    return sum;
}

// Returns the levels that an example supports: the filter must fit into the image, and the coarsest
// band must hold at least 16 independent values.
int supported_levels(const ExampleImage& example, int wanted) {
    std::size_t used = 0;
    for (std::size_t i = 0; i < example.count(); ++i) used += example.used(i) ? 1 : 0;
    int levels = 1;
    while (levels < wanted) {
        const int reach = 4 * (1 << (levels - 1)) + 1;
        const double independent = static_cast<double>(used) / std::pow(4.0, levels);
        if (std::min(example.width, example.height) < reach || independent < 16) break;
        ++levels;
    }
    return levels;
}

using ExampleBands = std::vector<std::vector<float>>;  // finest first, # pixels each

ExampleBands split_bands(const ExampleImage& example, int levels) {
    ExampleBands bands;
    std::vector<float> low = example.grey;
    for (int l = 0; l + 1 < levels; ++l) {
        // With decimation the gap of the filter in pixels of the example is the same: a level of
        // half the resolution is filtered with unit gaps. Statistics need no decimated copy.
        std::vector<float> next = lowpass_image(example, low, 1 << l);
        for (std::size_t i = 0; i < low.size(); ++i) low[i] -= next[i];
        bands.push_back(std::move(low));
        low = std::move(next);
    }
    bands.push_back(std::move(low));
    return bands;
}

// Fills the joint histogram of band l with its parent. Returns the number of empty rows.
int count_pairs(std::span<const ExampleImage> examples,
                const std::vector<ExampleBands>& values,
                std::size_t l,
                const PyramidBand& parent,
                PyramidBand* band) {
    const auto each = [&](const auto& body) {
        for (std::size_t e = 0; e < examples.size(); ++e) {
            for (std::size_t i = 0; i < examples[e].count(); ++i) {
                if (!examples[e].used(i)) continue;
                body(static_cast<std::size_t>(bin_of(parent, values[e][l + 1][i])),
                     static_cast<std::uint8_t>(bin_of(*band, values[e][l][i])));
            }
        }
    };
    std::array<std::uint32_t, kBins> count{};
    each([&](std::size_t p, std::uint8_t) { ++count[p]; });
    int empty_rows = 0;
    for (std::size_t p = 0; p < kBins; ++p) {
        band->row_begin[p + 1] = band->row_begin[p] + count[p];
        if (count[p] == 0) ++empty_rows;
    }
    band->children.resize(band->row_begin[kBins]);
    std::array<std::uint32_t, kBins> next{};
    std::copy_n(band->row_begin.begin(), kBins, next.begin());
    each([&](std::size_t p, std::uint8_t c) { band->children[next[p]++] = c; });
    return empty_rows;
}

float draw_marginal(const PyramidBand& band, double u) {
    const auto i = static_cast<std::size_t>(u * static_cast<double>(band.sorted.size()));
    return band.sorted[std::min(i, band.sorted.size() - 1)];
}

float draw_conditional(const PyramidBand& band, int parent_bin, double u, double v) {
    const std::uint32_t begin = band.row_begin[parent_bin];
    const std::uint32_t end = band.row_begin[parent_bin + 1];
    if (begin == end) return draw_marginal(band, u);
    const auto pick = begin + static_cast<std::uint32_t>(u * (end - begin));
    const float width = (band.high - band.low) / kBins;
    return band.low +
           (static_cast<float>(band.children[std::min(pick, end - 1)]) + static_cast<float>(v)) *
               width;
}

}  // namespace

PyramidStatistics learn_pyramid(std::span<const ExampleImage> examples,
                                const PyramidOptions& options) {
    assert(!examples.empty());
    PyramidStatistics out;
    out.options = options;
    int levels = std::clamp(options.levels, 1, 5);
    for (const ExampleImage& example : examples) {
        const int supported = supported_levels(example, levels);
        if (supported < levels) {
            out.warnings.push_back(
                example.name + ": " + std::to_string(example.width) + " x " +
                std::to_string(example.height) + " pixels are too few for level " +
                std::to_string(supported + 1) + " of the pyramid; " + std::to_string(supported) +
                (supported == 1 ? " level is used" : " levels are used"));
            levels = supported;
        }
    }
    out.options.levels = levels;
    out.bands.resize(levels);

    std::vector<ExampleBands> values;
    for (const ExampleImage& example : examples) values.push_back(split_bands(example, levels));
    for (std::size_t l = 0; l < out.bands.size(); ++l) {
        PyramidBand& band = out.bands[l];
        for (std::size_t e = 0; e < examples.size(); ++e) {
            for (std::size_t i = 0; i < examples[e].count(); ++i) {
                if (examples[e].used(i)) band.sorted.push_back(values[e][l][i]);
            }
        }
        std::sort(band.sorted.begin(), band.sorted.end());
        band.low = band.sorted.front();
        band.high = band.sorted.back();
    }
    for (std::size_t l = 0; l + 1 < out.bands.size(); ++l)
        out.empty_rows += count_pairs(examples, values, l, out.bands[l + 1], &out.bands[l]);
    return out;
}

std::vector<float> synthesise_pyramid(const PyramidStatistics& statistics,
                                      int edge,
                                      std::uint64_t seed) {
    assert(edge >= 8 && edge <= 128 && (edge & (edge - 1)) == 0);
    const int levels = static_cast<int>(statistics.bands.size());
    std::vector<float> sum;      // of the bands so far, at the resolution of the current level
    std::vector<float> parents;  // values of the coarser band at that resolution
    for (int l = levels - 1; l >= 0; --l) {
        const PyramidBand& band = statistics.bands[l];
        const bool coarsest = l == levels - 1;
        const int shrink = statistics.options.decimate ? std::min(l, 2 + (edge > 32)) : 0;
        const int n = edge >> shrink;
        if (!coarsest && static_cast<std::size_t>(n) * n * n > parents.size()) {
            parents = double_resolution(parents, n / 2);
            sum = double_resolution(sum, n / 2);
        }
        const double weight = l == 0 ? 0 : statistics.options.weight;
        const std::uint64_t stream = derive_seed(seed, 0x9A00 + static_cast<std::uint64_t>(l));
        const std::size_t count = static_cast<std::size_t>(n) * n * n;
        std::vector<float> drawn(count);
        parallel_for(count, 1 << 14, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i) {
                const double choice = uniform_at(stream, 3 * i);
                const double u = uniform_at(stream, 3 * i + 1), v = uniform_at(stream, 3 * i + 2);
                drawn[i] =
                    coarsest || choice < weight
                        ? draw_marginal(band, u)
                        : draw_conditional(band, bin_of(statistics.bands[l + 1], parents[i]), u, v);
            }
        });
        if (!statistics.options.decimate && l > 0) {
            // The filters that made the band in the example: G_l with gaps 1, 2, ... 2^(l-1), minus
            // G_{l+1} unless it is the coarsest.
            for (int k = 0; k < l; ++k) lowpass_periodic(drawn, n, 1 << k);
            if (!coarsest) {
                std::vector<float> next = drawn;
                lowpass_periodic(next, n, 1 << l);
                for (std::size_t i = 0; i < count; ++i) drawn[i] -= next[i];
            }
            match_distribution(drawn, band.sorted);
        }
        if (coarsest) {
            sum = drawn;
        } else {
            for (std::size_t i = 0; i < count; ++i) sum[i] += drawn[i];
        }
        parents = std::move(drawn);
    }
    return sum;
}

}  // namespace sonocase::pipeline::inline texture
