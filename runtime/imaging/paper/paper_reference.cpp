// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/paper/paper_reference.h"

#include <algorithm>
#include <cmath>

#include "runtime/imaging/core/noise.h"
#include "runtime/imaging/paper/paper_model.h"

namespace sonocase::runtime {
namespace {

int nearest(double x) {
    return static_cast<int>(std::floor(std::clamp(x, -1e6, 1e6) + 0.5));
}

// Where the tissue that is shown at a point of the plane lies at rest, and its material.
struct Shown {
    Point3 at;
    std::uint32_t material = 0;
};

Shown shown_at(const PaperScene& scene,
               const ScanGeometry& g,
               const PaperFrame& frame,
               PlanePoint p,
               double line,
               double sample) {
    bool closed = false;
    if (frame.press != nullptr) {
        const ScanGeometry::Beam beam{g.beam_origin(line), g.beam_direction(line)};
        const double r = (sample + 0.5) * g.step_mm;
        closed = frame.press->closed_in_plane(
            press::follows_columns(g) ? press::BeamPoint{press::lateral_of_line(g, line), r}
                                      : press::BeamPoint{p.x, p.z});
        p = press::rest_point(*frame.press, g, beam, line, r);
    }
    Shown out{frame.volume_from_probe * Point3{p.x, 0, p.z}};
    const Point3 v = scene.grid.voxel_from_point(out.at);
    out.material = material_at(scene, nearest(v.x), nearest(v.y), nearest(v.z));
    if (closed) out.material = static_cast<std::uint32_t>(scene.closed_material[out.material]);
    return out;
}

double texture_grey(const PaperScene& scene, std::uint32_t material, Point3 p) {
    const int edge = 1 << scene.edge_log2;
    const auto wrap = [&](double mm) {
        const double cell = std::floor(mm / scene.texture_voxel_mm);
        return static_cast<std::size_t>(cell - edge * std::floor(cell / edge));
    };
    const std::size_t n = edge;
    const Vector3 q = p - scene.grid.origin_mm;
    return scene.atlas[n * n * n * (material & 0x7F) + wrap(q.x) + n * (wrap(q.y) + n * wrap(q.z))];
}

// The picture by pixels, row by row.
class Picture {
  public:
    explicit Picture(const ScanGeometry& g)
        : geometry_(g), values_(static_cast<std::size_t>(g.width_px) * g.height_px, 0.0) {}

    double& at(int column, int row) { return values_[index(column, row)]; }
    double at(int column, int row) const { return values_[index(column, row)]; }

    // work(column, row, line, sample) for every pixel of the scanned area.
    template <class Work>
    void for_scanned(const Work& work) const {
        for (int row = 0; row < geometry_.height_px; ++row) {
            for (int column = 0; column < geometry_.width_px; ++column) {
                double line = 0, sample = 0;
                if (geometry_.locate(geometry_.pixel_centre(column, row), line, sample))
                    work(column, row, line, sample);
            }
        }
    }

  private:
    std::size_t index(int column, int row) const {
        return static_cast<std::size_t>(row) * geometry_.width_px +
               static_cast<std::size_t>(column);
    }

