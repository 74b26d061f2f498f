// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/streak_plates.h"

#include <algorithm>
#include <cmath>

#include "runtime/imaging/noise/noise.h"

namespace sonocase::runtime::physical {
namespace {

// Sixteen equally likely values of a gamma distribution of mean 4 and shape 2.5.
constexpr std::array<double, 16> kLengthsMm{0.74, 1.25, 1.63, 1.97, 2.3,  2.63, 2.96, 3.3,
                                            3.67, 4.06, 4.51, 5.01, 5.62, 6.4,  7.53, 9.82};
// Eight equally likely amplitudes of mean 0 dB, deviation 2 dB.
constexpr std::array<double, 8> kLevels{0.70, 0.82, 0.89, 0.96, 1.04, 1.12, 1.22, 1.43};

constexpr std::uint32_t kHashX = 0x9E3779B1u, kHashY = 0x85EBCA77u, kHashZ = 0xC2B2AE3Du;

// (1 - x)^4, close to a Gaussian, 0 from x = 1 on.
double bump(double x) {
    const double y = std::max(1 - x, 0.0);
    return y * y * y * y;
}

struct Search {
    const PhysicalScene& scene;
    const ScanGeometry& g;
    const Tables& tables;
    const PhysicalFrame& frame;
    const BreathingField* breathing;
    std::span<const float> gaps;
    std::span<Streak> out;
    Rigid probe_from_volume;
    double thickest_mm = 0;  // of the slab: deviation at the face or at the far end
    int found = 0;

    bool is_parenchyma(Point3 x) const {
        const Point3 v = scene.grid.voxel_from_point(x);
        const int label = label_at(scene, static_cast<int>(std::floor(v.x + 0.5)),
                                   static_cast<int>(std::floor(v.y + 0.5)),
                                   static_cast<int>(std::floor(v.z + 0.5)));
        return scene.fine.frames[static_cast<std::size_t>(label)].cube == kParenchymaCube;
    }

    // Where a point of the tissue shows, in the probe's frame.
    Point3 seen(Point3 x) const {
        if (breathing != nullptr) x = x + breathing->weight(x) * frame.motion.breathing_mm;
        return probe_from_volume * x;
    }

    // The beam at a place: its direction, and how far the place lies along it.
    PlanePoint beam_at(PlanePoint p, double& r) const {
        if (!g.fan) {
            r = p.z;
            return {0, 1};
        }
        const double x = p.x, z = p.z + g.radius_mm;
        const double from_centre = std::max(std::sqrt(x * x + z * z), 1e-9);
        r = from_centre - g.radius_mm;
        return {x / from_centre, z / from_centre};
    }

