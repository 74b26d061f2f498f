// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/paper/paper_reference.h"

#include <algorithm>
#include <cmath>

#include "runtime/imaging/noise/noise.h"
#include "runtime/imaging/paper/paper_model.h"

namespace sonocase::runtime {
namespace {

int nearest(double x) {
    return static_cast<int>(std::floor(std::clamp(x, -1e6, 1e6) + 0.5));
}

std::uint32_t material_of_point(const PaperScene& scene, Point3 p) {
    const Point3 v = scene.grid.voxel_from_point(p);
    return material_at(scene, nearest(v.x), nearest(v.y), nearest(v.z));
}

double texture_grey(const PaperScene& scene, std::uint32_t material, Point3 p) {
    const int edge = 1 << scene.edge_log2;
    const auto wrap = [&](double mm) {
        const double cell = std::floor(mm / scene.texture_voxel_mm);
        return static_cast<std::size_t>(cell - edge * std::floor(cell / edge));
    };
    const std::size_t n = static_cast<std::size_t>(edge);
    const Vector3 q = p - scene.grid.origin_mm;
    return scene.atlas[n * n * n * (material & 0x7F) + wrap(q.x) + n * (wrap(q.y) + n * wrap(q.z))];
}

}  // namespace

double paper_brightness(double depth_mm, bool attenuation) {
    return attenuation ? std::exp(-depth_mm / paper::kAttenuationLengthMm) : 1.0;
}

void render_paper_reference(const PaperScene& scene,
                            const ScanGeometry& g,
                            std::span<const std::int8_t> noise_tile,
                            const PaperFrame& frame,
                            std::span<std::uint8_t> pixels) {
    const std::size_t width = static_cast<std::size_t>(g.width_px);
    const std::size_t count = width * static_cast<std::size_t>(g.height_px);
    std::vector<double> raw(count, 0.0);

    for (int row = 0; row < g.height_px; ++row) {
        for (int column = 0; column < g.width_px; ++column) {
            const PlanePoint p = g.pixel_centre(column, row);
            double line = 0, sample = 0;
            if (!g.locate(p, line, sample)) continue;
            const Point3 x = frame.volume_from_probe * Point3{p.x, 0, p.z};
            const std::uint32_t material = material_of_point(scene, x);
            double grey = frame.effects.texture ? texture_grey(scene, material, x)
                                                : scene.flat_grey[material & 0x7F];
            if (frame.effects.needle && frame.needle != nullptr) {
                double along = 0;
                const double share = needle_share(*frame.needle, p.x, p.z, along);
                const double near_tip = std::clamp(1 - along / kTipReachMm, 0.0, 1.0);
                const double opacity =
                    frame.needle->shaft_opacity +
                    (frame.needle->tip_opacity - frame.needle->shaft_opacity) * near_tip;
                grey += (255 - grey) * share * opacity;
            }
            if (frame.effects.noise) {
                const int l = std::clamp(nearest(line), 0, g.scanlines - 1);
                const int k = std::clamp(nearest(sample), 0, g.samples - 1);
                grey += noise_tile[noise_row_start(frame.seed, frame.frame,
                                                   static_cast<std::uint32_t>(k)) +
                                   static_cast<std::uint32_t>(l)];
                grey = std::clamp(grey, 0.0, 255.0);
            }
            if (frame.effects.shadow) {
                double in_shadow_mm = 0;
                for (int k = 0; k <= sample; ++k) {
                    const PlanePoint q = g.point(line, k);
                    if (material_of_point(scene, frame.volume_from_probe * Point3{q.x, 0, q.z}) &
                        PaperScene::kShadowBit) {
                        in_shadow_mm += g.step_mm;
                    }
                }
                grey *= std::exp(-in_shadow_mm / paper::kShadowLengthMm);
            }
            raw[static_cast<std::size_t>(row) * width + static_cast<std::size_t>(column)] = grey;
        }
    }

    std::vector<double> blurred = raw;
    if (frame.effects.blur) {
        std::fill(blurred.begin(), blurred.end(), 0.0);
        for (int copy = -paper::kBlurReach; copy <= paper::kBlurReach; ++copy) {
            const double weight =
                paper::kBlurWeights[static_cast<std::size_t>(copy + paper::kBlurReach)];
            for (int row = 0; row < g.height_px; ++row) {
                for (int column = 0; column < g.width_px; ++column) {
                    double line = 0, sample = 0;
                    if (!g.locate(g.pixel_centre(column, row), line, sample)) continue;
                    // The copy's pixel that lands here; beyond the sector its edge is repeated.
                    line += copy * (g.fan ? paper::kBlurStepRad : paper::kBlurStepMm) / g.line_step;
                    const PlanePoint q = g.point(std::clamp(line, 0.0, g.scanlines - 1.0), sample);
                    const double cx =
                        std::clamp(q.x / g.mm_per_px + g.origin_x_px, 0.0, g.width_px - 1.0);
                    const double cy =
                        std::clamp(q.z / g.mm_per_px + g.origin_y_px, 0.0, g.height_px - 1.0);
                    blurred[static_cast<std::size_t>(row) * width +
                            static_cast<std::size_t>(column)] +=
                        weight * raw[static_cast<std::size_t>(nearest(cy)) * width +
                                     static_cast<std::size_t>(nearest(cx))];
                }
            }
        }
    }

    for (int row = 0; row < g.height_px; ++row) {
        for (int column = 0; column < g.width_px; ++column) {
            const std::size_t i =
                static_cast<std::size_t>(row) * width + static_cast<std::size_t>(column);
            double line = 0, sample = 0;
            double grey = 0;
            if (g.locate(g.pixel_centre(column, row), line, sample)) {
                const auto k =
                    static_cast<std::size_t>(std::clamp(nearest(sample), 0, g.samples - 1));
                grey = blurred[i] *
                       paper_brightness((sample + 0.5) * g.step_mm, frame.effects.attenuation) *
                       static_cast<double>(frame.row_gain[k]);
            }
            pixels[i] = static_cast<std::uint8_t>(std::lround(std::clamp(grey, 0.0, 255.0)));
        }
    }
}

}  // namespace sonocase::runtime