    const ScanGeometry& geometry_;
    std::vector<double> values_;
};

double with_needle(double grey, const NeedleShape& needle, PlanePoint p) {
    double along = 0;
    const double share = needle_share(needle, p.x, p.z, along);
    const double near_tip = std::clamp(1 - along / kTipReachMm, 0.0, 1.0);
    const double opacity =
        needle.shaft_opacity + (needle.tip_opacity - needle.shaft_opacity) * near_tip;
    return grey + (255 - grey) * share * opacity;
}

// Length in bone and gas from the probe's face down to a sample, mm.
double length_in_shadow_mm(const PaperScene& scene,
                           const ScanGeometry& g,
                           const PaperFrame& frame,
                           double line,
                           double sample) {
    double in_shadow_mm = 0;
    for (int k = 0; k <= sample; ++k) {
        if (shown_at(scene, g, frame, g.point(line, k), line, k).material & PaperScene::kShadowBit)
            in_shadow_mm += g.step_mm;
    }
    return in_shadow_mm;
}

// Texture, needle, noise and shadow of a pixel.
double grey_at(const PaperScene& scene,
               const ScanGeometry& g,
               std::span<const std::int8_t> noise_tile,
               const PaperFrame& frame,
               PlanePoint p,
               double line,
               double sample) {
    const auto [x, material] = shown_at(scene, g, frame, p, line, sample);
    double grey =
        frame.effects.texture ? texture_grey(scene, material, x) : scene.flat_grey[material & 0x7F];
    if (frame.effects.needle && frame.needle != nullptr) grey = with_needle(grey, *frame.needle, p);
    if (frame.effects.noise) {
        const int l = std::clamp(nearest(line), 0, g.scanlines - 1);
        const int k = std::clamp(nearest(sample), 0, g.samples - 1);
        grey += noise_tile[noise_row_start(frame.seed, frame.frame, static_cast<std::uint32_t>(k)) +
                           static_cast<std::uint32_t>(l)];
        grey = std::clamp(grey, 0.0, 255.0);
    }
    if (frame.effects.shadow) {
        grey *=
            std::exp(-length_in_shadow_mm(scene, g, frame, line, sample) / paper::kShadowLengthMm);
    }
    return grey;
}

// The mean of copies of the picture turned about the fan's centre.
Picture blurred_picture(const ScanGeometry& g, const Picture& raw) {
    Picture blurred(g);
    for (int copy = -paper::kBlurReach; copy <= paper::kBlurReach; ++copy) {
        const double weight = paper::kBlurWeights[copy + paper::kBlurReach];
        blurred.for_scanned([&](int column, int row, double line, double sample) {
            // The copy's pixel that lands here; beyond the sector its edge is repeated.
            line += copy * (g.fan ? paper::kBlurStepRad : paper::kBlurStepMm) / g.line_step;
            const PlanePoint q = g.point(std::clamp(line, 0.0, g.scanlines - 1.0), sample);
            const double cx = std::clamp(q.x / g.mm_per_px + g.origin_x_px, 0.0, g.width_px - 1.0);
            const double cy = std::clamp(q.z / g.mm_per_px + g.origin_y_px, 0.0, g.height_px - 1.0);
            blurred.at(column, row) += weight * raw.at(nearest(cx), nearest(cy));
        });
    }
    return blurred;
}

}  // namespace

std::vector<std::int8_t> make_paper_noise(std::uint32_t seed, int scanlines) {
    constexpr int kSlack = 2 * 64;  // a block of beams and a vector beyond the last beam
    return make_noise_tile(normal_levels(), paper::kNoiseSigma, seed, scanlines + kSlack);
}

double paper_brightness(double depth_mm, bool attenuation) {
    return attenuation ? std::exp(-depth_mm / paper::kAttenuationLengthMm) : 1.0;
}

void render_paper_reference(const PaperScene& scene,
                            const ScanGeometry& g,
                            std::span<const std::int8_t> noise_tile,
                            const PaperFrame& frame,
                            std::span<std::uint8_t> pixels) {
    Picture raw(g);
    raw.for_scanned([&](int column, int row, double line, double sample) {
        raw.at(column, row) =
            grey_at(scene, g, noise_tile, frame, g.pixel_centre(column, row), line, sample);
    });
    const Picture blurred = frame.effects.blur ? blurred_picture(g, raw) : raw;
    std::fill(pixels.begin(), pixels.end(), std::uint8_t{0});
    blurred.for_scanned([&](int column, int row, double, double sample) {
        const int k = std::clamp(nearest(sample), 0, g.samples - 1);
        const double grey =
            blurred.at(column, row) *
            paper_brightness((sample + 0.5) * g.step_mm, frame.effects.attenuation) *
            static_cast<double>(frame.row_gain[k]);
        pixels[static_cast<std::size_t>(row) * g.width_px + static_cast<std::size_t>(column)] =
            static_cast<std::uint8_t>(std::lround(std::clamp(grey, 0.0, 255.0)));
    });
}

}  // namespace sonocase::runtime