    void add_cell(int i, int j, int k);
    void add_plate(Point3 centre, Vector3 normal, std::uint32_t draw);
};

// normal: not unit, at most 127 long, in steps of 1, frame of the volume.
void Search::add_cell(int i, int j, int k) {
    const Point3 corner =
        scene.grid.origin_mm + kStreakCellMm * Vector3{double(i), double(j), double(k)};
    const Point3 middle = corner + 0.5 * kStreakCellMm * Vector3{1, 1, 1};
    const Point3 p = seen(middle);
    double r = 0;
    const PlanePoint beam = beam_at({p.x, p.z}, r);
    if (r < kStreakFirstMm - kStreakCellMm || r > g.depth_mm + kStreakCellMm) return;
    if (!is_parenchyma(middle)) return;
    const Vector3 along = frame.volume_from_probe.rotation * Vector3{beam.x, 0, beam.z};
    const auto bx = static_cast<float>(along.x), by = static_cast<float>(along.y),
               bz = static_cast<float>(along.z);
    // Within a cell beams turn by as much as its size over their distance from the fan's centre.
    const double turn = kStreakCellMm / (g.fan ? std::max(g.radius_mm + r, kStreakCellMm) : 1e9);
    const double widest = std::min(kStreakFaceSin + turn, 1.0);
    const auto least = static_cast<float>(1 - widest * widest);
    const std::uint32_t cell =
        hash32(static_cast<std::uint32_t>(i) * kHashX ^ static_cast<std::uint32_t>(j) * kHashY ^
               static_cast<std::uint32_t>(k) * kHashZ);
    for (std::uint32_t t = 0; t < kStreakTries; ++t) {
        const std::uint32_t h = hash32(cell + t);
        const auto nx = static_cast<float>(static_cast<std::int8_t>(h)),
                   ny = static_cast<float>(static_cast<std::int8_t>(h >> 8)),
                   nz = static_cast<float>(static_cast<std::int8_t>(h >> 16));
        const float square = nx * nx + ny * ny + nz * nz, cosine = nx * bx + ny * by + nz * bz;
        // Uniform directions: those within the ball.
        if (!(square < 127.0f * 127.0f && cosine * cosine > least * square)) continue;
        const std::uint32_t place = hash32(h ^ (cell + t) * kHashY);
        const auto part = [&](int shift) { return (place >> shift & 0x3FF) / 1024.0; };
        add_plate(corner + kStreakCellMm * Vector3{part(0), part(10), part(20)},
                  {static_cast<double>(nx), static_cast<double>(ny), static_cast<double>(nz)},
                  h >> 24);
    }
}

void Search::add_plate(Point3 centre, Vector3 normal, std::uint32_t draw) {
    Point3 p = seen(centre);
    double r = 0;
    PlanePoint beam = beam_at({p.x, p.z}, r);
    const double length = kLengthsMm[draw & 15], own = 0.25 * length;
    const double inverse = 1 / norm(normal);
    const Vector3 n = probe_from_volume.rotation * (inverse * normal);
    const double cosine = n.x * beam.x + n.z * beam.z;
    const double facing =
        bump(std::max(1 - cosine * cosine, 0.0) / (kStreakFaceSin * kStreakFaceSin));
    // Most plates are too far from the plane or turned away: their most comes before their place.
    const auto level_in = [&](double slab) {
        const double off = p.y / (2.9 * std::sqrt(slab * slab + own * own));
        return bump(off * off) * facing;
    };
    if (level_in(thickest_mm) < 0.1) return;
    double line = 0, sample = 0;
    g.locate({p.x, p.z}, line, sample);
    const int nearest = static_cast<int>(std::clamp(line + 0.5, 0.0, g.scanlines - 1.0));
    const double gap = static_cast<double>(gaps[static_cast<std::size_t>(nearest)]);
    if (gap < 0) return;
    // The gap to the skin closes: the plate shows that much closer to the face.
    const auto row_at = [&](double depth) -> const Row& {
        const int k = static_cast<int>(std::clamp(depth / g.step_mm, 0.0, g.samples - 1.0));
        return tables.rows[static_cast<std::size_t>(k)];
    };
    double shown = r;
    for (int step = 0; step < 3; ++step) shown = r - gap * row_at(shown).contact;
    if (shown < kStreakFirstMm || shown > g.depth_mm) return;
    const Row& row = row_at(shown);
    const double level = level_in(row.elevation_mm);
    if (level < 0.1 || found >= static_cast<int>(out.size()) || !is_parenchyma(centre)) return;
    Streak& s = out[static_cast<std::size_t>(found)];
    s.centre = {p.x + (shown - r) * beam.x, p.z + (shown - r) * beam.z};
    const double in_plane = 1 / std::sqrt(n.x * n.x + n.z * n.z);
    s.normal = {n.x * in_plane, n.z * in_plane};
    s.length_mm = length;
    s.width_mm = tables.streak_mm;
    s.amplitude = kStreakAmplitude * tables.streak_scale * kLevels[draw >> 4 & 7] * level;
    // Beyond 0.9 L from its middle a plate is 0.5 % of itself, beyond three widths 1 %.
    const double reach = 0.9 * length + 3 * s.width_mm;
    const double slope = std::sqrt(std::max(1 - cosine * cosine * in_plane * in_plane, 0.0));
    const double deep = 0.9 * length * slope + 3 * s.width_mm + g.step_mm;
    const double pitch = g.fan ? (g.radius_mm + shown) * g.line_step : g.line_step;
    s.line_begin = std::max(static_cast<int>(line - reach / pitch), 0);
    s.line_end = std::min(static_cast<int>(line + reach / pitch) + 2, g.scanlines);
    s.sample_begin = std::max(static_cast<int>((shown - deep) / g.step_mm), 0);
    s.sample_end = std::min(static_cast<int>((shown + deep) / g.step_mm) + 1, g.samples);
    if (s.line_begin < s.line_end && s.sample_begin < s.sample_end) ++found;
}

}  // namespace

int find_streaks(const PhysicalScene& scene,
                 const ScanGeometry& g,
                 const Tables& tables,
                 const PhysicalFrame& f,
                 const BreathingField* breathing,
                 std::span<const float> gaps,
                 std::span<Streak> out) {
    if (!scene.has_parenchyma || tables.frequency_mhz > kStreakFrequencyMhz) return 0;
    Search search{scene,
                  g,
                  tables,
                  f,
                  breathing,
                  gaps,
                  out,
                  inverse(f.volume_from_probe),
                  std::max(tables.rows.front().elevation_mm, tables.rows.back().elevation_mm)};
    const double shift_mm = norm(f.motion.breathing_mm);
    // Columns of cells along the axis that the plane's normal follows most.
    const Vector3 normal = f.volume_from_probe.rotation * Vector3{0, 1, 0};
    int a = 0;
    for (int axis = 1; axis < 3; ++axis) {
        if (std::abs(normal[axis]) > std::abs(normal[a])) a = axis;
    }
    const int u = (a + 1) % 3, v = (a + 2) % 3;
    // The box of the scanned area.
    const auto& first = g.beams.front();
    const auto& last = g.beams.back();
    Vector3 lower{1e9, 1e9, 1e9}, upper{-1e9, -1e9, -1e9};
    for (const PlanePoint p :
         {first.origin, last.origin,
          PlanePoint{first.origin.x + g.depth_mm * first.direction.x, first.origin.z},
          PlanePoint{last.origin.x + g.depth_mm * last.direction.x, g.depth_mm},
          PlanePoint{first.origin.x + g.depth_mm * first.direction.x, g.depth_mm},
          PlanePoint{last.origin.x + g.depth_mm * last.direction.x, last.origin.z}}) {
        const Vector3 at = f.volume_from_probe * Point3{p.x, 0, p.z} - scene.grid.origin_mm;
        for (int axis = 0; axis < 3; ++axis) {
            lower[axis] = std::min(lower[axis], at[axis]);
            upper[axis] = std::max(upper[axis], at[axis]);
        }
    }
    const Vector3 box =
        scene.voxel_mm *
        Vector3{double(scene.grid.size.x), double(scene.grid.size.y), double(scene.grid.size.z)};
    const auto cell = [&](double mm, int axis) {
        return static_cast<int>(std::floor(std::clamp(mm, 0.0, box[axis]) / kStreakCellMm));
    };
    const Vector3 origin = f.volume_from_probe * Point3{0, 0, 0} - scene.grid.origin_mm;
    // Half the slab, half the longest plate, and the cell's own extent along the normal.
    const double thick =
        4 + shift_mm +
        0.5 * kStreakCellMm * (std::abs(normal[u]) + std::abs(normal[v])) / std::abs(normal[a]);
    for (int j = cell(lower[v], v); j <= cell(upper[v], v); ++j) {
        for (int i = cell(lower[u], u); i <= cell(upper[u], u); ++i) {
            const double mu = (i + 0.5) * kStreakCellMm - origin[u],
                         mv = (j + 0.5) * kStreakCellMm - origin[v];
            const double plane = origin[a] - (normal[u] * mu + normal[v] * mv) / normal[a];
            if (plane < -thick || plane > box[a] + thick) continue;
            for (int k = cell(plane - thick, a); k <= cell(plane + thick, a); ++k) {
                int at[3];
                at[u] = i;
                at[v] = j;
                at[a] = k;
                search.add_cell(at[0], at[1], at[2]);
            }
        }
    }
    return search.found;
}

}  // namespace sonocase::runtime::physical
